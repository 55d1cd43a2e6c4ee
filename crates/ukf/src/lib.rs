//! Unscented transform and unscented Kalman filter on manifolds, without the standard library and without allocation.
//!
//! **What it is.** A Gaussian is represented by a few sigma points ([`SigmaPoints`]) that are pushed through the motion or
//! measurement function itself, so no derivative is needed. The crate offers the transform alone
//! ([`unscented_transform`]), the update of one Gaussian ([`unscented_update`], [`unscented_correction`]), and filters that
//! carry a state ([`Ukf`], and [`SquareRootUkf`], which carries a factor of the covariance). States and measurements are
//! vectors, headings, poses, rotations, or any type that implements [`Manifold`].
//!
//! **When to use it.** Use it where a model is curved over the spread of the estimate, where a state has headings or
//! rotations, or on a machine without an allocator. `Ukf` also takes noise inside the model (`predict_augmented`), many
//! measurements at once (`update_information`, `update_stacked`), gated measurements (`update_gated`) and very precise ones
//! (`update_iterated`). [`rts_smooth`] smooths the states afterwards, and [`assess_consistency`] judges whether the errors
//! match the covariances.
//!
//! **When not to use it.** A distribution with several modes wants a particle filter. For a linear model the Kalman filter
//! is cheaper and gives the same answer. A heading may be unknown (variance pi^2), but not for long if the model bends with it: the
//! transform is right to second order only. A function that folds within the spread of the points (a bearing to something
//! nearer than its own uncertainty) has no good Gaussian approximation, and the transform does not notice.
//!
//! ```
//! use nalgebra::{Matrix2, Vector1, Vector2, Matrix1};
//! use ukf::{SigmaPoints, Ukf, chi_square_quantile};
//!
//! # fn main() -> Result<(), ukf::UkfError> {
//! // Position and speed along a line; the distance to a mast 10 m beside its origin is measured.
//! let mut filter = Ukf::new(Vector2::new(0.0, 1.0), Matrix2::identity(), SigmaPoints::default())?;
//! filter.predict(&(Matrix2::identity() * 0.01), |x| Vector2::new(x[0] + x[1], x[1]))?;
//! let distance = Vector1::new(10.1);
//! let told = filter.update(&distance, &Matrix1::new(0.01), |x| Vector1::new(x[0].hypot(10.0)))?;
//! assert!(told.nis < chi_square_quantile(1.0, 0.99)?);
//! assert!(filter.covariance()[(0, 0)] < 2.0);
//! # Ok(())
//! # }
//! ```
//!
//! A robot that does not know its heading and reads a compass:
//!
//! ```
//! use nalgebra::Matrix1;
//! use std::f64::consts::PI;
//! use ukf::{Angle, SigmaPoints, Ukf};
//!
//! # fn main() -> Result<(), ukf::UkfError> {
//! let mut heading = Ukf::new(Angle::new(-2.0), Matrix1::new(PI * PI), SigmaPoints::default())?;
//! heading.update(&Angle::new(0.5), &Matrix1::new(0.01), |x| *x)?;
//! assert!((heading.mean().radians() - 0.5).abs() < 0.003);
//! assert!((heading.covariance()[0].sqrt() - 0.1).abs() < 1e-3);
//! # Ok(())
//! # }
//! ```
//!
//! **The three types to know.** [`SigmaPoints`] is a set of points with its weights; its constructors refuse parameters
//! that collapse the points. [`Ukf`] is the filter. [`UkfError`] says in which [`Step`] a matrix was no covariance and at
//! which pivot; after an error the state of the filter is what it was.
//!
//! All sizes are const generics: L is the dimension of the state's tangent, M that of the measurement's.
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

/// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct ReadmeDoctests;
