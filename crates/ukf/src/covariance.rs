//! Covariances as every step of a filter takes them: factorised, checked, or refused with the name of the step.

use estimation_base::{Cholesky, CholeskyError, check_symmetric, symmetric};
use nalgebra::{Dim, RawStorage, SMatrix, SVector, SquareMatrix};

use crate::error::{Step, UkfError};

/// The factor of a positive definite covariance.
pub(crate) fn definite<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    step: Step,
) -> Result<Cholesky<N>, UkfError> {
    Cholesky::definite(matrix).map_err(in_step(step))
}

/// The factor of a covariance that may lack variance in some direction.
pub(crate) fn semidefinite<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    step: Step,
) -> Result<Cholesky<N>, UkfError> {
    Cholesky::semidefinite(matrix).map_err(in_step(step))
}

/// Refuses a covariance whose triangles differ by more than rounding.
pub(crate) fn require_symmetric<D: Dim, S: RawStorage<f64, D, D>>(
    matrix: &SquareMatrix<f64, D, S>,
    step: Step,
) -> Result<(), UkfError> {
    check_symmetric(matrix).map_err(in_step(step))
}

/// The factor of a covariance that a caller gives: symmetric up to rounding, perhaps without variance in some direction.
pub(crate) fn covariance_root<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    step: Step,
) -> Result<Cholesky<N>, UkfError> {
    require_symmetric(matrix, step)?;
    semidefinite(&symmetric(matrix), step)
}

/// A vector whose entries are all finite; `what` names it in the error.
pub(crate) fn finite<const N: usize>(
    vector: SVector<f64, N>,
    step: Step,
    what: &'static str,
) -> Result<SVector<f64, N>, UkfError> {
    if vector.iter().all(|entry| entry.is_finite()) {
        Ok(vector)
    } else {
        Err(UkfError::NotFinite { step, what })
    }
}

/// Adds the step to an error of the factorisation.
pub(crate) const fn in_step(step: Step) -> impl Fn(CholeskyError) -> UkfError {
    move |reason| UkfError::Covariance { step, reason }
}
