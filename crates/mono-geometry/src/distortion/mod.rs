//! Lens distortion on the normalised image plane (x = X/Z, y = Y/Z).
//!
//! Three models, in the parameter order of the common calibration tools:
//!
//! - *radial-tangential* (Brown 1966): with r^2 = x^2 + y^2 and g = 1 + k1 r^2 + k2 r^4 + k3 r^6,
//!   x' = g x + 2 p1 x y + p2 (r^2 + 2 x^2), y' = g y + p1 (r^2 + 2 y^2) + 2 p2 x y;
//! - *rational*: the same with g = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6);
//! - *Kannala-Brandt* (2006), for wide lenses: with theta = atan r,
//!   theta' = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), (x', y') = (theta' / r) (x, y).
//!
//! All are fitted inside the image. Outside it they may fold over: a point far off the axis is then mapped back *into*
//! the image. The radius at which that begins, the first zero of the radial derivative or the first pole, is the edge
//! of the invertible field ([`Distortion::field_radius`]); nothing beyond it is projected or undistorted. The inverse
//! is Newton's method, to rounding.
//!
//! Not for mirrors or lenses that see behind the camera: the normalised plane ends at 90 degrees.

mod invert;
mod jacobian;
mod kannala_brandt;
mod model;
mod radtan;
mod rational;
mod roots;

pub use jacobian::LensJacobian;
pub(crate) use jacobian::MAX_LENS_PARAMETERS;
pub use model::Distortion;
