//! The measurement update of one Gaussian (Eq. 7-9 and 14-16 in their right form).
//!
//! ```text
//! S = P_zz + R
//! K = P_xz S^-1
//! x' = x + K (z - z^)
//! P' = P - K S K^T
//! ```
//!
//! with z^, P_zz, P_xz from the unscented transform of (x, P) through h. The paper prints the
//! innovation covariance without R and, in Eq. 16, a gain that multiplies a 3x3 by a 2x2 matrix.
//! R must enter S, or the filter ignores its sensor's noise; without a positive definite S there
//! is no update.
//!
//! P' is not formed by that difference, which loses its sign where a measurement is far more precise than the prior, but
//! as a sum of squares (`joint`): it is positive semidefinite, and right while standard deviations are within
//! 1e16 of one another. With a centre of negative weight (alpha far below 1, beta 0) there may be no such sum, which is an
//! error. On a manifold the small change of tangent between x and x' is neglected.

use estimation_base::generic::CholeskyFactor;
use estimation_base::{Manifold, Real};
use nalgebra::{SMatrix, SVector};

use crate::covariance::covariance_root;
use crate::error::{Step, UkfError};
use crate::innovation::Innovation;
use crate::joint::{Corrected, Joint};
use crate::placed::Placed;
use crate::sigma_points::SigmaPoints;
use crate::transform::Images;

/// A Gaussian after a measurement, and how well the measurement fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update<T, X, const L: usize, const M: usize> {
    /// Updated mean.
    pub mean: X,
    /// Updated covariance, symmetric.
    pub covariance: SMatrix<T, L, L>,
    /// How well the measurement fitted the Gaussian before the update.
    pub innovation: Innovation<T, M>,
}

/// Updates a Gaussian vector, such as a landmark, by a measurement z = h(x) + noise of covariance R,
/// with the default sigma points.
///
/// # Errors
/// See [`unscented_correction`].
///
/// ```
/// use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};
/// use ukf::unscented_update;
///
/// // A point near (3, 4), and its distance from the origin measured as 5.2 +- 0.1.
/// let (mean, covariance) = (Vector2::new(3.0_f64, 4.0), Matrix2::identity() * 0.25);
/// let noise = Matrix1::new(0.01);
/// let updated = unscented_update(&mean, &covariance, &Vector1::new(5.2), &noise, |p| Vector1::new(p.norm()))?;
/// assert!((updated.mean.norm() - 5.2).abs() < 0.05);
/// // Along the ray it is known now, across it is not.
/// let ray = mean.normalize();
/// let across = Vector2::new(-ray.y, ray.x);
/// assert!((ray.transpose() * updated.covariance * ray)[0] < 0.02);
/// assert!((across.transpose() * updated.covariance * across)[0] > 0.2);
/// # Ok::<(), ukf::UkfError>(())
/// ```
pub fn unscented_update<T: Real, const L: usize, const M: usize>(
    mean: &SVector<T, L>,
    covariance: &SMatrix<T, L, L>,
    measurement: &SVector<T, M>,
    noise: &SMatrix<T, M, M>,
    function: impl FnMut(&SVector<T, L>) -> SVector<T, M>,
) -> Result<Update<T, SVector<T, L>, L, M>, UkfError> {
    unscented_correction(
        mean,
        covariance,
        &SigmaPoints::default(),
        measurement,
        noise,
        function,
    )
}

/// Updates a Gaussian on a manifold by a measurement on a manifold.
///
/// A function that has no value at some point (behind the camera) returns NaN there, which is an
/// error and leaves the Gaussian to the caller as it was.
///
/// # Errors
/// [`UkfError::NotFinite`] for NaN or infinity in mean, measurement or a value of the function;
/// [`UkfError::TooWide`] as [`crate::unscented_transform`]; [`UkfError::Covariance`], with the step, for a covariance or noise
/// that is not symmetric, not finite or not positive semidefinite, and with the pivot where S is not positive definite or a
/// centre of negative weight takes more than the other points hold.
pub fn unscented_correction<T: Real, X, Z, const L: usize, const M: usize>(
    mean: &X,
    covariance: &SMatrix<T, L, L>,
    set: &SigmaPoints<T, L>,
    measurement: &Z,
    noise: &SMatrix<T, M, M>,
    mut function: impl FnMut(&X) -> Z,
) -> Result<Update<T, X, L, M>, UkfError>
where
    X: Manifold<L, T>,
    Z: Manifold<M, T>,
{
    let root = covariance_root(covariance, Step::SigmaPoints)?;
    let noise = covariance_root(noise, Step::Innovation)?;
    let corrected = correct(mean, &root, set, measurement, &noise, &mut function)?;
    Ok(Update {
        mean: mean.retract(&corrected.correction),
        covariance: corrected.root.product(),
        innovation: corrected.innovation,
    })
}

/// The update of a Gaussian whose factor is known, by a measurement whose noise is.
pub(crate) fn correct<T: Real, X, Z, const L: usize, const M: usize>(
    mean: &X,
    root: &CholeskyFactor<T, L>,
    set: &SigmaPoints<T, L>,
    measurement: &Z,
    noise: &CholeskyFactor<T, M>,
    function: &mut impl FnMut(&X) -> Z,
) -> Result<Corrected<T, M, L>, UkfError>
where
    X: Manifold<L, T>,
    Z: Manifold<M, T>,
{
    let points = Placed::new(mean, root.lower(), set)?;
    let images = Images::new(mean, &points, function)?;
    let joint = Joint::of_points(noise.lower(), points.count(), |index| {
        let weight = points.covariance_weight(index);
        (images.difference(index), points.tangent(index), weight)
    })?;
    joint.given(images.mean.local(measurement))
}
