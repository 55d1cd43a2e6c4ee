//! Gaussian steps in the tangent, from lower-triangular factors L with covariance L L^T.

use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, OVector, RawStorage, SMatrix, SVector, SquareMatrix, U1};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::error::EvolveError;

/// Lower-triangular factors of the step covariance. Entries above the diagonal are not read.
///
/// The factors must not depend on the genomes being moved, or moves stop being symmetric.
#[derive(Debug, Clone, Copy)]
pub enum StepFactors<'a, const D: usize> {
    /// The same factor for all slots.
    Common(&'a SMatrix<f64, D, D>),
    /// One factor a slot.
    PerSlot(&'a [SMatrix<f64, D, D>]),
}

impl<const D: usize> StepFactors<'_, D> {
    pub(crate) fn check(&self, slots: usize) -> Result<(), EvolveError> {
        let factors = match self {
            Self::Common(factor) => std::slice::from_ref(*factor),
            Self::PerSlot(factors) if factors.len() == slots => factors,
            Self::PerSlot(factors) => {
                return Err(EvolveError::FactorCount {
                    given: factors.len(),
                    required: slots,
                });
            }
        };
        for (slot, factor) in factors.iter().enumerate() {
            for row in 0..D {
                for column in 0..=row {
                    let value = factor[(row, column)];
                    if !value.is_finite() {
                        return Err(EvolveError::Factor {
                            slot,
                            row,
                            column,
                            value,
                        });
                    }
                }
            }
        }
        Ok(())
    }

    /// `scale * L * normal` with the factor of the slot.
    pub(crate) fn apply(
        &self,
        slot: usize,
        scale: f64,
        normal: &SVector<f64, D>,
    ) -> SVector<f64, D> {
        let factor = match self {
            Self::Common(factor) => factor,
            Self::PerSlot(factors) => &factors[slot],
        };
        lower_times(factor, normal) * scale
    }
}

/// L z for the lower triangle of a matrix. The sum of each row begins at its first column; the results of seeded runs
/// depend on that order.
pub(crate) fn lower_times<D: Dim, N: Dim, S: RawStorage<f64, N, N>>(
    lower: &SquareMatrix<f64, N, S>,
    vector: &OVector<f64, D>,
) -> OVector<f64, D>
where
    DefaultAllocator: Allocator<D>,
{
    OVector::from_fn_generic(vector.shape_generic().0, U1, |row, _| {
        (0..=row)
            .map(|column| lower[(row, column)] * vector[column])
            .sum()
    })
}

/// Independent standard normal components.
pub(crate) fn standard_normal<const D: usize>(rng: &mut impl Rng) -> SVector<f64, D> {
    SVector::from_fn(|_, _| StandardNormal.sample(rng))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Vector2};

    #[test]
    fn the_lower_triangle_alone_is_read() {
        let factor = Matrix2::new(2.0, f64::NAN, 3.0, 5.0);
        let factors = StepFactors::Common(&factor);
        assert_eq!(factors.check(7), Ok(()));
        let step = factors.apply(6, 2.0, &Vector2::new(1.0, 10.0));
        assert_eq!(step, Vector2::new(4.0, 106.0));
    }

    #[test]
    fn a_wrong_factor_is_named() {
        let factors = [Matrix1::new(1.0), Matrix1::new(f64::INFINITY)];
        let error = StepFactors::PerSlot(&factors).check(2).unwrap_err();
        assert_eq!(
            error.to_string(),
            "step factor of slot 1 must be finite, given inf in row 0, column 0"
        );
        let error = StepFactors::PerSlot(&factors).check(3).unwrap_err();
        assert_eq!(
            error.to_string(),
            "one step factor for each of 3 slots is required, given 2"
        );
    }
}
