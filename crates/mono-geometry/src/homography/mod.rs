//! Homographies: the map of one plane's image to another, from four points or from many.
//!
//! Problem: find the 3x3 matrix H, up to scale, with target ~ H source (homogeneous), for points of a plane (metres,
//! pixels or normalised coordinates) and their images. Four points in general position fix its 8 degrees of freedom.
//!
//! Four points ([`Homography::from_four_points`]): with the points as columns, A diag(a) and B diag(b) are the bases in
//! which the fourth point is (1, 1, 1); H = B diag(b / a) A^-1. No decomposition, no iteration.
//!
//! Many points: [`fit()`].
//!
//! Degenerate: two of the four points coincide or three are collinear, in either image; of many points, all but one
//! collinear. The first is `None`, the second an error with the rank found. Points collinear only up to noise pass:
//! their covariance tells.
//!
//! Source: Hartley and Zisserman (2004), algorithms 4.1 to 4.3, section 5.2; Sampson error section 4.2.6.

mod fit;
mod matrix;

pub(crate) use fit::rough;
pub use fit::{HomographyError, HomographyFit, fit};
pub use matrix::{Homography, keeps_orientation};
