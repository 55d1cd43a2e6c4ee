//! Covariance matrix adaptation with evolution paths (CMA-ES; Hansen and Ostermeier 2001, Hansen 2016).
//!
//! Steps are sigma A z, A A^T = C, z standard normal. After a generation, with the offspring ranked and weights w_i falling with the
//! rank (positive for the mu best, negative for the others), `<z>` and `<y>` the weighted means of z and y = A z over the mu best:
//!
//! ```text
//! p_s = (1 - c_s) p_s + sqrt(c_s (2 - c_s) mu_eff) <z>        the path of the step size
//! sigma = sigma exp(c_s / d_s (|p_s| / E|z| - 1))             longer than a random walk: larger steps
//! p_c = (1 - c_c) p_c + h sqrt(c_c (2 - c_c) mu_eff) <y>      the path of the covariance
//! C = (1 - c_1 - c_mu sum w) C + c_1 p_c p_c^T + c_mu sum w_i y_i y_i^T
//! ```
//!
//! Generations in one direction add up in a path and cancel in a zigzag: that is what a population of one generation does not
//! know, and why this needs a quarter of the evaluations of self-adapted sizes on ill-conditioned functions. Rank-one (p_c) and
//! rank-mu (y_i) updates, active (negative weights, each scaled to D / |z_i|^2, so that C stays positive definite). The
//! constants are the defaults of Hansen (2016, Table 1). `<z>` stands for `C^(-1/2) <y>`: with A from
//! Cholesky no decomposition is needed (Suttorp, Hansen and Igel 2009).

use estimation_base::{CholeskyError, cholesky_in_place};
use nalgebra::{DMatrix, DVector};

use crate::step::lower_times;

/// The distribution of the next generation's steps, in units of the initial sizes.
#[derive(Debug, Clone)]
pub(crate) struct Paths {
    weights: Vec<f64>,
    mu_eff: f64,
    c_sigma: f64,
    d_sigma: f64,
    c_c: f64,
    c_1: f64,
    c_mu: f64,
    /// E |z|.
    expected_length: f64,
    sigma: f64,
    path_sigma: DVector<f64>,
    path_c: DVector<f64>,
    /// The lower triangle of C, and its factor A.
    covariance: DMatrix<f64>,
    factor: DMatrix<f64>,
    generation: i32,
}

impl Paths {
    /// For a dimension and a population, 1 <= `parents` < `offspring`.
    pub(crate) fn new(dimension: usize, parents: usize, offspring: usize) -> Self {
        let n = dimension as f64;
        let raw: Vec<f64> = (1..=offspring)
            .map(|rank| (parents as f64 + 0.5).ln() - (rank as f64).ln())
            .collect();
        let effective = |weights: &[f64]| {
            let sum: f64 = weights.iter().sum();
            let squares: f64 = weights.iter().map(|w| w * w).sum();
            sum * sum / squares
        };
        let (best, rest) = raw.split_at(parents);
        let (mu_eff, mu_eff_rest) = (effective(best), effective(rest));
        let c_1 = 2.0 / ((n + 1.3).powi(2) + mu_eff);
        let c_mu = (2.0 * (0.25 + mu_eff + 1.0 / mu_eff - 2.0) / ((n + 2.0).powi(2) + mu_eff))
            .min(1.0 - c_1);
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        let rest_sum = (1.0 + c_1 / c_mu)
            .min(1.0 + 2.0 * mu_eff_rest / (mu_eff + 2.0))
            .min((1.0 - c_1 - c_mu) / (n * c_mu));
        let best_total: f64 = best.iter().sum();
        let rest_total: f64 = rest.iter().map(|w| w.abs()).sum();
        let scaled = |w: f64| {
            if w > 0.0 {
                w / best_total
            } else {
                rest_sum * w / rest_total
            }
        };
        Self {
            weights: raw.iter().map(|w| scaled(*w)).collect(),
            mu_eff,
            c_sigma,
            d_sigma: 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma,
            c_c: (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n),
            c_1,
            c_mu,
            expected_length: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
            sigma: 1.0,
            path_sigma: DVector::zeros(dimension),
            path_c: DVector::zeros(dimension),
            covariance: DMatrix::identity(dimension, dimension),
            factor: DMatrix::identity(dimension, dimension),
            generation: 0,
        }
    }

    pub(crate) fn dimension(&self) -> usize {
        self.path_c.len()
    }

    /// The step of z.
    pub(crate) fn step(&self, normal: &DVector<f64>) -> DVector<f64> {
        self.shaped(normal) * self.sigma
    }

    /// A z.
    fn shaped(&self, normal: &DVector<f64>) -> DVector<f64> {
        lower_times(&self.factor, normal)
    }

    /// Takes the z of all offspring, best first, of which the first `possible` are possible, at least one; returns the step of the
    /// centre. Of the impossible none counts among the best.
    ///
    /// # Errors
    /// The pivot at which C is no longer positive definite.
    pub(crate) fn adapt(
        &mut self,
        ranked: &[&DVector<f64>],
        possible: usize,
    ) -> Result<DVector<f64>, CholeskyError> {
        let dimension = self.path_c.len();
        let n = dimension as f64;
        self.generation = self.generation.saturating_add(1);
        let shaped: Vec<DVector<f64>> = ranked.iter().map(|z| self.shaped(z)).collect();
        let best = self
            .weights
            .iter()
            .filter(|w| **w > 0.0)
            .count()
            .min(possible);
        let share: f64 = self.weights[..best].iter().sum();
        let mean = |of: &dyn Fn(usize) -> DVector<f64>| {
            (0..best).fold(DVector::zeros(dimension), |sum, rank| {
                sum + of(rank) * (self.weights[rank] / share)
            })
        };
        let mean_z = mean(&|rank| ranked[rank].clone());
        let mean_y = mean(&|rank| shaped[rank].clone());
        let moved = &mean_y * self.sigma;

        let c = self.c_sigma;
        self.path_sigma =
            &self.path_sigma * (1.0 - c) + mean_z * (c * (2.0 - c) * self.mu_eff).sqrt();
        let length = self.path_sigma.norm();
        // the path of the first generations is short
        let settled = (1.0 - (1.0 - c).powi(2 * self.generation)).sqrt();
        let steady = length / settled < (1.4 + 2.0 / (n + 1.0)) * self.expected_length;
        let c = self.c_c;
        self.path_c *= 1.0 - c;
        if steady {
            self.path_c += mean_y * (c * (2.0 - c) * self.mu_eff).sqrt();
        }
        let lost = if steady { 0.0 } else { c * (2.0 - c) };
        let sum: f64 = self.weights.iter().sum();
        let kept = 1.0 + self.c_1 * lost - self.c_1 - self.c_mu * sum;
        let factors: Vec<f64> = self
            .weights
            .iter()
            .zip(ranked)
            .enumerate()
            .map(|(rank, (weight, z))| match *weight {
                // too few possible ones: the others say nothing of where to go
                w if w > 0.0 && rank >= possible => 0.0,
                w if w > 0.0 => self.c_mu * w,
                w => self.c_mu * w * n / z.norm_squared().max(f64::MIN_POSITIVE),
            })
            .collect();
        for row in 0..dimension {
            for column in 0..=row {
                let mut entry = kept * self.covariance[(row, column)]
                    + self.c_1 * self.path_c[row] * self.path_c[column];
                for (factor, y) in factors.iter().zip(&shaped) {
                    entry += factor * y[row] * y[column];
                }
                self.covariance[(row, column)] = entry;
            }
        }
        self.sigma *= (self.c_sigma / self.d_sigma * (length / self.expected_length - 1.0))
            .min(1.0)
            .exp();
        self.factor.copy_from(&self.covariance);
        cholesky_in_place(&mut self.factor)?;
        Ok(moved)
    }

    /// Standard deviation of a step along each coordinate.
    pub(crate) fn deviations(&self) -> DVector<f64> {
        DVector::from_fn(self.path_c.len(), |i, _| {
            self.sigma * self.covariance[(i, i)].max(0.0).sqrt()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// D = 10, lambda = 10: the constants of Hansen's purecma at its defaults.
    #[test]
    fn the_constants_are_those_of_the_tutorial() {
        let paths = Paths::new(10, 5, 10);
        let best: f64 = paths.weights[..5].iter().sum();
        assert!((best - 1.0).abs() < 1e-14);
        assert!(
            (paths.weights[0] - 0.456_272_6).abs() < 1e-6,
            "{:?}",
            paths.weights
        );
        assert!((paths.mu_eff - 3.167_299).abs() < 1e-5, "{}", paths.mu_eff);
        assert!(
            (paths.c_sigma - 0.284_429).abs() < 1e-5,
            "{}",
            paths.c_sigma
        );
        assert!((paths.c_1 - 0.015_283).abs() < 1e-5, "{}", paths.c_1);
        assert!((paths.c_mu - 0.023_551_8).abs() < 1e-6, "{}", paths.c_mu);
        assert!(paths.weights[5..].iter().all(|w| *w < 0.0));
        // what the negative weights may take is what the decay leaves
        let rest: f64 = paths.weights[5..].iter().map(|w| w.abs()).sum();
        assert!(rest <= (1.0 - paths.c_1 - paths.c_mu) / (10.0 * paths.c_mu) + 1e-12);
    }
}
