//! Rendered images with exact truth: a synthetic laboratory for monocular SLAM, and checkerboards for calibration.
//!
//! Use it to test or compare what works on images, where a recording could not tell the truth to the last digit: the
//! pose of every frame, the 3-D point behind every pixel, the corners of every board. Do not use it to claim how a
//! method does on real images: there is no rolling shutter, motion blur and passers-by are there only when asked for, and
//! the walls have more texture than most.
//!
//! One [`SceneSpec`] fixes a sequence to the last bit. Each use of randomness has a stream of its own, keyed by seed,
//! purpose and index, so neither threads nor the order of work can change a pixel.
//!
//! ```
//! use wall_scenes::{Scene, SceneSpec};
//!
//! // The first experiment of the paper, shortened: a textured wall 2 m to the left of a straight path.
//! let scene = Scene::new(SceneSpec { frames: 3, ..SceneSpec::wall(7) })?;
//!
//! // The truth costs no rendering: the world point behind a pixel, and where the next frame sees it.
//! let point = scene.point_at(0, 160.0, 120.0).ok_or("nothing there")?;
//! assert!((point.y - 2.0).abs() < 0.5);
//! let [u, _] = scene.project(1, &point).ok_or("out of the image")?;
//! assert!(u < 160.0, "the wall moves to the left");
//!
//! // Images need the skins, which are painted once a scene.
//! let skins = scene.skins();
//! let image = scene.render(&skins, 0);
//! assert_eq!((image.width, image.height), (320, 240));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The three types to know are [`SceneSpec`], the specification of a sequence; [`Scene`], its geometry, its truth and
//! its images; and [`BoardRenderer`], which draws a [`Board`] as a camera with any lens sees it. [`Scene::write`] and
//! [`write_board_set`] put a whole sequence or set into a folder, in the format that `mono-slam` reads.
//!
//! World axes: x forward along the first heading, y left, z up; the origin is the first body pose, on the floor.
//! Camera axes: x right, y down, z forward; pixel (0, 0) is the centre of the top-left pixel.

mod board;
mod calibration;
mod camera;
mod carrier;
mod course;
mod error;
mod facet;
mod files;
mod folder;
mod furnish;
mod image;
mod layout;
mod mishaps;
mod odometry;
mod render;
mod scene;
mod screen;
mod skin;
mod spec;
mod stops;
mod stream;
mod timing;
mod trajectory;
mod walker;
mod world;

pub use board::{Board, BoardRenderer, BoardSetSpec, Look, Picture, board_poses, write_board_set};
pub use calibration::CalibrationError;
pub use carrier::Carrier;
pub use error::SceneError;
pub use image::GreyImage;
pub use mishaps::{FrameSpan, Kidnap, Mishaps};
pub use odometry::{OdometryNoise, OdometryRow};
pub use scene::Scene;
pub use skin::paint::Skins;
pub use spec::{SceneKind, SceneSpec};
pub use stops::{Stop, Stops};
pub use timing::{FRAME_PERIOD_S, FrameRate, ROWS_PER_FRAME};
pub use trajectory::TruePath;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
