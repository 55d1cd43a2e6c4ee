//! The transform of crate `ukf` with its default points, about a factor that many functions share.
//!
//! Sums written out for these points alone were measured 1.4 times as fast for a proposal with ten landmarks, 1.3
//! for the update of a landmark, 2.2 for the motion of one command (0.4 us beside 0.9 us, of a proposal's 17 us).

use crate::error::RbpfError;
use crate::factor::Factor;
use crate::models::Gaussian;
use nalgebra::{SMatrix, SVector};
use ukf::{SigmaPoints, Transformed, unscented_transform};

/// A Gaussian, mean and square root of the covariance: factorised once, pushed through many functions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread<const L: usize> {
    pub(crate) mean: SVector<f64, L>,
    pub(crate) root: Factor<L>,
}

impl<const L: usize> Spread<L> {
    /// Of a Gaussian whose covariance may be semidefinite; an error names `what` it is.
    pub(crate) fn of(gaussian: &Gaussian<L>, what: &'static str) -> Result<Self, RbpfError> {
        if !gaussian.mean.iter().all(|entry| entry.is_finite()) {
            return Err(RbpfError::NotFinite { what });
        }
        Ok(Self {
            mean: gaussian.mean,
            root: Factor::semidefinite(&gaussian.covariance, what)?,
        })
    }

    /// The image of m + L u for a standard normal u, with the covariance of u and the image: L^-1 times
    /// that of the argument, and defined where L is singular. `None` if the function has no value at some point.
    ///
    /// # Errors
    /// [`RbpfError::NotFinite`] for a value that is not finite.
    pub(crate) fn through<const M: usize>(
        &self,
        function: impl Fn(&SVector<f64, L>) -> Option<SVector<f64, M>>,
    ) -> Result<Option<Transformed<SVector<f64, M>, L, M>>, RbpfError> {
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
            Err(_) => Err(RbpfError::NotFinite {
                what: "a function of sigma points",
            }),
        }
    }
}
