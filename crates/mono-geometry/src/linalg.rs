//! Dense linear algebra that can be trusted: the only place of the workspace that computes an SVD.

use nalgebra::{Matrix3, Rotation3};

/// The rotation nearest to a matrix in the Frobenius norm: U diag(1, 1, det(U V^T)) V^T.
#[must_use]
pub(crate) fn nearest_rotation(matrix: &Matrix3<f64>) -> Rotation3<f64> {
    #[expect(
        clippy::disallowed_methods,
        reason = "3x3 is exact to 4e-15; larger matrices go to faer"
    )]
    let svd = matrix.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Rotation3::identity();
    };
    let sign = if (u * v_t).determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let fixed = u * Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign)) * v_t;
    Rotation3::from_matrix_unchecked(fixed)
}
