//! The detector through its public interface: pictures whose keypoints are known, properties that hold for every
//! picture, and agreement with OpenCV.

#![expect(clippy::unwrap_used, reason = "a failed step fails the test")]

mod closed_forms;
mod inputs;
mod opencv_mode;
mod optional_data;
mod pictures;
mod properties;
mod validation;
