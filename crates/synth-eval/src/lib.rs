//! The evaluation on rendered walls: dead reckoning and the filters on the same images, compared with exact truth.
//!
//! Use it to see whether a change of the filter makes paths and maps better or worse, and to reproduce the figures of
//! the paper. Do not use it for accuracy on recorded data: rendered walls are kinder than real ones (see `wall-scenes`),
//! and `mono-slam eval` compares a run with any reference.
//!
//! ```no_run
//! use synth_eval::{Options, run};
//!
//! let options = Options { quick: true, seeds: Some(1), out: "out/one-wall".into() };
//! let table = run(&options, &|line| eprintln!("{line}"))?;
//! assert!(table.contains("dead reckoning"));
//! # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
//! ```
//!
//! [`Options`] say how much is compared, [`run`] compares, writes results, table and figures into a folder, and returns
//! the table. The program `synth-eval` has the same options as flags.

mod comparison;
mod estimator;
mod figures;
mod jobs;
mod measures;
mod recording;
mod statistics;
mod summary;
mod trial;

pub use comparison::{Options, run};
