//! The double-sphere camera (Usenko, Demmel, Cremers, "The Double Sphere Camera Model", 3DV 2018): fisheyes beyond 180 degrees.
//!
//! A point is projected onto a unit sphere, from there onto a second one whose centre is xi further along the axis, and from there
//! by a pinhole that is shifted by alpha / (1 - alpha). With d1 = |p|, t = xi d1 + z and d2 = sqrt(x^2 + y^2 + t^2),
//!
//! ```text
//! u = fx x / (alpha d2 + (1 - alpha) t) + cx,   v likewise
//! ```
//!
//! and both directions have a closed form. A [`crate::Camera`] works on the image plane of a pinhole, which ends at 90 degrees
//! off the axis; this model works on rays, so it stands beside it and not behind a [`crate::Pinhole`]. What takes ideal
//! pixels (triangulation, epipolar geometry) can use the rays of its inner field as normalised points x / z.

use nalgebra::{Matrix2x3, Matrix2x6, RowVector3, Vector2, Vector3};

use crate::error::{GeometryError, checked};

/// A fisheye camera by the double-sphere model, whose parameters were checked.
///
/// ```
/// use mono_geometry::DoubleSphere;
/// use nalgebra::Vector3;
///
/// // The camera of the TUM visual-inertial data set, 195 degrees wide.
/// let camera = DoubleSphere::new(512, 512, [158.3, 158.3, 255.6, 256.9, -0.176, 0.593])?;
/// let behind = Vector3::new(2.0, 0.5, -0.1);
/// let pixel = camera.project(&behind).expect("in the field");
/// let ray = camera.unproject(&pixel)?;
/// assert!(ray.cross(&behind).norm() < 1e-12);
/// # Ok::<(), mono_geometry::GeometryError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubleSphere {
    width: usize,
    height: usize,
    parameters: [f64; 6],
}

impl DoubleSphere {
    /// Names of [`Self::parameters`], in their order.
    pub const PARAMETER_NAMES: [&'static str; 6] = ["fx", "fy", "cx", "cy", "xi", "alpha"];

    /// A camera from its image size in pixels and fx, fy, cx, cy (pixels), xi (distance of the centres of the spheres) and alpha.
    ///
    /// # Errors
    /// [`GeometryError::InvalidParameter`] naming the parameter: size zero, focal length not positive, xi not above -1 and at
    /// most 1, alpha outside 0 to 1, anything not finite.
    pub fn new(width: usize, height: usize, parameters: [f64; 6]) -> Result<Self, GeometryError> {
        let [fx, fy, cx, cy, xi, alpha] = parameters;
        checked("width (px)", width as f64, "above 0", |v| v > 0.0)?;
        checked("height (px)", height as f64, "above 0", |v| v > 0.0)?;
        checked("fx (px)", fx, "finite and above 0", |v| v > 0.0)?;
        checked("fy (px)", fy, "finite and above 0", |v| v > 0.0)?;
        checked("cx (px)", cx, "finite", |_| true)?;
        checked("cy (px)", cy, "finite", |_| true)?;
        checked("xi", xi, "above -1 and at most 1", |v| v > -1.0 && v <= 1.0)?;
        checked("alpha", alpha, "0 to 1", |v| (0.0..=1.0).contains(&v))?;
        Ok(Self {
            width,
            height,
            parameters,
        })
    }

    /// Image width, pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Image height, pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// fx, fy, cx, cy, xi, alpha.
    #[must_use]
    pub fn parameters(&self) -> [f64; 6] {
        self.parameters
    }

    /// Pixel of a point in camera axes (x right, y down, z forward), which may lie behind the image plane.
    ///
    /// `None` at the origin and where the model does not project: beyond its field, or where the pixel is not finite. The
    /// pixel may be outside the image. O(1).
    #[must_use]
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        let [fx, fy, cx, cy, ..] = self.parameters;
        let spheres = self.spheres(point_in_camera)?;
        let pixel = Vector2::new(
            fx * (point_in_camera.x / spheres.denominator) + cx,
            fy * (point_in_camera.y / spheres.denominator) + cy,
        );
        pixel.iter().all(|v| v.is_finite()).then_some(pixel)
    }

    /// [`Self::project`] with its derivatives by the point (2x3, pixels per metre) and by [`Self::parameters`] (2x6, pixels per
    /// unit of each); `None` also where they overflow. O(1).
    #[must_use]
    pub fn project_with_jacobians(
        &self,
        point_in_camera: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>, Matrix2x6<f64>)> {
        let [fx, fy, cx, cy, xi, alpha] = self.parameters;
        let Spheres {
            d1,
            t,
            d2,
            denominator,
        } = self.spheres(point_in_camera)?;
        let (x, y, z) = (point_in_camera.x, point_in_camera.y, point_in_camera.z);
        let (mx, my) = (x / denominator, y / denominator);
        let by_t = RowVector3::new(xi * x / d1, xi * y / d1, xi * z / d1 + 1.0);
        let by_d2 = (RowVector3::new(x, y, 0.0) + by_t * t) / d2;
        let by_denominator = by_d2 * alpha + by_t * (1.0 - alpha);
        let rows = [
            (RowVector3::new(1.0, 0.0, 0.0) - by_denominator * mx) * (fx / denominator),
            (RowVector3::new(0.0, 1.0, 0.0) - by_denominator * my) * (fy / denominator),
        ];
        let by_point = Matrix2x3::from_rows(&rows);
        // The denominator by xi and by alpha.
        let by_xi = (alpha * t / d2 + (1.0 - alpha)) * d1;
        let by_alpha = d2 - t;
        let by_parameters = Matrix2x6::new(
            mx,
            0.0,
            1.0,
            0.0,
            -fx * mx * by_xi / denominator,
            -fx * mx * by_alpha / denominator,
            0.0,
            my,
            0.0,
            1.0,
            -fy * my * by_xi / denominator,
            -fy * my * by_alpha / denominator,
        );
        let pixel = Vector2::new(fx * mx + cx, fy * my + cy);
        pixel
            .iter()
            .chain(by_point.iter())
            .chain(by_parameters.iter())
            .all(|v| v.is_finite())
            .then_some((pixel, by_point, by_parameters))
    }

    /// Unit ray in camera axes through a pixel: the inverse of [`Self::project`], in closed form. O(1).
    ///
    /// # Errors
    /// [`GeometryError::NoRay`] for a pixel that no ray meets, or that is not finite.
    pub fn unproject(&self, pixel: &Vector2<f64>) -> Result<Vector3<f64>, GeometryError> {
        let [fx, fy, cx, cy, xi, alpha] = self.parameters;
        let (mx, my) = ((pixel.x - cx) / fx, (pixel.y - cy) / fy);
        let square = mx * mx + my * my;
        let outside = || GeometryError::NoRay { x: mx, y: my };
        let under_root = 1.0 - (2.0 * alpha - 1.0) * square;
        // Also false for NaN.
        if !(under_root >= 0.0 && square.is_finite()) {
            return Err(outside());
        }
        let mz = (1.0 - alpha * alpha * square) / (alpha * under_root.sqrt() + 1.0 - alpha);
        let on_second = mz * mz + (1.0 - xi * xi) * square;
        if !(on_second >= 0.0 && mz.is_finite()) {
            return Err(outside());
        }
        let scale = (mz * xi + on_second.sqrt()) / (mz * mz + square);
        let ray = Vector3::new(scale * mx, scale * my, scale * mz - xi);
        // The closed form gives a unit vector up to rounding.
        let length = ray.norm();
        if !(length > 0.5 && self.in_field(&ray, length)) {
            return Err(outside());
        }
        Ok(ray / length)
    }

    /// Greatest angle off the axis that is projected, radians.
    #[must_use]
    pub fn field_angle(&self) -> f64 {
        self.least_cosine().clamp(-1.0, 1.0).acos()
    }

    /// The cosine of the angle off the axis at which the field ends.
    fn least_cosine(&self) -> f64 {
        let [.., xi, alpha] = self.parameters;
        let w1 = if alpha <= 0.5 {
            alpha / (1.0 - alpha)
        } else {
            (1.0 - alpha) / alpha
        };
        -(w1 + xi) / (2.0 * w1 * xi + xi * xi + 1.0).sqrt()
    }

    fn in_field(&self, point: &Vector3<f64>, length: f64) -> bool {
        // A pixel on the rim comes back to the rim up to rounding.
        point.z > (self.least_cosine() - 1e-12) * length
    }

    fn spheres(&self, point: &Vector3<f64>) -> Option<Spheres> {
        let [.., xi, alpha] = self.parameters;
        let d1 = point.norm();
        let t = xi * d1 + point.z;
        let d2 = (point.x * point.x + point.y * point.y + t * t).sqrt();
        let denominator = alpha * d2 + (1.0 - alpha) * t;
        let valid = d1 > 0.0 && d1.is_finite() && self.in_field(point, d1);
        (valid && denominator > 0.0 && d2 > 0.0).then_some(Spheres {
            d1,
            t,
            d2,
            denominator,
        })
    }
}

/// The lengths of a projection.
struct Spheres {
    /// Distance of the point from the centre of the first sphere.
    d1: f64,
    /// Depth from the centre of the second.
    t: f64,
    /// Distance, on the first sphere's scale, from the centre of the second.
    d2: f64,
    denominator: f64,
}
