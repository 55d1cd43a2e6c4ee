//! Several measurements of one instant, such as all landmarks of a frame: z_k = h(x, k) + noise_k.
//!
//! Three forms, the same answer for linear h:
//!
//! - **sequential**: one update after the other. Each sees the state the ones before have left, so h is
//!   linearised anew; the order matters when h is curved. K updates.
//! - **stacked**: one measurement of K M rows, whose noise may be correlated between the blocks. What
//!   all of them have in common of h's curvature enters S. One factorisation of K M rows: cubic in K.
//! - **information**: each block is linearised statistically (Lefebvre, Bruyninckx, De Schutter 2002),
//!
//! ```text
//! H_k = P_xz,k^T P^-1,   O_k = P_zz,k - H_k P H_k^T + R_k
//! L' = P^-1 + sum H_k^T O_k^-1 H_k,   x' = x + L'^-1 sum H_k^T O_k^-1 (z_k - z^_k)
//! ```
//!
//!   linear in K, all from the same prior, with the curvature of different blocks taken as
//!   independent. P must be positive definite.
//!
//! On a manifold the small change of tangent between x and x' is neglected.

use core::f64::consts::TAU;

use estimation_base::{Manifold, cholesky_in_place, symmetric};
use nalgebra::{ComplexField, DMatrixViewMut, SMatrix, SVector};

use crate::covariance::{
    check_posterior, definite, finite, in_step, require_symmetric, semidefinite,
};
use crate::error::{Step, UkfError};
use crate::filter::Ukf;
use crate::innovation::log_normaliser;
use crate::transform::{Images, unscented_transform};

/// A measurement of one block and its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured<Z, const M: usize> {
    /// z.
    pub value: Z,
    /// R, M x M, positive definite.
    pub noise: SMatrix<f64, M, M>,
}

/// How well all measurements of an instant fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointFit {
    /// Rows of all blocks: the degrees of freedom of `nis`.
    pub rows: usize,
    /// Normalised innovation squared of all of them.
    pub nis: f64,
    /// log N(z; z^, S) of all of them.
    pub log_likelihood: f64,
}

/// Entries of the workspace that [`Ukf::update_stacked`] needs for `count` blocks of M rows.
#[must_use]
pub const fn stacked_workspace<const L: usize, const M: usize>(count: usize) -> usize {
    let rows = count * M;
    // S, P_zx, the innovation, a deviation for each sigma point
    rows * rows + rows * L + rows + rows * (2 * L + 1)
}

impl<X: Manifold<L>, const L: usize> Ukf<X, L> {
    /// Takes in the blocks one after the other; `function`(x, k) predicts block k.
    ///
    /// `nis` and `log_likelihood` are sums over the blocks, each given those before.
    ///
    /// # Errors
    /// As [`Ukf::update`]; the state is then unchanged by any of the blocks.
    pub fn update_sequentially<Z: Manifold<M>, const M: usize>(
        &mut self,
        measurements: &[Measured<Z, M>],
        mut function: impl FnMut(&X, usize) -> Z,
    ) -> Result<JointFit, UkfError> {
        let mut next = self.clone();
        let mut fit = JointFit::of_rows(measurements.len() * M);
        for (k, measured) in measurements.iter().enumerate() {
            let told = next.update(&measured.value, &measured.noise, |x| function(x, k))?;
            fit.nis += told.nis;
            fit.log_likelihood += told.log_likelihood;
        }
        *self = next;
        Ok(fit)
    }

    /// Takes in all blocks at once in the information form; `function`(x, k) predicts block k.
    ///
    /// # Errors
    /// [`UkfError::Covariance`] for a prior that is only semidefinite or a block whose
    /// noise is not positive definite, otherwise as [`Ukf::update`]; the state is then unchanged.
    pub fn update_information<Z: Manifold<M>, const M: usize>(
        &mut self,
        measurements: &[Measured<Z, M>],
        mut function: impl FnMut(&X, usize) -> Z,
    ) -> Result<JointFit, UkfError> {
        let prior = definite(self.covariance(), Step::SigmaPoints)?;
        let mut fit = JointFit::of_rows(measurements.len() * M);
        // in units of the prior's root: x = m + S t, t ~ N(0, I) before
        let mut information = SMatrix::<f64, L, L>::identity();
        let mut vector = SVector::<f64, L>::zeros();
        for (k, measured) in measurements.iter().enumerate() {
            require_symmetric(&measured.noise, Step::Innovation)?;
            let predicted =
                unscented_transform(self.mean(), self.covariance(), self.sigma_points(), |x| {
                    function(x, k)
                })?;
            let innovation = finite(
                predicted.mean.local(&measured.value),
                Step::Innovation,
                "the measurement",
            )?;
            // columns of slope^T: S^-1 P_xz = S^T H^T
            let slope = prior.whiten(&predicted.cross_covariance);
            let rest = predicted.covariance - slope.transpose() * slope + measured.noise;
            let rest = definite(&symmetric(&rest), Step::Innovation)?;
            let weighted = rest.solve(&slope.transpose());
            information += slope * weighted;
            vector += weighted.transpose() * innovation;
            fit.nis += rest.mahalanobis_squared(&innovation);
            fit.log_likelihood -= 0.5 * log_normaliser(&rest);
        }
        // det S = det I' prod det O_k and the inversion lemma, without forming S
        let information = definite(&symmetric(&information), Step::Posterior)?;
        fit.nis -= information.mahalanobis_squared(&vector);
        fit.log_likelihood -= 0.5 * (fit.nis + information.log_determinant());

        let correction = prior.lower() * information.solve(&vector);
        // (S I'^-1 S^T): rows of L'^-1 S^T
        let half = information.whiten(&prior.lower().transpose());
        let covariance = symmetric(&(half.transpose() * half));
        self.set_state(self.mean().retract(&correction), covariance);
        Ok(fit)
    }

    /// Takes in all blocks at once, K = `measurements.len()` known at run time only; `function`(x, k)
    /// predicts block k.
    ///
    /// `noise` is R of all K M rows, (K M)^2 entries row by row. `workspace` holds at least
    /// [`stacked_workspace`]`::<L, M>(K)` entries, whatever they are. O((K M)^3 / 6).
    ///
    /// # Errors
    /// [`UkfError::Length`] for a slice of another length, otherwise as [`Ukf::update`] (pivots count
    /// the stacked rows); the state is then unchanged.
    pub fn update_stacked<Z: Manifold<M>, const M: usize>(
        &mut self,
        measurements: &[Z],
        noise: &[f64],
        workspace: &mut [f64],
        mut function: impl FnMut(&X, usize) -> Z,
    ) -> Result<JointFit, UkfError> {
        let rows = measurements.len() * M;
        let needed = stacked_workspace::<L, M>(measurements.len());
        check_length("the noise of stacked rows", noise.len(), rows * rows, true)?;
        check_length("the workspace", workspace.len(), needed, false)?;
        let (s, rest) = workspace.split_at_mut(rows * rows);
        let (cross, rest) = rest.split_at_mut(rows * L);
        let (innovation, deviations) = rest.split_at_mut(rows);
        s.copy_from_slice(noise);
        let mut s = DMatrixViewMut::from_slice(s, rows, rows);
        require_symmetric(&s, Step::Innovation)?;
        cross.fill(0.0);

        let root = semidefinite(self.covariance(), Step::SigmaPoints)?;
        let set = *self.sigma_points();
        for (k, measured) in measurements.iter().enumerate() {
            let images = Images::new(self.mean(), root.lower(), &set, &mut |x| function(x, k))?;
            let difference = finite(
                images.mean.local(measured),
                Step::Innovation,
                "the measurement",
            )?;
            innovation[k * M..(k + 1) * M].copy_from_slice(difference.as_slice());
            for index in 0..set.count() {
                let first = index * rows + k * M;
                let difference: SVector<f64, M> = images.difference(index);
                deviations[first..first + M].copy_from_slice(difference.as_slice());
            }
        }
        for index in 0..set.count() {
            let weight = set.covariance_weight(index);
            let tangent = set.tangent(root.lower(), index);
            let deviation = &deviations[index * rows..(index + 1) * rows];
            for row in 0..rows {
                let weighted = deviation[row] * weight;
                for column in 0..L {
                    cross[row * L + column] += weighted * tangent[column];
                }
                for column in 0..=row {
                    s[(row, column)] += weighted * deviation[column];
                }
            }
        }
        cholesky_in_place(&mut s).map_err(in_step(Step::Innovation))?;
        // whiten e and P_zx in place: K e = B^T y, K S K^T = B^T B
        let mut fit = JointFit::of_rows(rows);
        let mut correction = SVector::<f64, L>::zeros();
        let mut reduction = SMatrix::<f64, L, L>::zeros();
        for row in 0..rows {
            for before in 0..row {
                let factor = s[(row, before)];
                innovation[row] -= factor * innovation[before];
                for column in 0..L {
                    cross[row * L + column] -= factor * cross[before * L + column];
                }
            }
            let pivot = s[(row, row)];
            innovation[row] /= pivot;
            for entry in &mut cross[row * L..(row + 1) * L] {
                *entry /= pivot;
            }
            let column = SVector::<f64, L>::from_column_slice(&cross[row * L..(row + 1) * L]);
            correction += column * innovation[row];
            reduction += column * column.transpose();
            fit.nis += innovation[row] * innovation[row];
            fit.log_likelihood -= ComplexField::ln(pivot) + 0.5 * ComplexField::ln(TAU);
        }
        fit.log_likelihood -= 0.5 * fit.nis;
        let covariance = symmetric(&(self.covariance() - reduction));
        check_posterior(&covariance, self.covariance())?;
        self.set_state(self.mean().retract(&correction), covariance);
        Ok(fit)
    }
}

impl JointFit {
    const fn of_rows(rows: usize) -> Self {
        Self {
            rows,
            nis: 0.0,
            log_likelihood: 0.0,
        }
    }
}

fn check_length(
    what: &'static str,
    given: usize,
    required: usize,
    exactly: bool,
) -> Result<(), UkfError> {
    if given < required || (exactly && given > required) {
        return Err(UkfError::Length {
            what,
            given,
            required,
        });
    }
    Ok(())
}
