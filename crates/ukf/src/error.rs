//! The errors of the crate.

use core::fmt;

/// Where in a prediction or an update something failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Drawing sigma points from the covariance given.
    SigmaPoints,
    /// The function applied to the sigma points.
    Function,
    /// The predicted covariance, process noise included.
    Prediction,
    /// The innovation covariance, measurement noise included.
    Innovation,
    /// The covariance after the update.
    Posterior,
    /// Judging an error against a covariance.
    Consistency,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SigmaPoints => "sigma points",
            Self::Function => "function of the sigma points",
            Self::Prediction => "prediction",
            Self::Innovation => "innovation",
            Self::Posterior => "posterior",
            Self::Consistency => "consistency",
        })
    }
}

/// What can go wrong in a filter. A filter that returns an error has kept its state.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UkfError {
    /// Parameters for which the sigma points collapse or become imaginary.
    #[error("sigma points need L + lambda > 0 and finite, {value} given")]
    InvalidSpread {
        /// L + lambda of the parameters given.
        value: f64,
    },
    /// A weight of the centre that leaves nothing for the simplex, or a state of dimension zero.
    #[error(
        "a simplex of {dimension} dimensions with centre weight {value} given, at least 1 dimension and a weight in [0, 1) required"
    )]
    InvalidSimplex {
        /// Dimension of the state.
        dimension: usize,
        /// The weight given.
        value: f64,
    },
    /// A covariance that is not positive (semi-)definite.
    #[error("{step}: pivot {pivot} of the covariance is {value}, a positive number required")]
    NotPositiveDefinite {
        /// Where it was met.
        step: Step,
        /// Row of the failing pivot, from 0.
        pivot: usize,
        /// What was found there.
        value: f64,
    },
    /// A covariance whose two triangles differ by more than rounding.
    #[error(
        "{step}: entries ({row}, {column}) and ({column}, {row}) of the covariance differ by {difference}, a symmetric matrix required"
    )]
    NotSymmetric {
        /// Where it was met.
        step: Step,
        /// Row of the entry below the diagonal, from 0.
        row: usize,
        /// Its column.
        column: usize,
        /// Lower less upper entry.
        difference: f64,
    },
    /// A workspace or a matrix given as a slice that is too short or too long.
    #[error("{what} has {given} entries, {required} required")]
    Length {
        /// Which slice.
        what: &'static str,
        /// Its entries.
        given: usize,
        /// What was needed.
        required: usize,
    },
    /// NaN or infinity in a mean, a measurement, a noise matrix or a function's value.
    #[error("{step}: {what} has entries that are not finite")]
    NotFinite {
        /// Where it was met.
        step: Step,
        /// Which quantity.
        what: &'static str,
    },
    /// A probability outside (0, 1).
    #[error("probability {value} given, a number strictly between 0 and 1 required")]
    InvalidProbability {
        /// The number given.
        value: f64,
    },
    /// No degrees of freedom, or no sample, to judge by.
    #[error("{what}: 0 given, at least 1 required")]
    Empty {
        /// What there is none of.
        what: &'static str,
    },
}
