//! The scalars of the estimators: `f64`, and `f32` for processors that have no more.

use nalgebra::RealField;

/// A real number of an estimator: `f64` or `f32`.
///
/// Constants are written as `f64` and rounded once ([`Real::of`]); what an error tells is an `f64` again.
pub trait Real: RealField + Copy + Default + Into<f64> + sealed::Sealed {
    /// The distance from 1 to the next number.
    const EPSILON: Self;

    /// The nearest number to `value`.
    #[must_use]
    fn of(value: f64) -> Self;

    /// Whether this is NaN.
    #[must_use]
    fn is_nan(self) -> bool;
}

mod sealed {
    /// Tolerances are chosen for these two alone.
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

impl Real for f64 {
    const EPSILON: Self = Self::EPSILON;

    #[inline]
    fn of(value: f64) -> Self {
        value
    }

    #[inline]
    fn is_nan(self) -> bool {
        self.is_nan()
    }
}

impl Real for f32 {
    const EPSILON: Self = Self::EPSILON;

    #[inline]
    fn of(value: f64) -> Self {
        value as Self
    }

    #[inline]
    fn is_nan(self) -> bool {
        self.is_nan()
    }
}
