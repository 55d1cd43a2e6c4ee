#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`absolute_error`] and [`relative_error`] compare two lists of [`StampedPose`]s under an [`Alignment`]. Poses are paired by the
//! nearest time, the estimate is aligned to the reference, and then
//!
//! - the absolute trajectory error compares pose by pose: `|t_ref - t_est|` and the angle of
//!   `R_ref^T R_est`, which for a planar path is the heading difference;
//! - the relative pose error compares the motion over `delta` frames: translation and angle of
//!   `(Q_i^-1 Q_j)^-1 (P_i^-1 P_j)`.

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
pub use nalgebra;
pub use pose::{StampedPose, spatial};
pub use relative::{RelativeError, relative_error, relative_error_of};
pub use statistics::Statistics;
