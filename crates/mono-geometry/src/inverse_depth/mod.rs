//! A point as a direction and an inverse depth from the camera that first saw it.
//!
//! Civera, Davison and Montiel (2008) keep a point as the ray of its first sighting and the inverse rho of its depth on
//! it. Along a ray, the pixel in a later view is nearly linear in rho even when rho may be zero, so a Gaussian describes
//! a point of unknown depth from its first sighting, and the epipolar constraint comes out of the filter itself. With a
//! known anchor pose (as a particle's own path is) three parameters are enough:
//!
//! > X = a + R (alpha, beta, 1)^T / rho,
//!
//! a and R the anchor's position and rotation in the world, (alpha, beta) the normalised image coordinates in the
//! anchor, rho the inverse of the *depth* along its optical axis, 1/m. A view at position c with rotation R_c sees
//! h = R_c^T (rho (a - c) + R (alpha, beta, 1)^T), a multiple of the point in its axes that stays finite at rho = 0.
//!
//! [`LandmarkGeometry`], [`Ray`] (seen from anywhere) and [`LandmarkView`] (seen from one camera) are what a filter needs
//! that keeps the three parameters and their covariance itself;
//! [`InverseDepthPoint`] is the point as a value. [`refine`] finds the three parameters and their covariance from n
//! views, at any parallax above zero; [`InverseDepthPoint::to_euclidean_if_linear`] turns them into a point once that is
//! harmless.
//!
//! Degenerate: for rho <= 0 (noise of a distant point) the formula goes on smoothly, at and past infinity; a Euclidean
//! point exists only for rho > 0. At the anchor itself rho has no effect on the pixel.

mod convert;
mod landmark;
mod pixel;
mod point;
mod refine;
mod turned;
mod view;

pub use convert::{CONVERSION_LINEARITY_INDEX, NotYet};
pub use landmark::{LandmarkGeometry, Ray, first_sighting, first_sighting_with_covariance};
pub use pixel::HORIZON;
pub use point::{InverseDepthPoint, Prediction};
pub use refine::{Refined, refine};
pub use turned::{turned_anchor, turned_camera};
pub use view::LandmarkView;
