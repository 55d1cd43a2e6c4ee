//! Fixed-lag smoothing: the recent path at its mean.
//!
//! A sequential filter draws every pose from what was known at that keyframe, and resampling can only choose among such
//! draws; what later images tell of it is lost once the particles share their ancestors. Here the path of a whole window
//! is solved again from the state at its beginning and *all* measurements since, and the particles take the mean of that
//! Gaussian ([`segment_gaussian`]), path and map. What leaves the window stays at the mean for good.
//!
//! The mean of a distribution in the place of a draw from it is one more step of Rao and Blackwell: the estimate of the window has
//! no greater variance, and where model and measurements are linear and Gaussian it is exact, given the beginning. A draw
//! would be kept when it leaves the window, and all that follows would lean on it. The spread that the
//! particles lose is that of the Gaussian, which the reported covariance carries on ([`super::drift`]).
//!
//! Particles with the same beginning become the same, so they take the mean of their weights: what a weight said about one path
//! of the window no longer concerns the new one.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::local_batch::{SegmentGaussian, segment_gaussian};
use super::particle::Particle;
use super::pose::CameraPose;
use super::segment::{SegmentDriver, WindowStep, recent_poses};

/// The outcome of smoothing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Smoothed {
    /// Increments of the log weights.
    pub(crate) log_increments: Vec<f64>,
    /// Origins whose local batch did not settle: their particles keep their paths.
    pub(crate) unsettled: usize,
    /// Covariance of the body poses of the window given its beginning, three rows a keyframe: that of the likeliest origin.
    pub(crate) covariance: Option<DMatrix<f64>>,
}

/// The smoother of one keyframe.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FixedLag<'a> {
    /// Drives particles along paths.
    pub(crate) driver: SegmentDriver<'a>,
    /// The keyframes since the origins of the particles.
    pub(crate) steps: &'a [Arc<WindowStep>],
    /// How many of them, the first ones, leave the window now.
    pub(crate) leaving: usize,
}

impl FixedLag<'_> {
    /// Puts all particles on the means of their windows, and moves their origins on along these over the steps that leave.
    ///
    /// Particles whose local batch fails keep their paths, and so do all when the window has seen nothing; their origins move on
    /// along the path of the likeliest of them. O(origins x cost of [`segment_gaussian`]).
    #[must_use]
    pub(crate) fn smooth(&self, particles: &mut [Particle], log_weights: &[f64]) -> Smoothed {
        let families = families(particles, log_weights);
        let blind = self.steps.iter().all(|s| s.observation.matches.is_empty());
        let solve = |(origin, likeliest): &(Arc<Particle>, usize)| {
            let guess = &particles[*likeliest];
            let gaussian = (!blind)
                .then(|| segment_gaussian(&self.driver, origin, guess, self.steps))
                .flatten();
            let at_mean = gaussian.as_ref().map(|g| self.at_mean(guess, origin, g));
            let path = recent_poses(at_mean.as_ref().unwrap_or(guess), self.steps.len());
            Solved {
                next_origin: self.leave(origin, &path),
                gaussian,
                at_mean,
            }
        };
        let solved: Vec<Solved> = families.origins.par_iter().map(solve).collect();
        for (particle, family) in particles.iter_mut().zip(&families.of_slot) {
            let Some(family) = *family else { continue };
            if let Some(at_mean) = &solved[family].at_mean {
                *particle = at_mean.clone();
            }
            particle.origin = Some(solved[family].next_origin.clone());
        }
        let covariance = families
            .likeliest(log_weights)
            .and_then(|family| solved[family].gaussian.as_ref())
            .and_then(|gaussian| gaussian.body_covariance(&self.driver.rig.lever_m()));
        let failed = solved.iter().filter(|s| s.gaussian.is_none()).count();
        Smoothed {
            covariance,
            log_increments: families
                .mean_weights(log_weights, |family| solved[family].gaussian.is_some()),
            unsettled: if blind { 0 } else { failed },
        }
    }

    /// The state after the steps that leave, driven along `path`.
    fn leave(&self, origin: &Arc<Particle>, path: &[CameraPose]) -> Arc<Particle> {
        let count = self.leaving.min(path.len());
        if count == 0 {
            return origin.clone();
        }
        self.driver
            .drive(origin, &self.steps[..count], &path[..count])
            .snapshot()
    }

    /// The particle on the mean path. Landmarks that took no part in the batch stay as it knows them, and move with their anchors.
    fn at_mean(
        &self,
        particle: &Particle,
        origin: &Particle,
        gaussian: &SegmentGaussian,
    ) -> Particle {
        let mut smoothed = particle.clone();
        smoothed.pose = gaussian.mean.last().copied().unwrap_or(origin.pose);
        smoothed.prior = None;
        smoothed.path = origin.path.clone();
        let (keyframes, metric) = self.driver.keyframes(origin, self.steps, &gaussian.mean);
        smoothed.path.extend(keyframes);
        smoothed.metric = metric;
        if !self.driver.mapping.frozen {
            for (id, landmark) in &gaussian.landmarks {
                // One that has left the map in the meantime stays away.
                if smoothed.map.get(*id).is_some() {
                    smoothed.map.insert(*id, *landmark);
                }
            }
        }
        smoothed
    }
}

/// One origin and the window that begins with it.
struct Solved {
    /// `None` when the local batch did not settle.
    gaussian: Option<SegmentGaussian>,
    /// A particle at its mean.
    at_mean: Option<Particle>,
    next_origin: Arc<Particle>,
}

/// Number of different states that the windows of these particles begin with.
pub(crate) fn origins(particles: &[Particle]) -> usize {
    let origin = |p: &Particle| p.origin.as_ref().map(Arc::as_ptr);
    particles
        .iter()
        .filter_map(origin)
        .collect::<BTreeSet<_>>()
        .len()
}

/// The particles by the state that their windows begin with.
struct Families {
    /// Each origin, and the slot of the likeliest particle that has it.
    origins: Vec<(Arc<Particle>, usize)>,
    of_slot: Vec<Option<usize>>,
}

fn families(particles: &[Particle], log_weights: &[f64]) -> Families {
    let mut origins: Vec<(Arc<Particle>, usize)> = Vec::new();
    let mut index: BTreeMap<*const Particle, usize> = BTreeMap::new();
    let of_slot = particles
        .iter()
        .enumerate()
        .map(|(slot, particle)| {
            let origin = particle.origin.as_ref()?;
            let family = *index.entry(Arc::as_ptr(origin)).or_insert_with(|| {
                origins.push((origin.clone(), slot));
                origins.len() - 1
            });
            let likeliest = &mut origins[family].1;
            if log_weights[slot] > log_weights[*likeliest] {
                *likeliest = slot;
            }
            Some(family)
        })
        .collect();
    Families { origins, of_slot }
}

impl Families {
    /// The origin whose particles have the most weight together.
    fn likeliest(&self, log_weights: &[f64]) -> Option<usize> {
        let sums = self.sums(log_weights).0;
        (0..sums.len()).max_by(|a, b| sums[*a].0.total_cmp(&sums[*b].0))
    }

    /// Sum of the weights and number of the particles of each origin; the weights are those over the largest, which comes with
    /// them as a logarithm.
    fn sums(&self, log_weights: &[f64]) -> (Vec<(f64, f64)>, f64) {
        let mut sums = vec![(0.0, 0.0); self.origins.len()];
        let largest = log_weights.iter().copied().fold(f64::MIN, f64::max);
        for (origin, log_weight) in self.of_slot.iter().zip(log_weights) {
            if let Some(origin) = *origin {
                sums[origin].0 += (log_weight - largest).exp();
                sums[origin].1 += 1.0;
            }
        }
        (sums, largest)
    }

    /// Log increments that give the members of each smoothed family the mean of their weights.
    fn mean_weights(&self, log_weights: &[f64], smoothed: impl Fn(usize) -> bool) -> Vec<f64> {
        let (sums, largest) = self.sums(log_weights);
        self.of_slot
            .iter()
            .zip(log_weights)
            .map(|(origin, log_weight)| match *origin {
                Some(origin) if smoothed(origin) && sums[origin].0 > 0.0 => {
                    (sums[origin].0 / sums[origin].1).ln() + largest - log_weight
                }
                _ => 0.0,
            })
            .collect()
    }
}
