//! SIFT keypoints and descriptors from a grey image.
//!
//! The method is that of D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV 60(2), 2004, one
//! stage per module, with sub-pixel positions that are exact with respect to the input image and results that do not
//! depend on the number of threads. Descriptors are laid out and quantised as OpenCV's, so both may be compared.
//!
//! ```
//! let pixels = vec![0_u8; 64 * 48];
//! let image = vision_sift::GrayImage::new(64, 48, &pixels)?;
//! let features = vision_sift::detect(&image)?;
//! assert_eq!(features.keypoints.len(), features.descriptors.len());
//! # Ok::<(), vision_sift::SiftError>(())
//! ```
//!
//! For a sequence of images make one [`Detector`] and reuse one [`Workspace`].
//!
//! Not for: colour (convert first), large changes of viewpoint (SIFT is invariant to similarities, tolerant of affine
//! maps up to some 40 degrees of tilt), or images of binary patterns, where corner detectors are faster.
//!
//! # Features
//! * `parallel` (default): pyramid, extrema, orientations and descriptors on the current rayon pool; same values.
//! * `image`: `TryFrom<&image::GrayImage>` for [`GrayImage`].

mod constants;
mod conventions;
mod params;
mod points;
mod simd;

mod image;

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

/// Compiles the README's code.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
#[derive(Debug)]
pub struct ReadmeDoctests;
