//! The errors of the crate.

use es_evolve::EvolveError;
use estimation_base::CholeskyError;

/// An input from which no pose can be proposed and no landmark updated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RangeBearingError {
    /// A matrix that must be a covariance and is not symmetric, not finite or not positive definite.
    #[error("{what}: {reason}")]
    Covariance {
        /// The name of the covariance.
        what: &'static str,
        /// The entry or the pivot that rules it out.
        reason: CholeskyError,
    },
    /// Several measurements of one landmark in one frame.
    #[error("landmark {id} is measured {times} times in one frame, once at most allowed")]
    DuplicateId {
        /// Id of the landmark.
        id: u32,
        /// Number of its measurements.
        times: usize,
    },
    /// A measurement with NaN or infinity.
    #[error("entry {entry} of measurement {id} is {value}, a finite number required")]
    MeasurementNotFinite {
        /// Id of the landmark, or place in a scan without ids.
        id: u32,
        /// Index of the entry, from 0.
        entry: usize,
        /// Its value.
        value: f64,
    },
    /// A pose, a landmark or the value of a function with NaN or infinite entries.
    #[error("{what} has entries that are not finite")]
    NotFinite {
        /// The name of the quantity.
        what: &'static str,
    },
}

/// The reason why poses could not be moved; they are then what they were.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MoveError {
    /// The models or a measurement give no target for a particle.
    #[error("target of particle {particle}")]
    Target {
        /// Slot of the particle.
        particle: usize,
        /// The reason.
        source: RangeBearingError,
    },
    /// A parameter out of range, or a target that is not a number.
    #[error(transparent)]
    Evolve(#[from] EvolveError),
}
