//! Camera calibration from photographs of a checkerboard: grey images in, a camera with the
//! standard deviation of every parameter out.
//!
//! [`find_board`] finds the inner corners of a checkerboard in one image, in board order and to a
//! few hundredths of a pixel. [`calibrate_boards`] makes a camera of the boards in several images
//! by Zhang's method ([`mono_geometry::calibration`]) and reports the outcome of every image.
//!
//! Use it for a pinhole camera with a radial-tangential, rational or Kannala-Brandt lens and a
//! printed checkerboard. Do not use it for circle grids or coded boards, for several cameras at
//! once, or for a camera whose shutter rolls while the board moves. The crate reads no files and
//! starts no threads; `mono-slam calibrate` does both around it.
//!
//! ```
//! use camera_calibration::{BoardSize, GreyView, NotFound, find_board};
//!
//! // A grey wall has no board on it, which is an ordinary outcome with its reason.
//! let pixels = vec![128; 320 * 240];
//! let wall = GreyView { width: 320, height: 240, pixels: &pixels };
//! let size: BoardSize = "9x6".parse()?;
//! assert_eq!(find_board(wall, size), Err(NotFound::NoCorners));
//! # Ok::<(), String>(())
//! ```
//!
//! The three types to know are [`FoundBoard`] (the corners of one image), [`SearchedImage`] (an
//! image after the search) and [`CalibrationRun`] (the camera, and the outcome of every image).

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
pub use warning::significant;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
