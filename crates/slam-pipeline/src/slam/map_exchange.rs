//! From a run to a map that outlives it, and back.

use mono_geometry::{PlacedCamera, Se3};
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use rbpf_core::{CowMap, PersistentPath};

use super::{Slam, SlamError};
use crate::config::ValidConfig;
use crate::filter::drift::Drift;
use crate::filter::landmark::{Landmark, Parametrisation};
use crate::filter::metric::ScaleNote;
use crate::filter::metric_path::MetricPath;
use crate::filter::particle::{Keyframe, Particle};
use crate::filter::pose::CameraPose;
use crate::frontend::catalogue::{Entry, Stage};
use crate::known_map::{KnownKeyframe, KnownLandmark, KnownMap, MapUse};
use crate::rig::Rig;

/// How much the metre of a map may differ from that of the odometry of a robot that goes on with it. One that only localises
/// takes the metre of the map.
const EXTENDED_SCALE_SIGMA: f64 = 0.01;

impl Slam {
    /// The map of the best particle with all that localisation and going on need, in metres.
    ///
    /// The covariance of a keyframe is that of the drift and of the calibration, as in the reports.
    /// O(keyframes + landmarks).
    #[must_use]
    pub fn known_map(&self) -> KnownMap {
        let set = self.state.filter.set();
        let best = &set.particles()[set.best()];
        let world = MetricPath::new(best, self.rig.lever_m(), &self.tied());
        let keyframes = best
            .path
            .iter()
            .enumerate()
            .map(|(index, keyframe)| {
                let body = world.body(index as u32, &keyframe.pose);
                let camera = &keyframe.camera;
                KnownKeyframe {
                    world_from_camera: Se3::new(
                        Rotation3::from_matrix_unchecked(camera.camera_from_world.transpose()),
                        world.position(index as u32, &camera.centre),
                    ),
                    body,
                    covariance: self.keyframe_covariance(index as u32, &body),
                }
            })
            .collect();
        let landmarks = self
            .state
            .catalogue
            .iter()
            .filter(|(_, entry)| entry.stage == Stage::Mapped)
            .filter_map(|(id, entry)| {
                let (anchor, parameters, covariance) = anchored(best, best.map.get(id)?, entry)?;
                let mut unit = Matrix3::identity();
                unit[(2, 2)] = 1.0 / world.scale(anchor);
                Some(KnownLandmark {
                    id,
                    anchor,
                    parameters: unit * parameters,
                    covariance: unit * covariance * unit,
                    descriptor: *entry.descriptor,
                    observations: entry.observations,
                    existence: entry.existence.log_odds(),
                    last_direction: entry.last_direction,
                })
            })
            .collect();
        KnownMap {
            camera: self.rig.camera,
            keyframes,
            errors: self.state.drift.errors(),
            landmarks,
        }
    }

    /// A system that knows a map and not where in it the robot is.
    ///
    /// It is [`super::Tracking::Lost`] until an image shows a place of the map. The world is that of the map.
    ///
    /// # Errors
    /// As [`Slam::new`]; [`SlamError::Map`] for a method that does not find places, and for a map without keyframes, or whose landmarks are not in order of their ids,
    /// refer to keyframes that it does not have or are not finite.
    pub fn with_map(
        rig: Rig,
        config: &ValidConfig,
        map: &KnownMap,
        usage: MapUse,
    ) -> Result<Self, SlamError> {
        check(map)?;
        let mut slam = Self::new(rig, config)?;
        if !slam.policies.recovers {
            return Err(SlamError::Map {
                reason: format!(
                    "the method {} does not find its place in one, the method exact does",
                    config.filter.method.name()
                ),
            });
        }
        let path: PersistentPath<Keyframe> = map.keyframes.iter().map(|k| known(k, &rig)).collect();
        let landmarks: CowMap<Landmark> = map
            .landmarks
            .iter()
            .map(|l| {
                let landmark = Landmark {
                    parametrisation: Parametrisation::InverseDepth { anchor: l.anchor },
                    mean: l.parameters,
                    covariance: l.covariance,
                };
                (l.id, landmark)
            })
            .collect();
        let last = map.keyframes[map.keyframes.len() - 1];
        slam.make_use(usage);
        let scale_sigma = match usage {
            MapUse::Extend => EXTENDED_SCALE_SIGMA.min(slam.carrier.scale_sigma),
            MapUse::Localise => 0.0,
        };
        for particle in slam.state.filter.particles_mut() {
            particle.metric = particle.metric.with_scale_of_map(scale_sigma);
            particle.path = path.clone();
            particle.map = landmarks.clone();
            particle.stand_at(known(&last, &rig).pose, &last.body);
        }
        let pinhole = *rig.pinhole();
        for l in &map.landmarks {
            let pixel = pinhole.pixel(&Vector2::new(l.parameters.x, l.parameters.y));
            slam.state.catalogue.insert_known(l, &pixel);
            slam.state.places.insert(l.id, &l.descriptor)?;
        }
        slam.state.catalogue.follow(&landmarks);
        slam.state.drift = Drift::of_map(
            &map.keyframes,
            &map.errors,
            slam.config.mapping.max_keyframes,
            // The system knows no keyframe yet, so this is without the focal length.
            |body| slam.constant_errors(0, body),
        );
        slam.state.keyframe = map.keyframes.len() as u32;
        slam.state.begin_lost(map);
        Ok(slam)
    }

    /// The use that is made of the map from now on; one that only localises takes the metre of the map.
    pub(super) fn make_use(&mut self, usage: MapUse) {
        self.usage = usage;
        if usage == MapUse::Localise {
            self.carrier.scale_drift = 0.0;
        }
    }
}

fn check(map: &KnownMap) -> Result<(), SlamError> {
    let refuse = |reason: String| Err(SlamError::Map { reason });
    let keyframes = map.keyframes.len();
    if keyframes == 0 || keyframes > u32::MAX as usize / 2 {
        return refuse(format!("{keyframes} keyframes, required: at least 1"));
    }
    for (index, k) in map.keyframes.iter().enumerate() {
        let finite = k.covariance.iter().all(|v| v.is_finite())
            && k.world_from_camera
                .translation
                .iter()
                .chain(k.world_from_camera.rotation.matrix().iter())
                .chain(&[k.body.x, k.body.y, k.body.phi])
                .all(|v| v.is_finite());
        if !finite {
            return refuse(format!("keyframe {index} is not finite"));
        }
    }
    for pair in map.landmarks.windows(2) {
        if pair[1].id <= pair[0].id {
            return refuse(format!(
                "landmark {} follows landmark {}, required: ascending ids",
                pair[1].id, pair[0].id
            ));
        }
    }
    let errors = &map.errors;
    let ascending = errors.keyframes.windows(2).all(|p| p[0] < p[1]);
    let within = errors
        .keyframes
        .last()
        .is_some_and(|k| (*k as usize) < keyframes);
    let triangle = errors.rows.len() == errors.keyframes.len()
        && errors.rows.iter().enumerate().all(|(i, row)| {
            row.len() == i + 1 && row.iter().all(|block| block.iter().all(|v| v.is_finite()))
        });
    if !ascending || !within || !triangle {
        return refuse(format!(
            "the errors of {} keyframes with {} rows are not the lower triangle of a covariance",
            errors.keyframes.len(),
            errors.rows.len()
        ));
    }
    for l in &map.landmarks {
        if l.anchor as usize >= keyframes {
            return refuse(format!(
                "landmark {} is anchored in keyframe {} of {keyframes}",
                l.id, l.anchor
            ));
        }
        let numbers = l.parameters.iter().chain(l.covariance.iter());
        if l.id == u32::MAX || !numbers.chain(&[l.existence]).all(|v| v.is_finite()) {
            return refuse(format!("landmark {} is not usable", l.id));
        }
    }
    Ok(())
}

/// Anchor, parameters and covariance of a landmark; one of points is seen from its first keyframe.
fn anchored(
    particle: &Particle,
    landmark: &Landmark,
    entry: &Entry,
) -> Option<(u32, Vector3<f64>, Matrix3<f64>)> {
    if let Some(anchor) = landmark.anchor() {
        return Some((anchor, landmark.mean, landmark.covariance));
    }
    let anchor = entry.first.keyframe;
    let camera: PlacedCamera = particle.path.get(anchor as usize)?.camera;
    let p = camera.camera_from_world * (landmark.mean - camera.centre);
    if p.z <= 0.0 {
        return None;
    }
    let rho = 1.0 / p.z;
    let (alpha, beta) = (p.x * rho, p.y * rho);
    let by_point = Matrix3::new(
        rho,
        0.0,
        -alpha * rho, //
        0.0,
        rho,
        -beta * rho, //
        0.0,
        0.0,
        -rho * rho,
    ) * camera.camera_from_world;
    Some((
        anchor,
        Vector3::new(alpha, beta, rho),
        by_point * landmark.covariance * by_point.transpose(),
    ))
}

/// A keyframe of a map as one of a path whose unit is the metre.
fn known(keyframe: &KnownKeyframe, rig: &Rig) -> Keyframe {
    let camera = PlacedCamera::new(&keyframe.world_from_camera);
    Keyframe {
        pose: pose_of_camera(&camera, rig),
        camera,
        scale: ScaleNote::METRE,
    }
}

/// The pose whose camera is `camera`.
pub(super) fn pose_of_camera(camera: &PlacedCamera, rig: &Rig) -> CameraPose {
    let world_from_body = camera.camera_from_world.transpose() * rig.body_from_camera().transpose();
    let (roll, pitch, phi) = Rotation3::from_matrix_unchecked(world_from_body).euler_angles();
    CameraPose {
        centre: camera.centre,
        phi,
        roll,
        pitch,
    }
}
