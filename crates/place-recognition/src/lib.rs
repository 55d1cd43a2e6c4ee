//! Where in a map was this image taken? From descriptors and geometry alone: no odometry, no earlier pose.
//!
//! A robot that is lost, that comes back to an old place, or that wakes up in a map made yesterday asks three questions,
//! and each is one call:
//!
//! 1. Which landmarks may these keypoints show? [`PlaceIndex::candidates`]: the nearest by descriptor, and where two are
//!    equally near, both.
//! 2. From where would they be seen like that? [`poses`]: every pose that enough of them agree on, with its covariance; two
//!    equal places give two answers.
//! 3. Without a map: do these two images show the same place? [`same_place`].
//!
//! ```
//! use mono_geometry::Pinhole;
//! use nalgebra::{Matrix3, Vector3};
//! use place_recognition::{CandidateOptions, PlaceIndex, PointMatch, PoseOptions, poses};
//!
//! // Forty landmarks, each with a descriptor of its own.
//! let point = |id: u32| {
//!     let k = f64::from(id);
//!     Vector3::new((k * 1.7).sin() * 2.0, (k * 2.9).sin() * 1.5, 5.0 + (k * 0.7).cos())
//! };
//! let descriptor = |id: u32| std::array::from_fn(|i| ((id as usize * 37 + 1) * (i + 3) * 71 % 251) as u8);
//! let mut index = PlaceIndex::new();
//! for id in 0..40 {
//!     index.insert(id, &descriptor(id))?;
//! }
//!
//! // A camera at the origin sees all of them.
//! let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 319.5, cy: 239.5 };
//! let pixels: Vec<_> = (0..40).map(|id| pinhole.project(&point(id)).expect("in front")).collect();
//! let descriptors: Vec<_> = (0..40).map(descriptor).collect();
//!
//! let candidates = index.candidates(&descriptors, &CandidateOptions::default())?;
//! let matches: Vec<PointMatch> = candidates
//!     .iter()
//!     .map(|c| PointMatch {
//!         keypoint: c.keypoint,
//!         landmark: c.landmark,
//!         point_in_world: point(c.landmark),
//!         point_covariance: Matrix3::identity() * 1e-4,
//!         seen_from: Vector3::zeros(),
//!         pixel_ideal: pixels[c.keypoint],
//!         sigma_px: 0.5,
//!         quality: c.quality,
//!     })
//!     .collect();
//! let places = poses(&pinhole, &matches, &PoseOptions::default())?;
//! assert_eq!(places.len(), 1);
//! assert!(places[0].world_from_camera.translation.norm() < 0.01);
//! # Ok::<(), place_recognition::PlaceError>(())
//! ```
//!
//! Use it where nothing is known about the pose. With a prediction of the pose a search in the landmarks in view is faster
//! and safer. It learns nothing: no vocabulary, no training.
//!
//! # Inside
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
pub use point_match::PointMatch;
pub use poses::{PlaceHypothesis, PoseOptions, poses, poses_where};
pub use same_place::{Evidence, SamePlaceOptions, View, same_place};

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
#[derive(Debug)]
pub struct ReadmeDoctests;
