//! The input of a calibration: views of a planar target, the lens model, the options.

use nalgebra::Vector2;

use crate::distortion::Distortion;
use crate::robust_loss::RobustLoss;

/// One point of the target and where it was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Position on the target plane z = 0, metres.
    pub board_m: Vector2<f64>,
    /// Where it was found in the image: distorted pixels, (0, 0) the centre of the top-left pixel.
    pub pixel: Vector2<f64>,
    /// Standard deviation of each pixel coordinate, pixels, above zero.
    ///
    /// Only the ratios between corners matter to the estimate and its covariance, which is scaled by the residuals.
    pub sigma_px: f64,
}

/// One image of the target; corners that were not found are left out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CalibrationView {
    /// At least four, no three of four of them collinear.
    pub corners: Vec<Corner>,
}

impl CalibrationView {
    /// A view of corners found equally well; the shorter of the two lists counts.
    #[must_use]
    pub fn new(board_m: &[Vector2<f64>], pixels: &[Vector2<f64>], sigma_px: f64) -> Self {
        Self {
            corners: board_m
                .iter()
                .zip(pixels)
                .map(|(&board_m, &pixel)| Corner {
                    board_m,
                    pixel,
                    sigma_px,
                })
                .collect(),
        }
    }
}

/// Which lens to estimate; the pinhole (fx, fy, cx, cy; no skew) is always estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum LensModel {
    /// No distortion.
    Pinhole,
    /// k1, k2, p1, p2 of [`Distortion::Radtan`], k3 = 0. The default: r^6 is nearly a combination of r^2 and r^4 inside
    /// the field of a common lens, so a free k3 takes its value from the noise and bends the image beyond the corners.
    #[default]
    Radtan,
    /// [`Distortion::Radtan`] with k3 free: for strong distortion with corners out to the image border.
    RadtanK3,
    /// All 8 coefficients of [`Distortion::Rational`]: for wide lenses; the coefficients are strongly correlated.
    Rational,
    /// [`Distortion::KannalaBrandt`]: for fisheye lenses.
    KannalaBrandt,
}

impl LensModel {
    /// The lens without distortion in the model that is estimated.
    #[must_use]
    pub fn ideal(self) -> Distortion {
        match self {
            Self::Pinhole => Distortion::None,
            Self::Radtan | Self::RadtanK3 => Distortion::Radtan {
                k1: 0.0,
                k2: 0.0,
                p1: 0.0,
                p2: 0.0,
                k3: 0.0,
            },
            Self::Rational => Distortion::Rational {
                k1: 0.0,
                k2: 0.0,
                p1: 0.0,
                p2: 0.0,
                k3: 0.0,
                k4: 0.0,
                k5: 0.0,
                k6: 0.0,
            },
            Self::KannalaBrandt => Distortion::KannalaBrandt {
                k1: 0.0,
                k2: 0.0,
                k3: 0.0,
                k4: 0.0,
            },
        }
    }

    /// Number of estimated parameters of the camera; they are the first of [`crate::Camera::parameters`].
    #[must_use]
    pub fn free_parameters(self) -> usize {
        match self {
            Self::Pinhole => 4,
            // k3 is the last of the lens's five.
            Self::Radtan | Self::KannalaBrandt => 8,
            Self::RadtanK3 => 9,
            Self::Rational => 12,
        }
    }
}

/// How to calibrate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationOptions {
    /// Lens model.
    pub model: LensModel,
    /// Robust loss over corners, thresholds in units of `sigma_px`; none by default.
    pub loss: RobustLoss,
    /// Levenberg-Marquardt steps allowed, accepted and refused, at least 1.
    pub max_iterations: usize,
    /// When to warn.
    pub limits: WarningLimits,
}

impl Default for CalibrationOptions {
    /// Radial-tangential with k3 = 0, no robust loss, 200 steps.
    fn default() -> Self {
        Self {
            model: LensModel::default(),
            loss: RobustLoss::None,
            max_iterations: 200,
            limits: WarningLimits::default(),
        }
    }
}

/// Beyond which values a calibration warns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WarningLimits {
    /// Largest standard deviation that goes unmentioned, as a share of the focal length: of fx and fy themselves, of
    /// the principal point, and of what a lens coefficient moves the outermost corner by. 0.01: at the edge of a 60
    /// degree field, a third of a degree.
    pub sigma_share: f64,
    /// Largest correlation of two parameters, 0 to 1. That of fx with fy is exempt: their common scale is always known
    /// less well than their ratio.
    pub correlation: f64,
    /// Smallest angle between the two most different target planes, radians. Parallel planes constrain the camera once
    /// only, however many there are.
    pub plane_angle_rad: f64,
    /// Smallest distance of the outermost corner from the principal point, as a share of that of the farthest image
    /// corner. Beyond the outermost corner the lens model is an extrapolation.
    pub covered_radius: f64,
    /// Largest residual of a view (root mean square) as a multiple of the median over the views.
    pub view_residual: f64,
}

impl Default for WarningLimits {
    /// 1 %, 0.99, 10 degrees, 0.7, 3 times.
    fn default() -> Self {
        Self {
            sigma_share: 0.01,
            correlation: 0.99,
            plane_angle_rad: 10.0_f64.to_radians(),
            covered_radius: 0.7,
            view_residual: 3.0,
        }
    }
}
