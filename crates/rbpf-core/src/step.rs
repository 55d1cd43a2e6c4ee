//! The three traits of a step, and the implementations that do nothing.
//!
//! A particle type `P` and an observation type `O` belong to the problem. [`Proposal`] moves a particle
//! and weighs the move, [`Rejuvenation`] spreads copies after a resampling, and [`MapUpdate`] conditions
//! the map on the final pose. [`crate::ParticleFilter`] calls them in this order.

use crate::streams::Streams;
use rand_chacha::ChaCha8Rng;
use std::convert::Infallible;

/// Draws the new pose of one particle and weighs the draw.
pub trait Proposal<P, O>: Sync {
    /// The reason why a particle could not be proposed; it ends the step.
    type Error: std::error::Error + Send + 'static;

    /// Moves `particle` and returns the increment of its log weight: exactly
    /// log p(z | s, map) + log p(s | s_prev, u) - log q(s) for a draw from q.
    ///
    /// Minus infinity is legal and means that the draw is impossible; NaN and +inf end the step.
    ///
    /// # Errors
    /// Observations or particles that the implementation cannot handle.
    fn propose(
        &self,
        particle: &mut P,
        observation: &O,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, Self::Error>;
}

/// Moves particles by steps that leave p(z | s, map) p(s | s_prev, u) invariant.
///
/// The set represents the same distribution afterwards, so the weights stay as they are.
pub trait Rejuvenation<P, O>: Sync {
    /// The reason why it failed; it ends the step.
    type Error: std::error::Error + Send + 'static;

    /// Moves the particles. Random numbers come from `streams` with
    /// (`frame`, particle index, [`crate::Purpose::Evolution`]).
    ///
    /// # Errors
    /// Observations or particles that the implementation cannot handle.
    fn rejuvenate(
        &self,
        particles: &mut [P],
        observation: &O,
        streams: &Streams,
        frame: u64,
    ) -> Result<RejuvenationReport, Self::Error>;
}

/// Updates the map of one particle, given its final pose.
pub trait MapUpdate<P, O>: Sync {
    /// The reason why it failed; it ends the step.
    type Error: std::error::Error + Send + 'static;

    /// Updates, starts and drops the landmarks of `particle`.
    ///
    /// # Errors
    /// Observations or particles that the implementation cannot handle.
    fn update_map(&self, particle: &mut P, observation: &O) -> Result<(), Self::Error>;
}

/// Number of moves that a rejuvenation tried and accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RejuvenationReport {
    /// Moves tried.
    pub proposed: usize,
    /// Moves accepted.
    pub accepted: usize,
}

impl RejuvenationReport {
    /// Share of the moves that were accepted; `None` if none was tried.
    #[must_use]
    pub fn acceptance(&self) -> Option<f64> {
        (self.proposed > 0).then(|| self.accepted as f64 / self.proposed as f64)
    }
}

/// The rejuvenation that leaves the particles as they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoRejuvenation;

impl<P, O> Rejuvenation<P, O> for NoRejuvenation {
    type Error = Infallible;

    fn rejuvenate(
        &self,
        _: &mut [P],
        _: &O,
        _: &Streams,
        _: u64,
    ) -> Result<RejuvenationReport, Infallible> {
        Ok(RejuvenationReport::default())
    }
}

/// The map update that leaves the maps as they are, for localisation in a known map and for state
/// estimation without a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoMapUpdate;

impl<P, O> MapUpdate<P, O> for NoMapUpdate {
    type Error = Infallible;

    fn update_map(&self, _: &mut P, _: &O) -> Result<(), Infallible> {
        Ok(())
    }
}
