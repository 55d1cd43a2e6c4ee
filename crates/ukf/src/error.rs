//! The errors of the crate.

use core::fmt;

use estimation_base::{ChiSquareError, CholeskyError, Readable};

/// The place in a prediction or an update where something failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
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
    #[error("sigma points need L + lambda > 0 and finite, {} given", Readable(*.value))]
    InvalidSpread {
        /// L + lambda of the parameters given.
        value: f64,
    },
    /// A weight of the centre that leaves nothing for the simplex, or a state of dimension zero.
    #[error(
        "a simplex of {dimension} dimensions with centre weight {} given, at least 1 dimension and a weight from 0 to below 1 required",
        Readable(*.value)
    )]
    InvalidSimplex {
        /// Dimension of the state.
        dimension: usize,
        /// The weight given.
        value: f64,
    },
    /// A standard deviation that the state's space has no room for: a heading of half a turn and more.
    #[error(
        "the standard deviation along axis {axis} of the state is {}, at most {} can be spread on a circle; \
         a heading of which nothing is known has 1.81 rad",
        Readable(*.sigma),
        Readable(*.at_most)
    )]
    TooWide {
        /// The axis (column of the covariance's factor), from 0; 0 for a simplex.
        axis: usize,
        /// The standard deviation along it.
        sigma: f64,
        /// The largest with which the points can be drawn.
        at_most: f64,
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
