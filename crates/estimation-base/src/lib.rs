#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`Manifold`] is the trait that moves a state along a tangent vector and names the tangent vector between two states.
//! [`Se2`] is a pose in the plane and implements it, [`Angle`] a heading. [`Cholesky`] is the factor P = L L^T; its error,
//! [`CholeskyError`], names the pivot that failed, the value found there and the bound it missed.
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
