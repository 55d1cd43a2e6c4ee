//! Integration tests of the crate, one binary.

mod conditioning;
mod consistency;
mod linear;
mod names;
mod oracle;
mod products;
mod single_precision;
mod smoother;
mod square_root;
mod val_filterpy;
mod wide_angles;

use ukf::{CholeskyError, Step, UkfError};

/// The step, pivot and value of an error that names a lost pivot.
fn lost_pivot(error: UkfError) -> Option<(Step, usize, f64)> {
    match error {
        UkfError::Covariance {
            step,
            reason: CholeskyError::NotPositiveDefinite { pivot, value, .. },
        } => Some((step, pivot, value)),
        _ => None,
    }
}
