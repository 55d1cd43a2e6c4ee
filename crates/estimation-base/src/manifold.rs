//! States, measurements and genomes that are not vectors.
//!
//! An estimator needs two things from a space: to move a point by a small tangent vector, and to name the tangent vector
//! between two points. Covariances live in the tangent. A product of spaces (a range and a bearing, a pose and a landmark)
//! is a type of its own, for which [`crate::product_manifold`] writes both methods.

use nalgebra::SVector;

use crate::real::Real;

/// A space with a D-dimensional tangent of scalars T at each point.
///
/// The laws: `x.retract(&x.local(&y))` is y, and `x.local(&x.retract(&t))` is t for tangents shorter than half a turn.
pub trait Manifold<const D: usize, T = f64>: Clone {
    /// The point reached from `self` along `tangent`.
    #[must_use]
    fn retract(&self, tangent: &SVector<T, D>) -> Self;

    /// The tangent at `self` that leads to `other`.
    #[must_use]
    fn local(&self, other: &Self) -> SVector<T, D>;
}

impl Manifold<1> for f64 {
    fn retract(&self, tangent: &SVector<Self, 1>) -> Self {
        self + tangent[0]
    }

    fn local(&self, other: &Self) -> SVector<Self, 1> {
        SVector::<Self, 1>::new(other - self)
    }
}

impl Manifold<1, Self> for f32 {
    fn retract(&self, tangent: &SVector<Self, 1>) -> Self {
        self + tangent[0]
    }

    fn local(&self, other: &Self) -> SVector<Self, 1> {
        SVector::<Self, 1>::new(other - self)
    }
}

impl<T: Real, const D: usize> Manifold<D, T> for SVector<T, D> {
    fn retract(&self, tangent: &SVector<T, D>) -> Self {
        self + tangent
    }

    fn local(&self, other: &Self) -> SVector<T, D> {
        other - self
    }
}
