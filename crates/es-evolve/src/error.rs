//! What can be wrong with a population, a parameter or a fitness value.

use thiserror::Error;

/// Errors of this crate.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[non_exhaustive]
pub enum EvolveError {
    /// There is nothing to evolve.
    #[error("population must hold at least 1 genome, given 0")]
    EmptyPopulation,
    /// A log-fitness is NaN or plus infinity; minus infinity is allowed and means impossible.
    #[error("log-fitness of slot {slot} must be finite or minus infinity, given {value}")]
    LogFitness {
        /// Slot whose fitness was asked for; the lowest one when several are wrong.
        slot: usize,
        /// The value given.
        value: f64,
    },
    /// A probability lies outside 0..=1.
    #[error("{name} must lie in 0..=1, given {given}")]
    Probability {
        /// Field of the parameters.
        name: &'static str,
        /// The value given.
        given: f64,
    },
    /// A scale is negative, NaN or infinite.
    #[error("{name} must be finite and at least 0, given {given}")]
    Scale {
        /// Field of the parameters.
        name: &'static str,
        /// The value given.
        given: f64,
    },
    /// One step factor for each slot was promised.
    #[error("one step factor for each of {required} slots is required, given {given}")]
    FactorCount {
        /// Number of factors given.
        given: usize,
        /// Size of the population.
        required: usize,
    },
    /// An entry of a step factor is NaN or infinite.
    #[error(
        "step factor of slot {slot} must be finite, given {value} in row {row}, column {column}"
    )]
    Factor {
        /// Slot of the factor; 0 for a common one.
        slot: usize,
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The value given.
        value: f64,
    },
}
