//! The errors of the crate.

use core::fmt;

use estimation_base::{ChiSquareError, CholeskyError};

/// The place in a prediction or an update where something failed.
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

/// Everything that can go wrong in a filter. A filter that returns an error has kept its state.
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
    /// A matrix that is no covariance: not positive (semi-)definite, not symmetric, or not finite.
    #[error("{step}, covariance: {reason}")]
    Covariance {
        /// Where it was met.
        step: Step,
        /// The entry or pivot at fault, with its value and the bound it missed.
        reason: CholeskyError,
    },
    /// A workspace or a matrix given as a slice that is too short or too long.
    #[error("{what} has {given} entries, {required} required")]
    Length {
        /// Name of the slice.
        what: &'static str,
        /// Number of its entries.
        given: usize,
        /// Number of entries required.
        required: usize,
    },
    /// NaN or infinity in a mean, a measurement or a function's value.
    #[error("{step}: {what} has entries that are not finite")]
    NotFinite {
        /// Where it was met.
        step: Step,
        /// Name of the quantity.
        what: &'static str,
    },
    /// No sample to judge by.
    #[error("0 values given, at least 1 required")]
    NoValues,
    /// A probability or a number of degrees of freedom for which there is no bound.
    #[error(transparent)]
    ChiSquare(#[from] ChiSquareError),
}
