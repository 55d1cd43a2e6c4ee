//! The fundamental matrix from eight or more matches, linearly.
//!
//! Each match is a linear equation p2^T F p1 = 0 in the nine entries of F.
//!
//! 1. Both images are shifted to their centroids and scaled to mean distance sqrt 2 (Hartley 1997): without it the
//!    columns differ by 10^5 and the smallest singular vector is that of rounding and noise.
//! 2. F is the null vector of the n x 9 system: of eight matches by QR, of more the least-squares one by SVD.
//! 3. The nearest matrix of rank 2 replaces it, and the normalisation is undone. F has Frobenius norm 1.
//!
//! Degenerate: matches of one plane, of a turning camera that does not move, or of a line leave the system with rank
//! below 8 (6 for a plane): no matrix. With noise the rank is 8 to rounding; then `second_smallest` not far above
//! `smallest` says so. The algebraic error minimised is not the reprojection error: refine, or score by Sampson.
//! For a calibrated camera prefer [`super::five_point`], which plane scenes do not disturb.
//!
//! Source: Hartley, In defense of the eight-point algorithm (1997); Hartley and Zisserman (2004), algorithm 11.1.

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::pair::Correspondence;
use crate::linalg::{null_space, null_vector, svd3};
use crate::ransac::Solver;

/// A pivot below this is rounding: normalised entries of size one carry a few eps, and sums of eight of them.
const RANK_TOLERANCE: f64 = 256.0 * f64::EPSILON;

/// F and how well it is determined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearFundamental {
    /// F of p2^T F p1 = 0, rank 2, Frobenius norm 1.
    pub matrix: Matrix3<f64>,
    /// Smallest singular value of the normalised system, the algebraic error; 0 of eight matches.
    pub smallest: f64,
    /// The next: F is unique only while this is clearly above `smallest`; 0 (not computed) of eight matches.
    pub second_smallest: f64,
}

/// Why there is no fundamental matrix.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoFundamental {
    /// Too few matches.
    #[error("{given} matches, required: at least {required}")]
    TooFew {
        /// Number of matches.
        given: usize,
        /// Number needed.
        required: usize,
    },
    /// The matches do not determine it: a plane, a line, no baseline, the same match again.
    #[error("the matches give {rank} independent equations at most, required: {required}")]
    Degenerate {
        /// Upper bound of the rank of the system.
        rank: usize,
        /// Rank needed.
        required: usize,
    },
    /// A coordinate is not finite, or all points of an image coincide.
    #[error("coordinates not finite, or all points of an image in one place")]
    NoScale,
}

/// F from n >= 8 matches, in ideal pixels or any other coordinates. O(n).
///
/// # Errors
/// [`NoFundamental`] with the numbers.
pub fn fundamental_from_points(
    matches: &[Correspondence],
) -> Result<LinearFundamental, NoFundamental> {
    let indices: Vec<usize> = (0..matches.len()).collect();
    fundamental_of(matches, &indices)
}

/// The essential matrix nearest to the linear estimate from n >= 8 matches in normalised coordinates: singular values
/// (1, 1, 0). A start for [`super::refine`]. O(n).
///
/// # Errors
/// As [`fundamental_from_points`].
pub fn essential_from_points(matches: &[Correspondence]) -> Result<Matrix3<f64>, NoFundamental> {
    let linear = fundamental_from_points(matches)?;
    nearest_essential(&linear.matrix).ok_or(NoFundamental::NoScale)
}

/// U diag(1, 1, 0) V^T. `None` for NaN, or a matrix of rank below 2, whose essential matrix is not unique.
#[must_use]
fn nearest_essential(matrix: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let svd = svd3(matrix).ok()?;
    if svd.singular_values[1] <= 3.0 * f64::EPSILON * svd.singular_values[0] {
        return None;
    }
    Some(svd.u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)) * svd.v_transposed)
}

/// The eight-point algorithm as RANSAC's solver: samples of 8, refits by least squares.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EightPoint;

impl Solver for EightPoint {
    type Datum = Correspondence;
    type Model = Matrix3<f64>;

    fn sample_size(&self) -> usize {
        8
    }

    fn fit(&self, data: &[Correspondence], sample: &[usize], models: &mut Vec<Matrix3<f64>>) {
        models.extend(fundamental_of(data, sample).ok().map(|f| f.matrix));
    }

    fn refit(
        &self,
        data: &[Correspondence],
        inliers: &[usize],
        _model: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        fundamental_of(data, inliers).ok().map(|f| f.matrix)
    }
}

fn fundamental_of(
    matches: &[Correspondence],
    indices: &[usize],
) -> Result<LinearFundamental, NoFundamental> {
    let given = indices.len();
    if given < 8 {
        return Err(NoFundamental::TooFew { given, required: 8 });
    }
    let first = Conditioner::new(indices.iter().map(|i| matches[*i].first), given)?;
    let second = Conditioner::new(indices.iter().map(|i| matches[*i].second), given)?;
    let row = |i: usize| {
        let m = &matches[indices[i]];
        let (p, q) = (first.apply(&m.first), second.apply(&m.second));
        [
            q.x * p.x,
            q.x * p.y,
            q.x,
            q.y * p.x,
            q.y * p.y,
            q.y,
            p.x,
            p.y,
            1.0,
        ]
    };
    let degenerate = |rank| NoFundamental::Degenerate { rank, required: 8 };
    let (vector, smallest, second_smallest) = if given == 8 {
        let system = SMatrix::<f64, 8, 9>::from_fn(|i, j| row(i)[j]);
        let null = null_space::<8, 9, 1>(&system, RANK_TOLERANCE).ok_or(degenerate(7))?;
        (SVector::<f64, 9>::from(null), 0.0, 0.0)
    } else {
        let mut system = DMatrix::zeros(given, 9);
        for i in 0..given {
            for (j, value) in row(i).into_iter().enumerate() {
                system[(i, j)] = value;
            }
        }
        let null = null_vector(&system).map_err(|_nan| NoFundamental::NoScale)?;
        // The largest singular value is about sqrt(n), that of the column of ones.
        if null.second_smallest <= RANK_TOLERANCE * (given as f64).sqrt() {
            return Err(degenerate(null.rank.min(7)));
        }
        (
            SVector::<f64, 9>::from_fn(|i, _| null.vector[i]),
            null.smallest,
            null.second_smallest,
        )
    };
    let full = Matrix3::from_row_slice(vector.as_slice());
    let svd = svd3(&full).map_err(|_nan| NoFundamental::NoScale)?;
    let mut values = svd.singular_values;
    values[2] = 0.0;
    // Rank 1 is no epipolar geometry: every line would be the same.
    if values[1] <= RANK_TOLERANCE * values[0] {
        return Err(degenerate(7));
    }
    let rank_two = svd.u * Matrix3::from_diagonal(&values) * svd.v_transposed;
    let matrix = second.matrix().transpose() * rank_two * first.matrix();
    let norm = matrix.norm();
    if !(norm > 0.0 && norm.is_finite()) {
        return Err(NoFundamental::NoScale);
    }
    Ok(LinearFundamental {
        matrix: matrix / norm,
        smallest,
        second_smallest,
    })
}

/// x -> scale (x - centre): centroid zero, mean distance sqrt 2.
struct Conditioner {
    centre: Vector2<f64>,
    scale: f64,
}

impl Conditioner {
    fn new(
        points: impl Iterator<Item = Vector2<f64>> + Clone,
        count: usize,
    ) -> Result<Self, NoFundamental> {
        let centre = points.clone().sum::<Vector2<f64>>() / count as f64;
        let mean = points.map(|p| (p - centre).norm()).sum::<f64>() / count as f64;
        // Points in one place differ by the rounding of their coordinates.
        let spread = mean > 16.0 * f64::EPSILON * centre.norm() && mean.is_finite();
        if !spread {
            return Err(NoFundamental::NoScale);
        }
        Ok(Self {
            centre,
            scale: std::f64::consts::SQRT_2 / mean,
        })
    }

    fn apply(&self, point: &Vector2<f64>) -> Vector2<f64> {
        (point - self.centre) * self.scale
    }

    fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(
            self.scale,
            0.0,
            -self.scale * self.centre.x,
            0.0,
            self.scale,
            -self.scale * self.centre.y,
            0.0,
            0.0,
            1.0,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_of_rank_below_two_has_no_essential_matrix_nearest() {
        assert!(nearest_essential(&Matrix3::zeros()).is_none());
        assert!(nearest_essential(&Matrix3::repeat(1.0)).is_none());
        assert!(nearest_essential(&Matrix3::repeat(f64::NAN)).is_none());
    }
}
