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
//!   independent. P must be positive definite. The factor of L' is built by rotations, row by row, with the right-hand side
//!   beside it (the square-root information filter: Bierman 1977).
//!
//! All keep the covariance positive definite. The stacked form needs an S that is positive definite as a matrix (variances
//! within 1e16 of one another), the others do not.
//!
//! On a manifold the small change of tangent between x and x' is neglected.

use estimation_base::generic::CholeskyFactor;
use estimation_base::{Manifold, Real, cholesky_in_place, symmetric};
use nalgebra::{ComplexField, DMatrixViewMut, SMatrix, SVector};

use crate::covariance::{covariance_root, finite, in_step, require_symmetric, semidefinite};
use crate::error::{Step, UkfError};
use crate::filter::Ukf;
use crate::innovation::log_normaliser;
use crate::joint::{Joint, definite_root};
use crate::placed::Placed;
use crate::rank_one::{downdate_rows, update, update_with_right_side};
use crate::transform::Images;

/// A measurement of one block and its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured<T, Z, const M: usize> {
    /// z.
    pub value: Z,
    /// R, M x M, positive definite.
    pub noise: SMatrix<T, M, M>,
}

/// How well all measurements of an instant fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointFit<T> {
    /// Rows of all blocks: the degrees of freedom of `nis`.
    pub rows: usize,
    /// Normalised innovation squared of all of them.
    pub nis: T,
    /// log N(z; z^, S) of all of them.
    pub log_likelihood: T,
}

/// Entries of the workspace that [`Ukf::update_stacked`] needs for `count` blocks of M rows.
#[must_use]
pub const fn stacked_workspace<const L: usize, const M: usize>(count: usize) -> usize {
    let rows = count * M;
    // S, P_zx, the innovation, a deviation for each sigma point
    rows * rows + rows * L + rows + rows * (2 * L + 1)
}

impl<T: Real, X: Manifold<L, T>, const L: usize> Ukf<T, X, L> {
    /// Takes in the blocks one after the other; `function`(x, k) predicts block k.
    ///
    /// `nis` and `log_likelihood` are sums over the blocks, each given those before.
    ///
    /// # Errors
    /// As [`Ukf::update`]; the state is then unchanged by any of the blocks.
    pub fn update_sequentially<Z: Manifold<M, T>, const M: usize>(
        &mut self,
        measurements: &[Measured<T, Z, M>],
        mut function: impl FnMut(&X, usize) -> Z,
    ) -> Result<JointFit<T>, UkfError> {
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
    pub fn update_information<Z: Manifold<M, T>, const M: usize>(
        &mut self,
        measurements: &[Measured<T, Z, M>],
        mut function: impl FnMut(&X, usize) -> Z,
    ) -> Result<JointFit<T>, UkfError> {
        let points = Placed::new(self.mean(), self.root().lower(), self.sigma_points())?;
        let prior = definite_root(self.root().lower(), Step::SigmaPoints)?;
        let mut fit = JointFit::of_rows(measurements.len() * M);
        // in units of the prior's root: x = m + S t, t ~ N(0, I) before; lower^T t = right is what is known of t
        let mut lower = SMatrix::<T, L, L>::identity();
        let mut right = SVector::<T, L>::zeros();
        for (k, measured) in measurements.iter().enumerate() {
            let noise = covariance_root(&measured.noise, Step::Innovation)?;
            let images: Images<T, Z, L, M> =
                Images::new(self.mean(), &points, &mut |x: &X| function(x, k))?;
            let innovation = finite(
                images.mean.local(&measured.value),
                Step::Innovation,
                "the measurement",
            )?;
            // x first: [S 0; H S O^1/2]
            let line = Joint::of_points(&SMatrix::<T, L, 1>::zeros(), points.count(), |index| {
                let weight = points.covariance_weight(index);
                (points.tangent(index), images.difference(index), weight)
            })?;
            let mut rest = *line.rest(Step::Innovation)?.lower();
            for column in noise.lower().column_iter() {
                update(&mut rest, column.into_owned());
            }
            let rest = definite_root(&rest, Step::Innovation)?;
            let weighted = rest.whiten(line.slope());
            let whitened = rest.whiten(&innovation);
            for row in 0..M {
                let equation = weighted.row(row).transpose();
                let residual =
                    update_with_right_side(&mut lower, &mut right, equation, whitened[row]);
                fit.nis += residual * residual;
            }
            fit.log_likelihood -= T::of(0.5) * log_normaliser(&rest);
        }
        // det S = det I' prod det O_k and the residuals of the least squares, without forming S
        let information = CholeskyFactor::from_lower(&lower).map_err(in_step(Step::Posterior))?;
        fit.log_likelihood -= T::of(0.5) * (fit.nis + information.log_determinant());

        let correction = prior.lower() * information.solve_transposed(&right);
        // (S I'^-1 S^T): rows of L'^-1 S^T
        let half = information.whiten(&prior.lower().transpose());
        let mut root = SMatrix::<T, L, L>::zeros();
        for row in half.row_iter() {
            update(&mut root, row.transpose());
        }
        let root = CholeskyFactor::from_lower(&root).map_err(in_step(Step::Posterior))?;
        self.set_state(self.mean().retract(&correction), root);
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
    pub fn update_stacked<Z: Manifold<M, T>, const M: usize>(
        &mut self,
        measurements: &[Z],
        noise: &[T],
        workspace: &mut [T],
        mut function: impl FnMut(&X, usize) -> Z,
    ) -> Result<JointFit<T>, UkfError> {
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
        cross.fill(T::zero());

        let prior = *self.root();
        let set = *self.sigma_points();
        let points = Placed::new(self.mean(), prior.lower(), &set)?;
        for (k, measured) in measurements.iter().enumerate() {
            let images = Images::new(self.mean(), &points, &mut |x| function(x, k))?;
            let difference = finite(
                images.mean.local(measured),
                Step::Innovation,
                "the measurement",
            )?;
            innovation[k * M..(k + 1) * M].copy_from_slice(difference.as_slice());
            for index in 0..points.count() {
                let first = index * rows + k * M;
                let difference: SVector<T, M> = images.difference(index);
                deviations[first..first + M].copy_from_slice(difference.as_slice());
            }
        }
        for index in 0..points.count() {
            let weight = points.covariance_weight(index);
            let tangent = points.tangent(index);
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
        // whiten e and P_zx in place: K e = B^T y with B = L_S^-1 P_zx
        let mut fit = JointFit::of_rows(rows);
        let mut correction = SVector::<T, L>::zeros();
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
            for column in 0..L {
                let entry = &mut cross[row * L + column];
                *entry /= pivot;
                correction[column] += *entry * innovation[row];
            }
            fit.nis += innovation[row] * innovation[row];
            fit.log_likelihood -=
                ComplexField::ln(pivot) + T::of(0.5) * ComplexField::ln(T::two_pi());
        }
        fit.log_likelihood -= T::of(0.5) * fit.nis;
        // K^T = L_S^-T B, row by row in the place of B
        for row in (0..rows).rev() {
            for below in row + 1..rows {
                let factor = s[(below, row)];
                for column in 0..L {
                    cross[row * L + column] -= factor * cross[below * L + column];
                }
            }
            for entry in &mut cross[row * L..(row + 1) * L] {
                *entry /= s[(row, row)];
            }
        }
        // P' = sum W (dx - K dz) (dx - K dz)^T + K R K^T, a sum of squares whatever the rounding of K
        let gain = |row: usize| SVector::<T, L>::from_column_slice(&cross[row * L..(row + 1) * L]);
        let mut of_noise = SMatrix::<T, L, L>::zeros();
        for row in 0..rows {
            let mut carried = SVector::<T, L>::zeros();
            for column in 0..rows {
                carried += gain(column) * noise[row * rows + column];
            }
            of_noise += gain(row) * carried.transpose();
        }
        // of rank K M at most, perhaps less than L: what rounding may have taken from a pivot of zero is given back
        let given_back = T::one() + T::of(16.0 * (rows + L) as f64) * T::EPSILON;
        for k in 0..L {
            of_noise[(k, k)] *= given_back;
        }
        let of_noise = semidefinite(&symmetric(&of_noise), Step::Posterior)?;
        let mut root = *of_noise.lower();
        let rest = |index: usize| {
            let deviation = &deviations[index * rows..(index + 1) * rows];
            let mut rest = points.tangent(index);
            for (row, value) in deviation.iter().enumerate() {
                rest -= gain(row) * *value;
            }
            rest * ComplexField::sqrt(ComplexField::abs(points.covariance_weight(index)))
        };
        for index in 1..points.count() {
            update(&mut root, rest(index));
        }
        let centre = rest(0);
        if points.covariance_weight(0) >= T::zero() {
            update(&mut root, centre);
        } else {
            let before = prior.lower();
            let length = |row: usize| before.row(row).norm();
            downdate_rows::<T, L, 0>(&mut root, |row| centre[row], length)
                .map_err(in_step(Step::Posterior))?;
        }
        let root = CholeskyFactor::from_lower(&root).map_err(in_step(Step::Posterior))?;
        self.set_state(self.mean().retract(&correction), root);
        Ok(fit)
    }
}

impl<T: Real> JointFit<T> {
    fn of_rows(rows: usize) -> Self {
        Self {
            rows,
            nis: T::zero(),
            log_likelihood: T::zero(),
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
