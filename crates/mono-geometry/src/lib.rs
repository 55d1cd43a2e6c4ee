//! The geometry of one camera: lenses, rigid motions, triangulation, two views, pose from points, calibration and bundle
//! adjustment.
//!
//! **What it is.** A library of estimators for a single calibrated camera. Whatever is estimated comes with a covariance
//! and with the reason why the iteration stopped ([`Termination`]); whatever is refused comes with the value measured and
//! the value required. Everything is `f64` on `nalgebra`.
//!
//! **When to use it.** Use it to project and undistort through a lens, to chain odometry with its covariance, to find a
//! point from its sightings, the motion between two images, the pose of a camera among known points, the camera itself
//! from images of a board, or all poses and points at once.
//!
//! **When not to use it.** It does not detect features or read images, and it has no mirrors, lenses beyond 180 degrees,
//! rolling shutters or stereo rigs. Its bundle adjustment is dense in the poses: hundreds of them, not thousands.
//!
//! ```
//! use mono_geometry::triangulation::{Acceptance, Observation, triangulate};
//! use mono_geometry::{Mount, NoiseShape, Pinhole, Se2};
//! use nalgebra::Vector3;
//!
//! let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 320.0, cy: 240.0 };
//! let mount = Mount::forward();
//! let landmark = Vector3::new(4.0, 0.5, 0.2);
//! // Two bodies 0.4 m apart look along x at the landmark.
//! let sightings = [-0.2, 0.2].map(|y| {
//!     let camera_from_world = mount.world_from_camera(&Se2::new(0.0, y, 0.0), 0.0, 0.0, 0.0).inverse();
//!     let pixel_ideal = pinhole.project(&camera_from_world.transform_point(&landmark)).expect("in front");
//!     Observation { camera_from_world, pixel_ideal, sigma_px: 0.5, shape: NoiseShape::ROUND }
//! });
//! let found = triangulate(&pinhole, &sightings, &Acceptance::default())?;
//! assert!((found.point - landmark).norm() < 1e-9);
//! assert!(found.covariance[(0, 0)].sqrt() < 0.1);
//! # Ok::<(), mono_geometry::triangulation::Rejection>(())
//! ```
//!
//! **The three types to know.** [`Camera`] is a [`Pinhole`] behind a lens ([`Distortion`]) and maps points to pixels and
//! back. [`Se3`] is a pose in space ([`Se2`] one in the plane, [`Mount`] the camera's place on a body). An *ideal pixel*,
//! a plain `Vector2`, has the lens taken out: everything but [`Camera`] works in ideal pixels.
//!
//! In reading order: [`so3`] (rotations), [`motion`] (odometry), [`triangulation`] and [`inverse_depth`] (from pixels back
//! to the world), [`epipolar`] and [`homography`] (two views of unknown motion), [`pnp`] (a pose from known points),
//! [`ransac`] and [`RobustLoss`] (data of which some are wrong), [`calibration`] (the camera itself), `bundle` (all at
//! once, with the feature of that name), [`linalg`] (singular values that can be trusted).
//!
//! Transforms are named destination_from_source. Body axes are x forward, y left, z up; camera axes x right, y down,
//! z forward; pixel (0, 0) is the centre of the top-left pixel. Angles are radians, lengths metres. Nothing here prints or
//! reads a clock, only [`mod@ransac`] draws random numbers, from a seed that the caller gives, and no input makes it panic.

#[cfg(feature = "bundle")]
pub mod bundle;
pub mod calibration;
mod camera;
mod distortion;
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
pub use error::GeometryError;
pub use estimation_base::Se2;
pub use least_squares::{Iteration, Termination};
pub use mount::{Mount, tilted_body_axes, world_from_tilted_body};
pub use noise_shape::NoiseShape;
pub use placed_camera::PlacedCamera;
pub use robust_loss::{Loss, RobustLoss};
pub use se3::Se3;

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
#[derive(Debug)]
pub struct ReadmeDoctests;
