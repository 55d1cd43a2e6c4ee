//! Innovation gating: a measurement too far from its prediction is not taken in.
//!
//! For a consistent filter nis = (z - z^)^T S^-1 (z - z^) is chi-square with M degrees of freedom. A bound of
//! [`crate::chi_square_quantile`]`(M, 0.99)` refuses one good measurement in a hundred (9.21 for M = 2, 11.34 for 3).

use estimation_base::{Manifold, Real};
use nalgebra::SMatrix;

use crate::error::UkfError;
use crate::filter::Ukf;
use crate::innovation::Innovation;

/// A measurement against its bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate<T, const M: usize> {
    /// How well it fits.
    pub innovation: Innovation<T, M>,
    /// The largest nis accepted.
    pub bound: T,
}

impl<T: Real, const M: usize> Gate<T, M> {
    /// nis <= bound.
    #[must_use]
    pub fn accepted(&self) -> bool {
        self.innovation.nis <= self.bound
    }
}

impl<T: Real, X: Manifold<L, T>, const L: usize> Ukf<T, X, L> {
    /// How well a measurement fits, without taking it in.
    ///
    /// # Errors
    /// As [`Ukf::update`].
    pub fn gate<Z: Manifold<M, T>, const M: usize>(
        &self,
        measurement: &Z,
        measurement_noise: &SMatrix<T, M, M>,
        bound: T,
        function: impl FnMut(&X) -> Z,
    ) -> Result<Gate<T, M>, UkfError> {
        self.clone()
            .update_gated(measurement, measurement_noise, bound, function)
    }

    /// Takes in a measurement if its nis is within `bound`; the state is unchanged otherwise.
    ///
    /// # Errors
    /// As [`Ukf::update`].
    pub fn update_gated<Z: Manifold<M, T>, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &SMatrix<T, M, M>,
        bound: T,
        function: impl FnMut(&X) -> Z,
    ) -> Result<Gate<T, M>, UkfError> {
        let mut next = self.clone();
        let gate = Gate {
            innovation: next.update(measurement, measurement_noise, function)?,
            bound,
        };
        if gate.accepted() {
            *self = next;
        }
        Ok(gate)
    }
}
