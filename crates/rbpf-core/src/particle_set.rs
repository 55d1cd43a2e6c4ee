//! Particles with their weights.
//!
//! The log weights are normalised at all times, so the log-sum of one frame's reweighting is the
//! logarithm of its evidence. Weights are carried from frame to frame, and only [`ParticleSet::select`]
//! resets them to 1/N.

use crate::diagnostics::check_ancestors;
use crate::error::RbpfError;
use crate::log_weights::{self, effective_count, linear_weights, normalize};

/// Particles with normalised log weights. A set is never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticleSet<P> {
    particles: Vec<P>,
    log_weights: Vec<f64>,
    origins: Vec<usize>,
}

impl<P> ParticleSet<P> {
    /// Equally weighted particles, each its own origin.
    ///
    /// # Errors
    /// [`RbpfError::NoParticles`].
    pub fn new(particles: Vec<P>) -> Result<Self, RbpfError> {
        let count = particles.len();
        Self::from_parts(particles, vec![0.0; count], (0..count).collect())
    }

    /// A set from its particles, log weights and origins, in slot order.
    ///
    /// The weights are normalised, unless they already are to within rounding: a set that is taken
    /// apart and put together again is bit for bit the same.
    ///
    /// # Errors
    /// [`RbpfError::NoParticles`], [`RbpfError::LengthMismatch`] or [`RbpfError::DegenerateWeights`].
    pub fn from_parts(
        particles: Vec<P>,
        mut log_weights: Vec<f64>,
        origins: Vec<usize>,
    ) -> Result<Self, RbpfError> {
        if particles.is_empty() {
            return Err(RbpfError::NoParticles);
        }
        check_length("log weights", log_weights.len(), particles.len())?;
        check_length("origins", origins.len(), particles.len())?;
        let mut normalized = log_weights.clone();
        let log_sum = normalize(&mut normalized)?;
        // a sum below 2^17 that was taken off has left its rounding in all of them; no weight is above one
        let rounding = f64::EPSILON * (131_072.0 + 4.0 * particles.len() as f64);
        let is_normalized = log_weights.iter().all(|w| *w <= rounding) && log_sum.abs() <= rounding;
        if !is_normalized {
            log_weights = normalized;
        }
        Ok(Self {
            particles,
            log_weights,
            origins,
        })
    }

    /// Number of particles, at least 1.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a set is never empty")]
    pub const fn len(&self) -> usize {
        self.particles.len()
    }

    /// The particles, in slot order.
    #[must_use]
    pub fn particles(&self) -> &[P] {
        &self.particles
    }

    /// The particles, to be moved or to have their maps changed.
    #[must_use]
    pub fn particles_mut(&mut self) -> &mut [P] {
        &mut self.particles
    }

    /// Normalised log weights, in slot order.
    #[must_use]
    pub fn log_weights(&self) -> &[f64] {
        &self.log_weights
    }

    /// Normalised weights as plain numbers, in slot order.
    #[must_use]
    pub fn weights(&self) -> Vec<f64> {
        self.log_weights
            .iter()
            .map(|log_weight| log_weight.exp())
            .collect()
    }

    /// For each slot, the slot of the first set from which its particle descends.
    #[must_use]
    pub fn origins(&self) -> &[usize] {
        &self.origins
    }

    /// Effective number of particles, 1 / sum w^2.
    #[must_use]
    pub fn effective_count(&self) -> f64 {
        effective_count(&self.log_weights)
    }

    /// Slot of the particle with the largest weight, the first of several.
    #[must_use]
    pub fn best(&self) -> usize {
        let mut best = 0;
        for (slot, weight) in self.log_weights.iter().enumerate() {
            if *weight > self.log_weights[best] {
                best = slot;
            }
        }
        best
    }

    /// Adds the increments of a frame to the log weights and normalises them. Returns the logarithm of
    /// the frame's evidence, log sum w_{t-1} exp(increment). Increments of any finite size are taken: the
    /// weights depend on their differences only, and sum to one to within rounding.
    ///
    /// # Errors
    /// [`RbpfError::LengthMismatch`], or [`RbpfError::DegenerateWeights`] if an increment is NaN or +inf
    /// or no weight is left. The set is then unchanged.
    pub fn reweight(&mut self, log_increments: &[f64]) -> Result<f64, RbpfError> {
        check_length("weight increments", log_increments.len(), self.len())?;
        log_weights::reweight(&mut self.log_weights, log_increments)
    }

    /// Replaces the set by copies of `ancestors`, one for each, with equal weights.
    ///
    /// # Errors
    /// [`RbpfError::NoParticles`] or [`RbpfError::UnknownAncestor`]. The set is then unchanged.
    pub fn select(&mut self, ancestors: &[usize]) -> Result<(), RbpfError>
    where
        P: Clone,
    {
        check_ancestors(ancestors, self.len())?;
        self.particles = ancestors
            .iter()
            .map(|&slot| self.particles[slot].clone())
            .collect();
        self.origins = ancestors.iter().map(|&slot| self.origins[slot]).collect();
        self.log_weights = vec![-(ancestors.len() as f64).ln(); ancestors.len()];
        Ok(())
    }

    /// Weighted mean of a number per particle, summed in slot order.
    ///
    /// The weighted mean square about it is the spread of the particles and not the covariance of the estimate, which
    /// is larger: it lacks what each particle carries in closed form, and all that happened before the particles'
    /// common ancestor ("Guarantees, and one that is not given" in the crate's documentation).
    ///
    /// # Errors
    /// [`RbpfError::DegenerateWeights`], which a valid set never meets.
    pub fn weighted_mean(&self, value: impl Fn(&P) -> f64) -> Result<f64, RbpfError> {
        let weights = linear_weights(&self.log_weights)?;
        Ok(self
            .particles
            .iter()
            .zip(weights)
            .map(|(particle, weight)| weight * value(particle))
            .sum())
    }
}

/// An error that names the vector `what` unless both lengths agree.
pub(crate) const fn check_length(
    what: &'static str,
    given: usize,
    required: usize,
) -> Result<(), RbpfError> {
    if given == required {
        Ok(())
    } else {
        Err(RbpfError::LengthMismatch {
            what,
            given,
            required,
        })
    }
}
