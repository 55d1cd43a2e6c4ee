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
//! The first round is the ordinary update; for linear h so are all. It ends when the mean moves by less
//! than `tolerance` standard deviations. Convergence is not guaranteed (nor is it for Gauss-Newton, which this is
//! for vanishing spread): the outcome says whether it came about. P must be positive definite. On a
//! manifold the small change of tangent between m and m_j is neglected.

use estimation_base::{Cholesky, Manifold, symmetric};
use nalgebra::{ComplexField, SMatrix};

use crate::covariance::{check_posterior, definite, finite, require_symmetric};
use crate::error::{Step, UkfError};
use crate::filter::Ukf;
use crate::innovation::Innovation;
use crate::transform::unscented_transform;

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
pub struct Iterated<const M: usize> {
    /// The innovation by the last linearisation.
    pub innovation: Innovation<M>,
    /// Number of rounds made.
    pub rounds: u32,
    /// True if the last round moved the mean by less than the tolerance.
    pub converged: bool,
}

impl<X: Manifold<L>, const L: usize> Ukf<X, L> {
    /// Takes in a measurement z = h(x) + noise, linearised where the posterior lies.
    ///
    /// # Errors
    /// [`UkfError::Covariance`] for a prior that is only semidefinite, otherwise as
    /// [`Ukf::update`]; the state is then unchanged.
    pub fn update_iterated<Z: Manifold<M>, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &SMatrix<f64, M, M>,
        iterations: &Iterations,
        mut function: impl FnMut(&X) -> Z,
    ) -> Result<Iterated<M>, UkfError> {
        require_symmetric(measurement_noise, Step::Innovation)?;
        let prior = self.covariance();
        let (mut mean, mut covariance) = (self.mean().clone(), *prior);
        let mut rounds = 0;
        loop {
            rounds += 1;
            let root = definite(&covariance, Step::SigmaPoints)?;
            let predicted =
                unscented_transform(&mean, &covariance, self.sigma_points(), &mut function)?;
            let slope = root.solve(&predicted.cross_covariance).transpose();
            let rest = predicted.covariance - slope * covariance * slope.transpose();
            let s = slope * prior * slope.transpose() + rest + measurement_noise;
            let s = symmetric(&s);
            let factor = definite(&s, Step::Innovation)?;
            let innovation = predicted.mean.local(measurement) - slope * mean.local(self.mean());
            let innovation = finite(innovation, Step::Innovation, "the measurement")?;
            let gain = factor.solve(&(slope * prior)).transpose();
            let next = self.mean().retract(&(gain * innovation));
            let reduced = symmetric(&(prior - gain * s * gain.transpose()));
            check_posterior(&reduced, prior)?;

            let moved = mean.local(&next);
            // a semidefinite posterior has no lengths: go on to the last round
            let length = Cholesky::definite(&reduced).map_or(f64::INFINITY, |root| {
                ComplexField::sqrt(root.mahalanobis_squared(&moved))
            });
            (mean, covariance) = (next, reduced);
            let converged = length <= iterations.tolerance;
            if converged || rounds >= iterations.at_most {
                self.set_state(mean, covariance);
                return Ok(Iterated {
                    innovation: Innovation::new(innovation, s, &factor),
                    rounds,
                    converged,
                });
            }
        }
    }
}
