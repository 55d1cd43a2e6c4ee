//! Robust losses: how much a residual may cost.
//!
//! Problem: least squares believes every measurement; one wrong match in a hundred bends the result. A robust loss lets
//! the cost of a large residual grow more slowly. With s = |r|^2, the squared length of a residual already divided by
//! its standard deviation, the cost of the residual is rho(s) / 2 and
//!
//! | loss | rho(s) | weight rho'(s) |
//! |---|---|---|
//! | none | s | 1 |
//! | Huber (1964), threshold k | s if s <= k^2, else 2 k sqrt(s) - k^2 | 1, else k / sqrt(s) |
//! | Cauchy, threshold k | k^2 ln(1 + s / k^2) | 1 / (1 + s / k^2) |
//!
//! The gradient of rho(|r(x)|^2) / 2 is rho'(s) J^T r: exact with the weight rho'. A Gauss-Newton step with J^T rho' J in
//! the place of the Hessian is iteratively re-weighted least squares; as rho is concave in s that model lies above
//! the cost for linear r, so an undamped step goes downhill (Holland and Welsch 1977; the second-order form is in
//! Triggs et al. 2000, section 4.3).
//!
//! Thresholds are in standard deviations. For one normal residual 95 % efficiency is k = 1.345 (Huber) and 2.385
//! (Cauchy); the length of a two-dimensional residual wants about half as much again.
//!
//! Degenerate: Cauchy is not convex, so the result depends on the start; a threshold far above the residuals is plain
//! least squares, one far below makes Huber the sum of lengths, still convex.

use crate::error::{GeometryError, checked};

/// A robust loss: how much a large residual may cost; thresholds in standard deviations, finite and above zero.
///
/// For one normal residual 95 % efficiency is a threshold of 1.345 (Huber) or 2.385 (Cauchy); the length of a
/// two-dimensional residual wants about half as much again. Cauchy is not convex: its result depends on the start.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum RobustLoss {
    /// Plain least squares.
    #[default]
    None,
    /// Quadratic up to the threshold, linear beyond.
    Huber {
        /// Length of a normalised residual at which the loss becomes linear.
        threshold: f64,
    },
    /// Logarithmic: the pull of a residual falls off as 1/|r| beyond the threshold.
    Cauchy {
        /// Length of a normalised residual that pulls hardest.
        threshold: f64,
    },
}

/// Value and slope of a loss at one squared residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loss {
    /// rho(s); the cost is half of it.
    pub rho: f64,
    /// rho'(s), in [0, 1]: the weight of the residual in the normal equations.
    pub weight: f64,
}

impl RobustLoss {
    /// rho and rho' at s = |r|^2 >= 0. O(1).
    #[must_use]
    #[inline]
    pub fn at(&self, squared_norm: f64) -> Loss {
        match *self {
            Self::None => Loss {
                rho: squared_norm,
                weight: 1.0,
            },
            Self::Huber { threshold } => {
                let square = threshold * threshold;
                if squared_norm <= square {
                    Loss {
                        rho: squared_norm,
                        weight: 1.0,
                    }
                } else {
                    let norm = squared_norm.sqrt();
                    Loss {
                        rho: 2.0 * threshold * norm - square,
                        weight: threshold / norm,
                    }
                }
            }
            Self::Cauchy { threshold } => {
                let square = threshold * threshold;
                let ratio = squared_norm / square;
                Loss {
                    rho: square * ratio.ln_1p(),
                    weight: 1.0 / (1.0 + ratio),
                }
            }
        }
    }

    /// The error naming a threshold that is not finite and above zero.
    ///
    /// # Errors
    /// [`GeometryError::InvalidParameter`].
    pub fn check(&self) -> Result<(), GeometryError> {
        match *self {
            Self::None => Ok(()),
            Self::Huber { threshold } | Self::Cauchy { threshold } => checked(
                "threshold of the robust loss (standard deviations)",
                threshold,
                "finite and above 0",
                |k| k > 0.0,
            )
            .map(|_| ()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOSSES: [RobustLoss; 3] = [
        RobustLoss::None,
        RobustLoss::Huber { threshold: 1.5 },
        RobustLoss::Cauchy { threshold: 0.7 },
    ];

    #[test]
    fn the_weight_is_the_derivative() {
        for loss in LOSSES {
            for s in [1e-6, 0.1, 1.0, 2.24, 2.26, 50.0, 1e6] {
                let h = 1e-6 * s;
                let slope = (loss.at(s + h).rho - loss.at(s - h).rho) / (2.0 * h);
                assert!((slope - loss.at(s).weight).abs() < 1e-8, "{loss:?} {s}");
            }
        }
    }

    #[test]
    fn small_residuals_are_plain_least_squares_and_large_ones_cost_less() {
        for loss in LOSSES {
            let small = loss.at(1e-12);
            assert!((small.rho / 1e-12 - 1.0).abs() < 1e-11 && small.weight > 1.0 - 1e-11);
            assert_eq!(loss.at(0.0).rho, 0.0);
        }
        let huber = RobustLoss::Huber { threshold: 2.0 };
        assert_eq!(huber.at(4.0).rho, 4.0);
        assert_eq!(huber.at(100.0).rho, 2.0 * 2.0 * 10.0 - 4.0);
        let cauchy = RobustLoss::Cauchy { threshold: 2.0 };
        assert!((cauchy.at(4.0).rho - 4.0 * 2.0_f64.ln()).abs() < 1e-15);
        // The pull |r| rho' of Cauchy is greatest at the threshold.
        let pull = |r: f64| r * cauchy.at(r * r).weight;
        assert!(pull(2.0) > pull(1.9) && pull(2.0) > pull(2.1));
    }

    #[test]
    fn a_bad_threshold_is_named() {
        for threshold in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(RobustLoss::Huber { threshold }.check().is_err());
            assert!(RobustLoss::Cauchy { threshold }.check().is_err());
        }
        assert!(RobustLoss::None.check().is_ok());
    }
}
