//! Gaussian steps in the tangent, from lower-triangular factors L with covariance L L^T.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::EvolveError;

/// Lower-triangular factors of the step covariance. Entries above the diagonal are not read.
///
/// The factors must not depend on the genomes being moved, or moves stop being symmetric.
#[derive(Debug, Clone, Copy)]
pub enum StepFactors<'a, const D: usize> {
    /// The same factor for all slots.
    Common(&'a [[f64; D]; D]),
    /// One factor a slot.
    PerSlot(&'a [[[f64; D]; D]]),
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
                    let value = factor[row][column];
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
    pub(crate) fn apply(&self, slot: usize, scale: f64, normal: &[f64; D]) -> [f64; D] {
        let factor = match self {
            Self::Common(factor) => factor,
            Self::PerSlot(factors) => &factors[slot],
        };
        std::array::from_fn(|row| {
            let product: f64 = (0..=row)
                .map(|column| factor[row][column] * normal[column])
                .sum();
            scale * product
        })
    }
}

/// Independent standard normal components.
pub(crate) fn standard_normal<const D: usize>(rng: &mut impl Rng) -> [f64; D] {
    std::array::from_fn(|_| StandardNormal.sample(rng))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lower_triangle_alone_is_read() {
        let factor = [[2.0, f64::NAN], [3.0, 5.0]];
        let factors = StepFactors::Common(&factor);
        assert_eq!(factors.check(7), Ok(()));
        assert_eq!(factors.apply(6, 2.0, &[1.0, 10.0]), [4.0, 106.0]);
    }

    #[test]
    fn a_wrong_factor_is_named() {
        let factors = [[[1.0]], [[f64::INFINITY]]];
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
