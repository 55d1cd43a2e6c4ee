//! Process noise that follows the residuals where the stated noise is too small.
//!
//! At a solution the residuals of the motions say how far the carrier really moved from its prediction. By axis, with r the residual in
//! stated standard deviations and n the motions, q = sum r^2 / n has at most the expectation one when the model is right: images take
//! a share of every residual. A q above 1 + 3 sqrt(2 / n), three standard errors, is no chance; the standard deviation of the axis is
//! then sqrt(q) times the stated one, and the problem is solved again. This is the rule by which the filter adapts its process noise, over
//! the whole drive at once, and like it never goes below what is stated.
//! The axis of travel has no factor: there the images only repeat the scale.

use crate::problem::Model;

/// Standard errors by which the squares must exceed one.
const DEAD_ZONE: f64 = 3.0;

/// Factors of the standard deviation of the process noise, by axis of the body; one where the stated noise is right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseFactors {
    /// Sideways.
    pub sideways: f64,
    /// Heading.
    pub heading: f64,
    /// Roll and pitch.
    pub tilt: f64,
    /// Height.
    pub height: f64,
}

impl NoiseFactors {
    /// The stated noise.
    pub const NOMINAL: Self = Self {
        sideways: 1.0,
        heading: 1.0,
        tilt: 1.0,
        height: 1.0,
    };

    /// Those of two solutions after one another.
    pub(crate) fn then(&self, next: &Self) -> Self {
        Self {
            sideways: self.sideways * next.sideways,
            heading: self.heading * next.heading,
            tilt: self.tilt * next.tilt,
            height: self.height * next.height,
        }
    }
}

/// Sums of the squares of the residuals of the motions over their stated standard deviations, by axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct MotionSquares {
    pub(crate) motions: usize,
    pub(crate) sideways: f64,
    pub(crate) heading: f64,
    /// Mean of roll and pitch.
    pub(crate) tilt: f64,
    pub(crate) height: f64,
}

impl MotionSquares {
    /// The factors that the residuals ask for.
    pub(crate) fn factors(&self) -> NoiseFactors {
        let count = self.motions as f64;
        let factor = |squares: f64| {
            let ratio = squares / count;
            if ratio > 1.0 + DEAD_ZONE * (2.0 / count).sqrt() {
                ratio.sqrt()
            } else {
                1.0
            }
        };
        NoiseFactors {
            sideways: factor(self.sideways),
            heading: factor(self.heading),
            tilt: factor(self.tilt),
            height: factor(self.height),
        }
    }
}

impl Model {
    /// The model with its process noise made larger.
    pub(crate) fn widened(mut self, by: &NoiseFactors) -> Self {
        self.odometry.sideways_per_sqrt_m *= by.sideways;
        self.odometry.turn_per_sqrt_rad *= by.heading;
        self.odometry.turn_per_sqrt_m *= by.heading;
        self.odometry.turn_per_sqrt_s *= by.heading;
        self.tilt_sigma *= by.tilt;
        self.slope_sigma *= by.height;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_standard_errors_are_left_alone() {
        let squares = |sideways: f64| MotionSquares {
            motions: 50,
            sideways,
            heading: 12.0,
            ..MotionSquares::default()
        };
        // 50 (1 + 3 sqrt(2 / 50)) = 80.
        assert_eq!(squares(79.9).factors(), NoiseFactors::NOMINAL);
        let factors = squares(200.0).factors();
        assert!((factors.sideways - 2.0).abs() < 1e-15);
        assert_eq!(
            (factors.heading, factors.tilt, factors.height),
            (1.0, 1.0, 1.0)
        );
        // No motion, no factor.
        assert_eq!(MotionSquares::default().factors(), NoiseFactors::NOMINAL);
    }
}
