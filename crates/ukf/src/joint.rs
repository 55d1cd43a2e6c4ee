//! Covariances as sums of squares, and the update that keeps them so.
//!
//! The textbook update P - K S K^T subtracts two matrices that agree in all their digits where a measurement is far more
//! precise than the prior: below eps P nothing is left of the answer but rounding, of either sign. Here nothing is
//! subtracted. With weighted deviations a_i = sqrt(W_i) (z_i - z), b_i = sqrt(W_i) (x_i - x) of the sigma points and
//! N N^T = R, rotations Theta turn one array into the other,
//!
//! ```text
//! [ N  a_1 a_2 ... ]           [ L_S       0  ]
//! [ 0  b_1 b_2 ... ] Theta  =  [ K L_S   L_P' ]
//! ```
//!
//! whose lower right corner is a root of the posterior: both sides have the same product with their transpose (the array form
//! of the Kalman filter: Kailath, Sayed, Hassibi 2000, ch. 12). The rotations round relative to each root, so an answer is right
//! while standard deviations, not variances, are within 1e16 of one another.
//!
//! Columns enter one after the other ([`Joint::add`], Givens rotations); a centre point of negative weight enters last,
//! by a downdate, the only step that can fail.

use estimation_base::generic::CholeskyFactor;
use estimation_base::{CholeskyError, Real};
use nalgebra::{ComplexField, SMatrix, SVector};

use crate::covariance::{finite, in_step};
use crate::error::{Step, UkfError};
use crate::innovation::Innovation;
use crate::rank_one::{Lower, downdate, downdate_rows, rotation, update};

/// The lower factor of noise noise^T + sum W d d^T over `count` points, whose deviations and weights `point` tells.
pub(crate) fn root_of_squares<T: Real, const N: usize, const K: usize>(
    noise: &SMatrix<T, N, K>,
    count: usize,
    point: impl Fn(usize) -> (SVector<T, N>, T),
    step: Step,
) -> Result<CholeskyFactor<T, N>, UkfError> {
    let mut lower = SMatrix::<T, N, N>::zeros();
    for column in noise.column_iter() {
        update(&mut lower, column.into_owned());
    }
    for index in 1..count {
        let (deviation, weight) = point(index);
        update(&mut lower, deviation * ComplexField::sqrt(weight));
    }
    let (deviation, weight) = point(0);
    let centre = deviation * ComplexField::sqrt(ComplexField::abs(weight));
    if weight >= T::zero() {
        update(&mut lower, centre);
    } else {
        downdate(&mut lower, &centre).map_err(in_step(step))?;
    }
    CholeskyFactor::from_lower(&lower).map_err(in_step(step))
}

/// The lower factor [L_z 0; L_xz L_x] of the joint covariance of z (M) and x (L).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Joint<T, const M: usize, const L: usize> {
    z: SMatrix<T, M, M>,
    xz: SMatrix<T, L, M>,
    x: SMatrix<T, L, L>,
}

/// A Gaussian corrected by a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Corrected<T, const M: usize, const L: usize> {
    /// The factor of the covariance after the update.
    pub(crate) root: CholeskyFactor<T, L>,
    /// K (z - z^).
    pub(crate) correction: SVector<T, L>,
    pub(crate) innovation: Innovation<T, M>,
}

impl<T: Real, const M: usize, const L: usize> Joint<T, M, L> {
    /// The factor of the points: `point` tells deviations in z and x and the weight; `noise` is a factor of what is added to z.
    pub(crate) fn of_points<const K: usize>(
        noise: &SMatrix<T, M, K>,
        count: usize,
        point: impl Fn(usize) -> (SVector<T, M>, SVector<T, L>, T),
    ) -> Result<Self, UkfError> {
        let mut joint = Self::of_noise(noise);
        for index in 1..count {
            let (z, x, weight) = point(index);
            let weight = ComplexField::sqrt(weight);
            joint.add(z * weight, x * weight);
        }
        let (z, x, weight) = point(0);
        let share = ComplexField::sqrt(ComplexField::abs(weight));
        if weight >= T::zero() {
            joint.add(z * share, x * share);
        } else {
            joint.take(&(z * share), &(x * share))?;
        }
        Ok(joint)
    }

    /// Noise in z alone, of which `noise` is a factor.
    pub(crate) fn of_noise<const K: usize>(noise: &SMatrix<T, M, K>) -> Self {
        let mut joint = Self {
            z: SMatrix::zeros(),
            xz: SMatrix::zeros(),
            x: SMatrix::zeros(),
        };
        for column in noise.column_iter() {
            update(&mut joint.z, column.into_owned());
        }
        joint
    }

    /// Adds (z, x) (z, x)^T.
    pub(crate) fn add(&mut self, mut z: SVector<T, M>, mut x: SVector<T, L>) {
        for column in 0..M {
            let (diagonal, entry) = (self.z[(column, column)], z[column]);
            if entry == T::zero() {
                continue;
            }
            let (cos, sin, length) = rotation(diagonal, entry);
            self.z[(column, column)] = length;
            for row in column + 1..M {
                let (l, v) = (self.z[(row, column)], z[row]);
                self.z[(row, column)] = cos * l + sin * v;
                z[row] = cos * v - sin * l;
            }
            for row in 0..L {
                let (l, v) = (self.xz[(row, column)], x[row]);
                self.xz[(row, column)] = cos * l + sin * v;
                x[row] = cos * v - sin * l;
            }
        }
        update(&mut self.x, x);
    }

    /// Takes (z, x) (z, x)^T away.
    fn take(&mut self, z: &SVector<T, M>, x: &SVector<T, L>) -> Result<(), UkfError> {
        let entry = |row: usize| row.checked_sub(M).map_or_else(|| z[row], |row| x[row]);
        let (of_z, of_x): ([T; M], [T; L]) = (
            core::array::from_fn(|row| self.z.row(row).norm()),
            // what x had before z was known
            core::array::from_fn(|row| self.xz.row(row).norm() + self.x.row(row).norm()),
        );
        let length = |row: usize| {
            row.checked_sub(M)
                .map_or_else(|| of_z[row], |row| of_x[row])
        };
        downdate_rows::<T, M, L>(self, entry, length).map_err(|error| match error {
            CholeskyError::NotPositiveDefinite {
                pivot,
                value,
                required,
            } if pivot >= M => in_step(Step::Posterior)(CholeskyError::NotPositiveDefinite {
                pivot: pivot - M,
                value,
                required,
            }),
            other => in_step(Step::Innovation)(other),
        })
    }

    /// The factor of the covariance of z.
    ///
    /// # Errors
    /// The first row of which the rows before leave no more than rounding.
    pub(crate) fn z_root(&self, step: Step) -> Result<CholeskyFactor<T, M>, UkfError> {
        definite_root(&self.z, step)
    }

    /// Covariance of x with whitened z: K L_z.
    pub(crate) const fn slope(&self) -> &SMatrix<T, L, M> {
        &self.xz
    }

    /// The factor of the covariance of x given z.
    pub(crate) fn rest(&self, step: Step) -> Result<CholeskyFactor<T, L>, UkfError> {
        CholeskyFactor::from_lower(&self.x).map_err(in_step(step))
    }

    /// x given z, which is `residual` away from its mean.
    pub(crate) fn given(&self, residual: SVector<T, M>) -> Result<Corrected<T, M, L>, UkfError> {
        let residual = finite(residual, Step::Innovation, "the measurement")?;
        let factor = self.z_root(Step::Innovation)?;
        Ok(Corrected {
            root: self.rest(Step::Posterior)?,
            correction: self.xz * factor.whiten(&residual),
            innovation: Innovation::new(residual, factor.product(), &factor),
        })
    }
}

impl<T: Real, const M: usize, const L: usize> Lower<T> for Joint<T, M, L> {
    fn at(&self, row: usize, column: usize) -> T {
        match (row.checked_sub(M), column.checked_sub(M)) {
            (None, _) => self.z[(row, column)],
            (Some(row), None) => self.xz[(row, column)],
            (Some(row), Some(column)) => self.x[(row, column)],
        }
    }

    fn set(&mut self, row: usize, column: usize, value: T) {
        match (row.checked_sub(M), column.checked_sub(M)) {
            (None, _) => self.z[(row, column)] = value,
            (Some(row), None) => self.xz[(row, column)] = value,
            (Some(row), Some(column)) => self.x[(row, column)] = value,
        }
    }
}

/// A factor whose every pivot is more than the rounding of its row: 8 N eps of its length, N rotations having made it.
pub(crate) fn definite_root<T: Real, const N: usize>(
    lower: &SMatrix<T, N, N>,
    step: Step,
) -> Result<CholeskyFactor<T, N>, UkfError> {
    let root = CholeskyFactor::from_lower(lower).map_err(in_step(step))?;
    for pivot in 0..N {
        let value = lower[(pivot, pivot)];
        let rounding = T::of(8.0 * N as f64) * T::EPSILON * lower.row(pivot).norm();
        if value <= rounding {
            return Err(in_step(step)(CholeskyError::NotPositiveDefinite {
                pivot,
                value: (value * value).into(),
                required: (rounding * rounding).into(),
            }));
        }
    }
    Ok(root)
}
