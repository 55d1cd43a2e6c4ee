//! Process noise that follows the innovations where the stated noise is too small.
//!
//! At every keyframe the consensus pose of the reference particle says how far the carrier really moved from its
//! prediction. By body axis j, e = F mu is the correction, P = F F^T the prior covariance and V = F (I - C C^T) F^T the
//! covariance that the correction has when the model is right. With the share w = V / P of the axis that images determine,
//! q = e^2 / V has the expectation one, and
//!
//! > S <- 0.9 S + w q,  n <- 0.9 n + w,  D <- 0.81 D + w^2
//!
//! estimate the factor of the variance as S / n with the standard error sqrt(2 D) / n. The factor stays one until S / n
//! exceeds one by three standard errors, so that a model that is right is left alone; it is never below one. Corrections
//! are measured against the noise in force, so q is counted in units of the stated noise. The axis of travel has no factor:
//! there the images only repeat the scale.

use nalgebra::{Matrix2, SMatrix, SVector};
use serde::{Deserialize, Serialize};

use super::linearised::PosePosterior;
use super::motion::{MotionPrior, NoiseFactors};
use super::pose::{POSE_DIM, PoseMatrix};

/// Number of axes with a factor.
const AXES: usize = 5;
/// Rows of the pose tangent in body axes: left, height, heading, roll, pitch.
const ROWS: [usize; AXES] = [1, 2, 3, 4, 5];
/// Weight of the past at every keyframe.
const MEMORY: f64 = 0.9;
/// Largest squared correction, in units of its variance: one wrong consensus must not open every gate.
const LARGEST_SQUARE: f64 = 100.0;
/// Largest factor of a standard deviation.
const LARGEST_FACTOR: f64 = 20.0;
/// Standard errors by which the estimate must exceed one.
const DEAD_ZONE: f64 = 3.0;
/// Number of nominal corrections that the estimate starts with.
const START: f64 = 4.0;
/// Share of an axis that images must determine to count.
const LEAST_SHARE: f64 = 0.01;

/// Running sums of the corrections.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Adaptation {
    sums: [Sums; AXES],
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Sums {
    squares: f64,
    weight: f64,
    weight_squared: f64,
}

impl Sums {
    const NONE: Self = Self {
        squares: 0.0,
        weight: 0.0,
        weight_squared: 0.0,
    };

    fn with(self, share: f64, square: f64) -> Self {
        Self {
            squares: MEMORY * self.squares + share * square,
            weight: MEMORY * self.weight + share,
            weight_squared: MEMORY * MEMORY * self.weight_squared + share * share,
        }
    }

    fn factor(&self) -> f64 {
        let weight = START + self.weight;
        let ratio = (START + self.squares) / weight;
        let error = (2.0 * self.weight_squared).sqrt() / weight;
        if ratio > 1.0 + DEAD_ZONE * error {
            ratio.sqrt().min(LARGEST_FACTOR)
        } else {
            1.0
        }
    }
}

impl Default for Adaptation {
    fn default() -> Self {
        Self {
            sums: [Sums::NONE; AXES],
        }
    }
}

impl Adaptation {
    /// The factors in force.
    #[must_use]
    pub(crate) fn factors(&self) -> NoiseFactors {
        let [sideways, height, heading, roll, pitch] = self.sums.map(|s| s.factor());
        NoiseFactors {
            sideways,
            height,
            heading,
            roll,
            pitch,
        }
    }

    /// The sums after a keyframe whose matches moved the pose from `prior`, made with [`Self::factors`], to `posterior`.
    #[must_use]
    pub(crate) fn after(&self, prior: &MotionPrior, posterior: &PosePosterior) -> Self {
        let factor = body_from_world(prior) * prior.factor;
        let correction: SVector<f64, POSE_DIM> = factor * posterior.mean;
        let left = PoseMatrix::identity() - posterior.factor * posterior.factor.transpose();
        let explained: PoseMatrix = factor * left * factor.transpose();
        let in_force = self.sums.map(|s| s.factor());
        let mut next = *self;
        for (j, row) in ROWS.into_iter().enumerate() {
            let before: f64 = factor.row(row).norm_squared();
            let share = explained[(row, row)] / before;
            if share > LEAST_SHARE {
                let square =
                    (correction[row] * correction[row] / explained[(row, row)]).min(LARGEST_SQUARE);
                next.sums[j] = next.sums[j].with(share, square * in_force[j] * in_force[j]);
            }
        }
        next
    }
}

/// Turns the x and y rows of a pose tangent into forward and left of the body.
fn body_from_world(prior: &MotionPrior) -> SMatrix<f64, POSE_DIM, POSE_DIM> {
    let (sin, cos) = prior.from.phi.sin_cos();
    let mut turn = PoseMatrix::identity();
    turn.fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&Matrix2::new(cos, sin, -sin, cos));
    turn
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::motion::CarrierModel;
    use crate::filter::pose::PoseStep;
    use crate::filter::tests::common::{
        control, normal, particle, planar_carrier, pose, rng, uniform,
    };
    use nalgebra::Vector2;

    /// Keyframes whose images determine all but `left` of the whitened pose, with a true noise of `factor` times the
    /// stated one sideways and in heading. Returns the share of keyframes that adapt, and the last factors.
    fn drive(seed: u64, factor: f64, keyframes: usize) -> (f64, NoiseFactors) {
        let mut rng = rng(seed);
        let mut adaptation = Adaptation::default();
        let mut adapted = 0;
        for _ in 0..keyframes {
            let model = CarrierModel {
                noise: adaptation.factors(),
                tilt_sigma: 0.01,
                slope_sigma: 0.01,
                ..planar_carrier()
            };
            let p = particle(pose(0.0, 0.0, uniform(&mut rng, -3.0, 3.0)));
            let u = control([0.2, 0.0, 0.05], [0.01, 0.01, 0.02]);
            let prior = model.prior(&Vector2::zeros(), &p.departure(), &u);
            // The motion of a carrier whose noise is `factor` times as large on two axes.
            let true_model = CarrierModel {
                noise: NoiseFactors {
                    sideways: factor,
                    heading: factor,
                    ..NoiseFactors::NOMINAL
                },
                ..model
            };
            let truth = true_model.prior(&Vector2::zeros(), &p.departure(), &u);
            let moved: PoseStep = truth.factor * PoseStep::from_fn(|_, _| normal(&mut rng));
            let whitened = prior.factor.solve_lower_triangular(&moved).unwrap();
            // A measurement of xi with variance r: posterior variance r / (1 + r), mean (xi + noise) / (1 + r).
            let r = 0.05_f64;
            let measured = whitened + PoseStep::from_fn(|_, _| normal(&mut rng)) * r.sqrt();
            let posterior = PosePosterior {
                mean: measured / (1.0 + r),
                factor: PoseMatrix::identity() * (r / (1.0 + r)).sqrt(),
                log_det_factor: 0.0,
            };
            adaptation = adaptation.after(&prior, &posterior);
            let f = adaptation.factors();
            adapted += usize::from(f != NoiseFactors::NOMINAL);
        }
        (adapted as f64 / keyframes as f64, adaptation.factors())
    }

    #[test]
    fn a_right_model_is_left_alone() {
        let adapted: f64 = (0..10).map(|seed| drive(seed, 1.0, 200).0).sum::<f64>() / 10.0;
        // Five axes, three standard errors each, of a skewed sum.
        assert!(adapted < 0.12, "{adapted}");
        // A noise that is stated three times too large is not touched either.
        let adapted: f64 = (0..10)
            .map(|seed| drive(seed, 1.0 / 3.0, 200).0)
            .sum::<f64>()
            / 10.0;
        assert!(adapted < 0.12, "{adapted}");
    }

    #[test]
    fn a_noise_three_times_too_small_is_found_on_its_axes() {
        let mut sums = [0.0; 3];
        for seed in 0..20 {
            let factors = drive(100 + seed, 3.0, 60).1;
            sums[0] += factors.sideways / 20.0;
            sums[1] += factors.heading / 20.0;
            sums[2] += factors.roll / 20.0;
        }
        // Four nominal corrections pull the estimate of about ten towards one: sqrt((4 + 9 * 9.5) / 13.5) = 2.6.
        for factor in &sums[..2] {
            assert!((2.0..3.4).contains(factor), "{sums:?}");
        }
        assert!(sums[2] < 1.1, "{sums:?}");
    }
}
