#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`optimise`], [`optimise_vector`] and [`optimise_restarting`] return an [`Optimum`] (or [`VectorOptimum`]) with the reason why
//! they stopped; [`resample_move`] and [`evolve_paper`] count in an [`EvolutionReport`] what they proposed and accepted, and
//! [`StepFactors`] holds the shape of their steps.
//!
//! A fitness is a function of slot and genome that returns a natural logarithm. The evaluations of one phase run in parallel and
//! in no promised order, so the value must depend on the arguments alone.
//!
//! With derivatives at hand a Gauss-Newton or quasi-Newton method needs far fewer evaluations. The optimiser says nothing about
//! a posterior, and the sampler does not search for its maximum.

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
pub use nalgebra;
pub use optimise::{OptimiseParams, OptimiseStop, Optimum, optimise};
pub use paper::evolve_paper;
pub use params::{MoveParams, PaperParams};
pub use rand;
pub use report::{EvolutionReport, StopReason};
pub use resample_move::resample_move;
pub use restarts::optimise_restarting;
pub use step::StepFactors;
pub use vector::{VectorOptimum, optimise_vector};
