//! Single-camera geometry: cameras, SE(2)/SE(3), triangulation, two views, pose from points, calibration, bundle adjustment.
//!
//! Everything is `f64`. Transforms are named destination_from_source; body axes are x forward, y left, z up; camera
//! axes x right, y down, z forward; pixel (0, 0) is the centre of the top-left pixel. Angles are radians, lengths
//! metres. Nothing here prints or reads a clock, only [`ransac`] draws random numbers, from a seed the caller gives, and no
//! input makes it panic.
//!
//! In reading order: [`Se2`], [`so3`], [`se3`] (motions); [`distortion`], [`camera`], [`mount`] (from the
//! world to a pixel); [`motion`] (odometry); [`triangulation`], [`inverse_depth`] (from pixels back to the world);
//! [`epipolar`], [`homography`] (two views of unknown motion); [`pnp`] (a pose from known points); [`ransac`] and
//! [`robust_loss`] (data of which some are wrong); [`calibration`] (the camera itself); [`bundle`] (everything at once);
//! [`linalg`] (the only singular value decompositions of the workspace).

#[cfg(feature = "bundle")]
pub mod bundle;
pub mod calibration;
pub mod camera;
pub mod distortion;
pub mod epipolar;
pub mod error;
pub mod homography;
pub mod inverse_depth;
mod least_squares;
pub mod linalg;
pub mod motion;
pub mod mount;
mod placed_camera;
pub mod pnp;
pub mod ransac;
pub mod robust_loss;
pub mod se3;
mod series;
pub mod so3;
mod structure;
pub mod triangulation;

pub use camera::{Camera, ParameterJacobian, Pinhole};
pub use distortion::Distortion;
pub use epipolar::EpipolarPair;
pub use error::GeometryError;
pub use estimation_base::Se2;
pub use homography::Homography;
pub use inverse_depth::InverseDepthPoint;
pub use least_squares::{Iteration, Termination};
pub use motion::{ControlNoise, Increment, OdometrySample};
pub use mount::Mount;
pub use placed_camera::PlacedCamera;
pub use robust_loss::RobustLoss;
pub use se3::Se3;
pub use triangulation::{Acceptance, Observation, Rejection, Triangulated, triangulate};

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
#[derive(Debug)]
pub struct ReadmeDoctests;
