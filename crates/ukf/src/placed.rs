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

use estimation_base::{Manifold, Real};
use nalgebra::{ComplexField, SMatrix, SVector};

use crate::error::UkfError;
use crate::sigma_points::SigmaPoints;

/// Share of the largest distance that can be undone at which points stay.
const MARGIN: f64 = 0.9;
/// The least factor f by which points move in.
const LEAST_SCALE: f64 = 1.0 / 3.0;
/// Share of an inner step that may not come back.
const NO_FOLD_SHARE: f64 = 1e-3;

/// Difference of an entry that may come back: folds are a matter of radians, this and less is none. Single precision rounds
/// a mean of 1e6 by 0.06.
fn no_fold<T: Real>() -> T {
    by_precision(1e-3, 0.3)
}

/// The same relative to the entry.
fn same_entry<T: Real>() -> T {
    by_precision(1e-6, 1e-4)
}

/// The same relative to the whole tangent.
fn same_tangent<T: Real>() -> T {
    by_precision(1e-12, 1e-5)
}

/// The tolerance of double or of single precision.
fn by_precision<T: Real>(double: f64, single: f64) -> T {
    T::of(if T::EPSILON.into() < 1e-10 {
        double
    } else {
        single
    })
}

/// Sigma points of a set around a mean, with the root of their covariance.
pub(crate) struct Placed<'a, T, const L: usize> {
    root: &'a SMatrix<T, L, L>,
    set: &'a SigmaPoints<T, L>,
    /// f of each axis.
    scales: SVector<T, L>,
    mean_weight_of_centre: T,
    covariance_weight_of_centre: T,
}

impl<'a, T: Real, const L: usize> Placed<'a, T, L> {
    /// The points mean + `root` u_i.
    ///
    /// # Errors
    /// [`UkfError::TooWide`].
    pub(crate) fn new<X: Manifold<L, T>>(
        mean: &X,
        root: &'a SMatrix<T, L, L>,
        set: &'a SigmaPoints<T, L>,
    ) -> Result<Self, UkfError> {
        let mut placed = Self {
            root,
            set,
            scales: SVector::repeat(T::one()),
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
            if reach < T::one() {
                let scale = T::of(MARGIN) * reach;
                if scale < T::of(LEAST_SCALE) {
                    let offset = set.offset(index).norm();
                    let sigma = tangent.norm() / offset;
                    return Err(UkfError::TooWide {
                        axis: set.axis(index),
                        sigma: sigma.into(),
                        at_most: (sigma * scale / T::of(LEAST_SCALE)).into(),
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
            let others = (1..set.count())
                .map(|i| placed.mean_weight(i))
                .fold(T::zero(), |sum, weight| sum + weight);
            placed.mean_weight_of_centre = T::one() - others;
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
    pub(crate) fn tangent(&self, index: usize) -> SVector<T, L> {
        if index == 0 {
            return SVector::zeros();
        }
        self.set.tangent(self.root, index) * self.scales[self.set.axis(index)]
    }

    /// Weight of point `index` in means.
    pub(crate) fn mean_weight(&self, index: usize) -> T {
        if index == 0 {
            return self.mean_weight_of_centre;
        }
        let scale = self.scales[self.set.axis(index)];
        self.set.mean_weight(index) / (scale * scale)
    }

    /// Weight of point `index` in covariances.
    pub(crate) fn covariance_weight(&self, index: usize) -> T {
        if index == 0 {
            self.covariance_weight_of_centre
        } else {
            self.mean_weight(index)
        }
    }
}

/// Whether a step and the way back are one. What is not finite is told elsewhere.
fn comes_back<T: Real, X: Manifold<L, T>, const L: usize>(
    mean: &X,
    tangent: &SVector<T, L>,
) -> bool {
    let same = no_fold::<T>() + same_tangent::<T>() * tangent.norm();
    let error = error_of_return(mean, tangent);
    (0..L).all(|k| {
        error[k].is_nan() || error[k] <= same + same_entry::<T>() * ComplexField::abs(tangent[k])
    })
}

fn error_of_return<T: Real, X: Manifold<L, T>, const L: usize>(
    mean: &X,
    tangent: &SVector<T, L>,
) -> SVector<T, L> {
    (mean.local(&mean.retract(tangent)) - tangent).abs()
}

/// The largest share of a tangent, at most 1, that comes back.
fn reach<T: Real, X: Manifold<L, T>, const L: usize>(mean: &X, tangent: &SVector<T, L>) -> T {
    let mut low = T::one();
    while low > T::zero() && !comes_back(mean, &(tangent * low)) {
        low *= T::of(0.5);
    }
    let mut high = T::of(2.0) * low;
    for _ in 0..40 {
        let middle = T::of(0.5) * (low + high);
        if comes_back(mean, &(tangent * middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    // below a fold steps come back; a step that a mean of 1e15 swallows does so at no length
    let inside = tangent * (T::of(0.5) * low);
    let (error, inner) = (
        error_of_return(mean, tangent),
        error_of_return(mean, &inside),
    );
    let share = T::of(NO_FOLD_SHARE);
    let folded =
        (0..L).any(|k| error[k] > no_fold() && inner[k] <= share * ComplexField::abs(inside[k]));
    if folded { low } else { T::one() }
}
