//! Single-camera geometry: cameras, SE(2)/SE(3), triangulation, inverse depth, epipolar constraints.
//!
//! Everything is `f64`. Transforms are named destination_from_source; body axes are x forward, y left, z up; camera
//! axes x right, y down, z forward; pixel (0, 0) is the centre of the top-left pixel. Angles are radians, lengths
//! metres. Nothing here prints, reads a clock or draws a random number, and no input makes it panic.

pub mod angle;
pub mod camera;
pub mod distortion;
pub mod error;
pub mod linalg;
pub mod mount;
pub mod se2;
pub mod se3;
mod series;
pub mod so3;

pub use camera::{Camera, Pinhole};
pub use distortion::Distortion;
pub use error::GeometryError;
pub use mount::Mount;
pub use se2::Se2;
pub use se3::Se3;
