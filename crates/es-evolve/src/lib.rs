//! Evolution strategies over a log-fitness: an optimiser, a sampler, and a published method that is neither.
//!
//! - [`optimise`] finds the genome of greatest fitness: (mu/mu_I, lambda) evolution strategy, self-adapted step sizes;
//!   [`optimise_restarting`] does so again and again with growing populations.
//! - [`resample_move`] moves a population without changing the distributions its fitness describes: Metropolis-Hastings
//!   mutation and differential crossover.
//! - [`evolve_paper`] implements published operators that climb the fitness and do not keep a distribution.
//!
//! Genomes are what a [`Space`] can move by tangent vectors: numbers, vectors ([`Euclidean`]), angles, poses. All ask the
//! caller for their random numbers, one generator for each (step, slot), so the results do not depend on the number of
//! threads. After an error the population is what it was.

mod adaptation;
mod error;
mod optimise;
mod paper;
mod params;
mod rates;
mod report;
mod resample_move;
mod restarts;
mod slots;
mod step;

pub use adaptation::StepAdaptation;
pub use error::EvolveError;
pub use estimation_base::Manifold;
pub use optimise::{OptimiseParams, OptimiseStop, Optimum, optimise};
pub use paper::evolve_paper;
pub use params::{MoveParams, PaperParams};
pub use report::{EvolutionReport, StopReason};
pub use resample_move::resample_move;
pub use restarts::optimise_restarting;
pub use step::StepFactors;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
