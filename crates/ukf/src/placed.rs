//! Sigma points placed around a mean, kept where a step can be undone.
//!
//! On a circle a step of more than half a turn ends where a shorter one does. A heading of standard deviation 2 rad has its
//! default points sqrt(3) 2 = 3.5 rad away: seen from the mean they lie 2.8 rad away on the other side, and the variance that
//! comes back from them is 2.6, not 4. A filter that starts with "heading unknown" would be sure of it after one prediction.
//!
//! Each point is therefore checked: the tangent that leads back to it must be the one it was placed by. Along an axis k where it is
//! not, the pair of points moves in, to [`MARGIN`] of the largest distance that can be undone, and its weights grow,
//!
//! ```text
//! u_k -> f_k u_k,   W_k -> W_k / f_k^2,   W_0 -> 1 - sum of the others
//! ```
//!
//! (Julier's scaling, 2002, axis by axis), which leaves mean and covariance of the points, and with them the second order of
//! the transform, as they were. The centre's weight falls: where the pair would have to move in to less than
//! [`LEAST_SCALE`] of its distance (beyond 4.9 rad for a heading and the default points), the second order says nothing of a
//! function any more, and the width is refused.
//!
//! Vectors pass always: what rounding takes from a step is told from a fold.

use estimation_base::Manifold;
use nalgebra::{SMatrix, SVector};

use crate::error::UkfError;
use crate::sigma_points::SigmaPoints;

/// Share of the largest distance that can be undone at which points stay.
const MARGIN: f64 = 0.9;
/// The least factor f by which points move in.
const LEAST_SCALE: f64 = 1.0 / 3.0;
/// Difference of an entry that may come back: folds are a matter of radians, this and less is none.
const NO_FOLD: f64 = 1e-3;
/// The same relative to the entry, and to the whole tangent.
const SAME_ENTRY: f64 = 1e-6;
const SAME_TANGENT: f64 = 1e-12;

/// Sigma points of a set around a mean, with the root of their covariance.
pub(crate) struct Placed<'a, const L: usize> {
    root: &'a SMatrix<f64, L, L>,
    set: &'a SigmaPoints<L>,
    /// f of each axis.
    scales: SVector<f64, L>,
    mean_weight_of_centre: f64,
    covariance_weight_of_centre: f64,
}

impl<'a, const L: usize> Placed<'a, L> {
    /// The points mean + `root` u_i.
    ///
    /// # Errors
    /// [`UkfError::TooWide`].
    pub(crate) fn new<X: Manifold<L>>(
        mean: &X,
        root: &'a SMatrix<f64, L, L>,
        set: &'a SigmaPoints<L>,
    ) -> Result<Self, UkfError> {
        let mut placed = Self {
            root,
            set,
            scales: SVector::repeat(1.0),
            mean_weight_of_centre: set.mean_weight(0),
            covariance_weight_of_centre: set.covariance_weight(0),
        };
        let mut moved = false;
        for index in 1..set.count() {
            let tangent = set.tangent(root, index);
            if comes_back(mean, &tangent) {
                continue;
            }
            let reach = reach(mean, &tangent);
            if reach < 1.0 {
                let scale = MARGIN * reach;
                if scale < LEAST_SCALE {
                    let offset = set.offset(index).norm();
                    let sigma = tangent.norm() / offset;
                    return Err(UkfError::TooWide {
                        axis: set.axis(index),
                        sigma,
                        at_most: sigma * scale / LEAST_SCALE,
                    });
                }
                let axis = set.axis(index);
                placed.scales[axis] = placed.scales[axis].min(scale);
                moved = true;
            }
        }
        if moved {
            if !set.has_axes() {
                placed.scales.fill(placed.scales.min());
            }
            let others: f64 = (1..set.count()).map(|i| placed.mean_weight(i)).sum();
            placed.mean_weight_of_centre = 1.0 - others;
            placed.covariance_weight_of_centre =
                placed.mean_weight_of_centre + (set.covariance_weight(0) - set.mean_weight(0));
        }
        Ok(placed)
    }

    /// Number of points.
    pub(crate) const fn count(&self) -> usize {
        self.set.count()
    }

    /// From the mean to point `index`.
    pub(crate) fn tangent(&self, index: usize) -> SVector<f64, L> {
        if index == 0 {
            return SVector::zeros();
        }
        self.set.tangent(self.root, index) * self.scales[self.set.axis(index)]
    }

    /// Weight of point `index` in means.
    pub(crate) fn mean_weight(&self, index: usize) -> f64 {
        if index == 0 {
            return self.mean_weight_of_centre;
        }
        let scale = self.scales[self.set.axis(index)];
        self.set.mean_weight(index) / (scale * scale)
    }

    /// Weight of point `index` in covariances.
    pub(crate) fn covariance_weight(&self, index: usize) -> f64 {
        if index == 0 {
            self.covariance_weight_of_centre
        } else {
            self.mean_weight(index)
        }
    }
}

/// Whether a step and the way back are one. What is not finite is told elsewhere.
fn comes_back<X: Manifold<L>, const L: usize>(mean: &X, tangent: &SVector<f64, L>) -> bool {
    let same = NO_FOLD + SAME_TANGENT * tangent.norm();
    let error = error_of_return(mean, tangent);
    (0..L).all(|k| error[k].is_nan() || error[k] <= same + SAME_ENTRY * tangent[k].abs())
}

fn error_of_return<X: Manifold<L>, const L: usize>(
    mean: &X,
    tangent: &SVector<f64, L>,
) -> SVector<f64, L> {
    (mean.local(&mean.retract(tangent)) - tangent).abs()
}

/// The largest share of a tangent, at most 1, that comes back.
fn reach<X: Manifold<L>, const L: usize>(mean: &X, tangent: &SVector<f64, L>) -> f64 {
    let mut low = 1.0;
    while low > 0.0 && !comes_back(mean, &(tangent * low)) {
        low *= 0.5;
    }
    let mut high = 2.0 * low;
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if comes_back(mean, &(tangent * middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    // below a fold steps come back; a step that a mean of 1e15 swallows does so at no length
    let inside = tangent * (0.5 * low);
    let (error, inner) = (
        error_of_return(mean, tangent),
        error_of_return(mean, &inside),
    );
    let folded = (0..L).any(|k| error[k] > NO_FOLD && inner[k] <= NO_FOLD * inside[k].abs());
    if folded { low } else { 1.0 }
}
