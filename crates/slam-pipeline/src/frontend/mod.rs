//! From keypoints to matched landmarks.
//!
//! [`catalogue`] is what all particles share of a landmark (identity,
//! descriptor, belief that it exists); [`association`] decides which keypoint
//! shows which landmark.

pub mod association;
pub mod catalogue;
pub mod frame;
