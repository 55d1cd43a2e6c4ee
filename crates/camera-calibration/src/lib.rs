#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`find_board`] finds the corners of one image, [`SearchedImage`] keeps an image after the search, [`calibrate_boards`]
//! makes a [`CalibrationRun`] of them by Zhang's method ([`mono_geometry::calibration`]). The crate reads no files and starts
//! no threads; `mono-slam calibrate` does both around it.

mod board;
mod calibrate;
mod detect;
mod image;
mod images;
mod warning;

pub use board::{BoardSize, FoundBoard, NotFound};
pub use calibrate::{CalibrateError, calibrate_boards};
pub use detect::find_board;
pub use image::GreyView;
pub use images::{CalibrationImage, CalibrationRun, CalibrationSettings, Outcome, SearchedImage};
pub use mono_geometry;
pub use warning::significant;
