//! The small mathematics that every estimator needs, without the standard library and without allocation.
//!
//! **What it is.** Angles on the circle ([`wrap`], [`Angle`]), states that are not vectors ([`Manifold`]), planar rigid
//! motions ([`Se2`]), the Cholesky factor of a covariance ([`Cholesky`]), and the chi-square distribution
//! ([`chi_square_cdf`], [`chi_square_quantile`]). The filters, the geometry and the evolution strategy of this workspace
//! stand on these, so that each formula exists once.
//!
//! **When to use it.** Use it where a state has a heading, where a covariance has to be factorised and a failure has to
//! be explained, or where a squared Mahalanobis distance is compared with a threshold. All sizes are const generics, and
//! nothing allocates.
//!
//! **When not to use it.** Large or sparse systems want a blocked factorisation (faer, for example). The eigenvalues and
//! singular values of a matrix are not here either.
//!
//! ```
//! use estimation_base::{Cholesky, Manifold, Se2, chi_square_quantile};
//! use nalgebra::{Matrix3, Vector3};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let estimated = Se2::new(1.0, 2.0, 3.1);
//! let true_pose = Se2::new(1.1, 1.9, -3.1); // the headings are 0.08 rad apart, not 6.2
//! let error = estimated.local(&true_pose);
//!
//! let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.01));
//! let squared_distance = Cholesky::definite(&covariance)?.mahalanobis_squared(&error);
//! assert!(squared_distance < chi_square_quantile(3.0, 0.99)?);
//! # Ok(())
//! # }
//! ```
//!
//! **The three types to know.** [`Manifold`] is the trait that moves a state along a tangent vector and names the
//! tangent vector between two states. [`Se2`] is a pose in the plane and implements it. [`Cholesky`] is the factor
//! P = L L^T; its error, [`CholeskyError`], names the pivot that failed, the value found there and the bound it missed.
#![no_std]

mod angle;
mod chi_square;
mod cholesky;
mod manifold;
mod readable;
mod rotation;
mod se2;
pub mod series;

pub use angle::{Angle, wrap};
pub use chi_square::{ChiSquareError, chi_square_cdf, chi_square_quantile};
pub use cholesky::{Cholesky, CholeskyError, check_symmetric, cholesky_in_place, symmetric};
pub use manifold::Manifold;
pub use readable::Readable;
pub use se2::Se2;

/// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct ReadmeDoctests;
