//! SIFT keypoints and descriptors from a grey image.
//!
//! A keypoint is a small patch of a picture that is found again, with its position, scale and orientation, in another
//! picture of the same place; its descriptor, 128 bytes, tells it from others. The method is that of D. G. Lowe,
//! "Distinctive Image Features from Scale-Invariant Keypoints", IJCV 60(2), 2004. Positions are exact with respect to the
//! input image, and the features do not depend on the number of threads or on the vector instructions, bit for bit.
//!
//! ```
//! use vision_sift::{Detector, Features, GrayImage, SiftParams, Workspace};
//!
//! let detector = Detector::new(SiftParams::default())?;
//! let (mut workspace, mut features) = (Workspace::new(), Features::default());
//! let pixels = vec![0_u8; 64 * 48];
//! detector.detect(&GrayImage::new(64, 48, &pixels)?, &mut workspace, &mut features)?;
//! assert_eq!(features.keypoints.len(), features.descriptors.len());
//! # Ok::<(), vision_sift::SiftError>(())
//! ```
//!
//! Use it to match pictures of one place that differ in position, rotation, scale and brightness. It is not for colour
//! (convert first), for large changes of viewpoint (SIFT is invariant to similarities and tolerates affine maps up to some
//! 40 degrees of tilt), or for images of binary patterns, where corner detectors are faster.
//!
//! Three types to know:
//! * [`GrayImage`] borrows the pixels, with any row stride.
//! * [`Detector`] holds the parameters ([`SiftParams`]) and finds the features; with a [`Workspace`] that is used again it
//!   allocates nothing from the second image on. [`detect`] does all of it for a single image.
//! * [`Features`] holds the keypoints and their descriptors.
//!
//! # Features of the crate
//! * `parallel` (default): all stages run on the current rayon pool; the values are the same.
//! * `image`: `TryFrom<&image::GrayImage>` for [`GrayImage`].
//!
//! # Inside
//! Each stage is a module: `scale_space` (with `blur` and `kernel`), `extrema`, `refine`, `orientation` and `descriptor`
//! (with `gradient` and `samples`); `detector` runs them in order. The inner loops are written once over sixteen lanes,
//! `simd`.

mod constants;
mod conventions;
mod params;
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
mod error;
mod features;
mod strongest;
mod threads;
mod workspace;

pub use conventions::Conventions;
pub use detector::{Detector, Stage, detect};
pub use error::SiftError;
pub use features::{Features, Keypoint};
pub use image::GrayImage;
pub use params::{Normalisation, SiftParams};
pub use workspace::Workspace;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
#[derive(Debug)]
pub struct ReadmeDoctests;
