//! Unscented transform and unscented Kalman filter on manifolds, without the standard library and
//! without allocation.
//!
//! 1. [`sigma_points`]: which points stand for a Gaussian, and their weights;
//! 2. [`manifold`]: states and measurements with headings, by one trait of two methods; [`so3`] for rotations;
//! 3. [`transform`]: mean and covariance of a function of a Gaussian;
//! 4. [`update`]: the measurement update of one Gaussian, alone, as a landmark needs it;
//! 5. [`filter`]: prediction and update as a filter; [`augmented`] where noise is not added,
//!    [`several`] for many measurements at once, [`gating`] against wrong ones, [`iterated`] for precise ones;
//! 6. [`square_root`]: the same filter carrying a factor of the covariance;
//! 7. [`smoother`]: each state given all measurements;
//! 8. [`consistency`]: does the error match the covariance? NIS, NEES, chi-square bounds;
//! 9. [`cholesky`]: the factorisation beneath, which names the pivot that failed.
//!
//! All sizes are const generics: L the state's tangent, M the measurement's.
#![no_std]

pub mod augmented;
pub mod cholesky;
pub mod consistency;
pub mod error;
pub mod filter;
pub mod gating;
pub mod iterated;
pub mod manifold;
pub mod several;
pub mod sigma_points;
pub mod smoother;
pub mod so3;
pub mod square_root;
pub mod transform;
pub mod update;

mod math;
mod rank_one;

pub use augmented::{AugmentedPoints, augmented_transform};
pub use cholesky::Cholesky;
pub use consistency::{
    Consistency, Verdict, assess_consistency, chi_square_cdf, chi_square_quantile,
    normalized_error_squared,
};
pub use error::{Step, UkfError};
pub use filter::{Innovation, Ukf};
pub use gating::Gate;
pub use iterated::{Iterated, Iterations};
pub use manifold::{Angle, Manifold, Se2};
pub use several::{JointFit, Measured, stacked_workspace};
pub use sigma_points::SigmaPoints;
pub use smoother::{Estimate, rts_smooth};
pub use square_root::SquareRootUkf;
pub use transform::{Transformed, unscented_transform};
pub use update::{Update, unscented_correction, unscented_update};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct ReadmeDoctests;
