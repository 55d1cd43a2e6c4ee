//! Bundle adjustment: poses and landmarks that explain pixels, measured motions and priors best.
//!
//! Problem: minimise over poses T_i (`world_from_body`, planar or spatial) and landmarks X_j
//!
//! > 1/2 sum rho(|(pi(T_i^-1 X_j) - z_ij) / sigma_ij|^2) + 1/2 sum |log(M^-1 T_f^-1 T_t)|^2_Sigma + 1/2 sum |log(M^-1 T_i)|^2_Sigma,
//!
//! the batch maximum a posteriori solution that no filter can beat on the same associations. pi is the pinhole behind
//! a known mount on the body, rho a [`RobustLoss`](crate::RobustLoss), M a measured motion or the mean of a prior.
//!
//! Steps: [`Problem`] describes it, [`adjust`] minimises by Levenberg-Marquardt with the landmarks eliminated (Schur
//! complement), [`covariance()`] gives marginal covariances of poses and landmarks. Derivation: page 10 of `docs/math`.
//!
//! The camera itself can be unknown too ([`Intrinsics`]): focal lengths, principal point and lens, each with a prior.
//!
//! Degenerate: see [`adjust`] for landmarks that are not fixed, [`covariance()`] for the gauge. Long chains of
//! poses are solved by the envelope of their reduced system (n b^2 operations an iteration for n poses with neighbourhoods of
//! b); one whose poses see all places again and again is dense, (D poses)^3 / 3 operations. The covariance is dense always.
//!
//! ```
//! use mono_geometry::bundle::{Options, PixelObservation, PlanarProblem, adjust};
//! use mono_geometry::{Mount, NoiseShape, Pinhole, Se2};
//! use nalgebra::Vector3;
//!
//! let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 320.0, cy: 240.0 };
//! let mount = Mount::forward();
//! let truth = [Se2::new(0.0, 0.0, 0.0), Se2::new(0.0, 0.3, 0.0), Se2::new(0.1, 0.6, 0.05)];
//! let mut problem = PlanarProblem::new(pinhole, mount.body_from_camera);
//! problem.poses = truth.to_vec();
//! problem.fixed_poses = vec![0, 1];
//! problem.poses[2] = Se2::new(0.0, 0.5, 0.0);
//! for (landmark, point) in [(3.0, 0.1, 0.2), (2.5, 0.8, -0.3), (4.0, -0.5, 0.1)].into_iter().enumerate() {
//!     let point = Vector3::new(point.0, point.1, point.2);
//!     for (pose, body) in truth.iter().enumerate() {
//!         let camera = mount.world_from_camera(body, 0.0, 0.0, 0.0).inverse();
//!         let pixel_ideal = pinhole.project(&camera.transform_point(&point)).expect("in front");
//!         problem.observations.push(PixelObservation { pose, landmark, pixel_ideal, sigma_px: 0.5, shape: NoiseShape::ROUND });
//!     }
//!     problem.landmarks.push(point + Vector3::new(0.3, -0.1, 0.05));
//! }
//! let adjusted = adjust(&problem, &Options::default())?;
//! assert!(adjusted.termination.converged());
//! assert!(truth[2].between(&adjusted.poses[2]).log().norm() < 1e-9);
//! # Ok::<(), mono_geometry::GeometryError>(())
//! ```

mod border;
#[cfg(test)]
mod camera_tests;
mod covariance;
mod intrinsics;
mod layout;
mod normal;
mod pose;
mod problem;
mod reduced;
mod schur;
mod solve;
#[cfg(test)]
mod tests;

pub use covariance::{Covariance, covariance};
pub use intrinsics::Intrinsics;
pub use pose::BundlePose;
pub use problem::{
    OdometryFactor, PixelObservation, PlanarProblem, PosePrior, Problem, SpatialProblem,
};
pub use solve::{Adjustment, Options, adjust};
