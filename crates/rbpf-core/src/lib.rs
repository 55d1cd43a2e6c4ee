#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`ParticleFilter`] owns a [`ParticleSet`] and runs a frame; [`Proposal`] is the trait that a model implements,
//! [`Rejuvenation`] and [`MapUpdate`] are its optional companions. [`CowMap`] and [`PersistentPath`] are shared by copies.
//! [`Streams`] gives every particle a random generator of its own, [`Resampler`] and [`KldSampling`] choose the ancestors and
//! their number, and [`Genealogy`] tells how far back all paths are one.
//!
//! Results do not depend on the number of threads: random numbers are keyed by the particle, and every reduction runs in
//! particle order. Weights are logarithms throughout, so a frame with a hundred measurements does not underflow; they sum to
//! one for log increments of any finite size.

mod bearing_landmark;
mod diagnostics;
mod error;
mod filter;
mod history;
mod kld;
mod landmark_changes;
mod landmark_map;
mod log_weights;
mod memory;
mod parallel;
mod particle_set;
mod resampling;
mod slots;
mod step;
mod stored;
mod streams;

pub use bearing_landmark::{BearingLandmark, PlanarPoint};
pub use diagnostics::{Genealogy, unique_ancestors};
pub use error::{RbpfError, StepError};
pub use filter::{
    FilterConfig, ParticleCount, ParticleFilter, RejuvenationSchedule, StepReport, StepStage,
};
pub use history::PersistentPath;
pub use kld::KldSampling;
pub use landmark_map::{CowMap, MappedNodes, SharedLeaves};
pub use memory::SharedBytes;
pub use parallel::map_particles;
pub use particle_set::ParticleSet;
pub use rand;
pub use rand_chacha;
pub use resampling::Resampler;
pub use step::{
    MapUpdate, NoMapUpdate, NoRejuvenation, Proposal, Rejuvenation, RejuvenationReport,
};
pub use stored::{NodeTable, SharedNodes, StoredMap, StoredNodes};
pub use streams::{Purpose, Streams};
