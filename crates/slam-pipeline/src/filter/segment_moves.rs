//! Metropolis-Hastings moves of the recent path: the evolution step on path segments.
//!
//! A particle is moved by a preconditioned Crank-Nicolson step (Neal 1999; Cotter et al. 2013) in the whitened
//! coordinates of the Gaussian of [`segment_gaussian`]: xi' = r xi + sqrt(1 - r^2) eta with eta ~ N(0, I), which leaves that
//! Gaussian invariant. With the density pi of the filter's own path it is accepted with the probability
//! min(1, pi(x') / N(x') * N(x) / pi(x)). So the posterior of the path given its beginning is left invariant, whatever the
//! quality of the Gaussian, and the weights stay as they are.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::DVector;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use rbpf_core::{Purpose, RejuvenationReport, Streams};

use super::local_batch::{SegmentGaussian, segment_gaussian};
use super::particle::Particle;
use super::pose::CameraPose;
use super::segment::{Origin, Segment, SegmentDriver, WindowStep};

/// Share of the old path in a move.
const KEEP: f64 = 0.0;

/// The moves of one keyframe.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SegmentMoves<'a> {
    /// Drives particles along the paths that are tried.
    pub(crate) driver: SegmentDriver<'a>,
    /// The keyframes since the older state of the particles.
    pub(crate) steps: &'a [Arc<WindowStep>],
    /// Number of steps from the older state to the newer one; zero while there is no newer one.
    pub(crate) middle: usize,
    /// Moves tried with each particle.
    pub(crate) moves: usize,
}

impl SegmentMoves<'_> {
    /// Moves every particle. Random numbers are those of `keyframe` and the particle.
    pub(crate) fn apply(
        &self,
        particles: &mut [Particle],
        streams: &Streams,
        frame: u64,
    ) -> RejuvenationReport {
        let mut origins: Vec<Arc<Particle>> = Vec::new();
        let mut of_slot: Vec<Option<usize>> = Vec::with_capacity(particles.len());
        let mut index: BTreeMap<usize, usize> = BTreeMap::new();
        for particle in &*particles {
            of_slot.push(particle.segment.older.as_ref().map(|origin| {
                *index
                    .entry(Arc::as_ptr(&origin.particle) as usize)
                    .or_insert_with(|| {
                        origins.push(origin.particle.clone());
                        origins.len() - 1
                    })
            }));
        }
        let gaussians: Vec<Option<SegmentGaussian>> = origins
            .par_iter()
            .map(|start| segment_gaussian(&self.driver, start, self.steps))
            .collect();
        let accepted: Vec<usize> = particles
            .par_iter_mut()
            .enumerate()
            .map(|(slot, particle)| {
                let Some(gaussian) = of_slot[slot].and_then(|o| gaussians[o].as_ref()) else {
                    return 0;
                };
                let mut rng = streams.stream(frame, slot as u64, Purpose::PathMoves);
                (0..self.moves)
                    .filter(|_| self.try_move(particle, gaussian, &mut rng))
                    .count()
            })
            .collect();
        RejuvenationReport {
            proposed: particles.len() * self.moves,
            accepted: accepted.iter().sum(),
        }
    }

    fn try_move(
        &self,
        particle: &mut Particle,
        gaussian: &SegmentGaussian,
        rng: &mut ChaCha8Rng,
    ) -> bool {
        let Some(older) = particle.segment.older.clone() else {
            return false;
        };
        let before = older.particle.path.len();
        let path: Option<Vec<CameraPose>> = (before..before + self.steps.len())
            .map(|k| particle.path.get(k).map(|keyframe| keyframe.pose))
            .collect();
        let Some(path) = path else { return false };
        let now = gaussian.whiten(&path);
        let noise = DVector::from_fn(now.len(), |_, _| StandardNormal.sample(rng));
        let next = &now * KEEP + noise * (1.0 - KEEP * KEEP).sqrt();
        let uniform: f64 = rng.random();
        let Some(poses) = gaussian.path(&next) else {
            return false;
        };
        let driven = self
            .driver
            .drive(&older.particle, self.steps, &poses, self.middle);
        let log_ratio = driven.log_density + 0.5 * next.norm_squared()
            - older.log_density
            - 0.5 * now.norm_squared();
        if std::env::var("EV_ACC2").is_ok() {
            eprintln!("   now {:.1} xi2 {:.1} next {:.1} xi2 {:.1} n {} ratio {:.1}", older.log_density, now.norm_squared(), driven.log_density, next.norm_squared(), now.len(), log_ratio);
        }
        if std::env::var("EV_ALL").is_err() && uniform.ln() >= log_ratio {
            return false;
        }
        *particle = Particle {
            segment: Segment {
                older: Some(Origin {
                    log_density: driven.log_density,
                    ..older
                }),
                newer: driven.middle,
            },
            ..driven.particle
        };
        true
    }
}
