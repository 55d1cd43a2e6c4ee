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
//! [`refine`] finds the three parameters and their covariance from n views, at any parallax above zero;
//! [`InverseDepthPoint::to_euclidean_if_linear`] turns them into a point once that is harmless.
//!
//! Degenerate: for rho <= 0 (noise of a distant point) the formula goes on smoothly, at and past infinity; a Euclidean
//! point exists only for rho > 0. At the anchor itself rho has no effect on the pixel.

mod convert;
mod refine;

pub use convert::{CONVERSION_LINEARITY_INDEX, NotYet};
pub use refine::{Refined, refine};

use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Vector2, Vector3};

use crate::camera::Pinhole;
use crate::se3::Se3;
use crate::so3::hat;

/// A point anchored in a camera pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseDepthPoint {
    /// Pose of the anchor camera in the world.
    pub world_from_anchor: Se3,
    /// Normalised x (X/Z) in the anchor.
    pub alpha: f64,
    /// Normalised y (Y/Z) in the anchor.
    pub beta: f64,
    /// Inverse depth in the anchor, 1/m.
    pub rho: f64,
}

/// A predicted pixel and how it changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Ideal pixel.
    pub pixel_ideal: Vector2<f64>,
    /// Derivative with respect to (alpha, beta, rho); pixels per unit.
    pub by_parameters: Matrix2x3<f64>,
    /// Derivative with respect to delta = (rho, omega) of world_from_camera * exp(delta), the camera's pose perturbed in
    /// its own axes; pixels per metre and per radian.
    pub by_camera: Matrix2x6<f64>,
}

impl InverseDepthPoint {
    /// A new point on the ray of an ideal pixel of the anchor camera.
    #[must_use]
    pub fn from_pixel(
        pinhole: &Pinhole,
        world_from_anchor: &Se3,
        pixel_ideal: &Vector2<f64>,
        rho: f64,
    ) -> Self {
        let normalized = pinhole.normalize(pixel_ideal);
        Self {
            world_from_anchor: *world_from_anchor,
            alpha: normalized.x,
            beta: normalized.y,
            rho,
        }
    }

    /// Covariance of (alpha, beta, rho) at the first sighting: pixel noise on the ray, a prior on the inverse depth.
    #[must_use]
    pub fn initial_covariance(pinhole: &Pinhole, sigma_px: f64, sigma_rho: f64) -> Matrix3<f64> {
        let x = sigma_px / pinhole.fx;
        let y = sigma_px / pinhole.fy;
        Matrix3::from_diagonal(&Vector3::new(x * x, y * y, sigma_rho * sigma_rho))
    }

    /// The same point with other (alpha, beta, rho).
    #[must_use]
    pub fn with_parameters(&self, parameters: &Vector3<f64>) -> Self {
        Self {
            world_from_anchor: self.world_from_anchor,
            alpha: parameters.x,
            beta: parameters.y,
            rho: parameters.z,
        }
    }

    /// (alpha, beta, rho).
    #[must_use]
    pub fn parameters(&self) -> Vector3<f64> {
        Vector3::new(self.alpha, self.beta, self.rho)
    }

    /// Ideal pixel in a view; `None` if the point is not in front of it. O(1).
    #[must_use]
    pub fn project(&self, pinhole: &Pinhole, world_from_camera: &Se3) -> Option<Vector2<f64>> {
        pinhole.project(&self.homogeneous(world_from_camera))
    }

    /// [`Self::project`] with its derivatives. O(1).
    #[must_use]
    pub fn predict(&self, pinhole: &Pinhole, world_from_camera: &Se3) -> Option<Prediction> {
        let direction = self.homogeneous(world_from_camera);
        let (pixel_ideal, by_direction) = pinhole.project_with_jacobian(&direction)?;
        let camera_from_world = world_from_camera.rotation.inverse();
        let camera_from_anchor = camera_from_world * self.world_from_anchor.rotation;
        let baseline = camera_from_world
            * (self.world_from_anchor.translation - world_from_camera.translation);
        let by_direction_of_parameters = Matrix3::from_columns(&[
            camera_from_anchor.matrix().column(0).into_owned(),
            camera_from_anchor.matrix().column(1).into_owned(),
            baseline,
        ]);
        let mut by_camera = Matrix2x6::zeros();
        by_camera
            .fixed_columns_mut::<3>(0)
            .copy_from(&(by_direction * -self.rho));
        by_camera
            .fixed_columns_mut::<3>(3)
            .copy_from(&(by_direction * hat(&direction)));
        Some(Prediction {
            pixel_ideal,
            by_parameters: by_direction * by_direction_of_parameters,
            by_camera,
        })
    }

    fn ray(&self) -> Vector3<f64> {
        Vector3::new(self.alpha, self.beta, 1.0)
    }

    /// rho times the point in the view's axes.
    fn homogeneous(&self, world_from_camera: &Se3) -> Vector3<f64> {
        let baseline = self.world_from_anchor.translation - world_from_camera.translation;
        world_from_camera.rotation.inverse()
            * (baseline * self.rho + self.world_from_anchor.rotation * self.ray())
    }
}
