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
//! [`LandmarkGeometry`] and [`Ray`] are what a filter needs that keeps the three parameters and their covariance itself;
//! [`InverseDepthPoint`] is the point as a value. [`refine`] finds the three parameters and their covariance from n
//! views, at any parallax above zero; [`InverseDepthPoint::to_euclidean_if_linear`] turns them into a point once that is
//! harmless.
//!
//! Degenerate: for rho <= 0 (noise of a distant point) the formula goes on smoothly, at and past infinity; a Euclidean
//! point exists only for rho > 0. At the anchor itself rho has no effect on the pixel.

mod convert;
mod landmark;
mod refine;

pub use convert::{CONVERSION_LINEARITY_INDEX, NotYet};
pub use landmark::{LandmarkGeometry, Ray, first_sighting};
pub use refine::{Refined, refine};

use nalgebra::{Matrix2x3, Matrix2x6, Vector2, Vector3};

use crate::camera::Pinhole;
use crate::placed_camera::PlacedCamera;
use crate::so3::hat;

/// A point anchored in a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseDepthPoint {
    /// The anchor camera.
    pub anchor: PlacedCamera,
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
    /// The point of (alpha, beta, rho) in an anchor camera.
    #[must_use]
    pub fn new(anchor: &PlacedCamera, parameters: &Vector3<f64>) -> Self {
        Self {
            anchor: *anchor,
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

    /// Ideal pixel in a view; `None` if the point is not in front of it or the pixel overflows. O(1).
    #[must_use]
    pub fn project(&self, pinhole: &Pinhole, camera: &PlacedCamera) -> Option<Vector2<f64>> {
        self.seen_from_anywhere()
            .project(pinhole, camera)
            .filter(|pixel| pixel.iter().all(|v| v.is_finite()))
    }

    /// [`Self::project`] with its derivatives; `None` also where these overflow. O(1).
    #[must_use]
    pub fn predict(&self, pinhole: &Pinhole, camera: &PlacedCamera) -> Option<Prediction> {
        let pixel_ideal = self.project(pinhole, camera)?;
        let by_parameters =
            self.geometry()
                .parameter_jacobian(pinhole, camera, &self.parameters())?;
        let in_camera = self.direction(camera);
        let by_direction = landmark::pixel_by_direction(pinhole, &in_camera);
        let mut by_camera = Matrix2x6::zeros();
        by_camera
            .fixed_columns_mut::<3>(0)
            .copy_from(&(by_direction * -self.rho));
        by_camera
            .fixed_columns_mut::<3>(3)
            .copy_from(&(by_direction * hat(&in_camera)));
        let mut derivatives = by_parameters.iter().chain(by_camera.iter());
        derivatives.all(|v| v.is_finite()).then_some(Prediction {
            pixel_ideal,
            by_parameters,
            by_camera,
        })
    }

    fn geometry(&self) -> LandmarkGeometry {
        LandmarkGeometry::InverseDepth {
            anchor: self.anchor,
        }
    }

    fn seen_from_anywhere(&self) -> Ray {
        self.geometry().ray(&self.parameters())
    }

    /// The ray in the anchor, of depth one.
    fn anchor_ray(&self) -> Vector3<f64> {
        Vector3::new(self.alpha, self.beta, 1.0)
    }

    /// rho times the point in the view's axes.
    fn direction(&self, camera: &PlacedCamera) -> Vector3<f64> {
        let ray = self.seen_from_anywhere();
        camera.rotate(&(ray.base + (ray.origin - camera.centre) * ray.rate))
    }
}
