//! Sigma points: a few points with the mean and covariance of a Gaussian.
//!
//! For a mean m and a square root P = S S^T the points are m + S u_i with fixed unit offsets u_i and
//! weights W_m (mean), W_c (covariance) that satisfy
//!
//! ```text
//! sum W_m = 1,   sum W u_i = 0,   sum W u_i u_i^T = I
//! ```
//!
//! Three sets are offered:
//!
//! - **scaled** (van der Merwe 2004; Eq. 3-5 of the paper): centre and +-sqrt(L + lambda) e_k,
//!   lambda = alpha^2 (L + kappa) - L, W_m0 = lambda/(L + lambda), W_c0 = W_m0 + 1 - alpha^2 + beta,
//!   all others 1/(2 (L + lambda));
//! - **Julier** (Julier and Uhlmann 1997): the same with alpha = 1, beta = 0;
//! - **spherical simplex** (Julier 2003): L + 2 points instead of 2 L + 1, all but the centre at the
//!   same distance and of the same weight; its third moments do not vanish.
//!
//! The paper prints alpha = 0, for which L + lambda = 0: all points fall on the mean with infinite
//! weights. Such parameters are an error at construction. A negative weight of the centre is allowed
//! (kappa = 3 - L has one for L > 3 in means, L > 9 in covariances): moments stay right to their order, but a
//! covariance may then come out indefinite for a strongly curved function, which the filters
//! report as an error and never return. A very small alpha (1e-3 is often
//! seen) makes W_0 about -1e6 and costs six digits; the default here is alpha = 1.

use estimation_base::Real;
use nalgebra::{ComplexField, SMatrix, SVector};

use crate::error::UkfError;

/// Unit offsets and weights of a set of sigma points in L dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaPoints<T, const L: usize> {
    kind: Kind<T>,
    mean_weight_of_centre: T,
    covariance_weight_of_centre: T,
    weight: T,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind<T> {
    /// +- this distance along each axis.
    Axes(T),
    /// L + 1 corners around the centre, for corner weight 1.
    Simplex,
}

impl<T: Real, const L: usize> SigmaPoints<T, L> {
    /// The scaled set. Usual: `alpha` in (0, 1], `beta` 2 for Gaussians, `kappa` 0 or 3 - L.
    ///
    /// # Errors
    /// [`UkfError::InvalidSpread`] if L + lambda = alpha^2 (L + kappa) is not positive and finite,
    /// or beta is not finite.
    pub fn scaled(alpha: T, beta: T, kappa: T) -> Result<Self, UkfError> {
        let weights = axis_weights(L, alpha, beta, kappa)?;
        Ok(Self {
            kind: Kind::Axes(weights.distance),
            mean_weight_of_centre: weights.mean_of_centre,
            covariance_weight_of_centre: weights.covariance_of_centre,
            weight: weights.other,
        })
    }

    /// Julier's set: the scaled one with alpha = 1, beta = 0. With `kappa` = 3 - L the fourth
    /// moments along the axes are those of a Gaussian, but the centre's weight is negative for L > 3.
    ///
    /// # Errors
    /// [`UkfError::InvalidSpread`] if L + kappa is not positive and finite.
    pub fn julier(kappa: T) -> Result<Self, UkfError> {
        Self::scaled(T::one(), T::zero(), kappa)
    }

    /// The reading of the paper that is not singular: alpha = 1, beta = 0, gamma (its kappa) = 2.
    #[must_use]
    pub fn paper() -> Self {
        Self::axes(T::of(L as f64 + 2.0), T::zero())
    }

    /// The spherical simplex with the given weight of the centre.
    ///
    /// # Errors
    /// [`UkfError::InvalidSimplex`] for a weight outside [0, 1) or L = 0.
    pub fn simplex(centre_weight: T) -> Result<Self, UkfError> {
        if L == 0 || !(T::zero()..T::one()).contains(&centre_weight) {
            return Err(UkfError::InvalidSimplex {
                dimension: L,
                value: centre_weight.into(),
            });
        }
        Ok(Self {
            kind: Kind::Simplex,
            mean_weight_of_centre: centre_weight,
            covariance_weight_of_centre: centre_weight,
            weight: (T::one() - centre_weight) / T::of(L as f64 + 1.0),
        })
    }

    /// Number of points: 2 L + 1, or L + 2 for the simplex. Point 0 is the centre.
    #[must_use]
    pub const fn count(&self) -> usize {
        match self.kind {
            Kind::Axes(_) => 2 * L + 1,
            Kind::Simplex => L + 2,
        }
    }

    /// Weight of point `index` in means.
    #[must_use]
    pub fn mean_weight(&self, index: usize) -> T {
        if index == 0 {
            self.mean_weight_of_centre
        } else {
            self.weight
        }
    }

    /// Weight of point `index` in covariances.
    #[must_use]
    pub fn covariance_weight(&self, index: usize) -> T {
        if index == 0 {
            self.covariance_weight_of_centre
        } else {
            self.weight
        }
    }

    /// Unit offset u of point `index`; zero for the centre and beyond the last point.
    #[must_use]
    pub fn offset(&self, index: usize) -> SVector<T, L> {
        let mut offset = SVector::zeros();
        if index == 0 || index >= self.count() {
            return offset;
        }
        match self.kind {
            Kind::Axes(distance) if index <= L => offset[index - 1] = distance,
            Kind::Axes(distance) => offset[index - 1 - L] = -distance,
            Kind::Simplex => {
                // row j (from 1) of Julier's recursion: corners up to j share -1/sqrt(j (j + 1) w),
                // corner j + 1 has j times that with the other sign, later corners 0
                for row in 0..L {
                    let j = T::of(row as f64 + 1.0);
                    let share = T::one() / ComplexField::sqrt(j * (j + T::one()) * self.weight);
                    if index <= row + 1 {
                        offset[row] = -share;
                    } else if index == row + 2 {
                        offset[row] = j * share;
                    }
                }
            }
        }
        offset
    }

    /// S u of point `index`: a column of the root for the sets along axes, without the product.
    pub(crate) fn tangent(&self, root: &SMatrix<T, L, L>, index: usize) -> SVector<T, L> {
        match self.kind {
            Kind::Axes(_) if index == 0 || index > 2 * L => SVector::zeros(),
            Kind::Axes(distance) if index <= L => root.column(index - 1) * distance,
            Kind::Axes(distance) => root.column(index - 1 - L) * -distance,
            Kind::Simplex => root * self.offset(index),
        }
    }

    /// Pairs at this distance along each axis.
    pub(crate) fn at_distance(distance: T) -> Self {
        Self {
            kind: Kind::Axes(distance),
            ..Self::axes(distance * distance, T::zero())
        }
    }

    /// The axis that point `index` lies along, from 0; 0 for all points of a simplex, which move together.
    pub(crate) const fn axis(&self, index: usize) -> usize {
        match self.kind {
            Kind::Axes(_) if index > 0 => (index - 1) % L,
            _ => 0,
        }
    }

    /// Whether the points lie along the axes, in pairs.
    pub(crate) const fn has_axes(&self) -> bool {
        matches!(self.kind, Kind::Axes(_))
    }

    fn axes(spread: T, extra_covariance_weight: T) -> Self {
        let mean_weight_of_centre = (spread - T::of(L as f64)) / spread;
        Self {
            kind: Kind::Axes(ComplexField::sqrt(spread)),
            mean_weight_of_centre,
            covariance_weight_of_centre: mean_weight_of_centre + extra_covariance_weight,
            weight: T::of(0.5) / spread,
        }
    }
}

/// The scaled set's numbers for any dimension.
pub(crate) struct AxisWeights<T> {
    pub(crate) distance: T,
    pub(crate) mean_of_centre: T,
    pub(crate) covariance_of_centre: T,
    pub(crate) other: T,
}

/// See [`SigmaPoints::scaled`].
pub(crate) fn axis_weights<T: Real>(
    dimension: usize,
    alpha: T,
    beta: T,
    kappa: T,
) -> Result<AxisWeights<T>, UkfError> {
    let spread = alpha * alpha * (T::of(dimension as f64) + kappa);
    let valid =
        spread > T::zero() && (T::one() / spread).is_finite() && (spread + beta).is_finite();
    if !valid {
        return Err(UkfError::InvalidSpread {
            value: if beta.is_finite() { spread } else { beta }.into(),
        });
    }
    let mean_of_centre = (spread - T::of(dimension as f64)) / spread;
    Ok(AxisWeights {
        distance: ComplexField::sqrt(spread),
        mean_of_centre,
        covariance_of_centre: mean_of_centre + (T::one() - alpha * alpha + beta),
        other: T::of(0.5) / spread,
    })
}

/// alpha 1, beta 2, kappa 3 - L: spread sqrt(3) in every dimension, no negative weight in
/// covariances for L <= 9 and none in means for L <= 3.
impl<T: Real, const L: usize> Default for SigmaPoints<T, L> {
    fn default() -> Self {
        Self::axes(T::of(3.0), T::of(2.0))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    fn check_moments<const L: usize>(set: &SigmaPoints<f64, L>, count: usize) {
        assert_eq!(set.count(), count);
        let (mut total, mut mean) = (0.0, SVector::<f64, L>::zeros());
        let mut covariance = SMatrix::<f64, L, L>::zeros();
        for i in 0..set.count() {
            total += set.mean_weight(i);
            mean += set.offset(i) * set.mean_weight(i);
            covariance += set.offset(i) * set.offset(i).transpose() * set.covariance_weight(i);
        }
        assert!((total - 1.0).abs() < 1e-14);
        assert!(mean.amax() < 1e-14);
        assert!((covariance - SMatrix::<f64, L, L>::identity()).amax() < 1e-14);
        assert_eq!(set.offset(count), SVector::<f64, L>::zeros());
    }

    fn check_all<const L: usize>() {
        check_moments(&SigmaPoints::<f64, L>::default(), 2 * L + 1);
        check_moments(&SigmaPoints::<f64, L>::paper(), 2 * L + 1);
        check_moments(
            &SigmaPoints::<f64, L>::scaled(0.5, 2.0, 1.0).unwrap(),
            2 * L + 1,
        );
        check_moments(&SigmaPoints::<f64, L>::julier(2.0).unwrap(), 2 * L + 1);
        check_moments(&SigmaPoints::<f64, L>::simplex(0.0).unwrap(), L + 2);
        check_moments(&SigmaPoints::<f64, L>::simplex(0.4).unwrap(), L + 2);
    }

    #[test]
    fn every_set_has_the_moments_of_the_unit_gaussian() {
        check_all::<1>();
        check_all::<2>();
        check_all::<3>();
        check_all::<6>();
    }

    #[test]
    fn the_printed_alpha_of_zero_is_an_error() {
        assert_eq!(
            SigmaPoints::<f64, 3>::scaled(0.0, 0.0, 2.0),
            Err(UkfError::InvalidSpread { value: 0.0 })
        );
        assert!(SigmaPoints::<f64, 3>::julier(-3.0).is_err());
        assert!(SigmaPoints::<f64, 3>::julier(-4.0).is_err());
        assert!(SigmaPoints::<f64, 3>::scaled(f64::NAN, 2.0, 0.0).is_err());
        assert!(SigmaPoints::<f64, 3>::scaled(1.0, f64::INFINITY, 0.0).is_err());
        assert!(SigmaPoints::<f64, 3>::scaled(1e-200, 2.0, 0.0).is_err());
        for weight in [-0.1, 1.0, f64::NAN] {
            assert!(matches!(
                SigmaPoints::<f64, 3>::simplex(weight),
                Err(UkfError::InvalidSimplex { dimension: 3, .. })
            ));
        }
        assert!(SigmaPoints::<f64, 0>::simplex(0.5).is_err());
    }

    /// The paper's weights for L = 3, written out: lambda = 2.
    #[test]
    fn the_weights_of_the_paper() {
        let set = SigmaPoints::<f64, 3>::paper();
        assert_eq!(set, SigmaPoints::<f64, 3>::scaled(1.0, 0.0, 2.0).unwrap());
        assert!((set.mean_weight(0) - 0.4).abs() < 1e-15);
        assert!((set.covariance_weight(0) - 0.4).abs() < 1e-15);
        assert!((set.mean_weight(4) - 0.1).abs() < 1e-15);
        assert!((set.offset(5)[1] + 5.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(
            SigmaPoints::<f64, 3>::default(),
            SigmaPoints::<f64, 3>::scaled(1.0, 2.0, 0.0).unwrap()
        );
    }
}
