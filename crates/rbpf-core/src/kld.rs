//! The number of particles by KLD-sampling (Fox 2003, "Adapting the sample size in particle filters").
//!
//! Divide the poses into bins, and draw n samples of a distribution over k occupied bins. The
//! Kullback-Leibler divergence of their histogram from the distribution stays below epsilon with
//! probability 1 - delta when 2 n epsilon reaches the 1 - delta quantile of chi-square with k - 1
//! degrees of freedom. By the approximation of Wilson and Hilferty (Fox, Eq. 7) that is
//!
//! ```text
//! n = (k - 1) / (2 epsilon) (1 - 2 / (9 (k - 1)) + sqrt(2 / (9 (k - 1))) z)^3,   z = z_(1 - delta)
//! ```
//!
//! k is not known beforehand, so samples are drawn one by one from the weighted set until there are
//! as many as the bins occupied so far ask for. The ancestors themselves are then drawn in that number
//! by the resampler, which has less variance than the counting draws.
//!
//! A set spread over many bins gets many particles, a concentrated one few. Only the pose is binned:
//! where particles must also cover other things, such as the maps of a SLAM filter, keep the smallest
//! number at what those need.

use crate::error::RbpfError;
use crate::log_weights::linear_weights;
use rand::{Rng, RngExt};
use std::collections::BTreeSet;

/// The settings of KLD-sampling, for [`crate::ParticleCount::Kld`].
#[derive(Clone, Debug, PartialEq)]
pub struct KldSampling {
    /// Largest divergence epsilon, positive; 0.05 is usual.
    pub error: f64,
    /// Upper quantile z of the standard normal, at least 0: 2.326 for delta = 0.01, 1.645 for 0.05.
    pub quantile: f64,
    /// Side of a bin along each coordinate of the pose, positive and in the unit of the coordinate. A
    /// side that divides 2 pi suits a heading.
    pub widths: Vec<f64>,
    /// Smallest number of particles, at least 1.
    pub min_particles: usize,
    /// Largest number of particles, not below the smallest.
    pub max_particles: usize,
}

impl KldSampling {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`RbpfError::InvalidSetting`] naming the first that is out of range.
    pub(crate) fn check(&self) -> Result<(), RbpfError> {
        let wrong = |what, value| Err(RbpfError::InvalidSetting { what, value });
        if !(self.error.is_finite() && self.error > 0.0) {
            return wrong("the KLD error must be finite and above 0", self.error);
        }
        if !(self.quantile.is_finite() && self.quantile >= 0.0) {
            return wrong(
                "the KLD quantile must be finite and at least 0",
                self.quantile,
            );
        }
        if let Some(&width) = self
            .widths
            .iter()
            .find(|width| !(width.is_finite() && **width > 0.0))
        {
            return wrong("every KLD bin width must be finite and above 0", width);
        }
        if self.widths.is_empty() {
            return wrong("the number of KLD bin widths must be at least 1", 0.0);
        }
        if self.min_particles == 0 {
            return wrong("the least number of particles must be at least 1", 0.0);
        }
        if self.max_particles < self.min_particles {
            return wrong(
                "the largest number of particles must be at least the least",
                self.max_particles as f64,
            );
        }
        Ok(())
    }

    /// Number of samples needed for `bins` occupied bins, rounded up and limited to the range from
    /// `min_particles` to `max_particles`.
    #[must_use]
    pub fn bound(&self, bins: usize) -> usize {
        let samples = if bins < 2 {
            0.0
        } else {
            let degrees = (bins - 1) as f64;
            let spread = 2.0 / (9.0 * degrees);
            let root = 1.0 - spread + spread.sqrt() * self.quantile;
            degrees / (2.0 * self.error) * root.powi(3)
        };
        // A cast saturates; the clamp follows.
        (samples.ceil() as usize).clamp(self.min_particles, self.max_particles)
    }

    /// Number of particles to draw from a weighted set whose particles have these poses.
    ///
    /// Draws one ancestor after another until there are as many as the bins they occupy ask for. Only
    /// the coordinates that have a width are binned. O(N + n (log N + log k)) for a result n.
    ///
    /// # Errors
    /// Settings out of range, a pose too short or not finite, or weights that cannot be normalised.
    pub(crate) fn count(
        &self,
        log_weights: &[f64],
        poses: &[Vec<f64>],
        rng: &mut impl Rng,
    ) -> Result<usize, RbpfError> {
        self.check()?;
        crate::particle_set::check_length("poses", poses.len(), log_weights.len())?;
        let weights = linear_weights(log_weights)?;
        let bins = poses
            .iter()
            .map(|pose| self.bin(pose))
            .collect::<Result<Vec<_>, RbpfError>>()?;
        let mut cumulative = weights;
        let mut total = 0.0;
        for weight in &mut cumulative {
            total += *weight;
            *weight = total;
        }
        let mut occupied = BTreeSet::new();
        let mut drawn = 0;
        // At least one draw a round, and the bound ends at the most particles.
        while drawn == 0 || drawn < self.bound(occupied.len()) {
            let point = rng.random::<f64>() * total;
            let slot = cumulative.partition_point(|&sum| sum <= point);
            occupied.insert(&bins[slot.min(bins.len() - 1)]);
            drawn += 1;
        }
        Ok(drawn)
    }

    fn bin(&self, pose: &[f64]) -> Result<Vec<i64>, RbpfError> {
        if pose.len() < self.widths.len() {
            return Err(RbpfError::LengthMismatch {
                what: "coordinates of a pose",
                given: pose.len(),
                required: self.widths.len(),
            });
        }
        if pose.iter().any(|value| !value.is_finite()) {
            return Err(RbpfError::NotFinite { what: "pose" });
        }
        let coordinates = pose.iter().zip(&self.widths);
        Ok(coordinates
            .map(|(value, width)| (value / width).floor() as i64)
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::streams::{Purpose, Streams};

    fn sampling() -> KldSampling {
        KldSampling {
            error: 0.05,
            quantile: 2.326_347_874,
            widths: vec![0.5, 0.5],
            min_particles: 10,
            max_particles: 100_000,
        }
    }

    /// Upper 1 % points of chi-square from printed tables; Wilson-Hilferty is good to 1 % from two degrees of freedom on
    /// (4 % at one), and the count is rounded up.
    #[test]
    fn val_chi_square_tables() {
        for (degrees, point, tolerance) in [
            (1, 6.634_897, 0.04),
            (2, 9.210_340, 0.01),
            (10, 23.209_251, 0.002),
            (50, 76.153_891, 0.001),
            (100, 135.806_723, 0.0005),
        ] {
            let exact = point / (2.0 * 0.05);
            let bound = sampling().bound(degrees + 1) as f64;
            assert!(
                (bound - exact).abs() <= tolerance * exact + 1.0,
                "{degrees}: {bound}, exact {exact}"
            );
        }
    }

    /// Eq. 7 by hand for k = 51: 500 (1 - 2/450 + sqrt(2/450) 2.326347874)^3 = 500 * 1.150644^3 = 761.73.
    #[test]
    fn the_bound_is_the_closed_formula() {
        assert_eq!(sampling().bound(51), 762);
        // One bin asks for nothing, the limits hold.
        assert_eq!((sampling().bound(0), sampling().bound(1)), (10, 10));
        assert_eq!(sampling().bound(usize::MAX), 100_000);
        let mut last = 0;
        for bins in 2..2000 {
            let bound = sampling().bound(bins);
            assert!(bound >= last, "{bins}");
            last = bound;
        }
    }

    #[test]
    fn a_spread_set_gets_more_particles_than_a_concentrated_one() {
        let poses = |side: f64| -> Vec<Vec<f64>> {
            (0..400)
                .map(|i| vec![side * f64::from(i % 20), side * f64::from(i / 20)])
                .collect()
        };
        let logs = vec![0.0; 400];
        let count = |poses: &[Vec<f64>], logs: &[f64]| {
            let mut rng = Streams::new(1).shared(0, Purpose::Resampling);
            sampling().count(logs, poses, &mut rng).unwrap()
        };
        // All in one bin; in the 4 x 4 bins of a square of side 2; one in each of 400 bins.
        let (one, some, all) = (
            count(&poses(0.01), &logs),
            count(&poses(0.1), &logs),
            count(&poses(0.5), &logs),
        );
        assert_eq!(one, 10);
        assert_eq!(some, sampling().bound(16));
        assert_eq!(all, sampling().bound(400));
        // Weight in one bin alone counts that bin alone, whatever the others hold.
        let mut logs = vec![f64::NEG_INFINITY; 400];
        logs[7] = -3000.0;
        assert_eq!(count(&poses(0.5), &logs), 10);
    }

    #[test]
    fn wrong_settings_and_poses_are_named() {
        let mut rng = Streams::new(1).shared(0, Purpose::Resampling);
        let count = |sampling: KldSampling, pose: Vec<f64>, rng: &mut _| {
            sampling.count(&[0.0], &[pose], rng).unwrap_err()
        };
        for (wrong, text) in [
            (
                KldSampling {
                    error: 0.0,
                    ..sampling()
                },
                "the KLD error must be finite and above 0, 0 given",
            ),
            (
                KldSampling {
                    quantile: f64::NAN,
                    ..sampling()
                },
                "the KLD quantile must be finite and at least 0, NaN given",
            ),
            (
                KldSampling {
                    widths: vec![1.0, -1.0],
                    ..sampling()
                },
                "every KLD bin width must be finite and above 0, -1 given",
            ),
            (
                KldSampling {
                    widths: vec![],
                    ..sampling()
                },
                "the number of KLD bin widths must be at least 1, 0 given",
            ),
            (
                KldSampling {
                    min_particles: 0,
                    ..sampling()
                },
                "the least number of particles must be at least 1, 0 given",
            ),
            (
                KldSampling {
                    max_particles: 9,
                    ..sampling()
                },
                "the largest number of particles must be at least the least, 9 given",
            ),
        ] {
            assert_eq!(count(wrong, vec![0.0; 2], &mut rng).to_string(), text);
        }
        assert!(matches!(
            count(sampling(), vec![0.0], &mut rng),
            RbpfError::LengthMismatch {
                given: 1,
                required: 2,
                ..
            }
        ));
        assert!(matches!(
            count(sampling(), vec![0.0, f64::NAN], &mut rng),
            RbpfError::NotFinite { .. }
        ));
        assert!(sampling().count(&[], &[], &mut rng).is_err());
    }
}
