//! Decides whether a range and bearing belong to a known beacon: a measurement on a manifold of its own, its innovation
//! whitened by a Cholesky factor, and a chi-square gate.

use estimation_base::{
    Angle, CholeskyError, CholeskyFactor, Manifold, Se2, chi_square_quantile, symmetric,
};
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// Metres and an angle: a product of two spaces with both methods written out.
#[derive(Clone, Copy, Debug)]
struct RangeBearing {
    range: f64,
    bearing: Angle,
}

impl Manifold<2> for RangeBearing {
    fn retract(&self, tangent: &Vector2<f64>) -> Self {
        Self {
            range: self.range + tangent.x,
            bearing: Angle::new(self.bearing.radians() + tangent.y),
        }
    }

    fn local(&self, other: &Self) -> Vector2<f64> {
        let bearing = self.bearing.local(&other.bearing);
        Vector2::new(other.range - self.range, bearing.x)
    }
}

fn predict(pose: &Se2, beacon: &Vector2<f64>) -> RangeBearing {
    let seen = pose.inverse().act(beacon);
    RangeBearing {
        range: seen.norm(),
        bearing: Angle::new(seen.y.atan2(seen.x)),
    }
}

/// The derivative of the prediction by the tangent of the pose, by central differences.
fn jacobian(pose: &Se2, beacon: &Vector2<f64>) -> Matrix2x3<f64> {
    let step = 1e-6;
    let mut jacobian = Matrix2x3::zeros();
    for axis in 0..3 {
        let mut delta = Vector3::zeros();
        delta[axis] = step;
        let before = predict(&pose.retract(&-delta), beacon);
        let after = predict(&pose.retract(&delta), beacon);
        jacobian.set_column(axis, &(before.local(&after) / (2.0 * step)));
    }
    jacobian
}

#[expect(clippy::print_stdout, reason = "an example")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let pose = Se2::new(0.0, 0.0, 0.0);
    let pose_covariance = Matrix3::from_diagonal(&Vector3::new(0.04, 0.04, 0.01));
    let noise = Matrix2::from_diagonal(&Vector2::new(0.01, 0.0025));
    // straight behind the robot, where bearings jump from pi to -pi
    let beacon = Vector2::new(-4.0, 0.01);

    let predicted = predict(&pose, &beacon);
    let h = jacobian(&pose, &beacon);
    let innovation_covariance = symmetric(&(h * pose_covariance * h.transpose() + noise));
    let factor = CholeskyFactor::definite(&innovation_covariance)?;
    let gate = chi_square_quantile(2.0, 0.99)?;
    for (range, bearing) in [(4.1, -3.1), (4.0, 3.0), (5.5, 3.1)] {
        let measured = RangeBearing {
            range,
            bearing: Angle::new(bearing),
        };
        let distance = factor.mahalanobis_squared(&predicted.local(&measured));
        let verdict = if distance <= gate {
            "accepted"
        } else {
            "refused"
        };
        println!(
            "range {range} m, bearing {bearing} rad: {distance:.2} against {gate:.2}, {verdict}"
        );
    }

    // a covariance that is none: the error says where and by how much
    let wrong = Matrix2::new(1.0, 2.0, 2.0, 1.0);
    if let Err(error @ CholeskyError::NotPositiveDefinite { .. }) = CholeskyFactor::definite(&wrong)
    {
        println!("{error}");
    }
    Ok(())
}
