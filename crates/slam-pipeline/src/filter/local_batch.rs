//! The Gaussian of a path segment: a local bundle adjustment started at the state of a particle.
//!
//! The unknowns are the poses x_1 ... x_L of a window, the constants of the carrier and the landmarks seen in it
//! ([`super::window_equations`], [`super::window_landmarks`]). The path before the window and the map at its beginning are
//! those of the particle. Steps are damped (Levenberg-Marquardt), the landmarks solved again after each
//! ([`super::window_settling`]); at the end the constants are eliminated. The result, N(mean, (G G^T)^-1) over the stacked
//! pose tangents and the Gaussian of every landmark given the poses, depends on the state at the beginning and on the
//! measurements alone; where the adjustment starts does not matter once it has settled.

use std::sync::Arc;

use nalgebra::{DMatrix, Rotation2, Vector2, Vector3};

use super::landmark::Landmark;
use super::particle::Particle;
use super::pose::{CameraPose, PLANAR};
use super::segment::{SegmentDriver, WindowStep, recent_poses};
use super::window_equations::{Elimination, NormalEquations, Unknowns, WindowProblem, row_of};
use super::window_landmarks::{Track, tracks};

/// Steps tried, accepted or not.
const STEPS: usize = 8;
/// Damping after a step that failed, as a share of the diagonal; it grows and shrinks tenfold.
const FIRST_DAMPING: f64 = 1e-3;
/// The adjustment has settled when a step promises to lower the cost by less than this: a fifth of a standard deviation in
/// one direction.
const SETTLED: f64 = 0.02;
/// After all steps it has settled as well as it can when a step promises less than this, one standard deviation in one direction: where
/// residuals bend, steps about the solution promise a little and keep none of it.
const NEARLY_SETTLED: f64 = 0.5;

/// Gaussian over the poses of a window and over its landmarks given the poses.
#[derive(Debug, Clone)]
pub(crate) struct SegmentGaussian {
    /// Mean of each pose.
    pub(crate) mean: Vec<CameraPose>,
    /// Lower Cholesky factor of the precision of the constants of the carrier and the stacked tangents together. What is below
    /// and right of the constants is G.
    pub(crate) factor: DMatrix<f64>,
    /// The landmarks of the window given the mean of the poses, with their identities.
    pub(crate) landmarks: Vec<(u32, Landmark)>,
    /// Metres per unit.
    pub(crate) scale: f64,
    /// Where the camera was at the beginning, in the unit.
    start: Vector2<f64>,
}

impl SegmentGaussian {
    /// Covariance of the body poses (x, y, heading; metres, rad), three rows a keyframe, given the pose at the beginning, with
    /// the camera at `lever_m` from the body origin. A camera measures no length: the unit of the path and the scale err
    /// together, their product by much less. `None` when the factor is singular. O((6 L)^3).
    #[must_use]
    pub(crate) fn body_covariance(&self, lever_m: &Vector2<f64>) -> Option<DMatrix<f64>> {
        let scale_row = 0;
        let mut by_unknowns = DMatrix::zeros(self.factor.nrows(), 3 * self.mean.len());
        for (k, pose) in self.mean.iter().enumerate() {
            let (row, column) = (row_of(k), 3 * k);
            let travelled = pose.centre.xy() - self.start;
            let lever = Rotation2::new(pose.phi) * lever_m;
            by_unknowns[(row + PLANAR[0], column)] = self.scale;
            by_unknowns[(row + PLANAR[1], column + 1)] = self.scale;
            by_unknowns[(row + PLANAR[2], column)] = lever.y;
            by_unknowns[(row + PLANAR[2], column + 1)] = -lever.x;
            by_unknowns[(row + PLANAR[2], column + 2)] = 1.0;
            by_unknowns[(scale_row, column)] = travelled.x;
            by_unknowns[(scale_row, column + 1)] = travelled.y;
        }
        let whitened = self.factor.solve_lower_triangular(&by_unknowns)?;
        Some(whitened.tr_mul(&whitened))
    }
}

/// A landmark as the window leaves it, with the prior of its depth, given the mean of the poses.
fn landmark(track: &Track, mean: &Vector3<f64>, part: &Elimination) -> Option<(u32, Landmark)> {
    let (weight, guess) = track.depth;
    let mut information = part.information;
    information[(2, 2)] += weight;
    let mut vector = part.vector;
    vector.z += weight * (guess - mean.z);
    let covariance = information.cholesky()?.inverse();
    let landmark = Landmark {
        parametrisation: track.parametrisation,
        mean: mean + covariance * vector,
        covariance,
    };
    Some((track.id, landmark))
}

/// The Gaussian of the path of `steps` that starts in `start`; the adjustment begins on the path of `guess`, which has the same
/// steps. `None` when the normal equations are singular or the adjustment does not settle.
///
/// Time O(matches x poses a landmark is seen from + (6 L)^3).
#[must_use]
pub(crate) fn segment_gaussian(
    driver: &SegmentDriver<'_>,
    start: &Particle,
    guess: &Particle,
    steps: &[Arc<WindowStep>],
) -> Option<SegmentGaussian> {
    let problem = WindowProblem {
        rig: driver.rig,
        start,
        steps,
        tracks: tracks(start, guess, steps, driver.depth),
    };
    let first = Unknowns {
        poses: recent_poses(guess, steps.len()),
        constants: guess.metric.constants(),
        landmarks: problem.tracks.iter().map(|t| t.start).collect(),
    };
    if first.poses.len() != steps.len() {
        return None;
    }
    let (at, normal, factor) = adjust(&problem, first)?;
    Some(SegmentGaussian {
        landmarks: problem
            .tracks
            .iter()
            .zip(&at.landmarks)
            .zip(normal.eliminated())
            .filter_map(|((track, mean), part)| {
                let (part, _) = part?;
                landmark(track, mean, part)
            })
            .collect(),
        mean: at.poses,
        factor,
        scale: at.constants.x,
        start: start.pose.centre.xy(),
    })
}

/// Levenberg-Marquardt from `at`: the solution, the normal equations there and the factor of their matrix.
fn adjust(
    problem: &WindowProblem<'_>,
    mut at: Unknowns,
) -> Option<(Unknowns, NormalEquations, DMatrix<f64>)> {
    let mut damping = 0.0;
    problem.settle(&mut at);
    let mut normal = problem.normal_equations(&at)?;
    for _ in 0..STEPS {
        let mut damped = normal.precision.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] *= 1.0 + damping;
        }
        let factor = damped.cholesky()?;
        let step = factor.solve(&normal.vector);
        if damping == 0.0 && 0.5 * step.dot(&normal.vector) < SETTLED {
            return Some((at, normal, factor.unpack()));
        }
        let mut candidate = at.after(&step, &normal);
        problem.settle(&mut candidate);
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
    let factor = normal.precision.clone().cholesky()?;
    let promised = 0.5 * normal.vector.dot(&factor.solve(&normal.vector));
    (promised < NEARLY_SETTLED).then(|| (at, normal, factor.unpack()))
}
