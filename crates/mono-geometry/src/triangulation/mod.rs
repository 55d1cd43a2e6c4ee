//! A point from two or more views with known poses, its covariance, or the reason why not yet (Eq. 22-24).
//!
//! The paper stacks z_c [u v 1]^T = M [X 1]^T of two views and solves by least squares. It prints the same projection
//! matrix M for both; they differ by the pose, M_i = K camera_i_from_world. The linear error is algebraic, not in
//! pixels, so it only starts what decides:
//!
//! 1. the angle between the rays must reach the minimal parallax;
//! 2. start at the point nearest to all rays ([`midpoint`]), or, if that is behind a camera, at the linear solution
//!    ([`linear`]);
//! 3. Gauss-Newton on the reprojection error sum |pixel - project|^2 / sigma^2, damped where it would rise;
//! 4. covariance (sum J^T J / sigma^2)^-1 at the solution;
//! 5. the point must be in front of every camera, the parallax at the point above the minimum, and the remaining error
//!    below the chi-square quantile of 2 n - 3 degrees of freedom.
//!
//! Two views have a solution without Gauss-Newton in space: move both pixels by the least so that their rays meet
//! ([`correct_match`], [`triangulate_two_views`]).
//!
//! Degenerate: zero baseline or points far away give a parallax near zero and are refused with the value. The covariance
//! is Gaussian in Cartesian coordinates, which describes depth badly below about 2 degrees of parallax: use
//! [`crate::inverse_depth`] there.

mod accept;
mod observation;
mod refine;
mod several_views;
mod start;
mod two_view;

pub use observation::{Acceptance, Observation, Rejection, Triangulated};
pub(crate) use observation::{check, largest_angle};
pub use several_views::triangulate;
pub use start::{linear, midpoint};
pub use two_view::{Correction, NoCorrection, correct_match, triangulate_two_views};
