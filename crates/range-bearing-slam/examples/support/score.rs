//! The errors of a filter on a simulated run.

use super::align::{fit_rigid, mean_squared, moved};
use super::filters::Trial;
use estimation_base::wrap;
use nalgebra::{Matrix3, Vector2, Vector3};
use range_bearing_slam::weighted_moments;
use std::error::Error;

/// The interval in which the mean NEES of 30 runs with 3 degrees of freedom lies in 95 % of the cases:
/// chi-square of 90 degrees of freedom over 30.
pub(crate) const NEES_BAND: [f64; 2] = [2.19, 3.93];

/// The errors of one run.
#[derive(Clone, Debug)]
pub(crate) struct Score {
    /// Mean squared position error of the path as it was reported, square metres.
    pub(crate) mse: f64,
    /// The same after the rigid motion that fits best, hence without the heading lost at the start.
    pub(crate) aligned_mse: f64,
    /// Position error at the end, metres.
    pub(crate) last: f64,
    /// Error over covariance of the particles, at every scan; infinite for a singular covariance.
    pub(crate) nees: Vec<f64>,
}

impl Trial<'_> {
    /// Runs the filter and scores the run.
    ///
    /// # Errors
    /// Any error of the filter.
    pub(crate) fn score(&self) -> Result<Score, Box<dyn Error>> {
        let mut judge = Judge::default();
        self.run(|poses, weights, scan| judge.take(poses, weights, &scan.truth))?;
        Ok(judge.score())
    }
}

/// Collects a run scan by scan.
#[derive(Clone, Debug, Default)]
struct Judge {
    estimated: Vec<Vector2<f64>>,
    truth: Vec<Vector2<f64>>,
    nees: Vec<f64>,
}

impl Judge {
    /// Takes the poses of all particles and their weights, which sum to one.
    fn take(&mut self, poses: &[Vector3<f64>], weights: &[f64], truth: &Vector3<f64>) {
        let Some(moments) = weighted_moments(poses, weights, &[2]) else {
            return;
        };
        let mut error = moments.mean - truth;
        error.z = wrap(error.z);
        self.estimated.push(moments.mean.xy());
        self.truth.push(truth.xy());
        self.nees.push(nees(&error, &moments.covariance));
    }

    /// The score of the scans taken.
    fn score(self) -> Score {
        let motion = fit_rigid(&self.estimated, &self.truth);
        let last = self.estimated.last().zip(self.truth.last());
        Score {
            mse: mean_squared(&self.estimated, &self.truth),
            aligned_mse: mean_squared(&moved(&self.estimated, &motion), &self.truth),
            last: last.map_or(f64::NAN, |(a, b)| (a - b).norm()),
            nees: self.nees,
        }
    }
}

fn nees(error: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    covariance
        .cholesky()
        .map_or(f64::INFINITY, |factor| error.dot(&factor.solve(error)))
}

/// Mean and its standard error.
pub(crate) fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / (count - 1.0);
    (mean, (variance / count).sqrt())
}
