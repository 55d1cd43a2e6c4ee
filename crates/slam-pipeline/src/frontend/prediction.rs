//! The landmarks that the reference particle predicts in view.

use mono_geometry::{Pinhole, PlacedCamera};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::catalogue::{Catalogue, Entry, Stage};
use super::frustum::Frustum;
use super::lens_noise::noise_at;
use crate::filter::landmark::Landmark;
use crate::filter::linearised::{PoseLinearisation, PosePosterior};
use crate::filter::motion::MotionPrior;
use crate::filter::observation::{MatchedFeature, Prepared, Scoring};
use crate::filter::particle::Particle;
use crate::filter::pixel_noise::PixelNoise;
use crate::rig::Rig;

/// A landmark predicted in view.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Predicted<'a> {
    /// The landmark as all particles share it.
    pub(crate) entry: &'a Entry,
    /// Predicted ideal pixel.
    pub(crate) pixel: Vector2<f64>,
    /// Innovation covariance.
    pub(crate) covariance: Matrix2<f64>,
    /// Direction from the camera, world axes, unit length.
    pub(crate) direction: Vector3<f64>,
    /// Distance from the camera over that from the camera of the first sighting; 1 for a landmark that has none.
    pub(crate) range_ratio: f64,
    /// The landmark in the reference particle, without a measurement.
    pub(crate) prepared: Prepared,
    /// The Gaussian of a tentative feature.
    pub(crate) prototype: Option<Landmark>,
}

/// The landmarks in view, in order of id.
#[derive(Debug, Clone, Default)]
pub(crate) struct InView<'a> {
    landmarks: Vec<(u32, Predicted<'a>)>,
}

impl<'a> InView<'a> {
    /// Number of landmarks.
    #[must_use]
    pub(crate) fn len(&self) -> usize {
        self.landmarks.len()
    }

    /// Ids and predictions, in order of id.
    #[must_use]
    pub(crate) fn landmarks(&self) -> &[(u32, Predicted<'a>)] {
        &self.landmarks
    }

    /// The place of `id` among them. O(log n).
    #[must_use]
    pub(crate) fn position(&self, id: u32) -> Option<usize> {
        self.landmarks.binary_search_by_key(&id, |l| l.0).ok()
    }

    /// The prediction of `id`. O(log n).
    #[must_use]
    pub(crate) fn get(&self, id: u32) -> Option<&Predicted<'a>> {
        Some(&self.landmarks[self.position(id)?].1)
    }
}

impl Predicted<'_> {
    /// The landmark in the reference particle with the measurement of `feature`.
    #[must_use]
    pub(crate) fn measured(&self, feature: &MatchedFeature) -> Prepared {
        Prepared {
            pixel: feature.pixel,
            noise: feature.noise,
            scoring: feature.scoring,
            ..self.prepared
        }
    }

    /// Angle between the rays of the first sighting and of `pixel`, radians, as
    /// far as the pose explains it: the rotation is taken out.
    #[must_use]
    pub(crate) fn parallax(
        &self,
        pixel: &Vector2<f64>,
        pinhole: &Pinhole,
        camera: &PlacedCamera,
    ) -> f64 {
        let n = pinhole.normalize(pixel);
        let seen = camera
            .camera_from_world
            .tr_mul(&Vector3::new(n.x, n.y, 1.0));
        self.prepared
            .geometry
            .ray(&self.prepared.mean)
            .base
            .angle(&seen)
    }
}

/// Predicts the landmarks and tentative features from `reference` under `prior`; those in view, by id. Landmarks that
/// cannot be in view are passed over by groups.
///
/// The innovation covariance holds the pose prior, the landmark and a pixel noise of `sigma_px` in the real image.
#[must_use]
pub(crate) fn predict<'a>(
    rig: &Rig,
    catalogue: &'a Catalogue,
    reference: &Particle,
    prior: &MotionPrior,
    sigma_px: f64,
) -> InView<'a> {
    let image_size = rig.image_size_px();
    let linearisation = PoseLinearisation::new(rig, prior, &PosePosterior::prior());
    let frustum = Frustum::new(rig, &linearisation);
    let mut landmarks = Vec::new();
    for id in catalogue.candidates(reference, &frustum) {
        let Some(entry) = catalogue.get(id) else {
            continue;
        };
        let landmark = match entry.stage {
            Stage::Mapped => reference.map.get(id),
            Stage::Tentative => Some(&entry.prototype),
        };
        let Some(landmark) = landmark else { continue };
        let Some(geometry) = reference.geometry(landmark) else {
            continue;
        };
        let landmark = &match entry.stage {
            Stage::Mapped => *landmark,
            Stage::Tentative => landmark.in_front_of(&geometry, &prior.mean.centre),
        };
        let prepared = Prepared {
            geometry,
            mean: landmark.mean,
            covariance: landmark.covariance,
            pixel: Vector2::zeros(),
            noise: PixelNoise::round(sigma_px),
            scoring: Scoring::Full,
        };
        let Some(line) = linearisation.linearise(&prepared) else {
            continue;
        };
        let p = line.mean;
        // Half a pixel beyond the image is still its edge.
        if p.x < -0.5 || p.y < -0.5 || p.x > image_size.x - 0.5 || p.y > image_size.y - 0.5 {
            let reach = (line.innovation()[(0, 0)] + line.innovation()[(1, 1)]).sqrt();
            let outside = Vector2::new(
                (-p.x).max(p.x - image_size.x).max(0.0),
                (-p.y).max(p.y - image_size.y).max(0.0),
            );
            if entry.stage == Stage::Mapped || outside.norm() > 3.0 * reach {
                continue;
            }
        }
        let ray = geometry.ray(&landmark.mean);
        let direction = ray.base + (ray.origin - prior.mean.centre) * ray.rate;
        let range = direction.norm().max(f64::MIN_POSITIVE);
        landmarks.push((
            id,
            Predicted {
                entry,
                pixel: p,
                covariance: line.innovation() + stretched(rig, &p, sigma_px),
                direction: direction / range,
                // Both lengths are multiples of the same inverse depth.
                range_ratio: landmark
                    .anchor()
                    .map_or(1.0, |_| range / ray.base.norm().max(f64::MIN_POSITIVE)),
                prepared,
                prototype: (entry.stage == Stage::Tentative).then_some(*landmark),
            },
        ));
    }
    InView { landmarks }
}

/// The noise of an ideal pixel beyond that of a real one, which the innovation holds already.
fn stretched(rig: &Rig, pixel_ideal: &Vector2<f64>, sigma_px: f64) -> Matrix2<f64> {
    (noise_at(&rig.camera, pixel_ideal) - Matrix2::identity()) * (sigma_px * sigma_px)
}
