//! The unscented transform: mean and covariance of y = f(x) for a Gaussian x (Eq. 3-6).
//!
//! 1. sigma points x_i = m + S u_i with P = S S^T ([`crate::SigmaPoints`]), each checked to be where its tangent says and
//!    moved in where the space folds (`placed`);
//! 2. y_i = f(x_i);
//! 3. mean of the y_i, covariance sum W_c (y_i - y)(y_i - y)^T, cross covariance
//!    sum W_c (x_i - m)(y_i - y)^T. Noise is the caller's to add.
//!
//! On a manifold there is no sum of points: the mean is found in the tangent at the image of the
//! centre, y = y_0 + sum W_m (y_i - y_0), and refined from there until the tangents at
//! the mean cancel. For vectors and angles the first step is already the answer.
//!
//! Exact for linear f; the mean is exact for quadratic f. Bad where f folds within the
//! spread of the points (bearing to something nearer than its own uncertainty). Cost: one
//! Cholesky factorisation and one call of f per point.

use core::marker::PhantomData;

use estimation_base::{Manifold, Real};
use nalgebra::{SMatrix, SVector};

use crate::covariance::{finite, semidefinite};
use crate::error::{Step, UkfError};
use crate::placed::Placed;
use crate::sigma_points::SigmaPoints;

/// Refinements of a mean on a manifold; each squares the error, so the cap is never met.
const MEAN_ITERATIONS: usize = 10;

/// The outcome of the transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transformed<T, Y, const L: usize, const M: usize> {
    /// Mean of f(x).
    pub mean: Y,
    /// Covariance of f(x) in the tangent at the mean, M x M, without noise.
    pub covariance: SMatrix<T, M, M>,
    /// Covariance of x with f(x), L x M.
    pub cross_covariance: SMatrix<T, L, M>,
}

/// Pushes the Gaussian (`mean`, `covariance`) through `function`.
///
/// A function that has no value at some point returns NaN there, which ends the transform.
///
/// # Errors
/// [`UkfError::Covariance`] for an indefinite covariance (a semidefinite one is accepted) or one that is not finite,
/// [`UkfError::TooWide`] for a heading beyond about 4.9 rad (default points), [`UkfError::NotFinite`] for NaN or infinity in the mean or a value.
///
/// ```
/// use ukf::nalgebra::{Matrix2, Vector1, Vector2};
/// use ukf::{SigmaPoints, unscented_transform};
///
/// // The mean of a square is the square of the mean and the variance: the transform is exact there.
/// let (mean, covariance) = (Vector2::new(3.0, 0.0), Matrix2::new(0.5, 0.0, 0.0, 1.0));
/// let squared = unscented_transform(&mean, &covariance, &SigmaPoints::default(), |x| Vector1::new(x[0] * x[0]))?;
/// assert!((squared.mean[0] - 9.5).abs() < 1e-12);
/// # Ok::<(), ukf::UkfError>(())
/// ```
pub fn unscented_transform<T: Real, X, Y, const L: usize, const M: usize>(
    mean: &X,
    covariance: &SMatrix<T, L, L>,
    set: &SigmaPoints<T, L>,
    mut function: impl FnMut(&X) -> Y,
) -> Result<Transformed<T, Y, L, M>, UkfError>
where
    X: Manifold<L, T>,
    Y: Manifold<M, T>,
{
    let root = semidefinite(covariance, Step::SigmaPoints)?;
    let points = Placed::new(mean, root.lower(), set)?;
    let images = Images::new(mean, &points, &mut function)?;
    let mut cross_covariance = SMatrix::<T, L, M>::zeros();
    let mut image_covariance = SMatrix::<T, M, M>::zeros();
    for index in 0..points.count() {
        // in place: no matrix for each point
        let difference = images.difference(index);
        let weighted = difference * points.covariance_weight(index);
        cross_covariance.ger(T::one(), &points.tangent(index), &weighted, T::one());
        image_covariance.ger(T::one(), &difference, &weighted, T::one());
    }
    Ok(Transformed {
        mean: images.mean,
        covariance: image_covariance,
        cross_covariance,
    })
}

/// The values of a function at the sigma points, and their mean.
pub(crate) struct Images<T, Y, const L: usize, const M: usize> {
    /// The mean of the values.
    pub(crate) mean: Y,
    centre: Y,
    // point 0, then L and L more: every set has at most 2 L + 1 points
    first: [Y; L],
    second: [Y; L],
    scalar: PhantomData<T>,
}

impl<T: Real, Y: Manifold<M, T>, const L: usize, const M: usize> Images<T, Y, L, M> {
    /// The values at the points around `mean`.
    pub(crate) fn new<X: Manifold<L, T>>(
        mean: &X,
        points: &Placed<'_, T, L>,
        function: &mut impl FnMut(&X) -> Y,
    ) -> Result<Self, UkfError> {
        let centre = function(mean);
        let mut image = |index: usize| {
            if index < points.count() {
                function(&mean.retract(&points.tangent(index)))
            } else {
                centre.clone()
            }
        };
        let first: [Y; L] = core::array::from_fn(|k| image(k + 1));
        let second: [Y; L] = core::array::from_fn(|k| image(k + 1 + L));
        let mut images = Self {
            mean: centre.clone(),
            centre,
            first,
            second,
            scalar: PhantomData,
        };
        images.mean = mean_of_points(&images.centre, points.count(), |index| {
            (images.at(index), points.mean_weight(index))
        })?;
        Ok(images)
    }

    /// From the mean of the values to the value at point `index`.
    pub(crate) fn difference(&self, index: usize) -> SVector<T, M> {
        self.mean.local(self.at(index))
    }

    fn at(&self, index: usize) -> &Y {
        match index {
            0 => &self.centre,
            index if index <= L => &self.first[index - 1],
            index => &self.second[index - 1 - L],
        }
    }
}

/// The weighted mean of `count` points on a manifold, from `start`.
pub(crate) fn mean_of_points<'a, T: Real, Y: Manifold<M, T> + 'a, const M: usize>(
    start: &Y,
    count: usize,
    point: impl Fn(usize) -> (&'a Y, T),
) -> Result<Y, UkfError> {
    let mut center = start.clone();
    for _ in 0..MEAN_ITERATIONS {
        let mut offset = SVector::<T, M>::zeros();
        let mut spread = T::zero();
        for index in 0..count {
            let (image, weight) = point(index);
            let difference = center.local(image);
            spread += difference.norm_squared();
            offset += difference * weight;
        }
        let offset = finite(offset, Step::Function, "the function's value")?;
        center = center.retract(&offset);
        if offset.norm_squared() <= T::EPSILON * T::EPSILON * spread {
            break;
        }
    }
    Ok(center)
}
