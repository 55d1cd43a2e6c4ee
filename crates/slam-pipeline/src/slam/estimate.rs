//! The reported pose and its covariance, at keyframes and between them.

use estimation_base::wrap;
use mono_geometry::Se2;
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use rbpf_core::ParticleSet;

use super::fixed_lag::Settled;
use super::{PoseEstimate, Slam};
use crate::filter::drift::{Draw, Support, cover};
use crate::filter::linearised::PosePosterior;
use crate::filter::motion::MotionPrior;
use crate::filter::particle::Particle;
use crate::filter::pose::{PLANAR, PoseMatrix};
use crate::method::ReportedCovariance;
use crate::odometry::Control;

impl Slam {
    /// The estimate at a new keyframe: weighted mean and covariance of the body pose over the particles, with the part
    /// that each particle leaves open, the drift of the path that the particles share, and the constant scale error of
    /// the wheels.
    pub(super) fn estimate(
        &mut self,
        support: Option<&Support>,
        control: &Control,
        settled: Option<&Settled>,
    ) -> PoseEstimate {
        let Spread {
            pose,
            between,
            open,
        } = spread(self.state.filter.set());
        let covariance = between + open;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.state.last.pose.phi);
        let odometry = turn.matrix() * control.covariance * turn.matrix().transpose();
        let draw = if self.lag() > 0 {
            Draw::Smoothed { open }
        } else {
            Draw::Final
        };
        let mut drift = self.state.drift.push(&pose, support, &odometry, &draw);
        if let Some(Settled {
            first,
            covariance,
            gone,
        }) = settled
        {
            let lever_m = self.rig.lever_m();
            let set = self.state.filter.set();
            self.state
                .drift
                .settle(*first, covariance.as_ref(), *gone, |keyframe| {
                    spread_at(set, keyframe, &lever_m)
                });
            drift = self.state.drift.last_covariance(&pose);
        }
        let covered = match self.policies.reported {
            ReportedCovariance::SpreadAndDrift => {
                let covered = cover(&covariance, &drift);
                self.state.drift.note_reported(&covered);
                covered
            }
            ReportedCovariance::Spread => covariance,
        };
        let added = match self.policies.reported {
            ReportedCovariance::SpreadAndDrift => self.constant_errors(self.state.keyframe, &pose),
            ReportedCovariance::Spread => self.scale_covariance(&pose),
        };
        PoseEstimate {
            pose,
            covariance: covered + added,
        }
    }

    /// The covariance of a keyframe of the path at `body`: what was reported of it, revisits since, calibration and the scale
    /// error of the wheels.
    pub(super) fn keyframe_covariance(&self, keyframe: u32, body: &Se2) -> Matrix3<f64> {
        let drift = self
            .state
            .drift
            .covariance_of(keyframe, &Vector2::new(body.x, body.y));
        drift + self.constant_errors(keyframe, body)
    }

    /// The covariance of the errors that every report adds to that of the path: calibration and the scale error of the wheels.
    pub(super) fn constant_errors(&self, keyframe: u32, body: &Se2) -> Matrix3<f64> {
        self.scale_covariance(body) + self.calibration_covariance(keyframe, body)
    }

    /// The covariance of the constant scale error of the wheels.
    fn scale_covariance(&self, pose: &Se2) -> Matrix3<f64> {
        let along = Vector3::new(pose.x, pose.y, 0.0) * self.config.odometry.scale_bias;
        along * along.transpose()
    }

    /// The covariance of the errors that no image sees: a first heading, a mount or a focal length that is wrong.
    ///
    /// A first heading off by a turns the whole path and the heading by a; a camera mounted with a yaw of a turns the path
    /// alone. A relative error of the focal length is one of every angle that the camera sees.
    fn calibration_covariance(&self, keyframe: u32, pose: &Se2) -> Matrix3<f64> {
        let carrier = &self.config.carrier;
        let heading = Vector3::new(-pose.y, pose.x, 1.0) * carrier.first_heading_sigma;
        let mount = Vector3::new(-pose.y, pose.x, 0.0) * carrier.mount_yaw_sigma;
        let focal = self.state.drift.focal_rate(keyframe, pose) * carrier.focal_sigma;
        heading * heading.transpose() + mount * mount.transpose() + focal * focal.transpose()
    }
}

/// The body pose over the particles.
struct Spread {
    /// Weighted mean.
    pose: Se2,
    /// Covariance between the particles.
    between: Matrix3<f64>,
    /// Mean covariance that each leaves open.
    open: Matrix3<f64>,
}

fn spread(set: &ParticleSet<Particle>) -> Spread {
    let bodies = set.particles().iter().map(|p| p.metric.body(p.pose.phi));
    let (pose, between) = moments(&set.weights(), bodies);
    let mut open = Matrix3::zeros();
    for (w, p) in set.weights().iter().zip(set.particles()) {
        let position = p.metric.position_covariance() * *w;
        let mut block = open.fixed_view_mut::<2, 2>(0, 0);
        block += position;
    }
    Spread {
        pose,
        between,
        open,
    }
}

/// Covariance of the body pose of a keyframe between the particles, as they have its path now.
fn spread_at(set: &ParticleSet<Particle>, keyframe: u32, lever_m: &Vector2<f64>) -> Matrix3<f64> {
    let bodies = set.particles().iter().filter_map(|p| {
        let pose = p.path.get(keyframe as usize)?.pose;
        Some(p.metric_world(*lever_m).body(&pose))
    });
    moments(&set.weights(), bodies).1
}

/// Weighted mean and covariance of poses, at least one.
fn moments(weights: &[f64], poses: impl Iterator<Item = Se2> + Clone) -> (Se2, Matrix3<f64>) {
    let first = poses.clone().next().map_or(0.0, |pose| pose.phi);
    let unwrapped = |pose: &Se2| Vector3::new(pose.x, pose.y, wrap(pose.phi - first));
    let mut mean = Vector3::zeros();
    for (w, pose) in weights.iter().zip(poses.clone()) {
        mean += unwrapped(&pose) * *w;
    }
    let mut covariance = Matrix3::zeros();
    for (w, pose) in weights.iter().zip(poses) {
        let d = unwrapped(&pose) - mean;
        covariance += d * d.transpose() * *w;
    }
    let pose = Se2 {
        x: mean.x,
        y: mean.y,
        phi: wrap(first + mean.z),
    };
    (pose, covariance)
}

/// Metric body motion of the reference particle since its keyframe.
pub(super) fn relative_motion(
    reference: &Particle,
    prior: &MotionPrior,
    posterior: &PosePosterior,
) -> Se2 {
    let pose = posterior.mean_pose(prior);
    let body = reference
        .metric
        .condition_on_pose(prior, &pose)
        .body(pose.phi);
    reference.metric.body(reference.pose.phi).between(&body)
}

/// The estimate of a frame between keyframes: `motion` on top of `last`, the covariance grown by that of the step.
///
/// `step` is the covariance of the pose tangent in the unit of the reference particle, `scale` its metres per unit.
pub(super) fn between_keyframes(
    last: &PoseEstimate,
    motion: &Se2,
    step: &PoseMatrix,
    scale: f64,
) -> PoseEstimate {
    let at = Se2::new(last.pose.x, last.pose.y, last.pose.phi);
    let now = at.compose(motion);
    let (dx, dy) = (now.x - at.x, now.y - at.y);
    let transition = Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0);
    let unit = Vector3::new(scale, scale, 1.0);
    let mut added = Matrix3::zeros();
    for (i, gi) in PLANAR.into_iter().enumerate() {
        for (j, gj) in PLANAR.into_iter().enumerate() {
            added[(i, j)] = step[(gi, gj)] * unit[i] * unit[j];
        }
    }
    PoseEstimate {
        pose: now,
        covariance: transition * last.covariance * transition.transpose() + added,
    }
}
