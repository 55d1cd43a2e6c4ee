//! First-order propagation of a pose's covariance, for motion models of one's own.

use estimation_base::wrap;
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};

/// F P F^T + G Q G^T, Q diagonal.
pub(crate) fn propagate(
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

/// The difference of two poses, heading wrapped.
pub(crate) fn between(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    moved(to, &-from)
}
