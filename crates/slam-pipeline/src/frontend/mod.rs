//! From keypoints to matched landmarks.
//!
//! Reading order: [`frame`] (the keypoints of a frame, undistorted), [`catalogue`] (the landmarks as all particles
//! share them), [`existence`] (the belief that a landmark is still there), [`frustum`] and [`view_index`] (which of them may
//! be in view), [`gate`], [`lens_noise`], [`prediction`], [`matching`], [`consensus`], [`missed`], and [`associate`], which runs them in this order.

pub(crate) mod associate;
pub(crate) mod association;
pub(crate) mod catalogue;
pub(crate) mod consensus;
pub(crate) mod existence;
pub(crate) mod frame;
pub(crate) mod frustum;
pub(crate) mod gate;
pub(crate) mod lens_noise;
#[cfg(test)]
mod lens_tests;
pub(crate) mod matching;
pub(crate) mod missed;
pub(crate) mod nearby;
pub(crate) mod prediction;
#[cfg(test)]
mod tests;
pub(crate) mod view_index;
