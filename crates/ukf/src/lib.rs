#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`SigmaPoints`] is a set of points with its weights. [`Ukf`] is the filter, [`SquareRootUkf`] the form that takes and gives
//! factors, [`unscented_transform`], [`unscented_update`] and [`unscented_correction`] are for one Gaussian alone. [`UkfError`] says
//! in which [`Step`] a matrix was no covariance and at which pivot. All sizes are const generics: L is the dimension of the
//! state's tangent, M that of the measurement's.
#![no_std]

mod augmented;
mod consistency;
mod covariance;
mod error;
mod filter;
mod gating;
mod innovation;
mod iterated;
mod joint;
mod placed;
mod rank_one;
mod several;
mod sigma_points;
mod smoother;
mod square_root;
mod transform;
mod update;

pub use augmented::{AugmentedPoints, augmented_transform};
pub use consistency::{Consistency, Verdict, assess_consistency, normalized_error_squared};
pub use error::{Step, UkfError};
pub use estimation_base::{Angle, Cholesky, CholeskyError, Manifold, Se2, chi_square_quantile};
pub use filter::Ukf;
pub use gating::Gate;
pub use innovation::Innovation;
pub use iterated::{Iterated, Iterations};
pub use several::{JointFit, Measured, stacked_workspace};
pub use sigma_points::SigmaPoints;
pub use smoother::{Estimate, rts_smooth};
pub use square_root::SquareRootUkf;
pub use transform::{Transformed, unscented_transform};
pub use update::{Update, unscented_correction, unscented_update};
