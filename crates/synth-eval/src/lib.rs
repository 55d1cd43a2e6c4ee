//! The study of the filters: dead reckoning and every method on the same keypoints, compared with the truth.
//!
//! Use it to see whether a change of the filter makes paths, maps and covariances better or worse, on rendered scenes
//! with exact truth and on recorded sequences with a reference, and to reproduce the figures of the paper. Rendered
//! scenes are kinder than real ones (see `wall-scenes`), so judge by both.
//!
//! ```no_run
//! use synth_eval::{Options, run};
//!
//! let options = Options { quick: true, seeds: Some((1, 1)), out: "out/one-wall".into(), ..Options::default() };
//! let outcome = run(&options, &|line| eprintln!("{line}"))?;
//! assert!(outcome.text.contains("dead reckoning"));
//! # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
//! ```
//!
//! [`Options`] say how much is compared, [`run`] compares, writes results and tables into a folder and returns the
//! tables, [`merge`] puts the results of several runs together, [`figures`] draws. The program `synth-eval` has the same
//! options as flags.

mod estimator;
mod figures;
mod jobs;
mod limit;
mod measures;
mod noise;
mod options;
mod plan;
mod points;
mod progress;
mod recording;
mod regression;
mod row;
mod scene_name;
mod sequence;
mod settings;
mod statistics;
mod study;
mod table;
mod trial;

pub use figures::figures;
pub use options::Options;
pub use scene_name::effects_help;
pub use study::{Outcome, merge, run};
