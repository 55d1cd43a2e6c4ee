//! Cameras: from a point in camera axes (x right, y down, z forward, metres) to a pixel and back.
//!
//! Pixel (0, 0) is the centre of the top-left pixel, so the image covers [-0.5, width - 0.5] x [-0.5, height - 0.5].
//! A [`Camera`] is a [`Pinhole`] behind a lens ([`Distortion`]). Two kinds of pixel must not be mixed:
//!
//! - the *distorted* pixel, where a feature is found in the image: [`Camera::project`], [`Camera::undistort`];
//! - the *ideal* pixel, where the same ray would meet the image of the bare pinhole: [`Camera::undistort_pixel`],
//!   [`Pinhole::project`]. Filters, triangulation and epipolar geometry work in ideal pixels: the lens is taken out
//!   once per feature.
//!
//! Degenerate: points with z <= 0, and points beyond the fold of the lens model, have no pixel (`None`).

use nalgebra::{DVector, Matrix2x3, Matrix3, SMatrix, Vector2, Vector3};

use crate::distortion::{Distortion, MAX_LENS_PARAMETERS};
use crate::error::{GeometryError, checked};

/// fx, fy, cx, cy: the parameters of a camera that are not the lens's.
const PINHOLE_PARAMETERS: usize = 4;
/// Most parameters a camera has: 4 and the lens's.
pub(crate) const MAX_PARAMETERS: usize = PINHOLE_PARAMETERS + MAX_LENS_PARAMETERS;

/// Derivative of a pixel by [`Camera::parameters`]; columns beyond [`Camera::parameter_count`] are zero.
pub type ParameterJacobian = SMatrix<f64, 2, MAX_PARAMETERS>;

/// Ideal pinhole intrinsics; pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, x, pixels.
    pub cx: f64,
    /// Principal point, y, pixels.
    pub cy: f64,
}

impl Pinhole {
    /// Ideal pixel of a point in camera axes; `None` unless it is in front of the camera and its pixel finite. O(1).
    #[must_use]
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        normalize(point_in_camera)
            .map(|normalized| self.pixel(&normalized))
            .filter(|pixel| pixel.iter().all(|v| v.is_finite()))
    }

    /// [`Self::project`] with its derivative with respect to the point (2x3, pixels per metre); `None` also where
    /// that overflows.
    #[must_use]
    pub fn project_with_jacobian(
        &self,
        point_in_camera: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let normalized = normalize(point_in_camera)?;
        self.pixel_with_jacobian(
            &normalized,
            normalize_jacobian(&normalized, point_in_camera.z),
        )
    }

    /// The pixel of a point of the image plane and its derivative, given that of the point; `None` if they overflow.
    fn pixel_with_jacobian(
        &self,
        on_plane: &Vector2<f64>,
        mut jacobian: Matrix2x3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        jacobian.row_mut(0).scale_mut(self.fx);
        jacobian.row_mut(1).scale_mut(self.fy);
        let pixel = self.pixel(on_plane);
        pixel
            .iter()
            .chain(jacobian.iter())
            .all(|v| v.is_finite())
            .then_some((pixel, jacobian))
    }

    /// Ideal pixel of a normalised point (X/Z, Y/Z).
    #[must_use]
    pub fn pixel(&self, normalized: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(
            self.fx * normalized.x + self.cx,
            self.fy * normalized.y + self.cy,
        )
    }

    /// Normalised point (X/Z, Y/Z) of an ideal pixel.
    #[must_use]
    pub fn normalize(&self, pixel: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy)
    }

    /// K^-1: maps homogeneous ideal pixels to homogeneous normalised points.
    pub(crate) fn normalized_from_pixel(&self) -> Matrix3<f64> {
        Matrix3::new(
            1.0 / self.fx,
            0.0,
            -self.cx / self.fx,
            0.0,
            1.0 / self.fy,
            -self.cy / self.fy,
            0.0,
            0.0,
            1.0,
        )
    }

    /// Unit ray in camera axes through an ideal pixel.
    #[must_use]
    pub fn bearing(&self, pixel: &Vector2<f64>) -> Vector3<f64> {
        let normalized = self.normalize(pixel);
        Vector3::new(normalized.x, normalized.y, 1.0).normalize()
    }

    /// Whether a pixel is inside the image by at least `margin_px` (negative: outside by at most that much).
    ///
    /// The border is that of the outermost pixels' squares, half a pixel beyond their centres. False for NaN.
    #[must_use]
    pub fn contains(&self, pixel: &Vector2<f64>, margin_px: f64) -> bool {
        let low = margin_px - 0.5;
        pixel.x >= low
            && pixel.y >= low
            && pixel.x <= self.width as f64 - 1.0 - low
            && pixel.y <= self.height as f64 - 1.0 - low
    }

    fn check(&self) -> Result<(), GeometryError> {
        checked("width (px)", self.width as f64, "above 0", |v| v > 0.0)?;
        checked("height (px)", self.height as f64, "above 0", |v| v > 0.0)?;
        checked("fx (px)", self.fx, "finite and above 0", |v| v > 0.0)?;
        checked("fy (px)", self.fy, "finite and above 0", |v| v > 0.0)?;
        checked("cx (px)", self.cx, "finite", |_| true)?;
        checked("cy (px)", self.cy, "finite", |_| true)?;
        Ok(())
    }
}

/// A camera whose parameters were checked: a pinhole behind a lens.
///
/// Two kinds of pixel must not be mixed. A *distorted* pixel is where a feature is found in the image
/// ([`Self::project`], [`Self::undistort`]); an *ideal* pixel is where the same ray would meet the image of the bare
/// pinhole ([`Self::undistort_pixel`], [`Pinhole::project`]). Filters, triangulation and epipolar geometry work in ideal
/// pixels: the lens is taken out once per feature.
///
/// ```
/// use mono_geometry::nalgebra::{Vector2, Vector3};
/// use mono_geometry::{Camera, Distortion, Pinhole};
///
/// let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 319.5, cy: 239.5 };
/// let camera = Camera::new(pinhole, Distortion::Radtan { k1: -0.2, k2: 0.05, p1: 0.0, p2: 0.0, k3: 0.0 })?;
/// let point = Vector3::new(0.5, -0.2, 2.0);
/// let found = camera.project(&point).expect("in view");
/// let ideal = camera.undistort_pixel(&found)?;
/// assert!((ideal - pinhole.project(&point).expect("in front")).norm() < 1e-9);
/// assert!((found - ideal).norm() > 1.0);
/// assert_eq!(camera.project(&Vector3::new(0.0, 0.0, -1.0)), None::<Vector2<f64>>);
/// # Ok::<(), mono_geometry::GeometryError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    pinhole: Pinhole,
    distortion: Distortion,
    field_radius: f64,
}

impl Camera {
    /// Checks the parameters and finds the invertible field of the lens.
    ///
    /// # Errors
    /// [`GeometryError::InvalidParameter`] naming the parameter: size zero, focal length not positive, anything not
    /// finite.
    pub fn new(pinhole: Pinhole, distortion: Distortion) -> Result<Self, GeometryError> {
        pinhole.check()?;
        distortion.check()?;
        Ok(Self {
            pinhole,
            distortion,
            field_radius: distortion.field_radius(),
        })
    }

    /// The intrinsics, and the camera for ideal pixels.
    #[must_use]
    pub fn pinhole(&self) -> &Pinhole {
        &self.pinhole
    }

    /// The lens model.
    #[must_use]
    pub fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// Distorted pixel of a point in camera axes.
    ///
    /// `None` behind the camera (z <= 0), beyond the fold of the lens model, or if the pixel is not finite. The pixel
    /// may be outside the image: see [`Self::contains`]. O(1).
    #[must_use]
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        normalize(point_in_camera)
            .filter(|normalized| self.sees(normalized))
            .map(|normalized| self.distort(&normalized))
            .filter(|pixel| pixel.iter().all(|v| v.is_finite()))
    }

    /// [`Self::project`] with its derivative with respect to the point (2x3, pixels per metre); `None` also where
    /// that overflows.
    #[must_use]
    pub fn project_with_jacobian(
        &self,
        point_in_camera: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let normalized = normalize(point_in_camera)?;
        if !self.sees(&normalized) {
            return None;
        }
        let (distorted, lens) = self.distortion.distort_with_jacobian(&normalized);
        let jacobian = lens * normalize_jacobian(&normalized, point_in_camera.z);
        self.pinhole.pixel_with_jacobian(&distorted, jacobian)
    }

    /// [`Self::project`] with its derivatives with respect to the point (2x3, pixels per metre) and to
    /// [`Self::parameters`] (2x12, pixels per unit of each; columns beyond [`Self::parameter_count`] are zero). O(1),
    /// no allocation.
    #[must_use]
    pub fn project_with_jacobians(
        &self,
        point_in_camera: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>, ParameterJacobian)> {
        normalize(point_in_camera)
            .filter(|normalized| self.sees(normalized))
            .and_then(|_| self.project_unbounded_with_jacobians(point_in_camera))
    }

    /// [`Self::project`] by the formula of the lens alone, beyond its fold too: a cost that has no steps there, for searches in
    /// which the lens itself moves.
    #[cfg(feature = "bundle")]
    pub(crate) fn project_unbounded(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        normalize(point_in_camera)
            .map(|normalized| self.distort(&normalized))
            .filter(|pixel| pixel.iter().all(|v| v.is_finite()))
    }

    /// [`Self::project_with_jacobians`] likewise.
    pub(crate) fn project_unbounded_with_jacobians(
        &self,
        point_in_camera: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>, ParameterJacobian)> {
        let normalized = normalize(point_in_camera)?;
        // Not from the pixel: the principal point would cost digits.
        let (distorted, lens) = self.distortion.distort_with_jacobian(&normalized);
        let by_point = lens * normalize_jacobian(&normalized, point_in_camera.z);
        let (pixel, by_point) = self.pinhole.pixel_with_jacobian(&distorted, by_point)?;
        let mut by_parameters = ParameterJacobian::zeros();
        by_parameters[(0, 0)] = distorted.x;
        by_parameters[(1, 1)] = distorted.y;
        by_parameters[(0, 2)] = 1.0;
        by_parameters[(1, 3)] = 1.0;
        let lens = self.distortion.parameter_jacobian(&normalized);
        for column in 0..MAX_LENS_PARAMETERS {
            by_parameters[(0, PINHOLE_PARAMETERS + column)] = self.pinhole.fx * lens[(0, column)];
            by_parameters[(1, PINHOLE_PARAMETERS + column)] = self.pinhole.fy * lens[(1, column)];
        }
        by_parameters
            .iter()
            .all(|v| v.is_finite())
            .then_some((pixel, by_point, by_parameters))
    }

    /// fx, fy, cx, cy in pixels, then [`Distortion::parameters`].
    #[must_use]
    pub fn parameters(&self) -> DVector<f64> {
        let Pinhole { fx, fy, cx, cy, .. } = self.pinhole;
        DVector::from_iterator(
            self.parameter_count(),
            [fx, fy, cx, cy]
                .into_iter()
                .chain(self.distortion.parameters()),
        )
    }

    /// Number of [`Self::parameters`]: 4, 8, 9 or 12.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        PINHOLE_PARAMETERS + self.distortion.parameter_names().len()
    }

    /// Names of [`Self::parameters`], in their order.
    #[must_use]
    pub fn parameter_names(&self) -> Vec<&'static str> {
        [&["fx", "fy", "cx", "cy"], self.distortion.parameter_names()].concat()
    }

    /// The camera of the same image size and lens model with other parameters, in the order of [`Self::parameters`].
    ///
    /// # Errors
    /// [`GeometryError::Shape`] for another number of them, and as [`Self::new`].
    pub fn with_parameters(&self, parameters: &[f64]) -> Result<Self, GeometryError> {
        let (&[fx, fy, cx, cy], lens) =
            parameters.split_first_chunk().ok_or(GeometryError::Shape {
                rows: parameters.len(),
                columns: 1,
                required: "as many rows as the camera has parameters",
            })?;
        let pinhole = Pinhole {
            fx,
            fy,
            cx,
            cy,
            ..self.pinhole
        };
        Self::new(pinhole, self.distortion.with_parameters(lens)?)
    }

    /// Normalised radius (tangent of the angle off the axis) up to which the lens is invertible; see
    /// [`Distortion::field_radius`].
    #[must_use]
    pub fn field_radius(&self) -> f64 {
        self.field_radius
    }

    /// Unit ray in camera axes of a distorted pixel: the inverse of [`Self::project`].
    ///
    /// # Errors
    /// As [`Self::undistort`].
    pub fn unproject(&self, pixel: &Vector2<f64>) -> Result<Vector3<f64>, GeometryError> {
        let normalized = self.undistort(pixel)?;
        Ok(Vector3::new(normalized.x, normalized.y, 1.0).normalize())
    }

    /// Distorted pixel of a normalised, undistorted point.
    #[must_use]
    pub fn distort(&self, normalized: &Vector2<f64>) -> Vector2<f64> {
        self.pinhole.pixel(&self.distortion.distort(normalized))
    }

    /// Normalised, undistorted point of a distorted pixel, by Newton's method to rounding.
    ///
    /// Distorting the answer gives the pixel back within 1e-10 px wherever it is accepted, for focal lengths up to
    /// 1000 px and |distorted point| up to 1; see [`Distortion::undistort`] for the bound and the conditioning near
    /// the fold. O(1).
    ///
    /// # Errors
    /// [`GeometryError::OutsideInvertibleField`] if the lens model maps no point inside its fold to this pixel.
    pub fn undistort(&self, pixel: &Vector2<f64>) -> Result<Vector2<f64>, GeometryError> {
        self.distortion
            .undistort_within(&self.pinhole.normalize(pixel), self.field_radius)
    }

    /// Ideal pixel of a distorted pixel.
    ///
    /// # Errors
    /// As [`Self::undistort`].
    pub fn undistort_pixel(&self, pixel: &Vector2<f64>) -> Result<Vector2<f64>, GeometryError> {
        Ok(self.pinhole.pixel(&self.undistort(pixel)?))
    }

    /// Distorted pixel of an ideal pixel.
    #[must_use]
    pub fn distort_pixel(&self, ideal_pixel: &Vector2<f64>) -> Vector2<f64> {
        self.distort(&self.pinhole.normalize(ideal_pixel))
    }

    /// Whether a (distorted) pixel is inside the image by at least `margin_px`; see [`Pinhole::contains`].
    #[must_use]
    pub fn contains(&self, pixel: &Vector2<f64>, margin_px: f64) -> bool {
        self.pinhole.contains(pixel, margin_px)
    }

    fn sees(&self, normalized: &Vector2<f64>) -> bool {
        normalized.norm() < self.field_radius
    }
}

/// (X/Z, Y/Z), `None` unless z > 0 and the quotient is finite.
fn normalize(point: &Vector3<f64>) -> Option<Vector2<f64>> {
    if point.z > 0.0 {
        let normalized = Vector2::new(point.x / point.z, point.y / point.z);
        normalized
            .iter()
            .all(|v| v.is_finite())
            .then_some(normalized)
    } else {
        None
    }
}

/// Derivative of (X/Z, Y/Z) with respect to the point.
fn normalize_jacobian(normalized: &Vector2<f64>, z: f64) -> Matrix2x3<f64> {
    let inverse = 1.0 / z;
    Matrix2x3::new(
        inverse,
        0.0,
        -normalized.x * inverse,
        0.0,
        inverse,
        -normalized.y * inverse,
    )
}
