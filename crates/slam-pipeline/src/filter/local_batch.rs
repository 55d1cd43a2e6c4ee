//! The Gaussian of a path segment: a local bundle adjustment started at the state of a particle.
//!
//! The unknowns are the poses x_1 ... x_L of a window, the constants of the carrier and the landmarks seen in it
//! ([`super::window_equations`], [`super::window_landmarks`]). The path before the window and the map at its beginning are
//! those of the particle. Steps are damped (Levenberg-Marquardt); at the end the constants are eliminated. The result
//! N(mean, (G G^T)^-1) over the stacked pose tangents depends on the state at the beginning and on the measurements alone.

use std::sync::Arc;

use estimation_base::Manifold;
use nalgebra::{DMatrix, DVector};

use super::linearised::pose_posterior;
use super::motion::CONSTANTS;
use super::particle::Particle;
use super::pose::{CameraPose, POSE_DIM};
use super::segment::{SegmentDriver, WindowStep};
use super::window_equations::{Unknowns, WindowProblem};
use super::window_landmarks::tracks;

/// Steps tried, accepted or not.
const STEPS: usize = 8;
/// Damping after a step that failed, as a share of the diagonal; it grows and shrinks tenfold.
const FIRST_DAMPING: f64 = 1e-3;
/// The adjustment has settled when a step promises to lower the cost by less than this: a fifth of a standard deviation in
/// one direction.
const SETTLED: f64 = 0.02;
/// Linearisations of the pose in the path that the adjustment starts from.
const START_LINEARISATIONS: usize = 2;

/// Gaussian over the poses of a window.
#[derive(Debug, Clone)]
pub(crate) struct SegmentGaussian {
    /// Mean of each pose.
    pub(crate) mean: Vec<CameraPose>,
    /// Lower Cholesky factor G of the precision of the stacked tangents.
    pub(crate) precision_factor: DMatrix<f64>,
}

impl SegmentGaussian {
    /// Number of unknowns, six a pose.
    #[must_use]
    pub(crate) fn dimension(&self) -> usize {
        self.precision_factor.nrows()
    }

    /// The path mean + G^-T `normal`: a draw, if `normal` is one of N(0, I). `None` when the factor is singular.
    #[must_use]
    pub(crate) fn path(&self, normal: &DVector<f64>) -> Option<Vec<CameraPose>> {
        let stacked = self.precision_factor.tr_solve_lower_triangular(normal)?;
        Some(
            self.mean
                .iter()
                .enumerate()
                .map(|(k, mean)| {
                    mean.retract(&stacked.fixed_rows::<POSE_DIM>(POSE_DIM * k).into_owned())
                })
                .collect(),
        )
    }
}

/// The Gaussian of the path of `steps` that starts in `start`; `None` when the normal equations are singular or the
/// adjustment does not settle.
///
/// Time O(matches x poses a landmark is seen from + (6 L)^3).
#[must_use]
pub(crate) fn segment_gaussian(
    driver: &SegmentDriver<'_>,
    start: &Particle,
    steps: &[Arc<WindowStep>],
) -> Option<SegmentGaussian> {
    let mut particle = start.clone();
    let mut poses = Vec::with_capacity(steps.len());
    for step in steps {
        driver.step(&mut particle, step, |particle, prior| {
            let matches = step.observation.prepare(particle);
            pose_posterior(driver.rig, prior, &matches, START_LINEARISATIONS).mean_pose(prior)
        });
        poses.push(particle.pose);
    }
    let problem = WindowProblem {
        rig: driver.rig,
        start,
        steps,
        tracks: tracks(start, &particle, steps, driver.depth),
    };
    let start = Unknowns {
        poses,
        constants: start.metric.constants(),
        landmarks: problem.tracks.iter().map(|t| t.start).collect(),
    };
    let (solution, precision) = adjust(&problem, start)?;
    let n = POSE_DIM * steps.len();
    let constants = precision.view((n, n), (CONSTANTS, CONSTANTS)).into_owned();
    let cross = precision.view((0, n), (n, CONSTANTS)).into_owned();
    let reduced = precision.view((0, 0), (n, n)).into_owned()
        - &cross * constants.cholesky()?.solve(&cross.transpose());
    Some(SegmentGaussian {
        mean: solution.poses,
        precision_factor: reduced.cholesky()?.unpack(),
    })
}

/// Levenberg-Marquardt from `at`: the solution, and the precision of poses and constants there.
fn adjust(problem: &WindowProblem<'_>, mut at: Unknowns) -> Option<(Unknowns, DMatrix<f64>)> {
    let mut damping = 0.0;
    let mut normal = problem.normal_equations(&at)?;
    for _ in 0..STEPS {
        let mut damped = normal.precision.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&normal.vector);
        if damping == 0.0 && 0.5 * step.dot(&normal.vector) < SETTLED {
            return Some((at, normal.precision));
        }
        let candidate = at.after(&step, &normal.eliminated);
        match problem.normal_equations(&candidate) {
            Some(next) if next.cost < normal.cost => {
                (at, normal) = (candidate, next);
                damping = if damping > FIRST_DAMPING {
                    damping * 0.1
                } else {
                    0.0
                };
            }
            _ => damping = (damping * 10.0).max(FIRST_DAMPING),
        }
    }
    None
}
