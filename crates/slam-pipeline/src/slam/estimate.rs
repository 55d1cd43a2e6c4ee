//! The reported pose and its covariance, at keyframes and between them.

use estimation_base::wrap;
use mono_geometry::Se2;
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use rbpf_core::ParticleSet;

use super::{PoseEstimate, Slam};
use crate::filter::drift::{Support, cover};
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
    ) -> PoseEstimate {
        let PoseEstimate { pose, covariance } = spread(self.state.filter.set());
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.state.last.pose.phi);
        let odometry = turn.matrix() * control.covariance * turn.matrix().transpose();
        let drift = self.state.drift.push(&pose, support, &odometry);
        let covered = match self.policies.reported {
            ReportedCovariance::SpreadAndDrift => {
                let covered = cover(&covariance, &drift);
                self.state.drift.note_reported(&covered);
                covered
            }
            ReportedCovariance::Spread => covariance,
        };
        let unseen = match self.policies.reported {
            ReportedCovariance::SpreadAndDrift => {
                self.calibration_covariance(self.state.keyframe, &pose)
            }
            ReportedCovariance::Spread => Matrix3::zeros(),
        };
        let along = Vector3::new(pose.x, pose.y, 0.0) * self.config.odometry.scale_bias;
        PoseEstimate {
            pose,
            covariance: covered + unseen + along * along.transpose(),
        }
    }

    /// The covariance of a keyframe of the path at `body`: what was reported of it, revisits since, calibration and the scale
    /// error of the wheels.
    pub(super) fn keyframe_covariance(&self, keyframe: u32, body: &Se2) -> Matrix3<f64> {
        let drift = self
            .state
            .drift
            .covariance_of(keyframe, &Vector2::new(body.x, body.y));
        let along = Vector3::new(body.x, body.y, 0.0) * self.config.odometry.scale_bias;
        drift + along * along.transpose() + self.calibration_covariance(keyframe, body)
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

/// Weighted mean and covariance of the body pose over the particles, the metric state of each included.
fn spread(set: &ParticleSet<Particle>) -> PoseEstimate {
    let weights = set.weights();
    let first = set.particles()[0].pose.phi;
    let unwrapped = |p: &Particle| {
        let position = p.metric.position();
        Vector3::new(position.x, position.y, wrap(p.pose.phi - first))
    };
    let mut mean = Vector3::zeros();
    for (w, p) in weights.iter().zip(set.particles()) {
        mean += unwrapped(p) * *w;
    }
    let mut covariance = Matrix3::zeros();
    for (w, p) in weights.iter().zip(set.particles()) {
        let d = unwrapped(p) - mean;
        covariance += d * d.transpose() * *w;
        let open = p.metric.position_covariance();
        for i in 0..2 {
            for j in 0..2 {
                covariance[(i, j)] += w * open[(i, j)];
            }
        }
    }
    PoseEstimate {
        pose: Se2 {
            x: mean.x,
            y: mean.y,
            phi: wrap(first + mean.z),
        },
        covariance,
    }
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
