//! The noise of a pixel, and what a lens makes of it.
//!
//! A feature is found in the image with the same error in both directions. The estimators work in ideal pixels, and taking the lens
//! out takes the error along: where the ideal picture is stretched, so is the noise. At the rim of a fisheye the radial stretch is
//! ten and more, and it is not the tangential one. With one sigma for all, pixels at the rim weigh a hundred times too much, right
//! matches there are refused, and covariances come out too small.
//!
//! A [`NoiseShape`] says how an error d in the ideal picture looks in the real one, from a measured pixel on, to second order:
//!
//! ```text
//! e = A d / (1 + c . d)
//! ```
//!
//! A is the derivative of the distortion. The stretch changes over the length of the error itself: without the second order an
//! error outwards would be taken for a larger one than the same error inwards, and an estimate leans to the centre of the picture.
//! c is along the radius and takes the second derivative of the lens along it; for an equidistant fisheye the form is
//! that of a picture taken by a camera turned to look at the pixel. Divided by the sigma of the real picture, e is standard normal.
//!
//! [`Camera::undistort_with_shape`] gives pixel and shape together; [`NoiseShape::ROUND`] is the shape without a lens.

use estimation_base::{CholeskyFactor, symmetric};
use nalgebra::{Matrix2, SMatrix, Vector2};

use crate::camera::Camera;
use crate::error::GeometryError;

/// How the noise of an ideal pixel is shaped, relative to its `sigma_px`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseShape {
    /// A and c; `None` for noise that is the same in every direction.
    bent: Option<(Matrix2<f64>, Vector2<f64>)>,
}

/// Least 1 + c . d: a prediction a quarter turn and more away, where only that it is wrong matters.
const LEAST_DIVISOR: f64 = 0.05;
/// A covariance this near to the unit matrix is round: a product of two 2x2 matrices and an inverse, in eps.
#[cfg(feature = "bundle")]
const ROUNDING: f64 = 1e-12;
/// Step of the second derivative of a lens, relative to 1 + radius: the cube root of eps.
const DERIVATIVE_STEP: f64 = 6e-6;

impl NoiseShape {
    /// The same in every direction: `sigma_px` is the standard deviation of each coordinate of the ideal pixel.
    pub const ROUND: Self = Self { bent: None };

    /// That of a covariance, pixels squared, for a `sigma_px` of 1: noise whose shape is known otherwise.
    ///
    /// # Errors
    /// [`GeometryError::NotPositiveDefinite`].
    pub fn from_covariance(covariance: &Matrix2<f64>) -> Result<Self, GeometryError> {
        let factor = CholeskyFactor::definite(covariance)?;
        Ok(Self {
            bent: Some((factor.whiten(&Matrix2::identity()), Vector2::zeros())),
        })
    }

    /// The covariance of the ideal pixel for noise of standard deviation `sigma_px`, pixels squared, to first order.
    #[must_use]
    pub fn covariance(&self, sigma_px: f64) -> Matrix2<f64> {
        let root = self.root(sigma_px);
        symmetric(&(root * root.transpose()))
    }

    /// The difference from the `predicted` to the `measured` ideal pixel in units of the noise: two standard normals.
    #[must_use]
    #[inline]
    pub fn residual(
        &self,
        measured: &Vector2<f64>,
        predicted: &Vector2<f64>,
        sigma_px: f64,
    ) -> Vector2<f64> {
        match &self.bent {
            None => (measured - predicted) / sigma_px,
            Some((map, skew)) => {
                let d = predicted - measured;
                map * d / (-divisor(skew, &d).0 * sigma_px)
            }
        }
    }

    /// [`Self::residual`], and the derivative of the prediction by C parameters brought to the same units. O(C).
    #[must_use]
    #[inline]
    pub fn whitened<const C: usize>(
        &self,
        measured: &Vector2<f64>,
        predicted: &Vector2<f64>,
        by_parameters: &SMatrix<f64, 2, C>,
        sigma_px: f64,
    ) -> (Vector2<f64>, SMatrix<f64, 2, C>) {
        match &self.bent {
            None => ((measured - predicted) / sigma_px, by_parameters / sigma_px),
            Some((map, skew)) => {
                let d = predicted - measured;
                let (divisor, slope) = divisor(skew, &d);
                let e = map * d / divisor;
                let by_pixel = (map - e * slope.transpose()) / (divisor * sigma_px);
                (-e / sigma_px, by_pixel * by_parameters)
            }
        }
    }

    /// The noise of a pixel y = f(x) to first order, this that of x; `by` is dy/dx. Round where it is round to rounding.
    #[cfg(feature = "bundle")]
    pub(crate) fn carried(&self, by: &Matrix2<f64>) -> Self {
        let Some(inverse) = by.try_inverse() else {
            return *self;
        };
        let map = match &self.bent {
            None => inverse,
            Some((map, _)) => map * inverse,
        };
        let off = (map.tr_mul(&map) - Matrix2::identity()).amax();
        Self {
            bent: (off > ROUNDING).then_some((map, Vector2::zeros())),
        }
    }

    /// A square root of [`Self::covariance`].
    pub(crate) fn root(&self, sigma_px: f64) -> Matrix2<f64> {
        match &self.bent {
            None => Matrix2::from_diagonal_element(sigma_px),
            Some((map, _)) => map
                .try_inverse()
                .map_or(Matrix2::from_element(f64::NAN), |inverse| {
                    inverse * sigma_px
                }),
        }
    }

    /// One over the geometric mean of the variances.
    pub(crate) fn weight(&self, sigma_px: f64) -> f64 {
        match &self.bent {
            None => sigma_px.powi(-2),
            Some((map, _)) => map.determinant().abs() / (sigma_px * sigma_px),
        }
    }
}

/// 1 + c . d and its derivative by d.
#[inline]
fn divisor(skew: &Vector2<f64>, d: &Vector2<f64>) -> (f64, Vector2<f64>) {
    let value = 1.0 + skew.dot(d);
    if value > LEAST_DIVISOR {
        (value, *skew)
    } else {
        (LEAST_DIVISOR, Vector2::zeros())
    }
}

impl Default for NoiseShape {
    fn default() -> Self {
        Self::ROUND
    }
}

impl Camera {
    /// Ideal pixel of a distorted pixel, and the shape of the noise it has when the distorted one has the same noise in every
    /// direction: what [`crate::pnp::Correspondence`], [`crate::triangulation::Observation`] and the bundle want beside the
    /// `sigma_px` of the distorted pixel. Without a lens the shape is [`NoiseShape::ROUND`]. O(1).
    ///
    /// # Errors
    /// As [`Camera::undistort`].
    pub fn undistort_with_shape(
        &self,
        pixel: &Vector2<f64>,
    ) -> Result<(Vector2<f64>, NoiseShape), GeometryError> {
        let normalized = self.undistort(pixel)?;
        let ideal = self.pinhole().pixel(&normalized);
        if *self.distortion() == crate::Distortion::None {
            return Ok((ideal, NoiseShape::ROUND));
        }
        let (fx, fy) = (self.pinhole().fx, self.pinhole().fy);
        let lens = |at: &Vector2<f64>| self.distortion().distort_with_jacobian(at).1;
        let jacobian = lens(&normalized);
        let map = Matrix2::new(
            jacobian[(0, 0)],
            jacobian[(0, 1)] * fx / fy,
            jacobian[(1, 0)] * fy / fx,
            jacobian[(1, 1)],
        );
        // -c along the radius u: half of the share by which the lens's slope along u changes per unit of u
        let radius = normalized.norm();
        let skew = normalized.try_normalize(0.0).map_or(Vector2::zeros(), |u| {
            let step = DERIVATIVE_STEP * (1.0 + radius);
            let change = (lens(&(normalized + u * step)) - lens(&(normalized - u * step))) * u
                / (2.0 * step);
            let share = jacobian
                .lu()
                .solve(&change)
                .map_or(0.0, |share| share.dot(&u));
            // d in normalised units is (dx / fx, dy / fy)
            u.component_div(&Vector2::new(fx, fy)) * (-0.5 * share)
        });
        Ok((
            ideal,
            NoiseShape {
                bent: Some((map, skew)),
            },
        ))
    }

    /// Ideal pixel of a distorted pixel and the covariance it has when the distorted one has `covariance` (2x2, pixels
    /// squared): J covariance J^T with J the derivative of the undistortion, to first order. O(1).
    ///
    /// # Errors
    /// As [`Camera::undistort`].
    pub fn undistort_with_covariance(
        &self,
        pixel: &Vector2<f64>,
        covariance: &Matrix2<f64>,
    ) -> Result<(Vector2<f64>, Matrix2<f64>), GeometryError> {
        let (ideal, shape) = self.undistort_with_shape(pixel)?;
        let stretch = shape.root(1.0);
        Ok((
            ideal,
            symmetric(&(stretch * covariance * stretch.transpose())),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Distortion, Pinhole};

    fn cameras() -> Vec<Camera> {
        let pinhole = Pinhole {
            width: 640,
            height: 480,
            fx: 300.0,
            fy: 310.0,
            cx: 320.0,
            cy: 240.0,
        };
        [
            Distortion::KannalaBrandt {
                k1: -0.01,
                k2: 0.005,
                k3: -0.002,
                k4: 0.0,
            },
            Distortion::Radtan {
                k1: -0.28,
                k2: 0.07,
                p1: 2e-4,
                p2: 2e-5,
                k3: 0.0,
            },
            Distortion::None,
        ]
        .map(|lens| Camera::new(pinhole, lens).expect("a lens"))
        .to_vec()
    }

    /// The residual of the ideal picture is that of the real one to second order: it falls with the cube of the difference.
    #[test]
    fn a_residual_is_that_of_the_real_picture() {
        for camera in cameras() {
            for (u, v) in [(40.0, 60.0), (320.5, 240.5), (500.0, 100.0)] {
                let raw = Vector2::new(u, v);
                let (ideal, shape) = camera.undistort_with_shape(&raw).expect("in the field");
                let outward = (ideal - Vector2::new(320.0, 240.0)).normalize();
                let error = |step: f64| {
                    // radially, where the lens bends most
                    let moved = camera
                        .undistort_pixel(&(raw + outward * step))
                        .expect("in the field");
                    let found = shape.residual(&ideal, &moved, 2.0);
                    (found + outward * step / 2.0).norm()
                };
                assert!(error(1.0) < 0.02, "{camera:?} {u} {v}: {}", error(1.0));
                // fourfold when the step doubles would be second order left over; an eighth of a share is tangential
                assert!(
                    error(4.0) < 0.05 * 4.0,
                    "{camera:?} {u} {v}: {}",
                    error(4.0)
                );
            }
        }
    }

    #[test]
    fn the_derivative_is_that_of_the_residual() {
        for camera in cameras() {
            let raw = Vector2::new(60.0, 90.0);
            let (ideal, shape) = camera.undistort_with_shape(&raw).expect("in the field");
            let at = ideal + Vector2::new(7.0, -3.0);
            let (residual, by_pixel) = shape.whitened(&ideal, &at, &Matrix2::identity(), 0.7);
            assert!((residual - shape.residual(&ideal, &at, 0.7)).norm() < 1e-12);
            for k in 0..2 {
                let mut step = Vector2::zeros();
                step[k] = 1e-4;
                let slope = (shape.residual(&ideal, &(at + step), 0.7)
                    - shape.residual(&ideal, &(at - step), 0.7))
                    / 2e-4;
                assert!(
                    (slope + by_pixel.column(k)).norm() < 1e-8,
                    "{slope} {by_pixel}"
                );
            }
        }
    }

    #[test]
    fn covariances_come_back() {
        let sigma = Matrix2::new(2.0, 0.3, 0.3, 0.5);
        let shape = NoiseShape::from_covariance(&sigma).expect("definite");
        assert!((shape.covariance(1.0) - sigma).amax() < 1e-15);
        let residual = shape.residual(&Vector2::new(1.0, 2.0), &Vector2::new(0.5, 2.5), 1.0);
        let d = Vector2::new(0.5, -0.5);
        let exact = d.dot(&sigma.lu().solve(&d).expect("definite"));
        assert!((residual.norm_squared() - exact).abs() < 1e-14);
        assert!(NoiseShape::from_covariance(&Matrix2::new(1.0, 2.0, 2.0, 1.0)).is_err());
        assert!((NoiseShape::ROUND.covariance(3.0) - Matrix2::identity() * 9.0).amax() < 1e-15);
        for camera in cameras() {
            let raw = Vector2::new(100.0, 50.0);
            let (ideal, covariance) = camera
                .undistort_with_covariance(&raw, &sigma)
                .expect("in the field");
            let step = |d: Vector2<f64>| camera.undistort_pixel(&(raw + d)).expect("in the field");
            let by = |d: Vector2<f64>| (step(d) - step(-d)) / 2e-3;
            let j =
                Matrix2::from_columns(&[by(Vector2::new(1e-3, 0.0)), by(Vector2::new(0.0, 1e-3))]);
            assert!((covariance - j * sigma * j.transpose()).amax() < 1e-5 * covariance.amax());
            assert!((ideal - camera.undistort_pixel(&raw).expect("in the field")).norm() == 0.0);
        }
    }
}
