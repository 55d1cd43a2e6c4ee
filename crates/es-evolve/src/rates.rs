//! Adaptive probabilities of crossover and mutation (paper, Eq. 19).
//!
//! With f_max and f_avg the greatest and the mean fitness of the population:
//!
//! p_c = p_c1 - (p_c1 - p_c2) (f_c - f_avg) / (f_max - f_avg) if f_c >= f_avg, else p_c1,
//! p_m = p_m1 - (p_m1 - p_m2) (f_max - f_m) / (f_max - f_avg) if f_m >= f_avg, else p_m1,
//!
//! f_c the greater fitness of the two parents, f_m that of the individual. As printed, p_m is p_m1 for the best
//! individual and p_m2 for an average one: the best mutates most often. That is kept. The formula does not change when
//! all fitness values are multiplied by one factor, so exp(log f - max log f) is used and neither
//! overflows nor loses the population to underflow.
//!
//! Degenerate case: equal fitness throughout, as just after resampling, makes the fractions 0/0; then p_c = p_c1 and
//! p_m = p_m1. A population that is impossible throughout counts as equal.

use crate::params::PaperParams;

/// Eq. 19, frozen for one population.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AdaptiveRates {
    params: PaperParams,
    log_fitness_max: f64,
    /// Mean fitness relative to the greatest, in (0, 1]; 1 when all are equal.
    average: f64,
}

impl AdaptiveRates {
    /// Rates for a population with these log-fitness values, none of them NaN or plus infinity. O(N).
    pub(crate) fn new(params: &PaperParams, log_fitness: &[f64]) -> Self {
        let log_fitness_max = log_fitness
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        let average = if log_fitness_max == f64::NEG_INFINITY {
            1.0
        } else {
            let sum: f64 = log_fitness
                .iter()
                .map(|value| (value - log_fitness_max).exp())
                .sum();
            sum / log_fitness.len() as f64
        };
        Self {
            params: *params,
            log_fitness_max,
            average,
        }
    }

    /// Probability that parents of these log-fitness values mate.
    pub(crate) fn crossover(&self, log_fitness_a: f64, log_fitness_b: f64) -> f64 {
        let PaperParams { p_c1, p_c2, .. } = self.params;
        let fitness = self.relative(log_fitness_a.max(log_fitness_b));
        let span = 1.0 - self.average;
        if span <= 0.0 || fitness < self.average {
            return p_c1;
        }
        p_c1 - (p_c1 - p_c2) * (fitness - self.average) / span
    }

    /// Probability that an individual of this log-fitness mutates.
    pub(crate) fn mutation(&self, log_fitness: f64) -> f64 {
        let PaperParams { p_m1, p_m2, .. } = self.params;
        let fitness = self.relative(log_fitness);
        let span = 1.0 - self.average;
        if span <= 0.0 || fitness < self.average {
            return p_m1;
        }
        p_m1 - (p_m1 - p_m2) * (1.0 - fitness) / span
    }

    fn relative(&self, log_fitness: f64) -> f64 {
        if self.log_fitness_max == f64::NEG_INFINITY {
            1.0
        } else {
            (log_fitness - self.log_fitness_max).exp()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn rates(log_fitness: &[f64]) -> AdaptiveRates {
        AdaptiveRates::new(&PaperParams::default(), log_fitness)
    }

    #[test]
    fn equal_fitness_gives_the_first_rates_and_no_nan() {
        for value in [0.0, -1e5, 700.0, f64::NEG_INFINITY] {
            for size in [1, 3, 50] {
                let rates = rates(&vec![value; size]);
                assert_eq!(rates.crossover(value, value), 0.85, "{value}");
                assert_eq!(rates.mutation(value), 0.1, "{value}");
            }
        }
    }

    #[test]
    fn agrees_with_the_printed_formula() {
        // Fitness 1, 2, 3, 6: average 3, greatest 6. The offset is far outside the range of exp.
        for offset in [0.0, -5000.0, 5000.0] {
            let log = |fitness: f64| fitness.ln() + offset;
            let rates = rates(&[log(1.0), log(2.0), log(3.0), log(6.0)]);
            // (5000 + ln) carries an absolute rounding of 1e-12.
            let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-11, "{a} {b}");
            close(rates.crossover(log(1.0), log(6.0)), 0.65);
            close(rates.crossover(log(4.5), log(1.0)), 0.85 - 0.2 * 1.5 / 3.0);
            close(rates.crossover(log(2.0), log(1.0)), 0.85);
            close(rates.mutation(log(2.0)), 0.1);
            close(rates.mutation(log(4.5)), 0.1 - 0.099 * 1.5 / 3.0);
            // As printed: the best mutates most.
            close(rates.mutation(log(6.0)), 0.1);
            close(rates.mutation(log(3.003)), 0.001 + 0.099 * 0.001);
        }
    }

    #[test]
    fn impossible_individuals_count_as_fitness_zero() {
        let rates = rates(&[f64::NEG_INFINITY, 0.0]);
        assert_eq!(rates.mutation(f64::NEG_INFINITY), 0.1);
        assert_eq!(rates.crossover(f64::NEG_INFINITY, f64::NEG_INFINITY), 0.85);
        assert_eq!(
            rates.crossover(0.0, f64::NEG_INFINITY),
            0.85 - (0.85 - 0.65)
        );
    }

    /// Eq. 19 inside a move: whether a slot proposes depends on its fitness, and the rate of the way back is left out of the ratio.
    #[test]
    fn rates_that_follow_the_fitness_move_the_target() {
        let standard = |x: f64| -0.5 * x * x;
        let mut population: Vec<f64> = StandardNormal
            .sample_iter(ChaCha8Rng::seed_from_u64(3))
            .take(20_000)
            .collect();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for _ in 0..8 {
            let values: Vec<f64> = population.iter().map(|&x| standard(x)).collect();
            let params = PaperParams {
                p_m1: 1.0,
                p_m2: 0.1,
                ..PaperParams::default()
            };
            let rates = AdaptiveRates::new(&params, &values);
            for (x, value) in population.iter_mut().zip(values) {
                if rng.random::<f64>() >= rates.mutation(value) {
                    continue;
                }
                let normal: f64 = StandardNormal.sample(&mut rng);
                let child = *x + 2.38 * normal;
                if rng.random::<f64>() < (standard(child) - value).exp() {
                    *x = child;
                }
            }
        }
        // Standard errors between the mean square and 1, that of the target; the square has variance 2.
        let count = population.len() as f64;
        let mean = population.iter().map(|x| x * x).sum::<f64>() / count;
        let errors = (mean - 1.0) / (2.0 / count).sqrt();
        // -15.4 measured.
        assert!(errors.abs() > 8.0, "{errors}");
    }
}
