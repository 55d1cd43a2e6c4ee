//! Errors of an estimated trajectory against a reference, as the tool [evo] computes them.
//!
//! Use it to judge the output of any odometry or SLAM system: give it two lists of [`StampedPose`]
//! and say what may be removed before the comparison ([`Alignment`]). It does not read files, it
//! does not interpolate between poses, and it does not judge a covariance; for the latter see
//! `ukf::assess_consistency`.
//!
//! Both measures are those of Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems"
//! (IROS 2012). Poses are paired by the nearest time, the estimate is aligned to the reference,
//! and then
//!
//! - the absolute trajectory error compares pose by pose: `|t_ref - t_est|` and the angle of
//!   `R_ref^T R_est`, which for a planar path is the heading difference ([`absolute_error`]);
//! - the relative pose error compares the motion over `delta` frames: translation and angle of
//!   `(Q_i^-1 Q_j)^-1 (P_i^-1 P_j)` ([`relative_error`]).
//!
//! ```
//! use trajectory_eval::{Alignment, StampedPose, absolute_error};
//!
//! let path = |y: f64| -> Vec<StampedPose> {
//!     (0..10).map(|k| StampedPose::planar(0.1 * k as f64, k as f64, y, 0.0)).collect()
//! };
//! // The estimate runs 3 cm beside the reference.
//! let error = absolute_error(&path(0.03), &path(0.0), Alignment::None)?;
//! assert!((error.translation_m.rmse - 0.03).abs() < 1e-12);
//! // A planar alignment removes exactly that.
//! let error = absolute_error(&path(0.03), &path(0.0), Alignment::Se2)?;
//! assert!(error.translation_m.rmse < 1e-12);
//! # Ok::<(), trajectory_eval::EvaluationError>(())
//! ```
//!
//! Choose the alignment by what the estimate owes. A filter that starts in the first pose of the
//! reference is judged with [`Alignment::None`]: aligning hides a wrong first heading, and
//! [`Alignment::Sim3`] hides a wrong scale, which is the very thing a monocular method must prove. Where the first heading
//! of the reference itself is in doubt, [`Alignment::Heading`] frees it and nothing else.
//!
//! The three types to know are [`StampedPose`], [`Alignment`] and [`AbsoluteError`].
//!
//! [evo]: https://github.com/MichaelGrupp/evo

mod absolute;
mod align;
mod alignment;
mod associate;
mod error;
mod pose;
mod relative;
mod statistics;

pub use absolute::{AbsoluteError, MatchedError, absolute_error, absolute_error_of};
pub use alignment::{Alignment, Similarity};
pub use associate::{Matching, associate};
pub use error::EvaluationError;
pub use pose::{StampedPose, spatial};
pub use relative::{RelativeError, relative_error, relative_error_of};
pub use statistics::Statistics;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
