//! An inverse depth point as a value, and the pixel at which a view sees it.

use nalgebra::{Matrix2x3, Matrix2x6, Vector2, Vector3};

use super::landmark::{LandmarkGeometry, Ray};
use super::pixel::pixel_by_direction;
use crate::camera::Pinhole;
use crate::placed_camera::PlacedCamera;
use crate::so3::hat;

/// A point anchored in a camera.
///
/// ```
/// use mono_geometry::inverse_depth::InverseDepthPoint;
/// use mono_geometry::{Pinhole, PlacedCamera, Se3, so3};
/// use nalgebra::Vector3;
///
/// let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 320.0, cy: 240.0 };
/// let camera = |x: f64| PlacedCamera::new(&Se3::new(so3::exp(&Vector3::zeros()), Vector3::new(x, 0.0, 0.0)));
/// // On the axis of the first camera: two metres away, or at infinity.
/// let near = InverseDepthPoint::new(&camera(0.0), &Vector3::new(0.0, 0.0, 0.5));
/// let far = InverseDepthPoint { rho: 0.0, ..near };
/// let u = |point: &InverseDepthPoint| point.project(&pinhole, &camera(0.1)).expect("in front").x;
/// assert!((u(&near) - 300.0).abs() < 1e-9);
/// assert!((u(&far) - 320.0).abs() < 1e-9);
/// ```
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
        let by_direction = pixel_by_direction(pinhole, &in_camera);
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

    pub(super) fn geometry(&self) -> LandmarkGeometry {
        LandmarkGeometry::InverseDepth {
            anchor: self.anchor,
        }
    }

    fn seen_from_anywhere(&self) -> Ray {
        self.geometry().ray(&self.parameters())
    }

    /// The ray in the anchor, of depth one.
    pub(super) fn anchor_ray(&self) -> Vector3<f64> {
        Vector3::new(self.alpha, self.beta, 1.0)
    }

    /// rho times the point in the view's axes.
    pub(super) fn direction(&self, camera: &PlacedCamera) -> Vector3<f64> {
        let ray = self.seen_from_anywhere();
        camera.rotate(&(ray.base + (ray.origin - camera.centre) * ray.rate))
    }
}
