//! Integration tests of mono-geometry, one module a subject; `common` is what they share.

#[cfg(feature = "bundle")]
mod bundle;
#[cfg(feature = "bundle")]
mod bundle_input;
#[cfg(feature = "bundle")]
mod bundle_intrinsics;
mod calibration;
mod cameras;
mod common;
mod double_sphere;
mod epipolar;
mod groups;
mod homography;
mod inverse_depth;
mod jacobians;
mod lens_noise;
mod linalg;
mod motion;
mod opencv_calibration;
mod planar_motion;
mod plane_pose;
mod pnp;
mod ransac;
mod robustness;
mod structure_statistics;
mod triangulation;
mod two_view;
mod two_view_opencv;
mod two_view_solvers;
mod val_structure;
