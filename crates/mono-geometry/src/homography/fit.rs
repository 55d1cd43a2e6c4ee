//! The homography of many points, by least squares, with its covariance.
//!
//! Problem: n >= 4 points of a plane, known exactly, and their noisy images; find the H with the least transfer error
//! sum |target - H source|^2 / sigma^2. Steps:
//!
//! 1. both sets are shifted to their centroids and scaled to mean distance sqrt 2;
//! 2. direct linear transformation: target x (H source) = 0 gives two rows a point, and their null vector a start;
//! 3. Levenberg-Marquardt on the transfer error sum |target - H source|^2 / sigma^2, on the sphere |H| = 1;
//! 4. the covariance of H is the pseudo-inverse of the information J^T J, which has rank 8.
//!
//! The error supposes exact source points, as those of a calibration board are. With noise in both images use it as an
//! approximation and score by [`Homography::sampson_squared`].
//!
//! Degenerate: all points but one at most are collinear, or fewer than four distinct: an error with the rank. The rank
//! is that of the Jacobian, so it depends on the source points and H, not on the noise. Points collinear only up to
//! noise pass; [`HomographyFit::condition`] and the covariance tell.
//!
//! Source: Hartley and Zisserman (2004), algorithms 4.2 and 4.3, section 5.2.

use std::convert::Infallible;

use estimation_base::symmetric;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::matrix::{Homography, Similarity, dehomogenize};
use crate::least_squares::{Control, Model, Problem, Taken, Termination, Trial, minimise};
use crate::linalg::{cholesky, svd};

/// A 9x9 matrix over the entries of H, row by row.
type Matrix9 = SMatrix<f64, 9, 9>;
type Vector9 = SVector<f64, 9>;

/// A step of this length on the sphere |H| = 1 is the last one: the next would be shorter by orders of magnitude.
const SETTLED_STEP: f64 = 1e-12;
/// A decrease of the cost by this share is rounding.
const SETTLED_COST: f64 = 1e-15;
/// Damping of the first step, relative to the mean of the diagonal.
const FIRST_DAMPING: f64 = 1e-6;
const MAX_ITERATIONS: usize = 30;
/// A refused step of this length changes the cost by less than its rounding errors.
const ROUNDING_STEP: f64 = 1e-8;

/// A homography from many points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HomographyFit {
    /// The minimiser of the transfer error; third coordinate positive at the centroid of the source points.
    pub homography: Homography,
    /// Covariance of the entries of H (row by row, |H| = 1) for target points with standard deviation 1 in each
    /// coordinate, in units of the target: multiply by sigma^2. Rank 8; H itself is its null vector.
    pub unit_covariance: Matrix9,
    /// Root mean square of |target - H source|, in units of the target.
    pub rms: f64,
    /// Largest over smallest of the 8 singular values of the whitened Jacobian in normalised coordinates: about 10 for
    /// a full board, growing without bound as the points approach a line.
    pub condition: f64,
    /// Levenberg-Marquardt steps tried.
    pub iterations: usize,
}

/// Why there is no homography.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HomographyError {
    /// The two lists differ in length.
    #[error("{sources} source points and {targets} target points, required: as many")]
    CountMismatch {
        /// Source points given.
        sources: usize,
        /// Target points given.
        targets: usize,
    },
    /// Fewer than four points.
    #[error("{points} points, required: at least 4")]
    TooFewPoints {
        /// Points given.
        points: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {point} is not finite, required: finite coordinates")]
    NotFinite {
        /// Index of the first such point.
        point: usize,
    },
    /// The points do not fix a homography: all but one at most are collinear, or fewer than four are distinct.
    #[error(
        "the points fix {rank} of 8 degrees of freedom, required: four points, no three of them collinear"
    )]
    Degenerate {
        /// Degrees of freedom that are fixed.
        rank: usize,
    },
}

/// The homography with the least transfer error over n >= 4 points. O(n) per step, at most 30 steps.
///
/// # Errors
/// [`HomographyError`], with the counts or the rank.
///
/// ```
/// use mono_geometry::homography::fit;
/// use nalgebra::Vector2;
///
/// // The corners of a sheet, and where a picture shows them.
/// let sheet = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2)].map(|(x, y)| Vector2::new(x, y));
/// let picture = [(100.0, 80.0), (400.0, 110.0), (390.0, 300.0), (90.0, 320.0)].map(|(u, v)| Vector2::new(u, v));
/// let found = fit(&sheet, &picture)?;
/// assert!(found.rms < 1e-9);
/// let middle = found.homography.map(&Vector2::new(0.15, 0.1)).expect("on the sheet");
/// assert!(middle.x > 100.0 && middle.x < 390.0);
/// # Ok::<(), mono_geometry::homography::HomographyError>(())
/// ```
pub fn fit(
    source: &[Vector2<f64>],
    target: &[Vector2<f64>],
) -> Result<HomographyFit, HomographyError> {
    check(source, target)?;
    let degenerate = |rank| HomographyError::Degenerate { rank };
    let from = Similarity::of(source).ok_or(degenerate(2))?;
    let to = Similarity::of(target).ok_or(degenerate(2))?;
    let pairs: Vec<(Vector2<f64>, Vector2<f64>)> = source
        .iter()
        .zip(target)
        .map(|(s, t)| (from.apply(s), to.apply(t)))
        .collect();
    let (h, iterations) = refine(&pairs, linear(&pairs));
    let Some((jacobian, squared)) = system(&pairs, &h) else {
        return Err(degenerate(7));
    };
    // J h = 0 by the scale of H, so 8 is full rank. The rank depends on the source points and H only, not on the noise.
    let decomposition = svd(&jacobian).map_err(|_unusable| degenerate(0))?;
    let rank = decomposition.rank();
    if rank < 8 {
        return Err(degenerate(rank));
    }
    let singular_values = &decomposition.singular_values;
    let mut normalized_covariance = Matrix9::zeros();
    for k in 0..8 {
        let direction: Vector9 = decomposition.v.fixed_view::<9, 1>(0, k).into_owned();
        normalized_covariance += direction * direction.transpose() / singular_values[k].powi(2);
    }
    let matrix = to.back() * unpack(&h) * from.forth();
    let sign = if (unpack(&h) * Vector3::z()).z < 0.0 {
        -1.0
    } else {
        1.0
    };
    let homography = Homography::from_matrix(&(matrix * sign)).ok_or(degenerate(7))?;
    // vec(T^-1 H U) by vec(H), then the tangent plane of the sphere |H| = 1.
    let mut map = Matrix9::zeros();
    let (back, forth) = (to.back(), from.forth());
    for i in 0..9 {
        for j in 0..9 {
            map[(i, j)] = back[(i / 3, j / 3)] * forth[(j % 3, i % 3)];
        }
    }
    let unit = pack(homography.matrix());
    let tangent = (Matrix9::identity() - unit * unit.transpose()) / matrix.norm();
    // Target noise of 1 is a noise of `scale` in normalised coordinates.
    let map = tangent * map * to.scale;
    let unit_covariance = symmetric(&(map * normalized_covariance * map.transpose()));
    if !unit_covariance.iter().all(|v| v.is_finite()) {
        return Err(degenerate(rank));
    }
    Ok(HomographyFit {
        homography,
        unit_covariance,
        rms: (squared / pairs.len() as f64).sqrt() / to.scale,
        condition: singular_values[0] / singular_values[7],
        iterations,
    })
}

/// The linear solution alone, to start other refinements; `None` for points that cannot be used.
pub(crate) fn rough(source: &[Vector2<f64>], target: &[Vector2<f64>]) -> Option<Homography> {
    check(source, target).ok()?;
    let (from, to) = (Similarity::of(source)?, Similarity::of(target)?);
    let pairs: Vec<_> = source
        .iter()
        .zip(target)
        .map(|(s, t)| (from.apply(s), to.apply(t)))
        .collect();
    Homography::from_matrix(&(to.back() * unpack(&linear(&pairs)) * from.forth()))
}

fn check(source: &[Vector2<f64>], target: &[Vector2<f64>]) -> Result<(), HomographyError> {
    if source.len() != target.len() {
        return Err(HomographyError::CountMismatch {
            sources: source.len(),
            targets: target.len(),
        });
    }
    if source.len() < 4 {
        return Err(HomographyError::TooFewPoints {
            points: source.len(),
        });
    }
    let finite = |p: &Vector2<f64>| p.iter().all(|v| v.is_finite());
    match (0..source.len()).find(|&k| !finite(&source[k]) || !finite(&target[k])) {
        Some(point) => Err(HomographyError::NotFinite { point }),
        None => Ok(()),
    }
}

/// Direct linear transformation in normalised coordinates: the eigenvector of the smallest eigenvalue of A^T A.
///
/// Squaring A costs half the digits, which the refinement gives back.
fn linear(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Vector9 {
    let mut square = Matrix9::zeros();
    for (s, t) in pairs {
        for axis in 0..2 {
            let mut row = Vector9::zeros();
            for (column, value) in [s.x, s.y, 1.0].into_iter().enumerate() {
                row[3 * axis + column] = value;
                row[6 + column] = -t[axis] * value;
            }
            square.syger(1.0, &row, &row, 1.0);
        }
    }
    square.fill_upper_triangle_with_lower_triangle();
    let eigen = square.symmetric_eigen();
    eigen
        .eigenvectors
        .column(eigen.eigenvalues.imin())
        .into_owned()
}

/// Levenberg-Marquardt from a linear start; returns the best H and the steps tried.
fn refine(pairs: &[(Vector2<f64>, Vector2<f64>)], start: Vector9) -> (Vector9, usize) {
    let h = start / start.norm();
    let Some(normal) = normal(pairs, &h) else {
        return (h, 0);
    };
    let mut problem = Transfer {
        pairs,
        h,
        normal,
        step: Vector9::zeros(),
        candidate: None,
    };
    let control = Control {
        damping: FIRST_DAMPING,
        first_damping: FIRST_DAMPING,
        max_iterations: MAX_ITERATIONS,
    };
    let Ok((_, iterations)) = minimise(&mut problem, &control);
    (problem.h, iterations)
}

/// The homography being refined.
struct Transfer<'a> {
    pairs: &'a [(Vector2<f64>, Vector2<f64>)],
    h: Vector9,
    normal: Normal,
    step: Vector9,
    candidate: Option<(Vector9, Normal)>,
}

impl Problem for Transfer<'_> {
    type Error = Infallible;

    fn cost(&self) -> f64 {
        self.normal.squared
    }

    fn solve(&mut self, damping: f64) -> Result<Option<Model>, Infallible> {
        // H itself is no direction: the outer product holds the step in the tangent plane of |H| = 1.
        let scale = self.normal.information.trace() / 8.0;
        let mut damped = self.normal.information + self.h * self.h.transpose() * scale;
        for i in 0..9 {
            damped[(i, i)] += damping * scale;
        }
        let Ok(factor) = cholesky(&damped) else {
            return Ok(None);
        };
        self.step = factor.solve(&self.normal.gradient);
        let damped = damping * scale * self.step.norm_squared();
        Ok(Some(Model {
            decrease: self.step.dot(&self.normal.gradient) + damped,
            length: self.step.norm(),
        }))
    }

    fn evaluate(&mut self, _model: &Model) -> Option<Trial> {
        let h = (self.h + self.step).normalize();
        let normal = normal(self.pairs, &h)?;
        let trial = Trial::new(normal.squared);
        self.candidate = Some((h, normal));
        Some(trial)
    }

    fn accept(&mut self) -> Result<(), Infallible> {
        if let Some((h, normal)) = self.candidate.take() {
            (self.h, self.normal) = (h, normal);
        }
        Ok(())
    }

    fn improves(&self, squared: f64) -> bool {
        squared <= self.normal.squared
    }

    fn at_estimate(&self, last: Option<Taken>) -> Option<Termination> {
        let Taken { relative, length } = last?;
        if length < SETTLED_STEP {
            return Some(Termination::Step {
                length,
                threshold: SETTLED_STEP,
            });
        }
        // NaN, a cost of zero before and after, has settled too.
        let falling = relative > SETTLED_COST;
        (!falling).then_some(Termination::CostChange {
            relative,
            threshold: SETTLED_COST,
        })
    }

    fn after_refusal(&self, model: &Model) -> Option<Termination> {
        (model.length < ROUNDING_STEP).then_some(Termination::Step {
            length: model.length,
            threshold: ROUNDING_STEP,
        })
    }
}

struct Normal {
    information: Matrix9,
    gradient: Vector9,
    squared: f64,
}

/// Normal equations of the transfer error; `None` if a point goes to infinity.
fn normal(pairs: &[(Vector2<f64>, Vector2<f64>)], h: &Vector9) -> Option<Normal> {
    let mut normal = Normal {
        information: Matrix9::zeros(),
        gradient: Vector9::zeros(),
        squared: 0.0,
    };
    for (s, t) in pairs {
        let (rows, error) = residual(h, s, t)?;
        for (row, e) in rows.iter().zip(error.iter()) {
            normal.information.syger(1.0, row, row, 1.0);
            normal.gradient.axpy(*e, row, 1.0);
        }
        normal.squared += error.norm_squared();
    }
    normal.information.fill_upper_triangle_with_lower_triangle();
    Some(normal)
}

/// The stacked Jacobian (2n x 9) and the sum of squares.
fn system(pairs: &[(Vector2<f64>, Vector2<f64>)], h: &Vector9) -> Option<(DMatrix<f64>, f64)> {
    let mut jacobian = DMatrix::zeros(2 * pairs.len().max(5), 9);
    let mut squared = 0.0;
    for (k, (s, t)) in pairs.iter().enumerate() {
        let (rows, error) = residual(h, s, t)?;
        for (axis, row) in rows.iter().enumerate() {
            jacobian.row_mut(2 * k + axis).copy_from(&row.transpose());
        }
        squared += error.norm_squared();
    }
    Some((jacobian, squared))
}

/// Derivative of the mapped point by h (two rows), and target - mapped.
fn residual(
    h: &Vector9,
    s: &Vector2<f64>,
    t: &Vector2<f64>,
) -> Option<([Vector9; 2], Vector2<f64>)> {
    let image = unpack(h) * s.push(1.0);
    let mapped = dehomogenize(&image)?;
    let p = s.push(1.0) / image.z;
    let mut rows = [Vector9::zeros(); 2];
    for axis in 0..2 {
        for column in 0..3 {
            rows[axis][3 * axis + column] = p[column];
            rows[axis][6 + column] = -mapped[axis] * p[column];
        }
    }
    Some((rows, t - mapped))
}

fn pack(matrix: &Matrix3<f64>) -> Vector9 {
    Vector9::from_fn(|i, _| matrix[(i / 3, i % 3)])
}

fn unpack(h: &Vector9) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| h[3 * i + j])
}
