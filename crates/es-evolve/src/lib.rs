//! Evolution strategies over a log-fitness: the paper's optimiser and a Metropolis-Hastings-correct mover.
//!
//! A population has one slot per genome, and fitness may depend on the slot. [`resample_move`] moves every
//! slot without changing the distribution its fitness describes; [`evolve_paper`] implements the published
//! operators, which climb the fitness and do not keep a distribution. Both ask the caller for their random numbers,
//! one generator for each (step, slot), so the populations do not depend on the number of threads.

mod error;
mod paper;
mod rates;
mod report;
mod resample_move;
mod slots;
mod space;
mod step;

pub use error::EvolveError;
pub use paper::{PaperParams, evolve_paper};
pub use rates::AdaptiveRates;
pub use report::{EvolutionReport, StopReason};
pub use resample_move::{MoveParams, resample_move};
pub use space::{LogFitness, Space};
pub use step::StepFactors;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
