//! Covariances as every step of a filter takes them: factorised, checked, or refused with the name of the step.

use estimation_base::generic::CholeskyFactor;
use estimation_base::{CholeskyError, Real, check_symmetric, symmetric};
use nalgebra::{Dim, RawStorage, SMatrix, SVector, SquareMatrix};

use crate::error::{Step, UkfError};

/// The factor of a positive definite covariance.
pub(crate) fn definite<T: Real, const N: usize>(
    matrix: &SMatrix<T, N, N>,
    step: Step,
) -> Result<CholeskyFactor<T, N>, UkfError> {
    CholeskyFactor::definite(matrix).map_err(in_step(step))
}

/// The factor of a covariance that may lack variance in some direction.
pub(crate) fn semidefinite<T: Real, const N: usize>(
    matrix: &SMatrix<T, N, N>,
    step: Step,
) -> Result<CholeskyFactor<T, N>, UkfError> {
    CholeskyFactor::semidefinite(matrix).map_err(in_step(step))
}

/// Refuses a covariance whose triangles differ by more than rounding.
pub(crate) fn require_symmetric<T: Real, D: Dim, S: RawStorage<T, D, D>>(
    matrix: &SquareMatrix<T, D, S>,
    step: Step,
) -> Result<(), UkfError> {
    check_symmetric(matrix).map_err(in_step(step))
}

/// The factor of a covariance that a caller gives: symmetric up to rounding, perhaps without variance in some direction.
pub(crate) fn covariance_root<T: Real, const N: usize>(
    matrix: &SMatrix<T, N, N>,
    step: Step,
) -> Result<CholeskyFactor<T, N>, UkfError> {
    require_symmetric(matrix, step)?;
    semidefinite(&symmetric(matrix), step)
}

/// A vector whose entries are all finite; `what` names it in the error.
pub(crate) fn finite<T: Real, const N: usize>(
    vector: SVector<T, N>,
    step: Step,
    what: &'static str,
) -> Result<SVector<T, N>, UkfError> {
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
