//! States, measurements and genomes that are not vectors.
//!
//! An estimator needs two things from a space: to move a point by a small tangent vector, and to name the tangent vector
//! between two points. Covariances live in the tangent. A product of spaces (a range and a bearing, say) is a type of its
//! own with both methods written out.

use nalgebra::SVector;

/// A space with a D-dimensional tangent at each point.
///
/// The laws: `x.retract(&x.local(&y))` is y, and `x.local(&x.retract(&t))` is t for tangents shorter than half a turn.
pub trait Manifold<const D: usize>: Clone {
    /// The point reached from `self` along `tangent`.
    #[must_use]
    fn retract(&self, tangent: &SVector<f64, D>) -> Self;

    /// The tangent at `self` that leads to `other`.
    #[must_use]
    fn local(&self, other: &Self) -> SVector<f64, D>;
}

impl Manifold<1> for f64 {
    fn retract(&self, tangent: &SVector<f64, 1>) -> Self {
        self + tangent[0]
    }

    fn local(&self, other: &Self) -> SVector<f64, 1> {
        SVector::<f64, 1>::new(other - self)
    }
}

impl<const D: usize> Manifold<D> for SVector<f64, D> {
    fn retract(&self, tangent: &SVector<f64, D>) -> Self {
        self + tangent
    }

    fn local(&self, other: &Self) -> SVector<f64, D> {
        other - self
    }
}
