//! The iterated update, for measurements far more precise than the prior (the iterated posterior linearisation
//! filter: Garcia-Fernandez, Svensson, Morelande, Särkkä 2015).
//!
//! A single update linearises h where the prior spreads. When the measurement leaves a
//! small part of that spread, h should be linearised there: with (m_j, P_j) the present posterior, the prior at
//! first,
//!
//! ```text
//! A = P_xz^T P_j^-1,  O = P_zz - A P_j A^T       from the sigma points of (m_j, P_j)
//! S = A P A^T + O + R,  K = P A^T S^-1
//! m_(j+1) = m + K (z - z^ - A (m - m_j)),  P_(j+1) = P - K S K^T
//! ```
//!
//! with O, S and P_(j+1) formed as sums of squares (`joint`).
//!
//! The first round is the ordinary update; for linear h so are all. It ends when the mean moves by less
//! than `tolerance` standard deviations. Convergence is not guaranteed (nor is it for Gauss-Newton, which this is
//! for vanishing spread): the outcome says whether it came about. P must be positive definite. On a
//! manifold the small change of tangent between m and m_j is neglected.

use estimation_base::{Manifold, Real};
use nalgebra::{ComplexField, SMatrix, SVector};

use crate::covariance::covariance_root;
use crate::error::{Step, UkfError};
use crate::filter::Ukf;
use crate::innovation::Innovation;
use crate::joint::{Joint, definite_root};
use crate::placed::Placed;
use crate::transform::Images;

/// The conditions under which the iteration stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iterations {
    /// The largest number of rounds; 0 counts as 1.
    pub at_most: u32,
    /// The iteration ends when the mean moves by no more than this many standard deviations of the posterior.
    pub tolerance: f64,
}

impl Default for Iterations {
    fn default() -> Self {
        Self {
            at_most: 10,
            tolerance: 1e-3,
        }
    }
}

/// The outcome of an iterated update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iterated<T, const M: usize> {
    /// The innovation by the last linearisation.
    pub innovation: Innovation<T, M>,
    /// Number of rounds made.
    pub rounds: u32,
    /// True if the last round moved the mean by less than the tolerance.
    pub converged: bool,
}

impl<T: Real, X: Manifold<L, T>, const L: usize> Ukf<T, X, L> {
    /// Takes in a measurement z = h(x) + noise, linearised where the posterior lies.
    ///
    /// # Errors
    /// [`UkfError::Covariance`] for a prior that is only semidefinite, otherwise as
    /// [`Ukf::update`]; the state is then unchanged.
    pub fn update_iterated<Z: Manifold<M, T>, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &SMatrix<T, M, M>,
        iterations: &Iterations,
        mut function: impl FnMut(&X) -> Z,
    ) -> Result<Iterated<T, M>, UkfError> {
        let noise = covariance_root(measurement_noise, Step::Innovation)?;
        let prior = *self.root();
        let (mut mean, mut root) = (self.mean().clone(), prior);
        let mut rounds = 0;
        loop {
            rounds += 1;
            let points = Placed::new(&mean, root.lower(), self.sigma_points())?;
            let images: Images<T, Z, L, M> = Images::new(&mean, &points, &mut function)?;
            // x first: [S_j 0; A S_j O^1/2]
            let line = Joint::of_points(&SMatrix::<T, L, 1>::zeros(), points.count(), |index| {
                let weight = points.covariance_weight(index);
                (points.tangent(index), images.difference(index), weight)
            })?;
            let present = line.z_root(Step::SigmaPoints)?;
            let slope = present
                .solve_transposed(&line.slope().transpose())
                .transpose();
            // the prior through that line: O and R are noise in z
            let mut joint = Joint::<T, M, L>::of_noise(noise.lower());
            for column in line.rest(Step::Innovation)?.lower().column_iter() {
                joint.add(column.into_owned(), SVector::zeros());
            }
            for column in prior.lower().column_iter() {
                joint.add(slope * column, column.into_owned());
            }
            let corrected =
                joint.given(images.mean.local(measurement) - slope * mean.local(self.mean()))?;
            let next = self.mean().retract(&corrected.correction);
            let moved = mean.local(&next);
            // a semidefinite posterior has no lengths: go on to the last round
            let length = definite_root(corrected.root.lower(), Step::Posterior)
                .map_or(f64::INFINITY, |root| {
                    ComplexField::sqrt(root.mahalanobis_squared(&moved)).into()
                });
            (mean, root) = (next, corrected.root);
            let converged = length <= iterations.tolerance;
            if converged || rounds >= iterations.at_most {
                self.set_state(mean, root);
                return Ok(Iterated {
                    innovation: corrected.innovation,
                    rounds,
                    converged,
                });
            }
        }
    }
}
