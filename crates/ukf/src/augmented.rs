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

use estimation_base::generic::CholeskyFactor;
use estimation_base::{Manifold, Real};
use nalgebra::{ComplexField, SMatrix, SVector};

use crate::covariance::covariance_root;
use crate::error::{Step, UkfError};
use crate::filter::Ukf;
use crate::innovation::Innovation;
use crate::joint::{Joint, root_of_squares};
use crate::placed::Placed;
use crate::sigma_points::{SigmaPoints, axis_weights};
use crate::transform::{Transformed, mean_of_points};

/// Scaled sigma points for a state of dimension L with noise of dimension W.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AugmentedPoints<T, const L: usize, const W: usize> {
    /// The points that move the state, as a set of their own: its pairs, not its centre, are in L dimensions what they are here.
    state: SigmaPoints<T, L>,
    distance: T,
    mean_weight_of_centre: T,
    covariance_weight_of_centre: T,
    weight: T,
}

impl<T: Real, const L: usize, const W: usize> AugmentedPoints<T, L, W> {
    /// The scaled set in L + W dimensions; parameters as for [`crate::SigmaPoints::scaled`].
    ///
    /// # Errors
    /// [`UkfError::InvalidSpread`] if alpha^2 (L + W + kappa) is not positive and finite, or
    /// beta is not finite.
    pub fn scaled(alpha: T, beta: T, kappa: T) -> Result<Self, UkfError> {
        let weights = axis_weights(L + W, alpha, beta, kappa)?;
        Ok(Self {
            state: SigmaPoints::at_distance(weights.distance),
            distance: weights.distance,
            mean_weight_of_centre: weights.mean_of_centre,
            covariance_weight_of_centre: weights.covariance_of_centre,
            weight: weights.other,
        })
    }
}

/// alpha 1, beta 2, kappa 3 - L - W: spread sqrt(3), as for [`crate::SigmaPoints`].
impl<T: Real, const L: usize, const W: usize> Default for AugmentedPoints<T, L, W> {
    fn default() -> Self {
        let dimension = T::of((L + W) as f64);
        Self {
            state: SigmaPoints::default(),
            distance: ComplexField::sqrt(T::of(3.0)),
            mean_weight_of_centre: T::one() - dimension / T::of(3.0),
            covariance_weight_of_centre: T::of(3.0) - dimension / T::of(3.0),
            weight: T::of(1.0 / 6.0),
        }
    }
}

/// Pushes the Gaussian (`mean`, `covariance`) with independent noise N(0, `noise`) through
/// `function`(x, w). Both covariances may be semidefinite.
///
/// # Errors
/// As [`crate::unscented_transform`], for either covariance.
pub fn augmented_transform<T: Real, X, Y, const L: usize, const W: usize, const M: usize>(
    mean: &X,
    covariance: &SMatrix<T, L, L>,
    noise: &SMatrix<T, W, W>,
    points: &AugmentedPoints<T, L, W>,
    mut function: impl FnMut(&X, &SVector<T, W>) -> Y,
) -> Result<Transformed<T, Y, L, M>, UkfError>
where
    X: Manifold<L, T>,
    Y: Manifold<M, T>,
{
    let state = covariance_root(covariance, Step::SigmaPoints)?;
    let noise = covariance_root(noise, Step::SigmaPoints)?;
    let images = Images::new(mean, &state, &noise, points, &mut function)?;
    let mut image_covariance = SMatrix::<T, M, M>::zeros();
    let mut cross_covariance = SMatrix::<T, L, M>::zeros();
    for index in 0..images.count() {
        let (z, x, weight) = images.deviation(index);
        image_covariance.ger(weight, &z, &z, T::one());
        cross_covariance.ger(weight, &x, &z, T::one());
    }
    Ok(Transformed {
        mean: images.mean,
        covariance: image_covariance,
        cross_covariance,
    })
}

/// The values of a function at the augmented points, and their mean.
struct Images<'a, T, Y, const L: usize, const W: usize, const M: usize> {
    state: Placed<'a, T, L>,
    points: AugmentedPoints<T, L, W>,
    /// Share of the centre that the state's points took when they moved in.
    shift: T,
    mean: Y,
    centre: Y,
    ahead: [Y; L],
    behind: [Y; L],
    up: [Y; W],
    down: [Y; W],
}

impl<'a, T: Real, Y: Manifold<M, T>, const L: usize, const W: usize, const M: usize>
    Images<'a, T, Y, L, W, M>
{
    fn new<X: Manifold<L, T>>(
        mean: &X,
        state_root: &'a CholeskyFactor<T, L>,
        noise_root: &CholeskyFactor<T, W>,
        points: &'a AugmentedPoints<T, L, W>,
        function: &mut impl FnMut(&X, &SVector<T, W>) -> Y,
    ) -> Result<Self, UkfError> {
        let state = Placed::new(mean, state_root.lower(), &points.state)?;
        let none = SVector::<T, W>::zeros();
        let centre = function(mean, &none);
        let mut state_at = |index: usize| function(&mean.retract(&state.tangent(index)), &none);
        let ahead: [Y; L] = core::array::from_fn(|k| state_at(k + 1));
        let behind: [Y; L] = core::array::from_fn(|k| state_at(k + 1 + L));
        let c = points.distance;
        let mut noise_at =
            |j: usize, sign: T| function(mean, &(noise_root.lower().column(j) * (sign * c)));
        let up: [Y; W] = core::array::from_fn(|j| noise_at(j, T::one()));
        let down: [Y; W] = core::array::from_fn(|j| noise_at(j, -T::one()));
        let shift = state.mean_weight(0) - points.state.mean_weight(0);
        let mut images = Self {
            state,
            points: *points,
            shift,
            mean: centre.clone(),
            centre,
            ahead,
            behind,
            up,
            down,
        };
        images.mean = mean_of_points(&images.centre, images.count(), |index| {
            let weight = if index == 0 {
                points.mean_weight_of_centre + shift
            } else {
                images.weight(index)
            };
            (images.at(index), weight)
        })?;
        Ok(images)
    }

    const fn count(&self) -> usize {
        2 * (L + W) + 1
    }

    /// Points in the order centre, ahead, behind, up, down.
    fn at(&self, index: usize) -> &Y {
        match index.checked_sub(1) {
            None => &self.centre,
            Some(k) if k < L => &self.ahead[k],
            Some(k) if k < 2 * L => &self.behind[k - L],
            Some(k) if k < 2 * L + W => &self.up[k - 2 * L],
            Some(k) => &self.down[k - 2 * L - W],
        }
    }

    fn weight(&self, index: usize) -> T {
        if index == 0 {
            self.points.covariance_weight_of_centre + self.shift
        } else if index <= 2 * L {
            self.state.covariance_weight(index)
        } else {
            self.points.weight
        }
    }

    /// Deviation of value and state at point `index`, and the weight in covariances.
    fn deviation(&self, index: usize) -> (SVector<T, M>, SVector<T, L>, T) {
        let x = if index <= 2 * L {
            self.state.tangent(index)
        } else {
            SVector::zeros()
        };
        (self.mean.local(self.at(index)), x, self.weight(index))
    }
}

impl<T: Real, X: Manifold<L, T>, const L: usize> Ukf<T, X, L> {
    /// Moves the state by x' = f(x, w), w of covariance `process_noise`.
    ///
    /// # Errors
    /// As [`augmented_transform`] and [`Ukf::predict`]; the state is then unchanged.
    pub fn predict_augmented<const W: usize>(
        &mut self,
        process_noise: &SMatrix<T, W, W>,
        points: &AugmentedPoints<T, L, W>,
        function: impl FnMut(&X, &SVector<T, W>) -> X,
    ) -> Result<(), UkfError> {
        let noise = covariance_root(process_noise, Step::SigmaPoints)?;
        let mut function = function;
        let images: Images<'_, T, X, L, W, L> =
            Images::new(self.mean(), self.root(), &noise, points, &mut function)?;
        let root = root_of_squares(
            &SMatrix::<T, L, 1>::zeros(),
            images.count(),
            |index| {
                let (deviation, _, weight) = images.deviation(index);
                (deviation, weight)
            },
            Step::Prediction,
        )?;
        let mean = images.mean;
        self.set_state(mean, root);
        Ok(())
    }

    /// Takes in a measurement z = h(x, v), v of covariance `measurement_noise`.
    ///
    /// # Errors
    /// As [`augmented_transform`] and [`Ukf::update`]; the state is then unchanged.
    pub fn update_augmented<Z: Manifold<M, T>, const V: usize, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &SMatrix<T, V, V>,
        points: &AugmentedPoints<T, L, V>,
        function: impl FnMut(&X, &SVector<T, V>) -> Z,
    ) -> Result<Innovation<T, M>, UkfError> {
        let noise = covariance_root(measurement_noise, Step::SigmaPoints)?;
        let mut function = function;
        let images: Images<'_, T, Z, L, V, M> =
            Images::new(self.mean(), self.root(), &noise, points, &mut function)?;
        let joint = Joint::of_points(&SMatrix::<T, M, 1>::zeros(), images.count(), |index| {
            images.deviation(index)
        })?;
        let corrected = joint.given(images.mean.local(measurement))?;
        self.set_state(self.mean().retract(&corrected.correction), corrected.root);
        Ok(corrected.innovation)
    }
}
