//! The measurement update of one Gaussian (Eq. 7-9 and 14-16 in their right form).
//!
//! ```text
//! S = P_zz + R
//! K = P_xz S^-1                                  (solved, not inverted)
//! x' = x + K (z - z^)
//! P' = P - K S K^T                               (symmetrised)
//! ```
//!
//! with z^, P_zz, P_xz from the unscented transform of (x, P) through h. The paper prints the
//! innovation covariance without R and, in Eq. 16, a gain that multiplies a 3x3 by a 2x2 matrix.
//! R must enter S, or the filter ignores its sensor's noise; without a positive definite S there
//! is no update.
//!
//! P' is symmetric, and checked positive semidefinite: with non-negative covariance weights it always is,
//! with a negative one (alpha far below 1, beta 0) it may not be, which is an error.
//! On a manifold the small change of tangent between x and x' is neglected.

use estimation_base::{Manifold, symmetric};
use nalgebra::{SMatrix, SVector};

use crate::covariance::{check_posterior, definite, finite, require_symmetric};
use crate::error::{Step, UkfError};
use crate::innovation::Innovation;
use crate::sigma_points::SigmaPoints;
use crate::transform::{Transformed, unscented_transform};

/// A Gaussian after a measurement, and how well the measurement fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update<X, const L: usize, const M: usize> {
    /// Updated mean.
    pub mean: X,
    /// Updated covariance, symmetric.
    pub covariance: SMatrix<f64, L, L>,
    /// How well the measurement fitted the Gaussian before the update.
    pub innovation: Innovation<M>,
}

/// Updates a Gaussian vector, such as a landmark, by a measurement z = h(x) + noise of covariance R,
/// with the default sigma points.
///
/// # Errors
/// See [`unscented_correction`].
pub fn unscented_update<const L: usize, const M: usize>(
    mean: &SVector<f64, L>,
    covariance: &SMatrix<f64, L, L>,
    measurement: &SVector<f64, M>,
    noise: &SMatrix<f64, M, M>,
    function: impl FnMut(&SVector<f64, L>) -> SVector<f64, M>,
) -> Result<Update<SVector<f64, L>, L, M>, UkfError> {
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
/// [`UkfError::Covariance`], with the step, for a covariance or noise that is not symmetric or not finite, and with the
/// pivot where the covariance given, S, or the covariance after the update is not positive definite.
pub fn unscented_correction<X, Z, const L: usize, const M: usize>(
    mean: &X,
    covariance: &SMatrix<f64, L, L>,
    set: &SigmaPoints<L>,
    measurement: &Z,
    noise: &SMatrix<f64, M, M>,
    function: impl FnMut(&X) -> Z,
) -> Result<Update<X, L, M>, UkfError>
where
    X: Manifold<L>,
    Z: Manifold<M>,
{
    require_symmetric(covariance, Step::SigmaPoints)?;
    require_symmetric(noise, Step::Innovation)?;
    let mut predicted = unscented_transform(mean, covariance, set, function)?;
    predicted.covariance += noise;
    correct(mean, covariance, &predicted, measurement)
}

/// The update from a predicted measurement whose covariance holds the noise already.
pub(crate) fn correct<X, Z, const L: usize, const M: usize>(
    mean: &X,
    covariance: &SMatrix<f64, L, L>,
    predicted: &Transformed<Z, L, M>,
    measurement: &Z,
) -> Result<Update<X, L, M>, UkfError>
where
    X: Manifold<L>,
    Z: Manifold<M>,
{
    let difference = predicted.mean.local(measurement);
    let difference = finite(difference, Step::Innovation, "the measurement")?;
    let innovation_covariance = symmetric(&predicted.covariance);
    let factor = definite(&innovation_covariance, Step::Innovation)?;

    let gain = factor
        .solve(&predicted.cross_covariance.transpose())
        .transpose();
    let correction = gain * difference;
    let reduced = covariance - gain * innovation_covariance * gain.transpose();
    let reduced = symmetric(&reduced);
    check_posterior(&reduced, covariance)?;
    Ok(Update {
        mean: mean.retract(&correction),
        covariance: reduced,
        innovation: Innovation::new(difference, innovation_covariance, &factor),
    })
}
