//! The search for checkerboards under its former path.

pub use camera_calibration::{BoardSize, FoundBoard, NotFound, find_board};
