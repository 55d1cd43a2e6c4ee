//! The errors of the crate.

use estimation_base::Readable;

/// An input that the particle set, the resampling or the filter refuses.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RbpfError {
    /// A set, or a vector of weights, without any entry.
    #[error("a particle set needs at least one particle, 0 given")]
    NoParticles,
    /// Weights that cannot be normalised: some are NaN or +inf, or all are zero.
    #[error(
        "{particles} log weights cannot be normalised: {zero} are minus infinity, {nan} are NaN, \
         {infinite} are infinity; at least one finite and none of the last two is required"
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
        /// The name of the vector.
        what: &'static str,
        /// Entries given.
        given: usize,
        /// Entries required.
        required: usize,
    },
    /// An ancestor index beyond the set.
    #[error("ancestor {ancestor} of slot {slot} is outside the set of {particles} particles")]
    UnknownAncestor {
        /// The slot whose ancestor it should be.
        slot: usize,
        /// The index given.
        ancestor: usize,
        /// Particles in the set.
        particles: usize,
    },
    /// A stored particle set, map or genealogy that breaks the named rule.
    #[error("stored state: {0}")]
    Stored(&'static str),
    /// The resampling threshold is not a fraction.
    #[error(
        "resampling threshold {} given, a fraction of the particles from 0 to 1 required",
        Readable(*.value)
    )]
    InvalidThreshold {
        /// The fraction given.
        value: f64,
    },
    /// A setting out of range; `what` names it and its range.
    #[error(
        "{what}, {} given",
        Readable(*.value)
    )]
    InvalidSetting {
        /// The setting and its range.
        what: &'static str,
        /// The value given.
        value: f64,
    },
    /// A quantity with NaN or infinite entries.
    #[error("{what} has entries that are not finite")]
    NotFinite {
        /// The name of the quantity.
        what: &'static str,
    },
}

/// The stage of a step that failed, and its error. The particle set is then what it was before.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError<PE, RE, ME>
where
    PE: std::error::Error + 'static,
    RE: std::error::Error + 'static,
    ME: std::error::Error + 'static,
{
    /// The weights cannot be normalised, or the number of particles cannot be chosen.
    #[error(transparent)]
    Filter(#[from] RbpfError),
    /// The proposal failed; of several failing particles the first is named.
    #[error("proposal of particle {particle}")]
    Proposal {
        /// Slot of the particle.
        particle: usize,
        /// The error of the proposal.
        source: PE,
    },
    /// The rejuvenation failed.
    #[error("rejuvenation")]
    Rejuvenation {
        /// The error of the rejuvenation.
        source: RE,
    },
    /// The map update failed; of several failing particles the first is named.
    #[error("map update of particle {particle}")]
    MapUpdate {
        /// Slot of the particle.
        particle: usize,
        /// The error of the map update.
        source: ME,
    },
}
