//! Planar robots (x, y in metres, heading in radians) whose commands follow one after the other, with the
//! covariance of the pose propagated to first order.

use estimation_base::wrap;
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};
use range_bearing_slam::{Gaussian, MotionModel};

/// The effect of one command on the pose.
pub(crate) struct Step {
    /// Displacement, metres and radians.
    pub(crate) displacement: Vector3<f64>,
    /// Derivatives of the displacement by the two noisy quantities of the command.
    pub(crate) by_noise: SMatrix<f64, 3, 2>,
    /// Variances of these quantities.
    pub(crate) variances: [f64; 2],
}

/// The commands of a robot. Its pose turns with the heading.
pub(crate) trait Commanded: Sync {
    /// One command.
    type Command;

    /// Variance that keeps the covariance of a robot at rest positive definite, m^2 and rad^2.
    const FLOOR: f64;

    /// The effect of a command at a heading.
    fn step(&self, heading: f64, command: &Self::Command) -> Step;
}

/// The motion model of a commanded robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planar<R>(pub(crate) R);

impl<R: Commanded> MotionModel<3> for Planar<R> {
    type Control = Vec<R::Command>;

    fn predict(&self, pose: &Vector3<f64>, commands: &Vec<R::Command>) -> Gaussian<3> {
        let mut mean = *pose;
        let mut covariance = Matrix3::identity() * R::FLOOR;
        for command in commands {
            let step = self.0.step(mean.z, command);
            let mut f = Matrix3::identity();
            f[(0, 2)] = -step.displacement.y;
            f[(1, 2)] = step.displacement.x;
            covariance = propagate(&covariance, &f, &step.by_noise, step.variances);
            mean += step.displacement;
        }
        mean.z = wrap(mean.z);
        Gaussian { mean, covariance }
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        moved(pose, tangent)
    }

    fn local(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
        moved(to, &-from)
    }
}

/// F P F^T + G Q G^T, Q diagonal.
fn propagate(
    covariance: &Matrix3<f64>,
    f: &Matrix3<f64>,
    g: &SMatrix<f64, 3, 2>,
    variances: [f64; 2],
) -> Matrix3<f64> {
    let q = Matrix2::from_diagonal(&Vector2::from(variances));
    let sum = f * covariance * f.transpose() + g * q * g.transpose();
    (sum + sum.transpose()) * 0.5
}

/// The sum of two poses, heading wrapped.
pub(crate) fn moved(pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
    let sum = pose + tangent;
    Vector3::new(sum.x, sum.y, wrap(sum.z))
}
