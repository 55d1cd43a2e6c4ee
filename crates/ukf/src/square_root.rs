//! The unscented Kalman filter in square-root form (van der Merwe and Wan 2001).
//!
//! It carries L with P = L L^T instead of P: half the digits suffice, and P cannot lose its
//! positive semidefiniteness. With deviations d_i from the mean and the Cholesky factor N of the noise,
//!
//! ```text
//! predict:  L = tri [ sqrt(W_i) d_i ..., N ]                        then the centre, W_c0
//! update:   L_S = tri [ sqrt(W_i) dz_i ..., N ]                     then the centre
//!           K = P_xz (L_S L_S^T)^-1
//!           L = tri [ sqrt(W_i) (dx_i - K dz_i) ..., K N ]          then the centre
//! ```
//!
//! where tri is the lower triangle of a QR factorisation, built row by row (`rank_one`). The last
//! line is P - K S K^T written as a sum of squares, as Joseph's form does for a linear filter; the
//! published form subtracts the columns of K L_S from L instead, which can fail by rounding when a
//! measurement is far more precise than the prior. The centre point enters last: with W_c0 >= 0 as one
//! more row, with W_c0 < 0 by a rank-one downdate, the only step that can fail, and an
//! error that carries step and pivot then.
//!
//! Noise is given as its factor ([`Cholesky`]), made once. Cost of a step: (2 L + 1) calls of the
//! function and about 4 L^3 multiplications.

use estimation_base::{Cholesky, CholeskyError, Manifold};
use nalgebra::{ComplexField, SMatrix, SVector};

use crate::covariance::{finite, in_step};
use crate::error::{Step, UkfError};
use crate::innovation::Innovation;
use crate::rank_one::{downdate, update};
use crate::sigma_points::SigmaPoints;
use crate::transform::Images;

/// A Gaussian state, its covariance by its Cholesky factor, and its sigma points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareRootUkf<X, const L: usize> {
    mean: X,
    root: Cholesky<L>,
    set: SigmaPoints<L>,
}

impl<X: Manifold<L>, const L: usize> SquareRootUkf<X, L> {
    /// A filter starting at `mean` with the covariance of which `root` is the factor.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`] for the mean.
    pub fn new(mean: X, root: Cholesky<L>, set: SigmaPoints<L>) -> Result<Self, UkfError> {
        finite(mean.local(&mean), Step::SigmaPoints, "the mean")?;
        Ok(Self { mean, root, set })
    }

    /// The mean.
    pub const fn mean(&self) -> &X {
        &self.mean
    }

    /// The factor of the covariance in the tangent at the mean.
    pub const fn root(&self) -> &Cholesky<L> {
        &self.root
    }

    /// The covariance, formed anew: L^3 multiplications.
    pub fn covariance(&self) -> SMatrix<f64, L, L> {
        self.root.product()
    }

    /// Moves the state by x' = f(x) + noise (in the tangent at the new mean).
    ///
    /// # Errors
    /// [`UkfError::NotFinite`] for a value of the function; [`UkfError::Covariance`] if the
    /// centre's negative weight takes more than the other points hold. The state is then unchanged.
    pub fn predict(
        &mut self,
        process_noise: &Cholesky<L>,
        mut function: impl FnMut(&X) -> X,
    ) -> Result<(), UkfError> {
        let images = Images::new(&self.mean, self.root.lower(), &self.set, &mut function)?;
        let lower = self.spread(
            |index| images.difference(index),
            process_noise.lower(),
            Step::Prediction,
        )?;
        self.root = Cholesky::from_lower(&lower).map_err(in_step(Step::Prediction))?;
        self.mean = images.mean;
        Ok(())
    }

    /// Takes in a measurement z = h(x) + noise.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`] for the measurement or a value of the function;
    /// [`UkfError::Covariance`] for an innovation without variance in some direction, or if
    /// the centre's negative weight takes more than the other points hold. The state is then unchanged.
    pub fn update<Z: Manifold<M>, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &Cholesky<M>,
        mut function: impl FnMut(&X) -> Z,
    ) -> Result<Innovation<M>, UkfError> {
        let images = Images::new(&self.mean, self.root.lower(), &self.set, &mut function)?;
        let innovation = images.mean.local(measurement);
        let innovation = finite(innovation, Step::Innovation, "the measurement")?;
        let lower = self.spread(
            |index| images.difference(index),
            measurement_noise.lower(),
            Step::Innovation,
        )?;
        if let Some(pivot) = (0..M).find(|&k| lower[(k, k)] <= 0.0) {
            return Err(in_step(Step::Innovation)(
                CholeskyError::NotPositiveDefinite {
                    pivot,
                    value: lower[(pivot, pivot)],
                    required: 0.0,
                },
            ));
        }
        let root = Cholesky::from_lower(&lower).map_err(in_step(Step::Innovation))?;

        let tangent = |index: usize| self.set.tangent(self.root.lower(), index);
        let mut cross_covariance = SMatrix::<f64, L, M>::zeros();
        for index in 1..self.set.count() {
            let weight = self.set.covariance_weight(index);
            let weighted = images.difference(index) * weight;
            cross_covariance.ger(1.0, &tangent(index), &weighted, 1.0);
        }
        let gain = root.solve(&cross_covariance.transpose()).transpose();
        // the noise first: K N has M columns
        let posterior = self.spread(
            |index| tangent(index) - gain * images.difference(index),
            &(gain * measurement_noise.lower()),
            Step::Posterior,
        )?;

        self.root = Cholesky::from_lower(&posterior).map_err(in_step(Step::Posterior))?;
        self.mean = self.mean.retract(&(gain * innovation));
        Ok(Innovation::new(innovation, root.product(), &root))
    }

    /// The lower factor of sum W_c d d^T + noise noise^T.
    fn spread<const N: usize, const K: usize>(
        &self,
        difference: impl Fn(usize) -> SVector<f64, N>,
        noise: &SMatrix<f64, N, K>,
        step: Step,
    ) -> Result<SMatrix<f64, N, N>, UkfError> {
        let mut lower = SMatrix::<f64, N, N>::zeros();
        for column in noise.column_iter() {
            update(&mut lower, column.into_owned());
        }
        for index in 1..self.set.count() {
            let weight = self.set.covariance_weight(index);
            update(&mut lower, difference(index) * ComplexField::sqrt(weight));
        }
        let weight = self.set.covariance_weight(0);
        let centre = difference(0) * ComplexField::sqrt(weight.abs());
        if weight >= 0.0 {
            update(&mut lower, centre);
        } else {
            downdate(&mut lower, &centre).map_err(in_step(step))?;
        }
        Ok(lower)
    }
}
