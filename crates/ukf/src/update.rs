//! The measurement update of one Gaussian (Eq. 7-9 and 14-16 in their right form).
//!
//! ```text
//! S = P_zz + R
//! K = P_xz S^-1                                  (solved, not inverted)
//! x' = x + K (z - z^)
//! P' = P - K S K^T                               (symmetrised)
//! nis = (z - z^)^T S^-1 (z - z^)
//! log p(z) = -(nis + log det S + M log 2 pi) / 2
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

use crate::cholesky::{Cholesky, check_symmetric};
use crate::error::{Step, UkfError};
use crate::filter::Innovation;
use crate::manifold::Manifold;
use crate::math::ln;
use crate::sigma_points::SigmaPoints;
use crate::transform::{Transformed, unscented_transform};
use core::f64::consts::TAU;
use nalgebra::{SMatrix, SVector};

/// A Gaussian after a measurement, and how well the measurement fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update<X, const L: usize, const M: usize> {
    /// Updated mean.
    pub mean: X,
    /// Updated covariance, symmetric.
    pub covariance: SMatrix<f64, L, L>,
    /// Normalised innovation squared; chi-square of M degrees of freedom for a consistent filter.
    pub nis: f64,
    /// log N(z; z^, S).
    pub log_likelihood: f64,
    /// z - z^, in the tangent at z^.
    pub innovation: SVector<f64, M>,
    /// S, measurement noise included.
    pub innovation_covariance: SMatrix<f64, M, M>,
}

impl<X, const L: usize, const M: usize> Update<X, L, M> {
    /// What a filter tells of it.
    pub(crate) const fn innovation(&self) -> Innovation<M> {
        Innovation {
            innovation: self.innovation,
            covariance: self.innovation_covariance,
            nis: self.nis,
            log_likelihood: self.log_likelihood,
        }
    }
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
/// [`UkfError::NotFinite`] for NaN or infinity in mean, covariance, measurement, noise or a value
/// of the function; [`UkfError::NotSymmetric`] for a covariance or noise that is not;
/// [`UkfError::NotPositiveDefinite`] with step and pivot for the covariance given, for S, or for the
/// covariance after the update.
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
    check_symmetric(covariance, Step::SigmaPoints)?;
    check_symmetric(noise, Step::Innovation)?;
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
    let innovation = predicted.mean.local(measurement);
    if !innovation.iter().all(|entry| entry.is_finite()) {
        return Err(UkfError::NotFinite {
            step: Step::Innovation,
            what: "the measurement",
        });
    }
    let innovation_covariance = symmetric(&predicted.covariance);
    let factor = Cholesky::positive_definite(&innovation_covariance, Step::Innovation)?;

    let gain = factor
        .solve(&predicted.cross_covariance.transpose())
        .transpose();
    let correction = gain * innovation;
    let reduced = covariance - gain * innovation_covariance * gain.transpose();
    let reduced = symmetric(&reduced);
    check_posterior(&reduced, covariance)?;

    let nis = factor.mahalanobis_squared(&innovation);
    Ok(Update {
        mean: mean.retract(&correction),
        covariance: reduced,
        nis,
        log_likelihood: -0.5 * (nis + factor.log_determinant() + M as f64 * ln(TAU)),
        innovation,
        innovation_covariance,
    })
}

/// (A + A^T) / 2.
pub(crate) fn symmetric<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (matrix + matrix.transpose()) * 0.5
}

/// P - K S K^T rounds relative to P, not to itself: a direction measured far better than it was
/// known may come out at zero within eps * P, and is accepted as zero.
pub(crate) fn check_posterior<const L: usize>(
    posterior: &SMatrix<f64, L, L>,
    prior: &SMatrix<f64, L, L>,
) -> Result<(), UkfError> {
    let mut padded = *posterior;
    for k in 0..L {
        padded[(k, k)] += 8.0 * L as f64 * f64::EPSILON * prior[(k, k)].abs();
    }
    Cholesky::semidefinite(&padded, Step::Posterior).map(|_| ())
}
