//! Cholesky factors of covariances; an error names the covariance that has none.

use crate::error::RangeBearingError;
use estimation_base::{CholeskyError, CholeskyFactor, check_symmetric};
use nalgebra::SMatrix;

/// Factorises a positive definite covariance; `what` names it in an error.
pub(crate) fn definite<const N: usize>(
    covariance: &SMatrix<f64, N, N>,
    what: &'static str,
) -> Result<CholeskyFactor<N>, RangeBearingError> {
    named(
        check_symmetric(covariance).and_then(|()| CholeskyFactor::definite(covariance)),
        what,
    )
}

/// Factorises a positive semidefinite covariance into a square root that cannot be solved with; `what`
/// names it in an error.
pub(crate) fn semidefinite<const N: usize>(
    covariance: &SMatrix<f64, N, N>,
    what: &'static str,
) -> Result<CholeskyFactor<N>, RangeBearingError> {
    named(
        check_symmetric(covariance).and_then(|()| CholeskyFactor::semidefinite(covariance)),
        what,
    )
}

fn named<const N: usize>(
    factor: Result<CholeskyFactor<N>, CholeskyError>,
    what: &'static str,
) -> Result<CholeskyFactor<N>, RangeBearingError> {
    factor.map_err(|reason| RangeBearingError::Covariance { what, reason })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    #[test]
    fn errors_name_the_covariance_and_the_reason() {
        let indefinite = Matrix2::new(1.0, 2.0, 2.0, 1.0);
        for result in [definite(&indefinite, "p"), semidefinite(&indefinite, "p")] {
            let Err(RangeBearingError::Covariance { what: "p", reason }) = result else {
                panic!("{result:?}");
            };
            assert!(
                matches!(reason, CholeskyError::NotPositiveDefinite { pivot: 1, value, .. } if value == -3.0),
                "{reason}"
            );
        }
        assert!(definite(&Matrix2::zeros(), "p").is_err());
        assert!(semidefinite(&Matrix2::zeros(), "p").is_ok());
        // a column under a zero variance must be zero
        assert!(semidefinite(&Matrix2::new(0.0, 1e-3, 1e-3, 1.0), "p").is_err());
        // the lower triangle alone is a covariance, the matrix is not
        let skew = Matrix2::new(1.0, 0.1, 0.2, 1.0);
        for result in [definite(&skew, "p"), semidefinite(&skew, "p")] {
            let Err(RangeBearingError::Covariance { reason, .. }) = result else {
                panic!("{result:?}");
            };
            assert!(matches!(
                reason,
                CholeskyError::NotSymmetric {
                    row: 1,
                    column: 0,
                    ..
                }
            ));
        }
        assert!(definite(&(indefinite * f64::NAN), "p").is_err());
    }
}
