//! A lens distortion model: its coefficients and its maps.

use nalgebra::{Matrix2, Vector2};

use super::invert::Lens;
use super::jacobian::LensJacobian;
use super::rational::Ratio;
use super::{invert, kannala_brandt, radtan};
use crate::error::{GeometryError, checked};

/// A lens distortion model on the normalised image plane (x = X/Z, y = Y/Z); every finite coefficient is legal.
///
/// The parameters come in the order of the common calibration tools. Outside the image a fitted model may fold over, so
/// nothing beyond [`Self::field_radius`] is projected or undistorted. The normalised plane ends at 90 degrees off the
/// axis: mirrors and lenses that see behind the camera are out of reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distortion {
    /// An ideal pinhole.
    None,
    /// Radial-tangential polynomial (Brown), without unit.
    Radtan {
        /// Coefficient of r^2.
        k1: f64,
        /// Coefficient of r^4.
        k2: f64,
        /// First tangential coefficient.
        p1: f64,
        /// Second tangential coefficient.
        p2: f64,
        /// Coefficient of r^6.
        k3: f64,
    },
    /// Radial-tangential with a rational radial part, without unit.
    Rational {
        /// Coefficient of r^2 above.
        k1: f64,
        /// Coefficient of r^4 above.
        k2: f64,
        /// First tangential coefficient.
        p1: f64,
        /// Second tangential coefficient.
        p2: f64,
        /// Coefficient of r^6 above.
        k3: f64,
        /// Coefficient of r^2 below.
        k4: f64,
        /// Coefficient of r^4 below.
        k5: f64,
        /// Coefficient of r^6 below.
        k6: f64,
    },
    /// Equidistant fisheye polynomial (Kannala and Brandt), without unit.
    KannalaBrandt {
        /// Coefficient of theta^2.
        k1: f64,
        /// Coefficient of theta^4.
        k2: f64,
        /// Coefficient of theta^6.
        k3: f64,
        /// Coefficient of theta^8.
        k4: f64,
    },
}

impl Distortion {
    /// Maps an undistorted normalised point to the distorted one. O(1).
    #[must_use]
    pub fn distort(&self, point: &Vector2<f64>) -> Vector2<f64> {
        self.distort_with_jacobian(point).0
    }

    /// The distorted point and its derivative with respect to the undistorted one (2x2). O(1).
    #[must_use]
    pub fn distort_with_jacobian(&self, point: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let s = point.norm_squared();
        match self.form() {
            Form::None => (*point, Matrix2::identity()),
            Form::Polynomial { k, p } => {
                radtan::distort_with_jacobian(point, radtan::gain(k, s), p)
            }
            Form::Ratio { ratio, p } => radtan::distort_with_jacobian(point, ratio.gain(s), p),
            Form::Fisheye { k } => kannala_brandt::distort_with_jacobian(k, point),
        }
    }

    /// Derivative of the distorted point with respect to [`Self::parameters`] (2x8, unused columns zero). O(1).
    #[must_use]
    pub fn parameter_jacobian(&self, point: &Vector2<f64>) -> LensJacobian {
        match self.form() {
            Form::None => LensJacobian::zeros(),
            Form::Polynomial { .. } => radtan::parameter_jacobian(point),
            Form::Ratio { ratio, .. } => ratio.parameter_jacobian(point),
            Form::Fisheye { .. } => kannala_brandt::parameter_jacobian(point),
        }
    }

    /// The coefficients: none; k1 k2 p1 p2 k3; k1 k2 p1 p2 k3 k4 k5 k6; or k1 k2 k3 k4 (fisheye).
    #[must_use]
    pub fn parameters(&self) -> Vec<f64> {
        match *self {
            Self::None => Vec::new(),
            Self::Radtan { k1, k2, p1, p2, k3 } => vec![k1, k2, p1, p2, k3],
            Self::Rational {
                k1,
                k2,
                p1,
                p2,
                k3,
                k4,
                k5,
                k6,
            } => vec![k1, k2, p1, p2, k3, k4, k5, k6],
            Self::KannalaBrandt { k1, k2, k3, k4 } => vec![k1, k2, k3, k4],
        }
    }

    /// Names of [`Self::parameters`], in their order.
    #[must_use]
    pub fn parameter_names(&self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::Radtan { .. } => &["k1", "k2", "p1", "p2", "k3"],
            Self::Rational { .. } => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
            Self::KannalaBrandt { .. } => &["k1", "k2", "k3", "k4"],
        }
    }

    /// The same model with other coefficients, in the order of [`Self::parameters`].
    ///
    /// # Errors
    /// [`GeometryError::Shape`] for another number of them.
    pub fn with_parameters(&self, parameters: &[f64]) -> Result<Self, GeometryError> {
        match (self, parameters) {
            (Self::None, []) => Ok(Self::None),
            (Self::Radtan { .. }, &[k1, k2, p1, p2, k3]) => Ok(Self::Radtan { k1, k2, p1, p2, k3 }),
            (Self::Rational { .. }, &[k1, k2, p1, p2, k3, k4, k5, k6]) => Ok(Self::Rational {
                k1,
                k2,
                p1,
                p2,
                k3,
                k4,
                k5,
                k6,
            }),
            (Self::KannalaBrandt { .. }, &[k1, k2, k3, k4]) => {
                Ok(Self::KannalaBrandt { k1, k2, k3, k4 })
            }
            _ => Err(GeometryError::Shape {
                rows: parameters.len(),
                columns: 1,
                required: "as many rows as the lens model has parameters",
            }),
        }
    }

    /// Normalised radius up to which the radial part is monotone and finite; infinite if it is everywhere.
    ///
    /// For the fisheye model this is the tangent of the limiting angle. Found from the roots of the derivative's
    /// numerator (and, for the rational model, of the denominator), O(1).
    #[must_use]
    pub fn field_radius(&self) -> f64 {
        match self.form() {
            Form::None => f64::INFINITY,
            Form::Polynomial { k, .. } => radtan::field_radius(k),
            Form::Ratio { ratio, .. } => ratio.field_radius(),
            Form::Fisheye { k } => kannala_brandt::field_radius(k),
        }
    }

    /// Maps a distorted normalised point back, to rounding: the residual is at most 5e-14 (1 + |point|), or what a
    /// change of the answer by four epsilon makes where the lens is steeper than that.
    ///
    /// O(1): a bracketed search on the radius, then 1 to 5 Newton steps. The error of the answer is the residual over
    /// the smallest singular value of the Jacobian: it grows without bound towards the fold.
    ///
    /// # Errors
    /// [`GeometryError::OutsideInvertibleField`] if no point inside [`Self::field_radius`] maps to `distorted`
    /// (also for NaN).
    pub fn undistort(&self, distorted: &Vector2<f64>) -> Result<Vector2<f64>, GeometryError> {
        self.undistort_within(distorted, self.field_radius())
    }

    /// [`Self::undistort`] with the field radius already known.
    pub(crate) fn undistort_within(
        &self,
        distorted: &Vector2<f64>,
        field_radius: f64,
    ) -> Result<Vector2<f64>, GeometryError> {
        invert::undistort(self, distorted, field_radius)
    }

    /// All coefficients finite, or the error naming the one that is not.
    pub(crate) fn check(&self) -> Result<(), GeometryError> {
        for (name, value) in self.parameter_names().iter().zip(self.parameters()) {
            checked(name, value, "a finite number", |_| true)?;
        }
        Ok(())
    }

    fn form(&self) -> Form {
        match *self {
            Self::None => Form::None,
            Self::Radtan { k1, k2, p1, p2, k3 } => Form::Polynomial {
                k: [k1, k2, k3],
                p: [p1, p2],
            },
            Self::Rational {
                k1,
                k2,
                p1,
                p2,
                k3,
                k4,
                k5,
                k6,
            } => Form::Ratio {
                ratio: Ratio {
                    numerator: [k1, k2, k3],
                    denominator: [k4, k5, k6],
                },
                p: [p1, p2],
            },
            Self::KannalaBrandt { k1, k2, k3, k4 } => Form::Fisheye {
                k: [k1, k2, k3, k4],
            },
        }
    }
}

impl Lens for Distortion {
    fn is_pinhole(&self) -> bool {
        *self == Self::None
    }

    fn is_fisheye(&self) -> bool {
        matches!(self, Self::KannalaBrandt { .. })
    }

    fn image(&self, point: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        self.distort_with_jacobian(point)
    }

    fn radial(&self, t: f64) -> (f64, f64) {
        let s = t * t;
        let planar = |(gain, slope): (f64, f64)| (t * gain, gain + 2.0 * s * slope);
        match self.form() {
            Form::None => (t, 1.0),
            Form::Polynomial { k, .. } => planar(radtan::gain(k, s)),
            Form::Ratio { ratio, .. } => planar(ratio.gain(s)),
            Form::Fisheye { k } => (
                t * kannala_brandt::gain(k, t),
                kannala_brandt::derivative(k, t),
            ),
        }
    }
}

/// The coefficients grouped by what they do.
enum Form {
    None,
    Polynomial { k: [f64; 3], p: [f64; 2] },
    Ratio { ratio: Ratio, p: [f64; 2] },
    Fisheye { k: [f64; 4] },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One negative cubic term: r (1 + k r^2) folds at r = 1 / sqrt(-3 k).
    #[test]
    fn field_radius_of_a_barrel() {
        let barrel = Distortion::Radtan {
            k1: -0.3,
            k2: 0.0,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
        };
        let expected = 1.0 / 0.9_f64.sqrt();
        assert!((barrel.field_radius() - expected).abs() < 1e-12);
        // The image of the fold itself is 2/3 of it; a point past that has no source.
        let edge = expected * 2.0 / 3.0;
        assert!(
            barrel
                .undistort(&Vector2::new(edge * 0.999_999, 0.0))
                .is_ok()
        );
        assert!(matches!(
            barrel.undistort(&Vector2::new(edge * 1.001, 0.0)),
            Err(GeometryError::OutsideInvertibleField { .. })
        ));
    }

    fn rational(numerator: [f64; 3], denominator: [f64; 3]) -> Distortion {
        let ([k1, k2, k3], [k4, k5, k6]) = (numerator, denominator);
        Distortion::Rational {
            k1,
            k2,
            p1: 0.0,
            p2: 0.0,
            k3,
            k4,
            k5,
            k6,
        }
    }

    /// r / (1 + a r^2) folds at 1 / sqrt(a), where its image is half of that; r / (1 - a r^2) has its pole there.
    #[test]
    fn field_radius_of_division_lenses() {
        let fold = rational([0.0; 3], [0.25, 0.0, 0.0]);
        assert!((fold.field_radius() - 2.0).abs() < 1e-12);
        let at = fold.undistort(&Vector2::new(0.0, 0.999)).unwrap();
        // y (1 + y^2 / 4) = y'  <=>  y = 2 (1 - sqrt(1 - y'^2)) / y'.
        let expected = 2.0 * (1.0 - (1.0 - 0.999_f64 * 0.999).sqrt()) / 0.999;
        assert!((at.y - expected).abs() < 1e-12, "{at}");
        assert!(fold.undistort(&Vector2::new(0.0, 1.001)).is_err());

        let pole = rational([0.0; 3], [-0.25, 0.0, 0.0]);
        assert!((pole.field_radius() - 2.0).abs() < 1e-12);
        // y' = y / (1 - y^2 / 4) takes every value before the pole.
        let far = pole.undistort(&Vector2::new(1e6, 0.0)).unwrap();
        assert!(far.x < 2.0 && (far.x - 2.0).abs() < 1e-5);
    }

    #[test]
    fn a_rational_lens_without_denominator_is_the_polynomial_one() {
        let plain = Distortion::Radtan {
            k1: -0.28,
            k2: 0.07,
            p1: 0.0,
            p2: 0.0,
            k3: -0.01,
        };
        let same = rational([-0.28, 0.07, -0.01], [0.0; 3]);
        let point = Vector2::new(0.31, -0.42);
        assert_eq!(
            plain.distort_with_jacobian(&point),
            same.distort_with_jacobian(&point)
        );
        assert!((plain.field_radius() - same.field_radius()).abs() < 1e-12);
    }

    #[test]
    fn fisheye_ends_at_ninety_degrees() {
        let fisheye = Distortion::KannalaBrandt {
            k1: 0.0,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
        };
        let angle = 1.5_f64;
        let point = fisheye.undistort(&Vector2::new(angle, 0.0)).unwrap();
        assert!((point.x - angle.tan()).abs() < 1e-9 * angle.tan());
        assert!(fisheye.undistort(&Vector2::new(1.6, 0.0)).is_err());
    }
}
