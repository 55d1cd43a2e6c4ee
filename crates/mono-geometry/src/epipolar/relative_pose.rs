//! The four poses of an essential matrix, and which of them has the points in front of both cameras.
//!
//! E = U diag(1, 1, 0) V^T is `[t]x R` for R = U W V^T or U W^T V^T (W a quarter turn about z) and t = +-u3, |t| = 1: the
//! reconstruction, its mirror through the baseline, and each with the baseline reversed. A point in front of both
//! cameras is so in one of the four only.
//!
//! Of rays f1, f2 with l2 f2 = l1 R f1 + t the signs of the depths are those of (t x f2) . (f2 x R f1) for l1 and
//! (t x R f1) . (f2 x R f1) for l2: no triangulation. A match whose rays meet at less than `min_parallax_rad` cannot
//! tell and does not vote.
//!
//! Degenerate: a camera that only turned has no parallax in the right R, whatever the estimated t: no votes, or few.
//! Matches at the epipoles do not vote. A tie is reported, not broken.
//!
//! Source: Hartley and Zisserman (2004), 9.6.2 to 9.6.3.

use nalgebra::{Matrix3, Matrix3x2, Rotation3, SVector, Vector3};

use super::pair::Correspondence;
use super::refine::Freedom;
use crate::linalg::svd3;
use crate::se3::Se3;
use crate::so3::{self, hat};

/// Motion of a camera up to the length of its baseline: five degrees of freedom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativePose {
    second_from_first: Se3,
}

impl RelativePose {
    /// From a motion with a baseline of any length; `None` without one, or if it is not finite.
    #[must_use]
    pub fn new(second_from_first: &Se3) -> Option<Self> {
        let length = second_from_first.translation.norm();
        (length > 0.0 && length.is_finite()).then(|| Self {
            second_from_first: Se3::new(
                second_from_first.rotation,
                second_from_first.translation / length,
            ),
        })
    }

    /// Rotation, and translation of length 1.
    #[must_use]
    pub fn second_from_first(&self) -> &Se3 {
        &self.second_from_first
    }

    /// Two unit vectors that span, with the translation, the axes of the second camera: where the first two of the
    /// five parameters move the translation.
    #[must_use]
    pub fn tangent(&self) -> Matrix3x2<f64> {
        let t = &self.second_from_first.translation;
        // The axis that t is farthest from.
        let mut axis = Vector3::zeros();
        axis[t.abs().imin()] = 1.0;
        let first = t.cross(&axis).normalize();
        Matrix3x2::from_columns(&[first, t.cross(&first)])
    }
}

impl Freedom<5> for RelativePose {
    fn essential(&self) -> Matrix3<f64> {
        hat(&self.second_from_first.translation) * self.second_from_first.rotation.matrix()
    }

    fn tangents(&self) -> [Matrix3<f64>; 5] {
        let rotation = self.second_from_first.rotation.matrix();
        let tangent = self.tangent();
        let essential = self.essential();
        let turn = |axis: Vector3<f64>| essential * hat(&axis);
        [
            hat(&tangent.column(0).into()) * rotation,
            hat(&tangent.column(1).into()) * rotation,
            turn(Vector3::x()),
            turn(Vector3::y()),
            turn(Vector3::z()),
        ]
    }

    /// (b, omega): the translation moves along the great circle towards `tangent() * b`, R becomes R exp(omega).
    fn moved(&self, delta: &SVector<f64, 5>) -> Self {
        let along = self.tangent() * delta.fixed_rows::<2>(0);
        let angle = along.norm();
        let t = &self.second_from_first.translation;
        let translation = if angle > 0.0 {
            (t * angle.cos() + along * (angle.sin() / angle)).normalize()
        } else {
            *t
        };
        let rotation =
            self.second_from_first.rotation * so3::exp(&delta.fixed_rows::<3>(2).into_owned());
        Self {
            second_from_first: Se3::new(rotation, translation),
        }
    }
}

/// The four motions second_from_first of an essential matrix, |t| = 1: (R, t), (R, -t), (R', t), (R', -t). O(1).
///
/// Singular values that are not (s, s, 0) are taken as if they were. `None` for NaN or a matrix of rank below 2.
#[must_use]
pub fn candidates(essential: &Matrix3<f64>) -> Option<[Se3; 4]> {
    let svd = svd3(essential).ok()?;
    if svd.singular_values[1] <= 3.0 * f64::EPSILON * svd.singular_values[0] {
        return None;
    }
    // The third columns belong to the zero: their signs make proper rotations of both factors.
    let mut u = svd.u;
    let mut v_transposed = svd.v_transposed;
    if u.determinant() < 0.0 {
        u.column_mut(2).neg_mut();
    }
    if v_transposed.determinant() < 0.0 {
        v_transposed.row_mut(2).neg_mut();
    }
    let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let one = Rotation3::from_matrix_unchecked(u * quarter * v_transposed);
    let other = Rotation3::from_matrix_unchecked(u * quarter.transpose() * v_transposed);
    let t: Vector3<f64> = u.column(2).into();
    Some([
        Se3::new(one, t),
        Se3::new(one, -t),
        Se3::new(other, t),
        Se3::new(other, -t),
    ])
}

/// A candidate and the matches that speak for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The motion, |t| = 1.
    pub second_from_first: Se3,
    /// Matches in front of both cameras.
    pub in_front: usize,
    /// Matches without enough parallax to tell.
    pub without_parallax: usize,
}

/// Why cheirality does not decide.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Undecided {
    /// No candidate has a match in front of both cameras.
    #[error(
        "none of {matches} matches is in front of both cameras, {without_parallax} of them lack parallax"
    )]
    NoVotes {
        /// Matches given.
        matches: usize,
        /// The least number without parallax among the candidates.
        without_parallax: usize,
    },
    /// Two candidates have equally many.
    #[error("two poses have {in_front} of {matches} matches in front each")]
    Tie {
        /// Matches in front.
        in_front: usize,
        /// Matches given.
        matches: usize,
    },
}

/// The four candidates, the best first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseChoice {
    /// All four, by descending number of matches in front (equal ones in the order of [`candidates`]).
    pub candidates: [Candidate; 4],
    /// Matches given.
    pub matches: usize,
}

impl PoseChoice {
    /// The candidate with most matches in front.
    ///
    /// # Errors
    /// [`Undecided`] if none has any, or two have the same number.
    pub fn best(&self) -> Result<&Candidate, Undecided> {
        let [first, second, ..] = &self.candidates;
        if first.in_front == 0 {
            return Err(Undecided::NoVotes {
                matches: self.matches,
                without_parallax: self
                    .candidates
                    .iter()
                    .map(|c| c.without_parallax)
                    .min()
                    .unwrap_or(0),
            });
        }
        if first.in_front == second.in_front {
            return Err(Undecided::Tie {
                in_front: first.in_front,
                matches: self.matches,
            });
        }
        Ok(first)
    }
}

/// Evaluates the four poses of an essential matrix on the matches (normalised coordinates) with the given indices,
/// inliers only. O(n).
///
/// Matches whose rays meet at less than `min_parallax_rad` (three standard deviations of the noise, sigma_px / f, are
/// reasonable; 0 for exact data) do not vote. `None` as for [`candidates`].
#[must_use]
pub fn choose_pose(
    essential: &Matrix3<f64>,
    matches: &[Correspondence],
    indices: &[usize],
    min_parallax_rad: f64,
) -> Option<PoseChoice> {
    let mut all = candidates(essential)?.map(|pose| {
        let (in_front, without_parallax) = in_front(&pose, matches, indices, min_parallax_rad);
        Candidate {
            second_from_first: pose,
            in_front,
            without_parallax,
        }
    });
    all.sort_by_key(|c| std::cmp::Reverse(c.in_front));
    Some(PoseChoice {
        candidates: all,
        matches: indices.len(),
    })
}

/// How many of the indexed matches (normalised coordinates) lie in front of both cameras, and how many cannot tell. O(n).
#[must_use]
pub fn in_front(
    second_from_first: &Se3,
    matches: &[Correspondence],
    indices: &[usize],
    min_parallax_rad: f64,
) -> (usize, usize) {
    let t = &second_from_first.translation;
    // Rounding leaves a few eps between equal unit rays.
    let least = min_parallax_rad.max(16.0 * f64::EPSILON);
    let (mut front, mut undecided) = (0, 0);
    for index in indices {
        let m = &matches[*index];
        let ahead = second_from_first.rotation * m.first.push(1.0).normalize();
        let seen = m.second.push(1.0).normalize();
        let normal = seen.cross(&ahead);
        let parallax = normal.norm().atan2(seen.dot(&ahead));
        if parallax > least && parallax < std::f64::consts::PI - least {
            let by_first = t.cross(&seen).dot(&normal);
            let by_second = t.cross(&ahead).dot(&normal);
            front += usize::from(by_first > 0.0 && by_second > 0.0);
        } else {
            undecided += 1;
        }
    }
    (front, undecided)
}
