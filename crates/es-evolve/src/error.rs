//! Errors of populations, parameters and fitness values.

use estimation_base::Readable;
use thiserror::Error;

/// Errors of this crate.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[non_exhaustive]
pub enum EvolveError {
    /// There is nothing to evolve.
    #[error("population must hold at least 1 genome, given 0")]
    EmptyPopulation,
    /// A log-fitness is NaN or plus infinity; minus infinity is allowed and means impossible.
    #[error("log-fitness of slot {slot} must be finite or minus infinity, given {}", Readable(*.value))]
    LogFitness {
        /// Slot whose fitness was asked for; the lowest one when several are wrong.
        slot: usize,
        /// The value given.
        value: f64,
    },
    /// A probability lies outside 0..=1.
    #[error("{name} must lie between 0 and 1, given {}", Readable(*.given))]
    Probability {
        /// Field of the parameters.
        name: &'static str,
        /// The value given.
        given: f64,
    },
    /// A scale is negative, NaN or infinite.
    #[error("{name} must be finite and at least 0, given {}", Readable(*.given))]
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
        "step factor of slot {slot} must be finite, given {} in row {row}, column {column}", Readable(*.value)
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
    /// The budget does not allow one look at every genome.
    #[error("at least {required} evaluations are required, {max_evaluations} allowed")]
    Budget {
        /// The budget.
        max_evaluations: usize,
        /// Evaluations needed before anything can be decided.
        required: usize,
    },
    /// Selection needs at least one parent and fewer parents than offspring.
    #[error(
        "at least 1 parent and fewer than the {offspring} offspring are required, given {parents}"
    )]
    Parents {
        /// Parents, mu.
        parents: usize,
        /// Offspring, lambda.
        offspring: usize,
    },
    /// A step size is zero, negative, NaN or infinite.
    #[error(
        "step size of coordinate {coordinate} must be finite and greater than 0, given {}", Readable(*.given)
    )]
    StepSize {
        /// The coordinate.
        coordinate: usize,
        /// The value given.
        given: f64,
    },
    /// Lists that must have one entry a coordinate do not.
    #[error("{given} {what} given, {required} required")]
    Dimension {
        /// The list.
        what: &'static str,
        /// Entries given.
        given: usize,
        /// Entries required.
        required: usize,
    },
    /// A lower bound is not below the upper one.
    #[error(
        "bounds of coordinate {coordinate} must leave room between them, given {} and {}",
        Readable(*.low),
        Readable(*.high)
    )]
    Bounds {
        /// The coordinate.
        coordinate: usize,
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// The log-fitness asked for is NaN.
    #[error("target log-fitness must not be NaN")]
    Target,
    /// All offspring of a generation are impossible: there is nothing to select.
    #[error(
        "log-fitness of all {offspring} offspring of generation {generation} is minus infinity"
    )]
    Impossible {
        /// The generation, from 0.
        generation: usize,
        /// Its offspring.
        offspring: usize,
    },
}

pub(crate) fn check_probability(name: &'static str, given: f64) -> Result<(), EvolveError> {
    if (0.0..=1.0).contains(&given) {
        Ok(())
    } else {
        Err(EvolveError::Probability { name, given })
    }
}

pub(crate) fn check_scale(name: &'static str, given: f64) -> Result<(), EvolveError> {
    if given.is_finite() && given >= 0.0 {
        Ok(())
    } else {
        Err(EvolveError::Scale { name, given })
    }
}
