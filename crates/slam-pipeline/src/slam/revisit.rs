//! Revisits: an old place that shows how far the path has drifted since it was first seen.
//!
//! Landmarks that were not seen for some keyframes are *dormant*. When a keyframe shows enough of them, its pose is solved
//! twice, from the recent landmarks and odometry, and from the dormant ones. Where the two differ by more than their noise,
//! the whole path is moved ([`crate::filter::revisit`]), every particle is weighted by how well its own path closes, and
//! the keyframe is associated anew from there.
//!
//! Dormant landmarks are found inside their gates, or, where the estimate is too sure of itself for that, by appearance
//! ([`super::place`]).

use estimation_base::wrap;
use mono_geometry::Se2;
use nalgebra::{Matrix3, Vector2, Vector3};

use super::ground::Ground;
use super::keyframe::Seen;
use super::{Slam, SlamError, filter_error};
use crate::filter::drift::{Drift, transport};
use crate::filter::linearised::pose_posterior;
use crate::filter::motion::MotionPrior;
use crate::filter::observation::Prepared;
use crate::filter::particle::Particle;
use crate::filter::path_correction::PathCorrection;
use crate::filter::pose::{CameraPose, PLANAR, PoseMatrix};
use crate::filter::revisit::{Correction, Revisit};
use crate::frontend::association::Association;
use crate::frontend::catalogue::{Entry, Stage};
use crate::frontend::frame::FrameFeatures;
use crate::known_map::MapUse;
use crate::odometry::Control;

/// Keyframes without a sighting after which a landmark is dormant.
const DORMANT: u32 = 15;
/// Dormant landmarks from which their pose is worth a comparison.
const LEAST_DORMANT: usize = 15;
/// Squared normalised difference, of three degrees of freedom, from which the path is moved: 0.1 % of differences that are
/// noise alone.
const NOTICEABLE: f64 = 16.3;
/// Information from which a difference that is noise is worth knowing, nats: the errors shrink by a third in each of three
/// directions, or more in one.
const INFORMATIVE: f64 = 1.0;
/// Largest squared normalised difference that is believed.
const BELIEVED: f64 = 36.0;
/// Error of a path as a share of its length that is believed whatever the filter says: a metre of drift in fifty.
const DRIFT_SHARE: f64 = 0.02;
/// The same for the heading, radians per square root of a metre.
const TURN_SHARE: f64 = 0.01;
/// Error of the position of an old place as a share of the distance of its landmarks: the error of their depths that is the same
/// for all of them, because a few steps of the robot told all of their depths.
const DEPTH_SHARE: f64 = 0.003;
/// Noise of either pose beyond its covariance: landmarks of one place have errors in common.
const FLOOR_M: f64 = 0.002;
const FLOOR_RAD: f64 = 0.001;

/// A pose with its covariance over the pose tangent, in the unit of the particle.
struct Solved {
    pose: CameraPose,
    covariance: PoseMatrix,
}

/// The ground after a revisit.
pub(super) struct Revisited {
    pub(super) ground: Ground,
    /// Whether the path has moved; else it closes as it is, and only its errors are known better.
    pub(super) moved: bool,
}

/// The dormant landmarks of a place and the pose they give.
struct OldPlace {
    solved: Solved,
    /// Share of each anchor keyframe.
    anchors: Vec<(u32, f64)>,
    /// Mean distance of the landmarks from the camera, in the unit of the particle.
    distance: f64,
}

impl Slam {
    /// Whether an entry was not seen for some keyframes.
    pub(super) fn is_dormant(&self, entry: &Entry) -> bool {
        entry.stage == Stage::Mapped && entry.last.keyframe + DORMANT <= self.state.keyframe
    }

    /// Whether an entry was first seen long ago. Where a path has drifted, such landmarks are missed one and all.
    pub(super) fn is_old(&self, entry: &Entry) -> bool {
        entry.first.keyframe + 2 * DORMANT <= self.state.keyframe
    }

    /// The corrected ground when the frame shows an old place that lies elsewhere than the recent landmarks say.
    pub(super) fn revisit(
        &self,
        frame: &FrameFeatures<'_>,
        seen: &Seen<'_>,
        ground: &Ground,
    ) -> Result<Option<Revisited>, SlamError> {
        // Nothing can have been out of sight for longer than the run.
        let too_early = self.state.keyframe < DORMANT;
        if !self.policies.recovers || self.usage == MapUse::Localise || too_early {
            return Ok(None);
        }
        let inliers = |dormant: bool| {
            prepared(&seen.association, |id| {
                self.state
                    .catalogue
                    .get(id)
                    .is_some_and(|e| self.is_dormant(e))
                    == dormant
            })
        };
        let old = inliers(true);
        let place = if old.len() >= LEAST_DORMANT {
            self.old_place_in_gates(seen, &old)
        } else {
            self.old_place_by_appearance(frame, seen)
        };
        let Some(place) = place else { return Ok(None) };
        let recent: Vec<Option<Prepared>> =
            inliers(false).into_iter().map(|(_, p)| Some(p)).collect();
        let recent = self.solved(&seen.prior, &recent);
        self.moved(seen, ground, &recent, &place)
    }

    fn solved(&self, prior: &MotionPrior, matches: &[Option<Prepared>]) -> Solved {
        let posterior = pose_posterior(&self.rig, prior, matches, self.association.iterations);
        Solved {
            pose: posterior.mean_pose(prior),
            covariance: posterior.pose_covariance(prior),
        }
    }

    /// The pose by the dormant landmarks that lie in their gates.
    fn old_place_in_gates(&self, seen: &Seen<'_>, old: &[(u32, Prepared)]) -> Option<OldPlace> {
        let anchors = anchors(&seen.reference, old);
        let here = seen.reference.metric.position();
        let revisit = Revisit::new(&self.state.drift, &here, &anchors, &Matrix3::zeros())?;
        let prior = self.carrier().prior(
            &self.rig.lever_m(),
            &seen.reference.departure(),
            &widened(&seen.control, &(revisit.covariance() * 9.0)),
        );
        let matches: Vec<Option<Prepared>> = old.iter().map(|(_, p)| Some(*p)).collect();
        Some(OldPlace {
            distance: mean_distance(old, &seen.association.camera.centre),
            solved: self.solved(&prior, &matches),
            anchors,
        })
    }

    /// The pose by dormant landmarks that the gates did not admit.
    fn old_place_by_appearance(
        &self,
        frame: &FrameFeatures<'_>,
        seen: &Seen<'_>,
    ) -> Option<OldPlace> {
        let place = self.place(frame, &seen.reference, Some(&seen.association))?;
        let old = prepared(&place.association, |id| {
            self.state
                .catalogue
                .get(id)
                .is_some_and(|e| self.is_dormant(e))
        });
        if old.len() < LEAST_DORMANT {
            return None;
        }
        let matches: Vec<Option<Prepared>> = old.iter().map(|(_, p)| Some(*p)).collect();
        Some(OldPlace {
            distance: mean_distance(&old, &place.association.camera.centre),
            solved: self.solved(&place.prior, &matches),
            anchors: anchors(&place.reference, &old),
        })
    }

    /// The ground moved so that the pose by the recent landmarks agrees with that by the old ones; `None` when the difference
    /// tells nothing, or is too large to be drift.
    fn moved(
        &self,
        seen: &Seen<'_>,
        ground: &Ground,
        recent: &Solved,
        place: &OldPlace,
    ) -> Result<Option<Revisited>, SlamError> {
        let reference = &seen.reference;
        let scale = reference.metric.scale();
        let world = reference.metric_world(self.rig.lever_m());
        let body = world.body(&recent.pose);
        let here = Vector2::new(body.x, body.y);
        let apart = difference(&body, &world.body(&place.solved.pose));
        let noise = self.noise(recent, &place.solved, scale) + self.common(&here, place, scale);
        let Some(revisit) = Revisit::new(&self.state.drift, &here, &place.anchors, &noise) else {
            return Ok(None);
        };
        let noticeable = squared(&apart, &noise);
        let believed = squared(
            &apart,
            &(revisit.covariance() + self.believable(&here, &place.anchors)),
        );
        if believed > BELIEVED {
            return Ok(None);
        }
        if noticeable < NOTICEABLE {
            // The path closes as it is. That is worth knowing, too, and moves nothing.
            let gain = 0.5 * (revisit.covariance().determinant() / noise.determinant()).ln();
            if gain < INFORMATIVE {
                return Ok(None);
            }
            let mut ground = ground.clone();
            ground.drift = Some(self.conditioned(&revisit));
            return Ok(Some(Revisited {
                ground,
                moved: false,
            }));
        }
        let Some(errors) = revisit.correction(&apart) else {
            return Ok(None);
        };
        let correction = PathCorrection {
            errors,
            scale,
            height: recent.pose.centre.z - place.solved.pose.centre.z,
            // The place is the present of its anchors.
            tied: self.tied_since(oldest(&place.anchors)),
            lever_m: self.rig.lever_m(),
        };
        let mut moved = ground.clone();
        let log_weights: Vec<f64> = moved
            .filter
            .set()
            .particles()
            .iter()
            .map(|particle| {
                revisit.log_density(
                    &(apart + deviation(particle, reference, &place.anchors, self.rig.lever_m())),
                )
            })
            .collect();
        let best = log_weights
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        if best.is_finite() {
            let increments: Vec<f64> = log_weights.iter().map(|w| w - best).collect();
            moved
                .filter
                .reweight(&increments)
                .map_err(|e| filter_error(self.state.frame, e))?;
        }
        correction.apply(moved.filter.particles_mut());
        moved.window = self.window_from_here(&mut moved.filter);
        moved.last.pose = moved_by(
            &correction.errors,
            self.state.keyframe - 1,
            &moved.last.pose,
        );
        let mut drift = self.conditioned(&revisit);
        drift.move_bodies(|keyframe, body| moved_by(&correction.errors, keyframe, body));
        moved.drift = Some(drift);
        Ok(Some(Revisited {
            ground: moved,
            moved: true,
        }))
    }

    /// The joint covariance of the errors after `revisit`.
    fn conditioned(&self, revisit: &Revisit) -> Drift {
        let mut drift = self.state.drift.clone();
        revisit.condition(&mut drift);
        drift
    }

    fn noise(&self, recent: &Solved, old: &Solved, scale: f64) -> Matrix3<f64> {
        let unit = Vector3::new(scale, scale, 1.0);
        let sum = recent.covariance + old.covariance;
        let floor = Vector3::new(FLOOR_M * FLOOR_M, FLOOR_M * FLOOR_M, FLOOR_RAD * FLOOR_RAD);
        Matrix3::from_fn(|i, j| sum[(PLANAR[i], PLANAR[j])] * unit[i] * unit[j])
            + Matrix3::from_diagonal(&floor)
    }

    /// The covariance of the errors that the landmarks of a place have in common: of their depths, and because their anchors
    /// err differently.
    fn common(&self, here: &Vector2<f64>, place: &OldPlace, scale: f64) -> Matrix3<f64> {
        let side = DEPTH_SHARE * place.distance * scale;
        Matrix3::from_diagonal(&Vector3::new(side * side, side * side, 0.0))
            + disagreement(&self.state.drift, here, &place.anchors)
    }

    /// The variances of an error that any path of this length may have.
    fn believable(&self, here: &Vector2<f64>, anchors: &[(u32, f64)]) -> Matrix3<f64> {
        let length = self.state.drift.length_since(oldest(anchors), here);
        let turn = TURN_SHARE * length.sqrt();
        let side = DRIFT_SHARE * length;
        Matrix3::from_diagonal(&Vector3::new(side * side, side * side, turn * turn))
    }
}

/// `control` with the covariance of its increment widened in every direction by that of `by`.
fn widened(control: &Control, by: &Matrix3<f64>) -> Control {
    let side = by[(0, 0)].max(by[(1, 1)]);
    Control {
        covariance: control.covariance
            + Matrix3::from_diagonal(&Vector3::new(side, side, by[(2, 2)])),
        ..*control
    }
}

/// The accepted matches that `wanted` takes by id, as the reference particle knows their landmarks.
fn prepared(association: &Association<'_>, wanted: impl Fn(u32) -> bool) -> Vec<(u32, Prepared)> {
    association
        .inliers
        .iter()
        .filter(|p| wanted(p.feature.id))
        .filter_map(|p| {
            let predicted = association.in_view.get(p.feature.id)?;
            Some((p.feature.id, predicted.measured(&p.feature)))
        })
        .collect()
}

/// The anchors of landmarks with their shares.
fn anchors(particle: &Particle, landmarks: &[(u32, Prepared)]) -> Vec<(u32, f64)> {
    let mut anchors: Vec<u32> = landmarks
        .iter()
        .filter_map(|(id, _)| particle.map.get(*id)?.anchor())
        .collect();
    anchors.sort_unstable();
    let share = 1.0 / anchors.len().max(1) as f64;
    let mut shares: Vec<(u32, f64)> = Vec::new();
    for anchor in anchors {
        match shares.last_mut() {
            Some((same, sum)) if *same == anchor => *sum += share,
            _ => shares.push((anchor, share)),
        }
    }
    shares
}

/// The first of `anchors`.
fn oldest(anchors: &[(u32, f64)]) -> u32 {
    anchors.iter().map(|(a, _)| *a).min().unwrap_or(0)
}

/// Mean distance of `landmarks` from `centre`, in the unit of the particle.
fn mean_distance(landmarks: &[(u32, Prepared)], centre: &Vector3<f64>) -> f64 {
    let distances = landmarks.iter().filter_map(|(_, p)| {
        let ray = p.geometry.ray(&p.mean);
        let direction = ray.base + (ray.origin - centre) * ray.rate;
        (ray.rate > 0.0).then(|| direction.norm() / ray.rate)
    });
    let (sum, count) = distances.fold((0.0, 0), |(sum, n), d| (sum + d, n + 1));
    sum / f64::from(count.max(1))
}

/// sum_a w_a var(T_a e_a - mean): how differently the errors of `anchors` move a body at `here`.
fn disagreement(drift: &Drift, here: &Vector2<f64>, anchors: &[(u32, f64)]) -> Matrix3<f64> {
    let terms: Vec<_> = anchors
        .iter()
        .map(|(anchor, weight)| drift.error_at(*anchor, here, *weight))
        .collect();
    let covariance = |a: &(usize, Matrix3<f64>, f64), b: &(usize, Matrix3<f64>, f64)| {
        a.1 * drift.block(a.0, b.0) * b.1.transpose()
    };
    let of_mean: Matrix3<f64> = terms
        .iter()
        .flat_map(|a| terms.iter().map(move |b| covariance(a, b) * (a.2 * b.2)))
        .sum();
    let of_each: Matrix3<f64> = terms.iter().map(|a| covariance(a, a) * a.2).sum();
    let rest = of_each - of_mean;
    (rest + rest.transpose()) * 0.5
}

/// The difference of two body poses in world axes.
fn difference(a: &Se2, b: &Se2) -> Vector3<f64> {
    Vector3::new(a.x - b.x, a.y - b.y, wrap(a.phi - b.phi))
}

fn squared(difference: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    covariance
        .cholesky()
        .map_or(0.0, |c| difference.dot(&c.solve(difference)))
}

/// A body pose without its error.
fn moved_by(errors: &Correction, keyframe: u32, body: &Se2) -> Se2 {
    let error = errors.at(keyframe, &Vector2::new(body.x, body.y));
    Se2::new(body.x - error.x, body.y - error.y, wrap(body.phi - error.z))
}

/// How much further the path of `particle` is from closing than that of `reference`; the camera stands at `lever_m` in the
/// body.
fn deviation(
    particle: &Particle,
    reference: &Particle,
    anchors: &[(u32, f64)],
    lever_m: Vector2<f64>,
) -> Vector3<f64> {
    // Particles of one ancestor have one unit up to the share by which their scales differ.
    let world = reference.metric_world(lever_m);
    let here = world.body(&reference.pose);
    let mut deviation = difference(&world.body(&particle.pose), &here);
    for (anchor, weight) in anchors {
        let body = |p: &Particle| p.path.get(*anchor as usize).map(|k| world.body(&k.pose));
        if let (Some(own), Some(other)) = (body(particle), body(reference)) {
            let moved = transport(
                &Vector2::new(other.x, other.y),
                &Vector2::new(here.x, here.y),
            );
            deviation -= moved * difference(&own, &other) * *weight;
        }
    }
    deviation
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::drift::Draw;

    /// Two anchors whose errors are independent disagree by half of the sum of their variances; two that err alike do not.
    #[test]
    fn anchors_disagree_by_what_they_do_not_have_in_common() {
        let noise = Matrix3::from_diagonal(&Vector3::new(4e-4, 1e-4, 0.0));
        let mut drift = Drift::keeping(16);
        let body = Se2::identity();
        drift.push(&body, None, &noise, &Draw::Final);
        drift.push(&body, None, &noise, &Draw::Final);
        drift.push(&body, None, &noise, &Draw::Final);
        let here = Vector2::new(1.0, 0.5);
        // Dead reckoning: keyframe 2 errs by a step more than keyframe 1.
        let apart = disagreement(&drift, &here, &[(1, 0.5), (2, 0.5)]);
        assert!((apart - noise * 0.25).amax() < 1e-15, "{apart}");
        assert!(disagreement(&drift, &here, &[(2, 1.0)]).amax() < 1e-18);
    }
}
