#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`GrayImage`] borrows the pixels, [`Detector`] holds the parameters ([`SiftParams`]) and finds the [`Features`]; with a
//! [`Workspace`] that is used again it allocates nothing from the second image on. [`detect`] does all of it for a single image.
//! The method is that of D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV 60(2), 2004.
//!
//! ## Inside
//!
//! Each stage is a module: `scale_space` (with `blur` and `kernel`), `extrema`, `refine`, `orientation` and `descriptor`
//! (with `gradient` and `samples`); `detector` runs them in order. The inner loops are written once over sixteen lanes,
//! `simd`.

mod constants;
mod conventions;
mod params;
mod pixel;
mod points;

mod image;
mod simd;

mod blur;
mod kernel;
mod scale_space;

mod extrema;
mod refine;

mod gradient;
mod samples;

mod orientation;

mod descriptor;

mod detector;
#[cfg(feature = "image")]
mod draw;
mod error;
mod features;
mod strongest;
mod threads;
mod workspace;

pub use conventions::Conventions;
pub use detector::{Detector, Stage, detect};
#[cfg(feature = "image")]
pub use draw::draw_keypoints;
pub use error::SiftError;
pub use features::{Features, Keypoint};
pub use image::GrayImage;
pub use params::{Normalisation, Selection, SiftParams};
pub use pixel::{Pixel, grey_from_rgb};
pub use simd_level::SimdLevel;
pub use workspace::Workspace;
