//! The errors of the crate.

/// What can go wrong in the building blocks.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RbpfError {
    /// A set, or a vector of weights, without any entry.
    #[error("a particle set needs at least one particle, 0 given")]
    NoParticles,
    /// Weights that cannot be normalised: some are NaN or +inf, or all are zero.
    #[error(
        "{particles} log weights cannot be normalised: {zero} are -inf, {nan} are NaN, \
         {infinite} are +inf; at least one finite and no NaN or +inf is required"
    )]
    DegenerateWeights {
        /// Number of weights.
        particles: usize,
        /// Weights of value zero, that is log weight -inf.
        zero: usize,
        /// Log weights that are NaN.
        nan: usize,
        /// Log weights that are +inf.
        infinite: usize,
    },
    /// Two vectors that must run over the same particles do not.
    #[error("{what}: {given} entries given, {required} required")]
    LengthMismatch {
        /// Which vector.
        what: &'static str,
        /// Entries given.
        given: usize,
        /// Entries required.
        required: usize,
    },
    /// An ancestor index beyond the set.
    #[error("ancestor {ancestor} of slot {slot} is outside the set of {particles} particles")]
    UnknownAncestor {
        /// The slot it was given for.
        slot: usize,
        /// The index given.
        ancestor: usize,
        /// Particles in the set.
        particles: usize,
    },
    /// The resampling threshold is not a fraction.
    #[error("resampling threshold {value} given, a fraction of the particles in [0, 1] required")]
    InvalidThreshold {
        /// The fraction given.
        value: f64,
    },
    /// A setting out of range; `what` names it and its range.
    #[error("{what}: {value} given")]
    InvalidSetting {
        /// The setting and its range.
        what: &'static str,
        /// The value given.
        value: f64,
    },
    /// A covariance that must be positive definite is not.
    #[error(
        "{what}: pivot {pivot} of the Cholesky factorisation is {value}, a positive number required"
    )]
    NotPositiveDefinite {
        /// Which covariance.
        what: &'static str,
        /// Row of the failing pivot, from 0.
        pivot: usize,
        /// Value found there.
        value: f64,
    },
    /// A covariance that is not symmetric.
    #[error(
        "{what}: entries ({row}, {column}) and ({column}, {row}) differ by {difference}, 0 required"
    )]
    NotSymmetric {
        /// Which covariance.
        what: &'static str,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// One entry less the other.
        difference: f64,
    },
    /// Two measurements of one landmark in one frame.
    #[error("landmark {id} is measured {times} times in one frame, once at most allowed")]
    DuplicateId {
        /// The landmark.
        id: u32,
        /// Measurements of it.
        times: usize,
    },
    /// A measurement with NaN or infinity.
    #[error("entry {entry} of measurement {id} is {value}, a finite number required")]
    MeasurementNotFinite {
        /// Id of the landmark, or place in a scan without ids.
        id: u32,
        /// Which entry, from 0.
        entry: usize,
        /// Its value.
        value: f64,
    },
    /// A pose, landmark or matrix with NaN or infinite entries.
    #[error("{what} has entries that are not finite")]
    NotFinite {
        /// Which quantity.
        what: &'static str,
    },
}

/// Why a step of the filter failed; the particle set is then what it was before the step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepError<PE, RE, ME>
where
    PE: std::error::Error + 'static,
    RE: std::error::Error + 'static,
    ME: std::error::Error + 'static,
{
    /// The weights, the threshold or the set itself.
    #[error(transparent)]
    Filter(#[from] RbpfError),
    /// The proposal failed; the lowest failing particle is named.
    #[error("proposal of particle {particle}")]
    Proposal {
        /// Its slot.
        particle: usize,
        /// What the proposal reported.
        source: PE,
    },
    /// The rejuvenation failed.
    #[error("rejuvenation")]
    Rejuvenation {
        /// What the rejuvenation reported.
        source: RE,
    },
    /// The map update failed; the lowest failing particle is named.
    #[error("map update of particle {particle}")]
    MapUpdate {
        /// Its slot.
        particle: usize,
        /// What the map update reported.
        source: ME,
    },
}
