//! The order of a frame.
//!
//! ```text
//! propose -> weight -> adaptive resampling -> rejuvenation -> map update
//! ```
//!
//! The map is conditioned on the pose, so it is updated last, with the pose that the particle finally
//! has; the paper's printed order updates it before the evolution steps move the pose away. Weights
//! are carried from frame to frame, log w_t = log w_{t-1} + increment, and only a resampling resets
//! them to 1/N. (Eq. 31 of the paper drops w_{t-1}, which forgets the past whenever a frame does not
//! resample.) A frame resamples when N_eff < threshold * N.
//!
//! Particles run in parallel (feature `parallel`). Each draws from its own stream, and all reductions
//! run in particle order, so the result is the same for any number of threads.
//!
//! A step works on a copy of the set and replaces the original at its end: after an error the set is
//! exactly what it was. This asks for particles that are cheap to clone, with their maps in
//! [`crate::CowMap`] and their paths in [`crate::PersistentPath`]. While the original lives, every
//! leaf that a map update touches is copied once. For N = 100 particles of 10000 landmarks each and
//! 10 updates in 10 leaves the copy itself takes 1.5 us and the leaves take 0.32 ms, of a step of
//! 0.96 ms (bench `filter_step` of crate `range-bearing-slam`, on two busy cores).

use crate::diagnostics::{Genealogy, unique_ancestors};
use crate::error::{RbpfError, StepError};
use crate::kld::KldSampling;
use crate::parallel::{first_error, map_particles};
use crate::particle_set::{ParticleSet, check_length};
use crate::resampling::Resampler;
use crate::step::{MapUpdate, Proposal, Rejuvenation, RejuvenationReport};
use crate::streams::{Purpose, Streams};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// The frames in which rejuvenation runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum RejuvenationSchedule {
    /// Only the frames that resampled, to spread the copies.
    #[default]
    AfterResampling,
    /// Every frame.
    EveryFrame,
}

/// How a [`ParticleFilter`] resamples and rejuvenates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterConfig {
    /// The scheme that draws the ancestors.
    pub resampler: Resampler,
    /// A frame resamples when N_eff is below this fraction of N, in [0, 1]. The paper uses 0.6; 0
    /// never resamples.
    pub resampling_threshold: f64,
    /// The frames in which rejuvenation runs.
    pub rejuvenation: RejuvenationSchedule,
}

impl Default for FilterConfig {
    fn default() -> Self {
        Self {
            resampler: Resampler::Systematic,
            resampling_threshold: 0.6,
            rejuvenation: RejuvenationSchedule::AfterResampling,
        }
    }
}

/// The rule for the number of particles that a resampling draws.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub enum ParticleCount<P> {
    /// As many as there are now.
    #[default]
    Fixed,
    /// As many as the spread of the poses asks for, by KLD-sampling.
    Kld {
        /// The bound on the divergence, and the bins.
        sampling: KldSampling,
        /// The coordinates to be binned, with headings wrapped.
        pose: fn(&P) -> Vec<f64>,
    },
}

impl<P> ParticleCount<P> {
    fn draw(&self, set: &ParticleSet<P>, rng: &mut ChaCha8Rng) -> Result<usize, RbpfError> {
        match self {
            Self::Fixed => Ok(set.len()),
            Self::Kld { sampling, pose } => {
                let poses: Vec<Vec<f64>> = set.particles().iter().map(pose).collect();
                sampling.count(set.log_weights(), &poses, rng)
            }
        }
    }
}

/// A stage of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepStage {
    /// Proposal, weighting and resampling.
    Proposal,
    /// The moves after a resampling.
    Rejuvenation,
    /// The updates of the maps.
    MapUpdate,
}

/// The report of one frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct StepReport {
    /// Logarithm of the frame's evidence, log sum w_{t-1} exp(increment).
    pub log_evidence: f64,
    /// Effective number of particles after weighting, before resampling.
    pub n_eff: f64,
    /// Ancestor of each slot, sorted, if the frame resampled. There is one for every particle that the
    /// set holds now.
    pub ancestors: Option<Vec<usize>>,
    /// Number of distinct ancestors; N if the frame did not resample.
    pub unique_ancestors: usize,
    /// Number of frames since the common ancestor of all paths; `None` while they have none.
    pub common_ancestor_age: Option<u64>,
    /// Moves tried and accepted; zeros if rejuvenation did not run.
    pub rejuvenation: RejuvenationReport,
}

impl StepReport {
    /// Whether the frame resampled.
    #[must_use]
    pub const fn resampled(&self) -> bool {
        self.ancestors.is_some()
    }
}

/// A particle set with its random streams, configuration and genealogy.
///
/// [`ParticleFilter::step`] runs one frame. `P` is the particle, cheap to clone.
///
/// ```
/// use rand::RngExt;
/// use rand_chacha::ChaCha8Rng;
/// use rand_distr::StandardNormal;
/// use rbpf_core::{
///     FilterConfig, NoMapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, Streams,
/// };
/// use std::convert::Infallible;
///
/// struct RandomWalk;
///
/// impl Proposal<f64, f64> for RandomWalk {
///     type Error = Infallible;
///
///     fn propose(&self, x: &mut f64, z: &f64, rng: &mut ChaCha8Rng) -> Result<f64, Infallible> {
///         *x += rng.sample::<f64, _>(StandardNormal);
///         Ok(-0.5 * (z - *x).powi(2)) // log likelihood, up to a constant
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let set = ParticleSet::new(vec![0.0; 500])?;
/// let mut filter = ParticleFilter::new(set, Streams::new(7), FilterConfig::default())?;
/// for (frame, z) in (0..).zip([0.5, 1.0, 2.0]) {
///     filter.step(frame, &z, &RandomWalk, &NoRejuvenation, &NoMapUpdate)?;
/// }
/// let mean = filter.set().weighted_mean(|x| *x)?;
/// assert!((mean - 1.5).abs() < 0.2); // the Kalman filter says 1.5
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct ParticleFilter<P> {
    set: ParticleSet<P>,
    streams: Streams,
    config: FilterConfig,
    count: ParticleCount<P>,
    genealogy: Genealogy,
}

impl<P: Clone + Send + Sync> ParticleFilter<P> {
    /// A filter over `set`.
    ///
    /// # Errors
    /// [`RbpfError::InvalidThreshold`] for a threshold outside [0, 1].
    pub fn new(
        set: ParticleSet<P>,
        streams: Streams,
        config: FilterConfig,
    ) -> Result<Self, RbpfError> {
        let genealogy = Genealogy::new(set.len());
        Self::resume(set, streams, config, genealogy)
    }

    /// A filter that goes on from the set and the genealogy of an earlier one.
    ///
    /// # Errors
    /// [`RbpfError::InvalidThreshold`], or [`RbpfError::LengthMismatch`] for a genealogy of another
    /// number of particles.
    pub fn resume(
        set: ParticleSet<P>,
        streams: Streams,
        config: FilterConfig,
        genealogy: Genealogy,
    ) -> Result<Self, RbpfError> {
        let value = config.resampling_threshold;
        if !(0.0..=1.0).contains(&value) {
            return Err(RbpfError::InvalidThreshold { value });
        }
        check_length("slots of the genealogy", genealogy.particles(), set.len())?;
        Ok(Self {
            set,
            streams,
            config,
            count: ParticleCount::Fixed,
            genealogy,
        })
    }

    /// The same filter with another rule for the number of particles that a resampling draws.
    ///
    /// # Errors
    /// [`RbpfError::InvalidSetting`] for settings of [`KldSampling`] that are out of range.
    pub fn with_particle_count(mut self, count: ParticleCount<P>) -> Result<Self, RbpfError> {
        if let ParticleCount::Kld { sampling, .. } = &count {
            sampling.check()?;
        }
        self.count = count;
        Ok(self)
    }

    /// The particle set.
    #[must_use]
    pub const fn set(&self) -> &ParticleSet<P> {
        &self.set
    }

    /// The particles, to be changed between frames.
    #[must_use]
    pub fn particles_mut(&mut self) -> &mut [P] {
        self.set.particles_mut()
    }

    /// Adds increments to the log weights between frames and normalises them, as a move that changes the meaning of
    /// weights asks for. O(N).
    ///
    /// # Errors
    /// As [`ParticleSet::reweight`]; the weights are then unchanged.
    pub fn reweight(&mut self, log_increments: &[f64]) -> Result<(), RbpfError> {
        self.set.reweight(log_increments).map(|_| ())
    }

    /// Resamples between frames so that at most `count` of the present particles live on, each with as many copies as the others
    /// up to one; the set keeps its size and the weights become equal. O(N).
    ///
    /// For moves whose cost is that of distinct particles. The draw is unbiased, as any resampling is; `rng` must not be that
    /// of another draw of the frame.
    ///
    /// # Errors
    /// As [`Resampler::resample`]. The set and the genealogy are then unchanged.
    pub fn thin(&mut self, frame: u64, count: usize, rng: &mut impl Rng) -> Result<(), RbpfError> {
        let size = self.set.len();
        let count = count.clamp(1, size);
        let chosen = self
            .config
            .resampler
            .resample(self.set.log_weights(), count, rng)?;
        let ancestors: Vec<usize> = (0..size).map(|slot| chosen[slot * count / size]).collect();
        self.set.select(&ancestors)?;
        self.genealogy.record(frame, &ancestors)
    }

    /// The family of random streams.
    #[must_use]
    pub const fn streams(&self) -> &Streams {
        &self.streams
    }

    /// How it resamples and rejuvenates.
    #[must_use]
    pub const fn config(&self) -> &FilterConfig {
        &self.config
    }

    /// The resampling events since the common ancestor.
    #[must_use]
    pub const fn genealogy(&self) -> &Genealogy {
        &self.genealogy
    }

    /// Runs one frame without an observer: see [`ParticleFilter::step_observed`].
    ///
    /// # Errors
    /// As [`ParticleFilter::step_observed`].
    #[expect(
        clippy::type_complexity,
        reason = "the error is named after the three stages it came from"
    )]
    pub fn step<O, A, R, M>(
        &mut self,
        frame: u64,
        observation: &O,
        proposal: &A,
        rejuvenation: &R,
        map_update: &M,
    ) -> Result<StepReport, StepError<A::Error, R::Error, M::Error>>
    where
        O: Sync,
        A: Proposal<P, O>,
        R: Rejuvenation<P, O>,
        M: MapUpdate<P, O>,
    {
        self.step_observed(
            frame,
            observation,
            proposal,
            rejuvenation,
            map_update,
            &mut |_| {},
        )
    }

    /// Runs one frame: propose, weight, resample if N_eff is low, rejuvenate, update maps.
    ///
    /// `frame` keys the random streams and must not repeat within a run. `begin` is told when a stage begins, so that
    /// the caller can time the stages; it has no other effect.
    /// The cost is N proposals, N map updates and N clones of a particle, and N clones more if the
    /// frame resamples.
    ///
    /// # Errors
    /// The first error, in particle order, of the first stage that failed. The set, the weights and the
    /// genealogy are then unchanged.
    #[expect(
        clippy::type_complexity,
        reason = "the error is named after the three stages it came from"
    )]
    pub fn step_observed<O, A, R, M>(
        &mut self,
        frame: u64,
        observation: &O,
        proposal: &A,
        rejuvenation: &R,
        map_update: &M,
        begin: &mut dyn FnMut(StepStage),
    ) -> Result<StepReport, StepError<A::Error, R::Error, M::Error>>
    where
        O: Sync,
        A: Proposal<P, O>,
        R: Rejuvenation<P, O>,
        M: MapUpdate<P, O>,
    {
        let mut next = self.set.clone();
        let streams = self.streams;

        begin(StepStage::Proposal);
        let outcomes = map_particles(next.particles_mut(), |slot, particle| {
            let mut rng = streams.stream(frame, slot as u64, Purpose::Proposal);
            proposal.propose(particle, observation, &mut rng)
        });
        let log_increments = first_error(outcomes)
            .map_err(|(particle, source)| StepError::Proposal { particle, source })?;

        let log_evidence = next.reweight(&log_increments)?;
        let n_eff = next.effective_count();

        let mut ancestors = None;
        if n_eff < self.config.resampling_threshold * next.len() as f64 {
            let mut rng = streams.shared(frame, Purpose::Resampling);
            let count = self.count.draw(&next, &mut rng)?;
            let resampler = self.config.resampler;
            let chosen = resampler.resample(next.log_weights(), count, &mut rng)?;
            next.select(&chosen)?;
            ancestors = Some(chosen);
        }

        let rejuvenate = match self.config.rejuvenation {
            RejuvenationSchedule::EveryFrame => true,
            RejuvenationSchedule::AfterResampling => ancestors.is_some(),
        };
        let moves = if rejuvenate {
            begin(StepStage::Rejuvenation);
            rejuvenation
                .rejuvenate(next.particles_mut(), observation, &streams, frame)
                .map_err(|source| StepError::Rejuvenation { source })?
        } else {
            RejuvenationReport::default()
        };

        begin(StepStage::MapUpdate);
        let outcomes = map_particles(next.particles_mut(), |_, particle| {
            map_update.update_map(particle, observation)
        });
        first_error(outcomes)
            .map_err(|(particle, source)| StepError::MapUpdate { particle, source })?;

        if let Some(ancestors) = &ancestors {
            self.genealogy.record(frame, ancestors)?;
        }
        self.set = next;
        Ok(StepReport {
            log_evidence,
            n_eff,
            unique_ancestors: ancestors
                .as_deref()
                .map_or(self.set.len(), unique_ancestors),
            common_ancestor_age: self.genealogy.common_ancestor_age(frame),
            ancestors,
            rejuvenation: moves,
        })
    }
}
