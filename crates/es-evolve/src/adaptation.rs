//! Self-adapted step sizes: what an offspring mutates with, and what its survivors hand on.
//!
//! With D dimensions, z standard normal, and one log-normal factor drawn for each offspring l:
//!
//! | [`StepAdaptation`] | step of offspring l | after selection |
//! |---|---|---|
//! | `Isotropic` | sigma_l z, sigma_l = sigma exp(tau N) | sigma = mean sigma_l |
//! | `PerCoordinate` | sigma_li z_i, sigma_li = sigma_i exp(tau' N + tau'' N_i) | sigma_i = mean sigma_li |
//! | `Covariance` | sigma_l L z, L L^T = C | sigma = mean sigma_l, C = (1 - 1/t) C + (1/t) mean (L z)(L z)^T |
//!
//! tau = tau' = 1/sqrt(2 D), tau'' = 1/sqrt(2 sqrt(D)) (Schwefel 1995; Beyer and Schwefel 2002), t = 1 + D (D + 1) / (2 mu)
//! (Beyer and Sendhoff 2008, CMSA-ES). `Paths` adapts by what happened over many generations instead (`paths`). All steps are in units of the initial step sizes. The trace of C is
//! kept at D, its scale handed to sigma, which changes no step and keeps both in range.

use estimation_base::{CholeskyError, cholesky_in_place};
use nalgebra::{DMatrix, DVector};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::paths::Paths;
use crate::step::lower_times;

/// The shape of the mutations, which adapts itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum StepAdaptation {
    /// One step size. Cheapest, best on well-scaled and on very rugged functions. O(D) an offspring.
    Isotropic,
    /// One step size a coordinate, for scales that differ along the axes. Wants mu of 5 or more. O(D) an offspring.
    PerCoordinate,
    /// One step size and a covariance, self-adapted: ridges and valleys in any direction, with some robustness against
    /// noise and ruggedness from the sizes that differ from offspring to offspring. O(D^2) an offspring, O(D^3) a generation.
    Covariance,
    /// One step size and a covariance, adapted along evolution paths (CMA-ES): a quarter of the evaluations of `Covariance` on
    /// smooth functions, whatever their condition. Cost as `Covariance`.
    #[default]
    Paths,
}

/// The mutation of one offspring.
#[derive(Debug, Clone)]
pub(crate) struct Mutation {
    /// Step in units of the initial sizes.
    pub(crate) step: DVector<f64>,
    /// Its own sizes; the normal vector it was made of for `Paths`.
    sizes: DVector<f64>,
}

/// The distribution of the next generation's steps.
#[derive(Debug)]
pub(crate) enum Strategy {
    /// Sizes that each offspring mutates for itself.
    SelfAdapted(SelfAdapted),
    /// Sizes that follow from the past of the run.
    Paths(Paths),
}

impl Strategy {
    pub(crate) fn new(
        kind: StepAdaptation,
        dimension: usize,
        parents: usize,
        offspring: usize,
    ) -> Self {
        match kind {
            StepAdaptation::Paths => Self::Paths(Paths::new(dimension, parents, offspring)),
            kind => Self::SelfAdapted(SelfAdapted::new(kind, dimension, parents)),
        }
    }

    /// The mutation of one offspring.
    pub(crate) fn mutate(&self, rng: &mut impl Rng) -> Mutation {
        match self {
            Self::SelfAdapted(sizes) => sizes.mutate(rng),
            Self::Paths(paths) => {
                let normal = standard_normal(paths.dimension(), rng);
                Mutation {
                    step: paths.step(&normal),
                    sizes: normal,
                }
            }
        }
    }

    /// Takes all offspring, best first, of which the first `possible` are possible, at least one, and returns the step of the
    /// centre.
    ///
    /// # Errors
    /// The pivot at which C is no longer positive definite.
    pub(crate) fn recombine(
        &mut self,
        ranked: &[&Mutation],
        possible: usize,
    ) -> Result<DVector<f64>, CholeskyError> {
        match self {
            Self::SelfAdapted(sizes) => sizes.recombine(&ranked[..possible.min(sizes.parents)]),
            Self::Paths(paths) => {
                let normals: Vec<&DVector<f64>> =
                    ranked.iter().map(|mutation| &mutation.sizes).collect();
                paths.adapt(&normals, possible)
            }
        }
    }

    /// Standard deviation of a step along each coordinate, in units of the initial sizes.
    pub(crate) fn deviations(&self) -> DVector<f64> {
        match self {
            Self::SelfAdapted(sizes) => sizes.deviations(),
            Self::Paths(paths) => paths.deviations(),
        }
    }
}

/// Step sizes that are mutated and inherited.
#[derive(Debug)]
pub(crate) struct SelfAdapted {
    kind: StepAdaptation,
    parents: usize,
    /// Step sizes; all equal unless per coordinate.
    sizes: DVector<f64>,
    /// The lower triangle of C and its factor; empty unless `Covariance`.
    covariance: DMatrix<f64>,
    factor: DMatrix<f64>,
}

impl SelfAdapted {
    fn new(kind: StepAdaptation, dimension: usize, parents: usize) -> Self {
        let size = if kind == StepAdaptation::Covariance {
            dimension
        } else {
            0
        };
        Self {
            kind,
            parents,
            sizes: DVector::repeat(dimension, 1.0),
            covariance: DMatrix::identity(size, size),
            factor: DMatrix::identity(size, size),
        }
    }

    fn mutate(&self, rng: &mut impl Rng) -> Mutation {
        let size = self.sizes.len();
        let dimension = size as f64;
        let tau = 1.0 / (2.0 * dimension).sqrt();
        let common: f64 = StandardNormal.sample(rng);
        let mut sizes = self.sizes.map(|size| size * (tau * common).exp());
        if self.kind == StepAdaptation::PerCoordinate && size > 1 {
            let tau = 1.0 / (2.0 * dimension.sqrt()).sqrt();
            for (size, normal) in sizes.iter_mut().zip(&standard_normal(size, rng)) {
                *size *= (tau * normal).exp();
            }
        }
        let normal = standard_normal(size, rng);
        let direction = if self.kind == StepAdaptation::Covariance {
            lower_times(&self.factor, &normal)
        } else {
            normal
        };
        Mutation {
            step: sizes.component_mul(&direction),
            sizes,
        }
    }

    /// Intermediate recombination of the survivors, at least one: their mean step; the sizes and C follow them.
    fn recombine(&mut self, survivors: &[&Mutation]) -> Result<DVector<f64>, CholeskyError> {
        let size = self.sizes.len();
        let count = survivors.len() as f64;
        let mean = |entry: &dyn Fn(&Mutation) -> f64| {
            survivors
                .iter()
                .map(|mutation| entry(mutation))
                .sum::<f64>()
                / count
        };
        let step = DVector::from_fn(size, |i, _| mean(&|mutation| mutation.step[i]));
        self.sizes = DVector::from_fn(size, |i, _| mean(&|mutation| mutation.sizes[i]));
        if self.kind == StepAdaptation::Covariance {
            let dimension = size as f64;
            let share = 1.0 / (1.0 + dimension * (dimension + 1.0) / (2.0 * count));
            for row in 0..size {
                for column in 0..=row {
                    let product = mean(&|Mutation { step, sizes }| {
                        step[row] * step[column] / (sizes[row] * sizes[column])
                    });
                    let entry = &mut self.covariance[(row, column)];
                    *entry += share * (product - *entry);
                }
            }
            let trace: f64 = (0..size).map(|i| self.covariance[(i, i)]).sum();
            let scale = trace / dimension;
            self.covariance /= scale;
            self.sizes *= scale.sqrt();
            self.factor.copy_from(&self.covariance);
            cholesky_in_place(&mut self.factor)?;
        }
        Ok(step)
    }

    fn deviations(&self) -> DVector<f64> {
        let mut deviations = self.sizes.clone();
        for i in 0..self.covariance.nrows() {
            deviations[i] *= self.covariance[(i, i)].sqrt();
        }
        deviations
    }
}

/// Independent standard normal components.
fn standard_normal(size: usize, rng: &mut impl Rng) -> DVector<f64> {
    DVector::from_fn(size, |_, _| StandardNormal.sample(rng))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dvector;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// C of the given lower triangle: steps must have that covariance.
    #[test]
    fn steps_have_the_covariance() {
        let mut strategy = SelfAdapted::new(StepAdaptation::Covariance, 3, 1);
        // The factor of [[4, 2, 0.4], [2, 5, 1], [0.4, 1, 1]].
        strategy.covariance =
            DMatrix::from_row_slice(3, 3, &[4.0, 0.0, 0.0, 2.0, 5.0, 0.0, 0.4, 1.0, 1.0]);
        strategy.factor = strategy.covariance.clone();
        cholesky_in_place(&mut strategy.factor).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let count = 100_000;
        let mut sums = [[0.0; 3]; 3];
        for _ in 0..count {
            let mutation = strategy.mutate(&mut rng);
            for row in 0..3 {
                for column in 0..=row {
                    sums[row][column] += mutation.step[row] * mutation.step[column]
                        / (mutation.sizes[row] * mutation.sizes[column]);
                }
            }
        }
        for row in 0..3 {
            for column in 0..=row {
                let c = &strategy.covariance;
                // Isserlis: the product of two normals has variance c_rr c_cc + c_rc^2.
                let variance = c[(row, row)] * c[(column, column)] + c[(row, column)].powi(2);
                let bound = 4.0 * (variance / f64::from(count)).sqrt();
                let mean = sums[row][column] / f64::from(count);
                assert!(
                    (mean - c[(row, column)]).abs() < bound,
                    "{row} {column}: {mean}"
                );
            }
        }
    }

    #[test]
    fn recombination_is_the_mean_and_leaves_the_scale_of_steps() {
        let mut strategy = SelfAdapted::new(StepAdaptation::Covariance, 2, 2);
        let survivors = [
            Mutation {
                step: dvector![2.0, 0.0],
                sizes: DVector::repeat(2, 1.0),
            },
            Mutation {
                step: dvector![2.0, 6.0],
                sizes: DVector::repeat(2, 3.0),
            },
        ];
        let step = strategy.recombine(&[&survivors[0], &survivors[1]]).unwrap();
        assert_eq!(step, dvector![2.0, 3.0]);
        // t = 1 + 2 * 3 / (2 * 2) = 5/2; directions (2, 0) and (2/3, 2) have mean products 20/9, 2/3 and 2.
        let share: f64 = 1.0 / 2.5;
        let c00 = 1.0 + share * (20.0 / 9.0 - 1.0);
        let c10 = share * (2.0 / 3.0);
        let c11 = 1.0 + share;
        let variance = 4.0 * c00;
        assert!((strategy.deviations()[0].powi(2) - variance).abs() < 1e-14 * variance);
        let trace = strategy.covariance.trace();
        assert!((trace - 2.0).abs() < 1e-15);
        let ratio = strategy.covariance[(1, 0)] / strategy.covariance[(1, 1)];
        assert!((ratio - c10 / c11).abs() < 1e-15, "{ratio}");
    }

    #[test]
    fn a_lost_covariance_names_its_pivot() {
        let mut strategy = SelfAdapted::new(StepAdaptation::Covariance, 2, 2);
        strategy.covariance = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 2.0, 1.0]);
        // One survivor of a step of zero shrinks the diagonal and leaves the correlation of 2.
        let still = Mutation {
            step: DVector::zeros(2),
            sizes: DVector::repeat(2, 1.0),
        };
        let lost = strategy.recombine(&[&still]);
        assert!(
            matches!(lost, Err(CholeskyError::NotPositiveDefinite { pivot: 1, value, .. }) if (value + 3.0).abs() < 1e-14),
            "{lost:?}"
        );
    }
}
