//! A Gaussian that is factorised once and pushed through many functions by sigma points.
//!
//! The transform is that of crate `ukf` with its default points. Sums written out for these points
//! alone were measured 1.4 times as fast for a proposal with ten landmarks, 1.3 times for the update of
//! a landmark and 2.2 times for the motion of one command (0.4 us beside 0.9 us, of a proposal's 17 us).

use crate::covariance::semidefinite;
use crate::error::RangeBearingError;
use crate::models::Gaussian;
use estimation_base::CholeskyFactor;
use nalgebra::{SMatrix, SVector};
use ukf::{SigmaPoints, Transformed, unscented_transform};

/// The mean of a Gaussian and a square root of its covariance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread<const L: usize> {
    pub(crate) mean: SVector<f64, L>,
    pub(crate) root: CholeskyFactor<L>,
}

impl<const L: usize> Spread<L> {
    /// The spread of a Gaussian whose covariance may be semidefinite; an error names it by `what`.
    pub(crate) fn of(
        gaussian: &Gaussian<L>,
        what: &'static str,
    ) -> Result<Self, RangeBearingError> {
        if !gaussian.mean.iter().all(|entry| entry.is_finite()) {
            return Err(RangeBearingError::NotFinite { what });
        }
        Ok(Self {
            mean: gaussian.mean,
            root: semidefinite(&gaussian.covariance, what)?,
        })
    }

    /// The image of m + L u for a standard normal u, with the covariance of u and the image. That
    /// covariance is L^-1 times the one of the argument, and defined where L is singular. `None` if the
    /// function has no value at some point.
    ///
    /// # Errors
    /// [`RangeBearingError::NotFinite`] for a value that is not finite.
    pub(crate) fn through<const M: usize>(
        &self,
        function: impl Fn(&SVector<f64, L>) -> Option<SVector<f64, M>>,
    ) -> Result<Option<Transformed<SVector<f64, M>, L, M>>, RangeBearingError> {
        let mut missing = false;
        let at = |u: &SVector<f64, L>| {
            function(&(self.mean + self.root.lower() * u)).unwrap_or_else(|| {
                missing = true;
                SVector::from_element(f64::NAN)
            })
        };
        let unit = SMatrix::identity();
        match unscented_transform(&SVector::zeros(), &unit, &SigmaPoints::default(), at) {
            Ok(image) => Ok(Some(image)),
            Err(_) if missing => Ok(None),
            Err(_) => Err(RangeBearingError::NotFinite {
                what: "a function of sigma points",
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector1, Vector2};

    /// x y has mean 2 * 3 + 0.5, and covariance P (3, 2) with (x, y): the slopes at the centre, without third moments.
    #[test]
    fn the_covariance_is_with_the_whitened_argument() {
        let gaussian = Gaussian {
            mean: Vector2::new(2.0, 3.0),
            covariance: Matrix2::new(2.0, 0.5, 0.5, 1.0),
        };
        let spread = Spread::of(&gaussian, "p").unwrap();
        let product = |x: &Vector2<f64>| Some(Vector1::new(x.x * x.y));
        let image = spread.through(product).unwrap().unwrap();
        // a dozen operations on numbers of order ten
        assert!((image.mean[0] - 6.5).abs() < 1e-13);
        let cross = spread.root.lower() * image.cross_covariance;
        assert!((cross - gaussian.covariance * Vector2::new(3.0, 2.0)).amax() < 1e-13);
        assert!((cross - image.cross_covariance).amax() > 0.1);
    }

    #[test]
    fn no_value_is_none_and_nan_is_an_error() {
        let unit = Gaussian {
            mean: Vector1::new(0.0),
            covariance: nalgebra::Matrix1::new(1.0),
        };
        let spread = Spread::of(&unit, "p").unwrap();
        assert_eq!(spread.through(|x| (x[0] < 1.0).then_some(*x)), Ok(None));
        let root = |x: &Vector1<f64>| Some(x.map(f64::sqrt));
        assert!(matches!(
            spread.through(root),
            Err(RangeBearingError::NotFinite { .. })
        ));
        assert!(
            spread
                .through(|x| (x[0] < 2.0).then_some(*x))
                .unwrap()
                .is_some()
        );
    }
}
