#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`SceneSpec`] is the specification of a sequence, [`Scene`] its geometry, truth and images; [`BoardRenderer`] draws a
//! [`Board`] as a camera with any lens sees it. [`Scene::write`] and [`write_board_set`] put a whole sequence or set into a
//! folder, in the format that `mono-slam` reads. Each use of randomness has a stream of its own, keyed by seed, purpose and
//! index, so neither threads nor the order of work can change a pixel.

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
