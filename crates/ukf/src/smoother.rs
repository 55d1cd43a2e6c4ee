//! The unscented Rauch-Tung-Striebel smoother (Särkkä 2008): each state given all measurements, those after
//! it too.
//!
//! From the last filtered state backwards, with x^-, P^- the prediction from (m_k, P_k) and C the covariance of x_k with it:
//!
//! ```text
//! G = C (P^-)^-1
//! m_k^s = m_k + G (m_(k+1)^s - x^-)
//! P_k^s = (P_k - G P^- G^T) + G P_(k+1)^s G^T
//! ```
//!
//! The difference in brackets is formed as a sum of squares (`joint`). Exact for linear models. The predictions are made again from the filtered states, so a filter need store nothing but
//! (m_k, P_k) after each update. On a manifold m_(k+1)^s - x^- is the tangent at x^-, taken
//! as one at m_(k+1)^s for the covariances.

use estimation_base::{Manifold, Real, symmetric};
use nalgebra::SMatrix;

use crate::covariance::{covariance_root, finite};
use crate::error::{Step, UkfError};
use crate::joint::Joint;
use crate::placed::Placed;
use crate::sigma_points::SigmaPoints;
use crate::transform::Images;

/// A Gaussian state at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<T, X, const L: usize> {
    /// Mean.
    pub mean: X,
    /// Covariance in the tangent at the mean, symmetric.
    pub covariance: SMatrix<T, L, L>,
}

/// Smooths `filtered`, the states after their updates in order of time, into `smoothed`, as long.
///
/// `transition`(k, x) is the state at k + 1 without noise, `process_noise`(k) the covariance Q of what is added on
/// the way. The last state is its own smoothed one.
///
/// Cost: per state one prediction and about 4 L^3 multiplications; no allocation.
///
/// # Errors
/// [`UkfError::Length`] for slices of different lengths; as [`crate::unscented_transform`] for a filtered state;
/// [`UkfError::Covariance`] for a predicted covariance that is only semidefinite. States after
/// the failing one are then smoothed, `filtered` is as it was.
///
/// ```
/// use ukf::nalgebra::{Matrix1, Vector1};
/// use ukf::{Estimate, SigmaPoints, rts_smooth};
///
/// // Two equally good measurements of a number that does not change: the first state becomes as good as the second.
/// let estimate = |mean, variance| Estimate { mean: Vector1::new(mean), covariance: Matrix1::new(variance) };
/// let filtered = [estimate(1.0, 1.0), estimate(1.5, 0.5)];
/// let mut smoothed = filtered;
/// rts_smooth(&filtered, &mut smoothed, &SigmaPoints::default(), |_| Matrix1::new(0.0), |_, x| *x)?;
/// assert!((smoothed[0].mean[0] - 1.5).abs() < 1e-12 && (smoothed[0].covariance[0] - 0.5).abs() < 1e-12);
/// # Ok::<(), ukf::UkfError>(())
/// ```
pub fn rts_smooth<T: Real, X: Manifold<L, T>, const L: usize>(
    filtered: &[Estimate<T, X, L>],
    smoothed: &mut [Estimate<T, X, L>],
    set: &SigmaPoints<T, L>,
    mut process_noise: impl FnMut(usize) -> SMatrix<T, L, L>,
    mut transition: impl FnMut(usize, &X) -> X,
) -> Result<(), UkfError> {
    if smoothed.len() != filtered.len() {
        return Err(UkfError::Length {
            what: "the slice of smoothed states",
            given: smoothed.len(),
            required: filtered.len(),
        });
    }
    let Some((last, _)) = filtered.split_last() else {
        return Ok(());
    };
    let mut later = last.clone();
    smoothed[filtered.len() - 1] = later.clone();
    for k in (0..filtered.len() - 1).rev() {
        let now = &filtered[k];
        let root = covariance_root(&now.covariance, Step::SigmaPoints)?;
        let noise = covariance_root(&process_noise(k), Step::Prediction)?;
        let points = Placed::new(&now.mean, root.lower(), set)?;
        let images: Images<T, X, L, L> =
            Images::new(&now.mean, &points, &mut |x: &X| transition(k, x))?;
        let joint: Joint<T, L, L> = Joint::of_points(noise.lower(), points.count(), |index| {
            let weight = points.covariance_weight(index);
            (images.difference(index), points.tangent(index), weight)
        })?;
        let predicted = joint.z_root(Step::Prediction)?;
        let gain = predicted
            .solve_transposed(&joint.slope().transpose())
            .transpose();
        let correction = gain * images.mean.local(&later.mean);

        let kept = joint.rest(Step::Posterior)?.product();
        let carried = gain * later.covariance * gain.transpose();
        later = Estimate {
            mean: now.mean.retract(&correction),
            covariance: symmetric(&(kept + carried)),
        };
        let still = later.mean.local(&later.mean);
        finite(still, Step::Posterior, "the smoothed mean")?;
        smoothed[k] = later.clone();
    }
    Ok(())
}
