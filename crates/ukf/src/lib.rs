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

pub use augmented::augmented_transform;
pub use consistency::{Consistency, Verdict, assess_consistency, normalized_error_squared};
pub use error::{Step, UkfError};
pub use estimation_base::{
    Angle, CholeskyError, CholeskyFactor, Manifold, Real, Se2, chi_square_quantile, nalgebra,
    product_manifold,
};
pub use iterated::Iterations;
pub use several::stacked_workspace;
pub use smoother::rts_smooth;
pub use transform::unscented_transform;
pub use update::{unscented_correction, unscented_update};

/// The types over any scalar ([`Real`]); at the root they are those of `f64`.
pub mod generic {
    pub use crate::augmented::AugmentedPoints;
    pub use crate::filter::Ukf;
    pub use crate::gating::Gate;
    pub use crate::innovation::Innovation;
    pub use crate::iterated::Iterated;
    pub use crate::several::{JointFit, Measured};
    pub use crate::sigma_points::SigmaPoints;
    pub use crate::smoother::Estimate;
    pub use crate::square_root::SquareRootUkf;
    pub use crate::transform::Transformed;
    pub use crate::update::Update;
    pub use estimation_base::generic::{Angle, CholeskyFactor, Se2};
}

/// The types of one scalar, by the names of the generic ones.
macro_rules! types_of {
    ($scalar:ty) => {
        /// [`crate::generic::SigmaPoints`] of this scalar.
        pub type SigmaPoints<const L: usize> = crate::generic::SigmaPoints<$scalar, L>;
        /// [`crate::generic::AugmentedPoints`] of this scalar.
        pub type AugmentedPoints<const L: usize, const W: usize> =
            crate::generic::AugmentedPoints<$scalar, L, W>;
        /// [`crate::generic::Ukf`] of this scalar.
        pub type Ukf<X, const L: usize> = crate::generic::Ukf<$scalar, X, L>;
        /// [`crate::generic::SquareRootUkf`] of this scalar.
        pub type SquareRootUkf<X, const L: usize> = crate::generic::SquareRootUkf<$scalar, X, L>;
        /// [`crate::generic::Innovation`] of this scalar.
        pub type Innovation<const M: usize> = crate::generic::Innovation<$scalar, M>;
        /// [`crate::generic::Gate`] of this scalar.
        pub type Gate<const M: usize> = crate::generic::Gate<$scalar, M>;
        /// [`crate::generic::Iterated`] of this scalar.
        pub type Iterated<const M: usize> = crate::generic::Iterated<$scalar, M>;
        /// [`crate::generic::Measured`] of this scalar.
        pub type Measured<Z, const M: usize> = crate::generic::Measured<$scalar, Z, M>;
        /// [`crate::generic::JointFit`] of this scalar.
        pub type JointFit = crate::generic::JointFit<$scalar>;
        /// [`crate::generic::Estimate`] of this scalar.
        pub type Estimate<X, const L: usize> = crate::generic::Estimate<$scalar, X, L>;
        /// [`crate::generic::Transformed`] of this scalar.
        pub type Transformed<Y, const L: usize, const M: usize> =
            crate::generic::Transformed<$scalar, Y, L, M>;
        /// [`crate::generic::Update`] of this scalar.
        pub type Update<X, const L: usize, const M: usize> =
            crate::generic::Update<$scalar, X, L, M>;
    };
}

types_of!(f64);

/// The types in single precision, for processors that have no more; the functions take either.
///
/// ```
/// use ukf::nalgebra::{Matrix1, Matrix2, Vector1, Vector2};
/// use ukf::single::{SigmaPoints, Ukf};
///
/// let mut filter = Ukf::new(Vector2::new(0.0, 1.0), Matrix2::identity(), SigmaPoints::default())?;
/// filter.predict(&(Matrix2::identity() * 0.01), |x| Vector2::new(x[0] + x[1], x[1]))?;
/// filter.update(&Vector1::new(1.2), &Matrix1::new(0.1), |x| Vector1::new(x[0]))?;
/// let speed: f32 = filter.mean()[1];
/// assert!((speed - 1.095).abs() < 1e-3);
/// # Ok::<(), ukf::UkfError>(())
/// ```
pub mod single {
    pub use estimation_base::single::{Angle, CholeskyFactor, Se2};
    types_of!(f32);
}
