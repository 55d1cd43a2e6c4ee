#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`PlaceIndex`] with [`PlaceIndex::candidates`], then [`poses`], which returns [`PlaceHypothesis`]es; [`same_place`] compares
//! two [`View`]s without a map.
//!
//! ## Inside
//!
//! `point_match` is the input; `projection` scores a match under a pose, `refine` finds the pose of many, `regions` chooses
//! where to search, `spread` measures blobs, `poses` puts them together. Nothing here panics on input or draws a random
//! number that does not follow from a seed of the caller.

mod error;
mod index;
mod point_match;
mod poses;
mod projection;
mod refine;
mod regions;
mod same_place;
mod spread;

pub use error::PlaceError;
pub use index::{Candidate, CandidateOptions, PlaceIndex};
pub use mono_geometry;
pub use nalgebra;
pub use point_match::PointMatch;
pub use poses::{PlaceHypothesis, PoseOptions, poses, poses_where};
pub use same_place::{Evidence, SamePlaceOptions, View, same_place};
