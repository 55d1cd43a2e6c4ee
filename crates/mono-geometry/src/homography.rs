//! Homographies: the map of one plane's image to another, from four points or from many.
//!
//! Problem: find the 3x3 matrix H, up to scale, with target ~ H source (homogeneous), for points of a plane (metres,
//! pixels or normalised coordinates) and their images. Four points in general position fix its 8 degrees of freedom.
//!
//! Four points ([`Homography::from_four_points`]): with the points as columns, A diag(a) and B diag(b) are the bases in
//! which the fourth point is (1, 1, 1); H = B diag(b / a) A^-1. No decomposition, no iteration.
//!
//! Many points ([`fit`]):
//! 1. both sets are shifted to their centroids and scaled to mean distance sqrt 2;
//! 2. direct linear transformation: target x (H source) = 0 gives two rows a point; the null vector starts
//! 3. Levenberg-Marquardt on the transfer error sum |target - H source|^2 / sigma^2, on the sphere |H| = 1;
//! 4. the covariance of H is the pseudo-inverse of the information J^T J, which has rank 8.
//!
//! That error supposes exact source points, as those of a calibration board are. With noise in both images use it as an
//! approximation and score by [`Homography::sampson_squared`].
//!
//! Degenerate: two of the four points coincide or three are collinear, in either image; of many points, all but one
//! collinear. The first is `None`, the second an error with the rank found. Points collinear only up to noise pass:
//! their covariance tells.
//!
//! Source: Hartley and Zisserman (2004), algorithms 4.1 to 4.3, section 5.2; Sampson error section 4.2.6.

use nalgebra::{DMatrix, Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::linalg::{cholesky, null_vector, svd, svd3, symmetrize};

/// A 9x9 matrix over the entries of H, row by row.
pub type Matrix9 = SMatrix<f64, 9, 9>;
type Vector9 = SVector<f64, 9>;

/// An invertible map of the projective plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography {
    matrix: Matrix3<f64>,
    inverse: Matrix3<f64>,
}

impl Homography {
    /// A homography from its matrix, scaled to Frobenius norm 1 (the sign is kept). O(1).
    ///
    /// `None` if an entry is not finite or the matrix singular to rounding.
    #[must_use]
    pub fn from_matrix(matrix: &Matrix3<f64>) -> Option<Self> {
        let largest = matrix.amax();
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        // First by the largest entry: the square of a huge one would overflow.
        let scaled = matrix / largest;
        let scaled = scaled / scaled.norm();
        let singular_values = svd3(&scaled).ok()?.singular_values;
        if singular_values[2] <= 3.0 * f64::EPSILON * singular_values[0] {
            return None;
        }
        Some(Self {
            matrix: scaled,
            inverse: scaled.try_inverse()?,
        })
    }

    /// The only homography that maps four points to four others; the sign is such that the first source point has a
    /// positive third coordinate. O(1), without decomposition.
    ///
    /// `None` if two points coincide or three are collinear (to rounding) in either image, or a number is not finite.
    #[must_use]
    pub fn from_four_points(
        source: &[Vector2<f64>; 4],
        target: &[Vector2<f64>; 4],
    ) -> Option<Self> {
        let (from, source_shift) = Basis::new(source)?;
        let (to, target_shift) = Basis::new(target)?;
        let core = to.matrix
            * Matrix3::from_diagonal(&to.weights.component_div(&from.weights))
            * from.inverse;
        let matrix = target_shift.back() * core * source_shift.forth();
        let sign = (matrix * source[0].push(1.0)).z.signum();
        Self::from_matrix(&(matrix * sign))
    }

    /// H, of Frobenius norm 1.
    #[must_use]
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.matrix
    }

    /// The map from target to source.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let norm = self.inverse.norm();
        Self {
            matrix: self.inverse / norm,
            inverse: self.matrix * norm,
        }
    }

    /// Where a source point goes; `None` on the line that goes to infinity, or for NaN. O(1).
    #[must_use]
    pub fn map(&self, source: &Vector2<f64>) -> Option<Vector2<f64>> {
        dehomogenize(&(self.matrix * source.push(1.0)))
    }

    /// Where a target point comes from; `None` on the line that comes from infinity, or for NaN. O(1).
    #[must_use]
    pub fn map_inverse(&self, target: &Vector2<f64>) -> Option<Vector2<f64>> {
        dehomogenize(&(self.inverse * target.push(1.0)))
    }

    /// [`Self::map`] and its derivative with respect to the source point (2x2).
    #[must_use]
    pub fn map_with_jacobian(&self, source: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let image = self.matrix * source.push(1.0);
        let point = dehomogenize(&image)?;
        let h = &self.matrix;
        let jacobian = Matrix2::new(
            h[(0, 0)] - point.x * h[(2, 0)],
            h[(0, 1)] - point.x * h[(2, 1)],
            h[(1, 0)] - point.y * h[(2, 0)],
            h[(1, 1)] - point.y * h[(2, 1)],
        ) / image.z;
        jacobian
            .iter()
            .all(|v| v.is_finite())
            .then_some((point, jacobian))
    }

    /// target - H source, in units of the target; `None` as for [`Self::map`].
    #[must_use]
    pub fn transfer_error(
        &self,
        source: &Vector2<f64>,
        target: &Vector2<f64>,
    ) -> Option<Vector2<f64>> {
        self.map(source).map(|mapped| target - mapped)
    }

    /// |target - H source|^2 + |source - H^-1 target|^2; both images in one unit. `None` as for [`Self::map`].
    #[must_use]
    pub fn symmetric_transfer_squared(
        &self,
        source: &Vector2<f64>,
        target: &Vector2<f64>,
    ) -> Option<f64> {
        let forth = self.transfer_error(source, target)?;
        let back = source - self.map_inverse(target)?;
        Some(forth.norm_squared() + back.norm_squared())
    }

    /// Squared first-order distance of the pair (source, target) in R^4 from the pairs that H maps exactly.
    ///
    /// Chi-square with 2 degrees of freedom, times sigma^2, if every coordinate of both images has the standard deviation
    /// sigma. `None` where the constraint has no gradient, or for NaN. O(1).
    #[must_use]
    pub fn sampson_squared(&self, source: &Vector2<f64>, target: &Vector2<f64>) -> Option<f64> {
        // Constraint c = (H s)_xy - t (H s)_z = 0; its gradient by t is -(H s)_z I.
        let image = self.matrix * source.push(1.0);
        let constraint = image.xy() - target * image.z;
        let h = &self.matrix;
        let by_source = Matrix2::new(
            h[(0, 0)] - target.x * h[(2, 0)],
            h[(0, 1)] - target.x * h[(2, 1)],
            h[(1, 0)] - target.y * h[(2, 0)],
            h[(1, 1)] - target.y * h[(2, 1)],
        );
        let spread = by_source * by_source.transpose() + Matrix2::identity() * (image.z * image.z);
        let squared = constraint.dot(&(spread.try_inverse()? * constraint));
        squared.is_finite().then_some(squared.max(0.0))
    }
}

/// Whether every triple of four points turns the same way in both images, or every triple the opposite way.
///
/// Points in front of both cameras do: a plane does not reach infinity between them. A sample that fails this needs no
/// model. O(1); false for NaN.
#[must_use]
pub fn keeps_orientation(source: &[Vector2<f64>; 4], target: &[Vector2<f64>; 4]) -> bool {
    let products = TRIPLES.map(|[a, b, c]| {
        twice_area(&source[a], &source[b], &source[c])
            * twice_area(&target[a], &target[b], &target[c])
    });
    products.iter().all(|p| *p > 0.0) || products.iter().all(|p| *p < 0.0)
}

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
    /// Largest over smallest of the 8 singular values of the whitened Jacobian in normalised coordinates: about 10 for a
    /// full board, growing without bound as the points approach a line.
    pub condition: f64,
    /// Levenberg-Marquardt steps accepted.
    pub iterations: usize,
}

/// Why there is no homography.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
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
    let start = linear(&pairs)?;
    let (h, iterations) = refine(&pairs, start);
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
    Ok(HomographyFit {
        homography,
        unit_covariance: symmetrize(&(map * normalized_covariance * map.transpose())),
        rms: (squared / pairs.len() as f64).sqrt() / to.scale,
        condition: singular_values[0] / singular_values[7],
        iterations,
    })
}

/// Index triples of four points.
const TRIPLES: [[usize; 3]; 4] = [[1, 2, 3], [2, 0, 3], [0, 1, 3], [0, 1, 2]];

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

/// Null vector of the direct linear transformation, in normalised coordinates.
fn linear(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Result<Vector9, HomographyError> {
    let mut rows = DMatrix::zeros(2 * pairs.len(), 9);
    for (k, (s, t)) in pairs.iter().enumerate() {
        let point = [s.x, s.y, 1.0];
        for column in 0..3 {
            rows[(2 * k, column)] = point[column];
            rows[(2 * k, 6 + column)] = -t.x * point[column];
            rows[(2 * k + 1, 3 + column)] = point[column];
            rows[(2 * k + 1, 6 + column)] = -t.y * point[column];
        }
    }
    let null = null_vector(&rows).map_err(|_unusable| HomographyError::Degenerate { rank: 0 })?;
    if null.rank < 8 {
        return Err(HomographyError::Degenerate { rank: null.rank });
    }
    Ok(Vector9::from_iterator(null.vector.iter().copied()))
}

/// Levenberg-Marquardt from a linear start; returns the best H and the accepted steps.
fn refine(pairs: &[(Vector2<f64>, Vector2<f64>)], start: Vector9) -> (Vector9, usize) {
    let mut h = start / start.norm();
    let Some(mut current) = normal(pairs, &h) else {
        return (h, 0);
    };
    let mut damping = 1e-6;
    let mut iterations = 0;
    for _ in 0..30 {
        // H itself is no direction: the outer product holds the step in the tangent plane of |H| = 1.
        let scale = current.information.trace() / 8.0;
        let mut damped = current.information + h * h.transpose() * scale;
        for i in 0..9 {
            damped[(i, i)] += damping * scale;
        }
        let Ok(factor) = cholesky(&damped) else {
            break;
        };
        let step = factor.solve(&current.gradient);
        let candidate = (h + step).normalize();
        match normal(pairs, &candidate).filter(|next| next.squared <= current.squared) {
            Some(next) => {
                let gain = current.squared - next.squared;
                h = candidate;
                iterations += 1;
                damping = (damping * 0.1).max(1e-12);
                let settled = step.norm() < 1e-14 || gain <= 1e-15 * current.squared;
                current = next;
                if settled {
                    break;
                }
            }
            None => {
                damping *= 10.0;
                if damping > 1e6 || step.norm() < 1e-14 {
                    break;
                }
            }
        }
    }
    (h, iterations)
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

/// x -> scale (x - centre): centroid at zero, mean distance sqrt 2.
#[derive(Debug, Clone, Copy)]
struct Similarity {
    centre: Vector2<f64>,
    scale: f64,
}

impl Similarity {
    /// `None` if all points coincide to rounding.
    fn of(points: &[Vector2<f64>]) -> Option<Self> {
        let count = points.len() as f64;
        let centre = points.iter().map(|p| p / count).sum::<Vector2<f64>>();
        let distance = points
            .iter()
            .map(|p| (p - centre).norm() / count)
            .sum::<f64>();
        let scale = std::f64::consts::SQRT_2 / distance;
        let apart = distance > 4.0 * f64::EPSILON * centre.amax();
        (apart && scale.is_finite()).then_some(Self { centre, scale })
    }

    fn apply(&self, point: &Vector2<f64>) -> Vector2<f64> {
        (point - self.centre) * self.scale
    }

    fn forth(&self) -> Matrix3<f64> {
        let shift = -self.centre * self.scale;
        Matrix3::new(
            self.scale, 0.0, shift.x, 0.0, self.scale, shift.y, 0.0, 0.0, 1.0,
        )
    }

    fn back(&self) -> Matrix3<f64> {
        let size = 1.0 / self.scale;
        Matrix3::new(
            size,
            0.0,
            self.centre.x,
            0.0,
            size,
            self.centre.y,
            0.0,
            0.0,
            1.0,
        )
    }
}

/// Three points as columns and the weights that make the fourth (1, 1, 1), in normalised coordinates.
struct Basis {
    matrix: Matrix3<f64>,
    inverse: Matrix3<f64>,
    weights: Vector3<f64>,
}

impl Basis {
    fn new(points: &[Vector2<f64>; 4]) -> Option<(Self, Similarity)> {
        if !points.iter().all(|p| p.iter().all(|v| v.is_finite())) {
            return None;
        }
        let similarity = Similarity::of(points)?;
        let [a, b, c, d] = points.map(|p| similarity.apply(&p));
        // Subtracting the centre leaves coordinates with an error of eps times their former size.
        let reach = points
            .iter()
            .fold(1.0, |m: f64, p| m.max(p.amax() * similarity.scale));
        let tolerance = 16.0 * f64::EPSILON * reach;
        let normalized = [a, b, c, d];
        let flat = TRIPLES.iter().any(|&[i, j, k]| {
            let (p, q, r) = (&normalized[i], &normalized[j], &normalized[k]);
            let side = (q - p).norm().max((r - p).norm()).max((r - q).norm());
            let apart = twice_area(p, q, r).abs() > tolerance * side;
            !apart
        });
        if flat {
            return None;
        }
        let matrix = Matrix3::from_columns(&[a.push(1.0), b.push(1.0), c.push(1.0)]);
        let inverse = matrix.try_inverse()?;
        let weights = inverse * d.push(1.0);
        Some((
            Self {
                matrix,
                inverse,
                weights,
            },
            similarity,
        ))
    }
}

fn twice_area(a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

fn dehomogenize(image: &Vector3<f64>) -> Option<Vector2<f64>> {
    let point = image.xy() / image.z;
    point.iter().all(|v| v.is_finite()).then_some(point)
}

fn pack(matrix: &Matrix3<f64>) -> Vector9 {
    Vector9::from_fn(|i, _| matrix[(i / 3, i % 3)])
}

fn unpack(h: &Vector9) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| h[3 * i + j])
}
