//! Noise that is not added: x' = f(x, w), z = h(x, v).
//!
//! The state is augmented by the noise (Julier and Uhlmann 1997; the paper's pose prediction pushes
//! control noise through the motion model so). Sigma points are drawn from the block-diagonal covariance
//! of (x, w), dimension n = L + W:
//!
//! ```text
//! (m, 0),   (m +- c S_k, 0) for the L columns of S,   (m, +- c N_j) for the W columns of N
//! c^2 = n + lambda,  W_m0 = lambda / c^2,  W_c0 = W_m0 + 1 - alpha^2 + beta,  else 1 / (2 c^2)
//! ```
//!
//! with S S^T = P and N N^T = Q. For f(x) + w this is the additive filter up to what the points
//! see of f's curvature. No point moves state and noise together, so products of the two
//! are not seen: for x (1 + w) the variance comes out as P + m^2 Q, without the P Q of the exact one.

use estimation_base::Manifold;
use nalgebra::{ComplexField, SMatrix, SVector};

use crate::covariance::{require_symmetric, semidefinite};
use crate::error::{Step, UkfError};
use crate::filter::Ukf;
use crate::innovation::Innovation;
use crate::sigma_points::axis_weights;
use crate::transform::{Transformed, mean_of_points};
use crate::update::correct;

/// Scaled sigma points for a state of dimension L with noise of dimension W.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AugmentedPoints<const L: usize, const W: usize> {
    distance: f64,
    mean_weight_of_centre: f64,
    covariance_weight_of_centre: f64,
    weight: f64,
}

impl<const L: usize, const W: usize> AugmentedPoints<L, W> {
    /// The scaled set in L + W dimensions; parameters as for [`crate::SigmaPoints::scaled`].
    ///
    /// # Errors
    /// [`UkfError::InvalidSpread`] if alpha^2 (L + W + kappa) is not positive and finite, or
    /// beta is not finite.
    pub fn scaled(alpha: f64, beta: f64, kappa: f64) -> Result<Self, UkfError> {
        let weights = axis_weights(L + W, alpha, beta, kappa)?;
        Ok(Self {
            distance: weights.distance,
            mean_weight_of_centre: weights.mean_of_centre,
            covariance_weight_of_centre: weights.covariance_of_centre,
            weight: weights.other,
        })
    }
}

/// alpha 1, beta 2, kappa 3 - L - W: spread sqrt(3), as for [`crate::SigmaPoints`].
impl<const L: usize, const W: usize> Default for AugmentedPoints<L, W> {
    fn default() -> Self {
        let dimension = (L + W) as f64;
        Self {
            distance: ComplexField::sqrt(3.0),
            mean_weight_of_centre: 1.0 - dimension / 3.0,
            covariance_weight_of_centre: 3.0 - dimension / 3.0,
            weight: 1.0 / 6.0,
        }
    }
}

/// Pushes the Gaussian (`mean`, `covariance`) with independent noise N(0, `noise`) through
/// `function`(x, w). Both covariances may be semidefinite.
///
/// # Errors
/// As [`crate::unscented_transform`], for either covariance.
pub fn augmented_transform<X, Y, const L: usize, const W: usize, const M: usize>(
    mean: &X,
    covariance: &SMatrix<f64, L, L>,
    noise: &SMatrix<f64, W, W>,
    points: &AugmentedPoints<L, W>,
    mut function: impl FnMut(&X, &SVector<f64, W>) -> Y,
) -> Result<Transformed<Y, L, M>, UkfError>
where
    X: Manifold<L>,
    Y: Manifold<M>,
{
    require_symmetric(noise, Step::SigmaPoints)?;
    let state_root = *semidefinite(covariance, Step::SigmaPoints)?.lower();
    let noise_root = *semidefinite(noise, Step::SigmaPoints)?.lower();
    let c = points.distance;

    let none = SVector::<f64, W>::zeros();
    let centre = function(mean, &none);
    let mut state_at = |k: usize, sign: f64| {
        let tangent = state_root.column(k) * (sign * c);
        function(&mean.retract(&tangent), &none)
    };
    let ahead: [Y; L] = core::array::from_fn(|k| state_at(k, 1.0));
    let behind: [Y; L] = core::array::from_fn(|k| state_at(k, -1.0));
    let mut noise_at = |j: usize, sign: f64| function(mean, &(noise_root.column(j) * (sign * c)));
    let up: [Y; W] = core::array::from_fn(|j| noise_at(j, 1.0));
    let down: [Y; W] = core::array::from_fn(|j| noise_at(j, -1.0));

    // points in the order centre, ahead, behind, up, down
    let at = |index: usize| match index.checked_sub(1) {
        None => (&centre, points.mean_weight_of_centre),
        Some(k) if k < L => (&ahead[k], points.weight),
        Some(k) if k < 2 * L => (&behind[k - L], points.weight),
        Some(k) if k < 2 * L + W => (&up[k - 2 * L], points.weight),
        Some(k) => (&down[k - 2 * L - W], points.weight),
    };
    let count = 2 * (L + W) + 1;
    let center = mean_of_points(&centre, count, at)?;

    let difference = center.local(&centre);
    let mut image_covariance =
        difference * difference.transpose() * points.covariance_weight_of_centre;
    for index in 1..count {
        let difference = center.local(at(index).0);
        image_covariance += difference * difference.transpose() * points.weight;
    }
    let mut cross_covariance = SMatrix::<f64, L, M>::zeros();
    for k in 0..L {
        let slope = center.local(&ahead[k]) - center.local(&behind[k]);
        cross_covariance += state_root.column(k) * slope.transpose() * (c * points.weight);
    }
    Ok(Transformed {
        mean: center,
        covariance: image_covariance,
        cross_covariance,
    })
}

impl<X: Manifold<L>, const L: usize> Ukf<X, L> {
    /// Moves the state by x' = f(x, w), w of covariance `process_noise`.
    ///
    /// # Errors
    /// As [`augmented_transform`] and [`Ukf::predict`]; the state is then unchanged.
    pub fn predict_augmented<const W: usize>(
        &mut self,
        process_noise: &SMatrix<f64, W, W>,
        points: &AugmentedPoints<L, W>,
        function: impl FnMut(&X, &SVector<f64, W>) -> X,
    ) -> Result<(), UkfError> {
        let moved = augmented_transform::<X, X, L, W, L>(
            self.mean(),
            self.covariance(),
            process_noise,
            points,
            function,
        )?;
        self.move_to(moved.mean, &moved.covariance)
    }

    /// Takes in a measurement z = h(x, v), v of covariance `measurement_noise`.
    ///
    /// # Errors
    /// As [`augmented_transform`] and [`Ukf::update`]; the state is then unchanged.
    pub fn update_augmented<Z: Manifold<M>, const V: usize, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &SMatrix<f64, V, V>,
        points: &AugmentedPoints<L, V>,
        function: impl FnMut(&X, &SVector<f64, V>) -> Z,
    ) -> Result<Innovation<M>, UkfError> {
        let predicted = augmented_transform(
            self.mean(),
            self.covariance(),
            measurement_noise,
            points,
            function,
        )?;
        let update = correct(self.mean(), self.covariance(), &predicted, measurement)?;
        Ok(self.take(update))
    }
}
