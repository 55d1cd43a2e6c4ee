//! Pose of a calibrated camera from points of known position: perspective-n-point.
//!
//! Problem: n world points X_i are seen at ideal pixels p_i with noise sigma_i. Find `world_from_camera` that minimises
//! sum rho(|p_i - project(camera_from_world X_i)|^2 / sigma_i^2), and its covariance.
//!
//! - [`p3p()`]: all poses that explain three points, exactly;
//! - [`refine_pose`]: the minimum next to a start, by damped Gauss-Newton, with covariance, from three points on;
//! - [`estimate_pose`]: the minimum from four or more points without a start and without wrong matches;
//! - [`estimate_pose_ransac`]: the same among wrong matches.
//!
//! Steps of [`estimate_pose`]: solve P3P on wide triangles of the image; rank all poses by the cost of all points; refine
//! the best few that differ; keep the lowest. The few matter for points on a plane, where a second local minimum, the
//! plane tilted the other way, may lie close to the first (Schweighofer and Pinz 2006).
//!
//! Degenerate: fewer than four points leave several exact poses; collinear points leave a turn free. Both are refused.
//! Four coplanar points seen from far away give two nearly equal minima: compare
//! [`PoseEstimate::chi_square`] with [`PoseFit::runner_up_chi_square`].

mod correspondence;
mod cubic;
mod estimate;
mod p3p;
mod refine;
mod robust;

pub use correspondence::{Correspondence, NoPose};
pub use estimate::{PoseFit, estimate_pose};
pub use p3p::{P3pSolutions, p3p};
pub use refine::{PoseEstimate, RefineOptions, refine_pose};
pub use robust::{PoseSolver, RobustPose, RobustPoseOptions, estimate_pose_ransac};
