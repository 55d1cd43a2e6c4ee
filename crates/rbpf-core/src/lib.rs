//! A Rao-Blackwellized particle filter without its sensor.
//!
//! Each particle carries the part of the state that is sampled, such as the path of a robot, and the
//! part that has a closed form given the sampled one, such as a map of Gaussian landmarks. This
//! crate holds everything of such a filter that does not depend on the robot or on the sensor: the
//! weighted set, the order of a step, resampling, random numbers and the memory that particles share.
//!
//! # First example
//!
//! A number takes a random step of unit variance in every frame and is measured with unit variance.
//! Only the proposal belongs to the problem; nothing is mapped and nothing is rejuvenated.
//!
//! ```
//! use rand::RngExt;
//! use rand_chacha::ChaCha8Rng;
//! use rand_distr::StandardNormal;
//! use rbpf_core::{
//!     FilterConfig, NoMapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, Streams,
//! };
//! use std::convert::Infallible;
//!
//! struct RandomWalk;
//!
//! impl Proposal<f64, f64> for RandomWalk {
//!     type Error = Infallible;
//!
//!     fn propose(&self, x: &mut f64, z: &f64, rng: &mut ChaCha8Rng) -> Result<f64, Infallible> {
//!         *x += rng.sample::<f64, _>(StandardNormal);
//!         Ok(-0.5 * (z - *x).powi(2)) // log likelihood, up to a constant
//!     }
//! }
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let set = ParticleSet::new(vec![0.0; 500])?;
//! let mut filter = ParticleFilter::new(set, Streams::new(7), FilterConfig::default())?;
//! for (frame, z) in (0..).zip([0.5, 1.0, 2.0]) {
//!     filter.step(frame, &z, &RandomWalk, &NoRejuvenation, &NoMapUpdate)?;
//! }
//! let mean = filter.set().weighted_mean(|x| *x)?;
//! assert!((mean - 1.5).abs() < 0.2); // the Kalman filter says 1.5
//! # Ok(())
//! # }
//! ```
//!
//! # Three types to know
//!
//! - [`ParticleFilter`] owns the set and runs a frame: propose, weight, resample, rejuvenate, update
//!   the maps.
//! - [`Proposal`] is the trait that a model implements: it moves one particle and returns the
//!   logarithm of its importance weight. [`Rejuvenation`] and [`MapUpdate`] are its optional
//!   companions.
//! - [`CowMap`] is a map of landmarks that clones in O(1) and copies only the parts it writes;
//!   [`PersistentPath`] does the same for a path.
//!
//! [`Streams`] gives every particle a random generator of its own, [`Resampler`] and [`KldSampling`]
//! choose the ancestors and their number, and [`Genealogy`] tells how far back all paths are one.
//!
//! # When to use it, and when not
//!
//! Use it when the posterior has a part that must be sampled (a nonlinear path, an unknown
//! association) and a part that has a closed form given the samples. A state that is Gaussian as a
//! whole needs a Kalman filter instead. A step clones every particle in order to restore the set
//! after an error, so everything large in a particle belongs behind [`CowMap`],
//! [`PersistentPath`] or `Arc`.
//!
//! # Guarantees, and one that is not given
//!
//! Results do not depend on the number of threads: random numbers are keyed by the particle, and
//! every reduction runs in particle order. After an error the filter is what it was before the step.
//! Weights are logarithms throughout, so a frame with a hundred measurements does not underflow; they sum to one for
//! log increments of any finite size.
//!
//! The spread of the particles is **not** the covariance of an estimate. It lacks the covariances that the particles carry
//! in closed form (add their mean: the law of total variance), and it lacks the past: resampling leaves one path
//! before the common ancestor, so an error made there is in no particle any more. [`StepReport::common_ancestor_age`] tells
//! how old that path is. Carry the uncertainty of the past beside the set; the README shows a robot whose particles
//! are sure of a position that is off by the error of its first step.

mod diagnostics;
mod error;
mod filter;
mod history;
mod kld;
mod landmark_changes;
mod landmark_map;
mod log_weights;
mod parallel;
mod particle_set;
mod resampling;
mod step;
mod stored;
mod streams;

pub use diagnostics::{Genealogy, unique_ancestors};
pub use error::{RbpfError, StepError};
pub use filter::{
    FilterConfig, ParticleCount, ParticleFilter, RejuvenationSchedule, StepReport, StepStage,
};
pub use history::PersistentPath;
pub use kld::KldSampling;
pub use landmark_map::{CowMap, MappedNodes, SharedLeaves};
pub use parallel::map_particles;
pub use particle_set::ParticleSet;
pub use resampling::Resampler;
pub use step::{
    MapUpdate, NoMapUpdate, NoRejuvenation, Proposal, Rejuvenation, RejuvenationReport,
};
pub use stored::{NodeTable, SharedNodes, StoredMap, StoredNodes};
pub use streams::{Purpose, Streams};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct ReadmeDoctests;
