#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`Camera`] is a [`Pinhole`] behind a lens ([`Distortion`]); [`Se3`] is a pose in space, [`Se2`] one in the plane, [`Mount`] the
//! camera's place on a body. [`DoubleSphere`] is a fisheye beyond 180 degrees. In reading order: [`so3`] (rotations), [`motion`] (odometry), [`triangulation`] and
//! [`inverse_depth`] (from pixels back to the world), [`epipolar`] and [`homography`] (two views of unknown motion), [`pnp`] (a
//! pose from known points), [`ransac`] and [`RobustLoss`] (data of which some are wrong), [`calibration`] (the camera itself),
//! `bundle` (all at once, with the feature of that name), [`linalg`] (singular values that can be trusted).
//!
//! Angles are radians, lengths metres. Nothing here prints or reads a clock, only [`mod@ransac`] draws random numbers, from a
//! seed that the caller gives, and no input makes it panic.

#[cfg(feature = "bundle")]
pub mod bundle;
pub mod calibration;
mod camera;
mod distortion;
mod double_sphere;
pub mod epipolar;
mod error;
pub mod homography;
pub mod inverse_depth;
mod least_squares;
pub mod linalg;
pub mod motion;
mod mount;
mod noise_shape;
mod placed_camera;
pub mod pnp;
pub mod ransac;
mod robust_loss;
mod se3;
mod series;
pub mod so3;
mod structure;
pub mod triangulation;

pub use camera::{Camera, ParameterJacobian, Pinhole};
pub use distortion::{Distortion, LensJacobian};
pub use double_sphere::DoubleSphere;
pub use error::GeometryError;
pub use estimation_base::Se2;
pub use least_squares::{Iteration, Termination};
pub use mount::{Mount, tilted_body_axes, world_from_tilted_body};
pub use nalgebra;
pub use noise_shape::NoiseShape;
pub use placed_camera::PlacedCamera;
pub use robust_loss::{Loss, RobustLoss};
pub use se3::Se3;
