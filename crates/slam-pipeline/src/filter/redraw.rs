//! New draws of the recent path: the evolution step on path segments.
//!
//! A sequential filter draws every pose from what was known at that keyframe, and resampling can only choose among such
//! draws; what later images tell of them is lost once the particles share their ancestors. Here the path of a whole window
//! is drawn again, for every particle, from its distribution given the state of the particle at the beginning of the window
//! and *all* measurements since: the Gaussian of [`segment_gaussian`]. It is a block Gibbs step. Where model and
//! measurements are linear and Gaussian it leaves the posterior invariant exactly; elsewhere it is the Laplace
//! approximation of that step. The map of the particle is the Gaussian of the same adjustment, given the new path.
//!
//! Particles with the same beginning are then draws of one distribution, so they take the mean of their weights
//! (Rao-Blackwell): what a weight said about one path of the segment no longer concerns the new one.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use rbpf_core::{Purpose, Streams};

use super::local_batch::{SegmentGaussian, segment_gaussian};
use super::particle::Particle;
use super::segment::{SegmentDriver, WindowStep, recent_poses};

/// The outcome of a new draw.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Redrawn {
    /// Increments of the log weights.
    pub(crate) log_increments: Vec<f64>,
    /// Origins whose local batch did not settle: their particles keep their paths.
    pub(crate) unsettled: usize,
    /// Covariance of the body poses of the window given its beginning, three rows a keyframe: that of the likeliest origin.
    pub(crate) covariance: Option<DMatrix<f64>>,
}

/// The new draw of one keyframe.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PathRedraw<'a> {
    /// Drives particles along paths.
    pub(crate) driver: SegmentDriver<'a>,
    /// The keyframes since the origins of the particles.
    pub(crate) steps: &'a [Arc<WindowStep>],
}

impl PathRedraw<'_> {
    /// Moves the origin of every particle on by `count` steps along its own path. Particles with the same path, which a
    /// resampling leaves next to one another, share the new one. O(distinct paths x matches).
    pub(crate) fn advance(&self, particles: &mut [Particle], count: usize) {
        let mut last: Option<(Arc<Particle>, Vec<_>, Arc<Particle>)> = None;
        for particle in particles {
            let Some(origin) = particle.origin.clone() else {
                continue;
            };
            let mut poses = recent_poses(particle, self.steps.len());
            poses.truncate(count);
            let moved = match &last {
                Some((before, path, moved)) if Arc::ptr_eq(before, &origin) && *path == poses => {
                    moved.clone()
                }
                _ => self
                    .driver
                    .drive(&origin, &self.steps[..count], &poses)
                    .snapshot(),
            };
            particle.origin = Some(moved.clone());
            last = Some((origin, poses, moved));
        }
    }

    /// Draws every path again. Random numbers are those of `frame` and the
    /// slot. A particle whose local batch fails keeps its path, and so do all when the window has seen nothing.
    #[must_use]
    pub(crate) fn apply(
        &self,
        particles: &mut [Particle],
        log_weights: &[f64],
        streams: &Streams,
        frame: u64,
    ) -> Redrawn {
        if self.steps.iter().all(|s| s.observation.matches.is_empty()) {
            return Redrawn {
                log_increments: vec![0.0; particles.len()],
                unsettled: 0,
                covariance: None,
            };
        }
        let family = families(particles);
        let gaussians: Vec<Option<SegmentGaussian>> = family
            .origins
            .par_iter()
            .map(|(start, first)| {
                segment_gaussian(&self.driver, start, &particles[*first], self.steps)
            })
            .collect();
        particles
            .par_iter_mut()
            .zip(&family.of_slot)
            .enumerate()
            .for_each(|(slot, (particle, origin))| {
                let Some(origin) = *origin else { return };
                let Some(gaussian) = &gaussians[origin] else {
                    return;
                };
                let mut rng = streams.stream(frame, slot as u64, Purpose::PathRedraw);
                let normal =
                    DVector::from_fn(gaussian.dimension(), |_, _| StandardNormal.sample(&mut rng));
                self.take(particle, &family.origins[origin].0, gaussian, &normal);
            });
        let covariance = family
            .likeliest(log_weights)
            .and_then(|origin| gaussians[origin].as_ref())
            .and_then(|gaussian| gaussian.body_covariance(&self.driver.rig.lever_m()));
        Redrawn {
            covariance,
            log_increments: family.mean_weights(log_weights, |origin| gaussians[origin].is_some()),
            unsettled: gaussians.iter().filter(|g| g.is_none()).count(),
        }
    }

    /// Puts the particle on the path that `normal` draws. Landmarks that took no part in the batch stay as the particle knows
    /// them, and move with their anchors.
    fn take(
        &self,
        particle: &mut Particle,
        origin: &Particle,
        gaussian: &SegmentGaussian,
        normal: &DVector<f64>,
    ) {
        let Some(tangents) = gaussian.tangents(normal) else {
            return;
        };
        let poses = gaussian.path(&tangents);
        let Some(last) = poses.last() else { return };
        particle.pose = *last;
        particle.prior = None;
        particle.path = origin.path.clone();
        let (keyframes, metric) = self.driver.keyframes(origin, self.steps, &poses);
        particle.path.extend(keyframes);
        particle.metric = metric;
        if self.driver.mapping.frozen {
            return;
        }
        for landmark in &gaussian.landmarks {
            // One that has left the map in the meantime stays away.
            if particle.map.get(landmark.id).is_some() {
                particle.map.insert(landmark.id, landmark.at(&tangents));
            }
        }
    }
}

/// Number of different states that the windows of these particles begin with.
pub(crate) fn origins(particles: &[Particle]) -> usize {
    families(particles).origins.len()
}

/// The particles by the state that their windows begin with.
struct Families {
    /// Each origin, and the slot of a particle that has it.
    origins: Vec<(Arc<Particle>, usize)>,
    of_slot: Vec<Option<usize>>,
}

fn families(particles: &[Particle]) -> Families {
    let mut origins: Vec<(Arc<Particle>, usize)> = Vec::new();
    let mut index: BTreeMap<*const Particle, usize> = BTreeMap::new();
    let of_slot = particles
        .iter()
        .enumerate()
        .map(|(slot, particle)| {
            let origin = particle.origin.as_ref()?;
            Some(*index.entry(Arc::as_ptr(origin)).or_insert_with(|| {
                origins.push((origin.clone(), slot));
                origins.len() - 1
            }))
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

    /// Log increments that give the members of each redrawn family the mean of their weights.
    fn mean_weights(&self, log_weights: &[f64], redrawn: impl Fn(usize) -> bool) -> Vec<f64> {
        let (sums, largest) = self.sums(log_weights);
        self.of_slot
            .iter()
            .zip(log_weights)
            .map(|(origin, log_weight)| match *origin {
                Some(origin) if redrawn(origin) && sums[origin].0 > 0.0 => {
                    (sums[origin].0 / sums[origin].1).ln() + largest - log_weight
                }
                _ => 0.0,
            })
            .collect()
    }
}
