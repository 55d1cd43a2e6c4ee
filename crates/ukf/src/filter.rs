//! The unscented Kalman filter with additive noise (Eq. 3-9 in their right form).
//!
//! - predict: x^ = UT mean of f, P^ = UT covariance of f + Q;
//! - update: sigma points are drawn afresh from P^, so that they spread with the
//!   process noise; S = P_zz + R; see [`crate::unscented_correction`].
//!
//! Using the propagated points again in the update, as is sometimes done to save a factorisation,
//! leaves Q out of S and out of the gain.
//!
//! The filter takes and shows covariances, and carries the factor of its own from step to step (`joint`), so that it stays
//! positive definite: a prior of variance 1e6 measured with 1e-12 leaves 1e-12, where P - K S K^T leaves rounding.
//! [`crate::SquareRootUkf`] is the same filter for noise that is given by its factors.
//!
//! Both steps return an error and keep the state for NaN, infinity, noise that is no covariance, or a centre of negative
//! weight that takes more than the other points hold.

use estimation_base::generic::CholeskyFactor;
use estimation_base::{Manifold, Real, symmetric};
use nalgebra::SMatrix;

use crate::covariance::{covariance_root, finite};
use crate::error::{Step, UkfError};
use crate::innovation::Innovation;
use crate::joint::root_of_squares;
use crate::placed::Placed;
use crate::sigma_points::SigmaPoints;
use crate::transform::Images;
use crate::update::correct;

/// A Gaussian state and its sigma points.
///
/// ```
/// use nalgebra::{Matrix2, Vector1, Vector2, Matrix1};
/// use ukf::{SigmaPoints, Ukf, chi_square_quantile};
///
/// # fn main() -> Result<(), ukf::UkfError> {
/// // Position and speed along a line; the distance to a mast 10 m beside its origin is measured.
/// let mut filter = Ukf::new(Vector2::new(0.0, 1.0), Matrix2::identity(), SigmaPoints::default())?;
/// filter.predict(&(Matrix2::identity() * 0.01), |x| Vector2::new(x[0] + x[1], x[1]))?;
/// let distance = Vector1::new(10.1);
/// let told = filter.update(&distance, &Matrix1::new(0.01), |x| Vector1::new(x[0].hypot(10.0)))?;
/// assert!(told.nis < chi_square_quantile(1.0, 0.99)?);
/// assert!(filter.covariance()[(0, 0)] < 2.0);
/// # Ok(())
/// # }
/// ```
///
/// ```
/// use nalgebra::Matrix1;
/// use std::f64::consts::PI;
/// use ukf::{Angle, SigmaPoints, Ukf};
///
/// # fn main() -> Result<(), ukf::UkfError> {
/// let mut heading = Ukf::new(Angle::new(-2.0), Matrix1::new(PI * PI), SigmaPoints::default())?;
/// heading.update(&Angle::new(0.5), &Matrix1::new(0.01), |x| *x)?;
/// assert!((heading.mean().radians() - 0.5).abs() < 0.003);
/// assert!((heading.covariance()[0].sqrt() - 0.1).abs() < 1e-3);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ukf<T, X, const L: usize> {
    mean: X,
    /// L L^T, as shown.
    covariance: SMatrix<T, L, L>,
    /// L, as carried on.
    root: CholeskyFactor<T, L>,
    set: SigmaPoints<T, L>,
}

impl<T: Real, X: Manifold<L, T>, const L: usize> Ukf<T, X, L> {
    /// A filter starting at (`mean`, `covariance`); rounding is symmetrised away.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`] for the mean, [`UkfError::Covariance`] for a matrix that is no covariance.
    pub fn new(
        mean: X,
        covariance: SMatrix<T, L, L>,
        set: SigmaPoints<T, L>,
    ) -> Result<Self, UkfError> {
        let root = covariance_root(&covariance, Step::SigmaPoints)?;
        finite(mean.local(&mean), Step::SigmaPoints, "the mean")?;
        Ok(Self {
            mean,
            covariance: symmetric(&covariance),
            root,
            set,
        })
    }

    /// The mean.
    pub const fn mean(&self) -> &X {
        &self.mean
    }

    /// The covariance, symmetric, in the tangent at the mean.
    ///
    /// The filter goes on from its root. As a matrix, a direction known some 1e15 times as well as another is rounding, and
    /// [`Ukf::new`] may refuse it.
    pub const fn covariance(&self) -> &SMatrix<T, L, L> {
        &self.covariance
    }

    /// Moves the state by x' = f(x) + noise of covariance `process_noise` (in the tangent at the
    /// new mean).
    ///
    /// # Errors
    /// As [`crate::unscented_transform`]; [`UkfError::Covariance`] for a process noise that is not positive semidefinite,
    /// or if the centre's negative weight takes more than the other points hold. The state is then unchanged.
    pub fn predict(
        &mut self,
        process_noise: &SMatrix<T, L, L>,
        mut function: impl FnMut(&X) -> X,
    ) -> Result<(), UkfError> {
        let noise = covariance_root(process_noise, Step::Prediction)?;
        let points = Placed::new(&self.mean, self.root.lower(), &self.set)?;
        let images = Images::new(&self.mean, &points, &mut function)?;
        let root = root_of_squares(
            noise.lower(),
            points.count(),
            |index| (images.difference(index), points.covariance_weight(index)),
            Step::Prediction,
        )?;
        self.set_state(images.mean, root);
        Ok(())
    }

    /// Takes in a measurement z = h(x) + noise of covariance `measurement_noise`.
    ///
    /// # Errors
    /// As [`crate::unscented_correction`]; the state is then unchanged.
    pub fn update<Z: Manifold<M, T>, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &SMatrix<T, M, M>,
        mut function: impl FnMut(&X) -> Z,
    ) -> Result<Innovation<T, M>, UkfError> {
        let noise = covariance_root(measurement_noise, Step::Innovation)?;
        let corrected = correct(
            &self.mean,
            &self.root,
            &self.set,
            measurement,
            &noise,
            &mut function,
        )?;
        self.set_state(self.mean.retract(&corrected.correction), corrected.root);
        Ok(corrected.innovation)
    }

    /// The sigma points.
    pub const fn sigma_points(&self) -> &SigmaPoints<T, L> {
        &self.set
    }

    /// The factor of the covariance.
    pub(crate) const fn root(&self) -> &CholeskyFactor<T, L> {
        &self.root
    }

    /// Both are known to be finite.
    pub(crate) fn set_state(&mut self, mean: X, root: CholeskyFactor<T, L>) {
        self.mean = mean;
        self.covariance = root.product();
        self.root = root;
    }
}
