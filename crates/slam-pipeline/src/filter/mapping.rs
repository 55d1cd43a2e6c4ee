//! The map of a particle after its pose is final.
//!
//! Landmarks are updated by an unscented Kalman filter (Eq. 14-16 in the right
//! form, R inside S), iterated at its posterior while the depth is open. New
//! landmarks start as anchored inverse depth at their second sighting (`exact`)
//! or as a two-view point when parallax allows (`paper`, Eq. 22-24).

use core::convert::Infallible;

use mono_geometry::inverse_depth::LandmarkView;
use mono_geometry::triangulation::{Acceptance, Observation, triangulate};
use mono_geometry::{Pinhole, PlacedCamera, Se3};
use nalgebra::{Rotation3, Vector2};
use rbpf_core::MapUpdate;
use ukf::SigmaPoints;

use super::landmark::{Landmark, Parametrisation};
use super::landmark_moments::AxisPoints;
use super::landmark_update::LandmarkUpdate;
use super::motion::MotionPrior;
use super::observation::{FrameObservation, Initialisation};
use super::particle::{Keyframe, Particle};
use super::pixel_noise::PixelNoise;
use crate::method::LandmarkStart;
use crate::rig::Rig;

/// The map update of a particle: landmarks are updated, started and removed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mapping<'a> {
    /// Camera and mount.
    pub(crate) rig: &'a Rig,
    /// Sigma points over the three parameters of a landmark.
    pub(crate) points: SigmaPoints<3>,
    /// When a feature becomes a landmark.
    pub(crate) start: LandmarkStart,
    /// Whether the map stays as it is.
    pub(crate) frozen: bool,
}

impl MapUpdate<Particle, FrameObservation> for Mapping<'_> {
    type Error = Infallible;

    fn update_map(
        &self,
        particle: &mut Particle,
        observation: &FrameObservation,
    ) -> Result<(), Infallible> {
        match particle.prior.take() {
            Some(drawn) => self.arrive(particle, &drawn.prior, observation),
            None => self.map(particle, 0.0, observation),
        }
        Ok(())
    }
}

impl Mapping<'_> {
    /// The metric state and the map of a particle that has taken its pose under `prior`.
    pub(crate) fn arrive(
        &self,
        particle: &mut Particle,
        prior: &MotionPrior,
        observation: &FrameObservation,
    ) {
        particle.metric = particle.metric.condition_on_pose(prior, &particle.pose);
        self.map(particle, prior.scale_drift_variance, observation);
    }

    fn map(&self, particle: &mut Particle, scale_drift: f64, observation: &FrameObservation) {
        let update = LandmarkUpdate {
            pinhole: self.rig.pinhole(),
            points: AxisPoints::new(&self.points),
        };
        let camera = particle.pose.place(self.rig);
        particle.path.push(Keyframe {
            pose: particle.pose,
            camera,
            scale: particle.metric.scale_note(scale_drift),
        });
        if self.frozen {
            return;
        }
        // Landmarks come in order of their ids, so those of one anchor follow one another.
        let mut last: Option<(Option<u32>, LandmarkView)> = None;
        for m in &observation.matches {
            let known = particle.map.get(m.id).copied();
            let landmark = match (known, m.prototype) {
                (Some(known), _) => known,
                (None, Some(prototype)) if self.start == LandmarkStart::SecondSighting => prototype,
                _ => continue,
            };
            let anchor = landmark.anchor();
            let view = match last {
                Some((same, view)) if same == anchor => view,
                _ => {
                    let Some(geometry) = particle.geometry(&landmark) else {
                        continue;
                    };
                    geometry.view(&camera)
                }
            };
            last = Some((anchor, view));
            let (pixel, noise) = (&m.pixel, &m.noise);
            let updated = if known.is_some() {
                update.update(&view, &landmark, pixel, noise)
            } else {
                update.first(&view, &landmark, pixel, noise)
            };
            match updated {
                Some(updated) => particle.map.insert(m.id, updated),
                None if known.is_none() => particle.map.insert(m.id, landmark),
                None => None,
            };
        }
        for new in &observation.initialised {
            if let Some(landmark) = two_view(self.rig.pinhole(), particle, new) {
                particle.map.insert(new.id, landmark);
            }
        }
        for id in &observation.removed {
            particle.map.remove(*id);
        }
    }
}

/// Two-view structure in the particle's own path (Eq. 22-24 with the two views'
/// own poses); `None` with no acceptable solution. The particle's path must
/// already end in the present keyframe.
#[must_use]
pub(crate) fn two_view(
    pinhole: &Pinhole,
    particle: &Particle,
    new: &Initialisation,
) -> Option<Landmark> {
    let first = particle.path.get(new.first.keyframe as usize)?.camera;
    let second = particle.path.last()?.camera;
    let view = |camera: &PlacedCamera, pixel: Vector2<f64>, noise: &PixelNoise| {
        let (sigma_px, shape) = noise.sigma_and_shape();
        Observation {
            camera_from_world: Se3::new(
                Rotation3::from_matrix_unchecked(camera.camera_from_world),
                -(camera.camera_from_world * camera.centre),
            ),
            pixel_ideal: pixel,
            sigma_px,
            shape,
        }
    };
    let solution = triangulate(
        pinhole,
        &[
            view(&first, new.first.pixel, &new.noise[0]),
            view(&second, new.second, &new.noise[1]),
        ],
        // The parallax was judged once for all particles, in the reference.
        &Acceptance {
            min_parallax_rad: 0.0,
            ..Acceptance::default()
        },
    )
    .ok()?;
    Some(Landmark {
        parametrisation: Parametrisation::Point,
        mean: solution.point,
        covariance: solution.covariance,
    })
}
