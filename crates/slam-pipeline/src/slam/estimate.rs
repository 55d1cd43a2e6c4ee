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
        let drift = self
            .state
            .drift
            .push(Vector2::new(pose.x, pose.y), support, &odometry);
        let covered = match self.policies.reported {
            ReportedCovariance::SpreadAndDrift => cover(&covariance, &drift),
            ReportedCovariance::Spread => covariance,
        };
        let unseen = match self.policies.reported {
            ReportedCovariance::SpreadAndDrift => {
                let step = Vector2::new(
                    pose.x - self.state.last.pose.x,
                    pose.y - self.state.last.pose.y,
                );
                let turn = wrap(pose.phi - self.state.last.pose.phi);
                self.state.turned.add(&step, turn);
                self.calibration_covariance(&pose)
            }
            ReportedCovariance::Spread => Matrix3::zeros(),
        };
        let along = Vector3::new(pose.x, pose.y, 0.0) * self.config.odometry.scale_bias;
        PoseEstimate {
            pose,
            covariance: covered + unseen + along * along.transpose(),
        }
    }

    /// The covariance of the errors that no image sees: a first heading, a mount or a focal length that is wrong.
    ///
    /// A first heading off by a turns the whole path and the heading by a; a camera mounted with a yaw of a turns the path
    /// alone. A relative error of the focal length is one of every angle turned, and swings the path driven since.
    fn calibration_covariance(&self, pose: &Se2) -> Matrix3<f64> {
        let carrier = &self.config.carrier;
        let heading = Vector3::new(-pose.y, pose.x, 1.0) * carrier.first_heading_sigma;
        let mount = Vector3::new(-pose.y, pose.x, 0.0) * carrier.mount_yaw_sigma;
        let focal = self.state.turned.gain() * carrier.focal_sigma;
        heading * heading.transpose() + mount * mount.transpose() + focal * focal.transpose()
    }
}

/// The effect of a relative error of all angles on the pose: the angle turned so far, and its swing of the path.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Turned {
    angle: f64,
    swing: Vector2<f64>,
}

impl Turned {
    /// Adds a step of the path, world axes, that ends with a turn.
    fn add(&mut self, step: &Vector2<f64>, turn: f64) {
        let middle = self.angle + 0.5 * turn;
        self.swing += Vector2::new(-step.y, step.x) * middle;
        self.angle += turn;
    }

    /// d (x, y, phi) / d (relative error).
    fn gain(&self) -> Vector3<f64> {
        Vector3::new(self.swing.x, self.swing.y, self.angle)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A path whose turns are all too large by the share e ends where the gain times e says.
    #[test]
    fn the_gain_of_turning_is_the_derivative_of_the_path() {
        let path = |stretch: f64| {
            let mut pose = Se2::identity();
            let mut turned = Turned::default();
            for k in 0..200 {
                let turn = 0.02 * (1.0 + (f64::from(k) * 0.05).sin());
                // The chord of an arc.
                let half = Se2::new(0.0, 0.0, 0.5 * turn * stretch);
                let next = pose
                    .compose(&half)
                    .compose(&Se2::new(0.05, 0.0, 0.0))
                    .compose(&half);
                turned.add(&Vector2::new(next.x - pose.x, next.y - pose.y), turn);
                pose = next;
            }
            (pose, turned)
        };
        let e = 1e-6;
        let (straight, turned) = path(1.0);
        let (more, less) = (path(1.0 + e).0, path(1.0 - e).0);
        let gain = turned.gain();
        let difference =
            Vector3::new(more.x - less.x, more.y - less.y, wrap(more.phi - less.phi)) / (2.0 * e);
        assert!((difference - gain).norm() < 1e-6, "{difference} {gain}");
        assert!(gain.z > 3.0 && straight.phi.abs() <= core::f64::consts::PI);
    }
}
