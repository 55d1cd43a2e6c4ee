//! Evolution strategies over a log-fitness: an optimiser, a sampler, and a published method that is neither.
//!
//! **What it is.** Three ways to change a population of genomes by mutation and crossover:
//! - [`optimise`] finds the genome of greatest fitness by an evolution strategy that adapts its steps (CMA-ES, or three
//!   self-adapted forms); [`optimise_vector`] does so for vectors whose dimension is known at run time, inside bounds;
//!   [`optimise_restarting`] repeats it with growing populations;
//! - [`resample_move`] moves a population without changing the distribution that its fitness describes, by
//!   Metropolis-Hastings mutation and differential crossover;
//! - [`evolve_paper`] implements published operators that climb the fitness and do not keep a distribution.
//!
//! Genomes are points of a [`Manifold`]: numbers, vectors, angles, poses, or a type of your own. A fitness is a function
//! of slot and genome that returns a natural logarithm. Minus infinity means impossible; NaN and plus infinity are errors
//! that name the slot. The evaluations of one phase run in parallel and in no promised order, so the value must depend on
//! the arguments alone. The caller gives one random generator for each (step, slot), and the results do not depend on the
//! number of threads. After an error the population is what it was.
//!
//! **When to use it.** Use the optimiser where there are no derivatives or many local optima, and the sampler to restore
//! the spread of a particle set after a resampling.
//!
//! **When not to use it.** With derivatives at hand a Gauss-Newton or quasi-Newton method needs far fewer evaluations. The
//! optimiser says nothing about a posterior, and the sampler does not search for its maximum.
//!
//! ```
//! use es_evolve::{OptimiseParams, OptimiseStop, optimise};
//! use nalgebra::Vector2;
//! use rand::SeedableRng;
//! use rand_chacha::ChaCha8Rng;
//!
//! # fn main() -> Result<(), es_evolve::EvolveError> {
//! let log_fitness = |_: usize, x: &Vector2<f64>| -(x - Vector2::new(1.0, -2.0)).norm_squared();
//! let streams = |generation: usize, offspring: usize| {
//!     let mut rng = ChaCha8Rng::seed_from_u64(7);
//!     rng.set_stream((generation as u64) << 32 | offspring as u64);
//!     rng
//! };
//! let params = OptimiseParams { target: -1e-10, ..OptimiseParams::for_dimension(2) };
//! let (start, step_sizes) = (Vector2::zeros(), Vector2::repeat(0.5));
//! let found = optimise(&start, &step_sizes, &log_fitness, &params, &streams)?;
//! assert!(matches!(found.stop, OptimiseStop::Target { .. }));
//! assert!((found.best - Vector2::new(1.0, -2.0)).norm() < 1e-4);
//! # Ok(())
//! # }
//! ```
//!
//! **The three types to know.** [`StepFactors`] holds the shape of the movers' steps. [`EvolutionReport`] counts what they
//! proposed and accepted. [`Optimum`] is the result of the optimiser, with the reason why it stopped.

mod adaptation;
mod bounds;
mod error;
mod optimise;
mod paper;
mod params;
mod paths;
mod rates;
mod report;
mod resample_move;
mod restarts;
mod slots;
mod step;
mod vector;

pub use adaptation::StepAdaptation;
pub use bounds::Bounds;
pub use error::EvolveError;
pub use estimation_base::Manifold;
pub use optimise::{OptimiseParams, OptimiseStop, Optimum, optimise};
pub use paper::evolve_paper;
pub use params::{MoveParams, PaperParams};
pub use report::{EvolutionReport, StopReason};
pub use resample_move::resample_move;
pub use restarts::optimise_restarting;
pub use step::StepFactors;
pub use vector::{VectorOptimum, optimise_vector};

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
