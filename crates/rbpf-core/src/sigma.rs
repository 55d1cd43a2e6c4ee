//! Sigma points at sqrt(3) standard deviations, and what a function makes of them.
//!
//! The set is the default of crate `ukf` (alpha 1, beta 2, kappa 3 - L): the centre and m +- sqrt(3) L e_k,
//! weight 1/6 each. With e the images less the image of the centre, its moments reduce to
//!
//! ```text
//! mean = f(m) + d,  d = sum e / 6,   covariance = sum e e^T / 6 + d d^T
//! ```
//!
//! positive semidefinite for every L. Points are drawn once and pushed through many functions.

use crate::factor::Factor;
use crate::models::Gaussian;
use nalgebra::{SMatrix, SVector};

/// The points of one Gaussian in L dimensions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SigmaPoints<const L: usize> {
    pub(crate) centre: SVector<f64, L>,
    /// m + sqrt(3) L e_k and m - sqrt(3) L e_k.
    pairs: [[SVector<f64, L>; 2]; L],
}

/// A function of a Gaussian: mean and covariance, and the slope of the linear function that fits best,
/// in coordinates in which the argument has unit covariance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Image<const L: usize, const M: usize> {
    pub(crate) mean: SVector<f64, M>,
    pub(crate) covariance: SMatrix<f64, M, M>,
    pub(crate) whitened_slope: SMatrix<f64, M, L>,
}

impl<const L: usize> SigmaPoints<L> {
    /// Of N(mean, L L^T).
    pub(crate) fn new(mean: &SVector<f64, L>, root: &Factor<L>) -> Self {
        let spread = root.lower() * 3.0_f64.sqrt();
        Self {
            centre: *mean,
            pairs: std::array::from_fn(|k| {
                let offset = spread.column(k);
                [mean + offset, mean - offset]
            }),
        }
    }

    /// The same points elsewhere, such as poses for tangents.
    pub(crate) fn moved(&self, to: impl Fn(&SVector<f64, L>) -> SVector<f64, L>) -> Self {
        Self {
            centre: to(&self.centre),
            pairs: self.pairs.map(|pair| pair.map(|point| to(&point))),
        }
    }

    /// `None` if the function has no value at some point. `at_centre` is the value there.
    pub(crate) fn image<const M: usize>(
        &self,
        at_centre: &SVector<f64, M>,
        function: impl Fn(&SVector<f64, L>) -> Option<SVector<f64, M>>,
    ) -> Option<Image<L, M>> {
        let mut sum = SVector::<f64, M>::zeros();
        let mut squares = SMatrix::<f64, M, M>::zeros();
        let mut whitened_slope = SMatrix::<f64, M, L>::zeros();
        for (k, [above, below]) in self.pairs.iter().enumerate() {
            let above = function(above)? - at_centre;
            let below = function(below)? - at_centre;
            sum += above + below;
            squares += above * above.transpose() + below * below.transpose();
            whitened_slope.set_column(k, &((above - below) / 12.0_f64.sqrt()));
        }
        let shift = sum / 6.0;
        Some(Image {
            mean: at_centre + shift,
            covariance: squares / 6.0 + shift * shift.transpose(),
            whitened_slope,
        })
    }
}

impl<const K: usize> Gaussian<K> {
    /// Its sigma points; an error names `what` it is.
    pub(crate) fn sigma_points(
        &self,
        what: &'static str,
    ) -> Result<SigmaPoints<K>, crate::RbpfError> {
        if !self.mean.iter().all(|entry| entry.is_finite()) {
            return Err(crate::RbpfError::NotFinite { what });
        }
        Ok(SigmaPoints::new(
            &self.mean,
            &Factor::semidefinite(&self.covariance, what)?,
        ))
    }
}

#[cfg(all(test, feature = "ukf"))]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector2, Vector3};
    use ukf::unscented_transform;

    #[test]
    fn equals_the_transform_of_crate_ukf() {
        let mean = Vector3::new(1.0, -2.0, 0.5);
        let covariance = Matrix3::new(0.4, 0.1, -0.05, 0.1, 0.3, 0.02, -0.05, 0.02, 0.2);
        let f = |x: &Vector3<f64>| Vector2::new(x.norm(), x.x.sin() * x.z + x.y * x.y);
        let oracle =
            unscented_transform(&mean, &covariance, &ukf::SigmaPoints::default(), f).unwrap();
        let root = Factor::definite(&covariance, "p").unwrap();
        let image = SigmaPoints::new(&mean, &root)
            .image(&f(&mean), |x| Some(f(x)))
            .unwrap();
        // numbers of order one, a dozen operations each
        assert!((image.mean - oracle.mean).amax() < 1e-14);
        assert!((image.covariance - oracle.covariance).amax() < 1e-14);
        let cross = root.lower() * image.whitened_slope.transpose();
        assert!((cross - oracle.cross_covariance).amax() < 1e-14);
    }
}
