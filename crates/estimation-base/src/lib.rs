#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`Manifold`] is the trait that moves a state along a tangent vector and names the tangent vector between two states.
//! [`Se2`] is a pose in the plane and implements it, [`Angle`] a heading. [`CholeskyFactor`] is the factor P = L L^T; its error,
//! [`CholeskyError`], names the pivot that failed, the value found there and the bound it missed.
#![no_std]

mod angle;
mod chi_square;
mod cholesky;
mod manifold;
mod product;
mod readable;
mod real;
mod rotation;
mod se2;
pub mod series;

pub use angle::wrap;
pub use chi_square::{ChiSquareError, chi_square_cdf, chi_square_quantile};
pub use cholesky::{CholeskyError, check_symmetric, cholesky_in_place, symmetric};
pub use manifold::Manifold;
pub use nalgebra;
pub use readable::Readable;
pub use real::Real;

/// The types over any scalar ([`Real`]); at the root they are those of `f64`.
pub mod generic {
    pub use crate::angle::Angle;
    pub use crate::cholesky::CholeskyFactor;
    pub use crate::se2::Se2;
}

/// The types in single precision; the functions take either.
pub mod single {
    /// [`crate::generic::Angle`] of `f32`.
    pub type Angle = crate::generic::Angle<f32>;
    /// [`crate::generic::CholeskyFactor`] of `f32`.
    pub type CholeskyFactor<const N: usize> = crate::generic::CholeskyFactor<f32, N>;
    /// [`crate::generic::Se2`] of `f32`.
    pub type Se2 = crate::generic::Se2<f32>;
}

/// [`generic::Angle`] of `f64`.
pub type Angle = generic::Angle<f64>;
/// [`generic::CholeskyFactor`] of `f64`.
pub type CholeskyFactor<const N: usize> = generic::CholeskyFactor<f64, N>;
/// [`generic::Se2`] of `f64`.
pub type Se2 = generic::Se2<f64>;
