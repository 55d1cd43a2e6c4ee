//! The window of keyframes whose path may still move.
//!
//! Every `lag` keyframes all particles are moved over the keyframes since their older state, twice the lag (see
//! [`crate::filter::segment_moves`]). Then the newer state becomes the older one and the present state the newer one. The
//! first window reaches back to the start, whose depths are only known once there is parallax.

use std::sync::Arc;

use rbpf_core::ParticleFilter;

use super::Slam;
use crate::filter::landmark::InverseDepthPrior;
use crate::filter::mapping::Mapping;
use crate::filter::observation::FrameObservation;
use crate::filter::particle::Particle;
use crate::filter::segment::{Origin, Segment, SegmentDriver, WindowStep};
use crate::filter::segment_moves::SegmentMoves;

/// The keyframes since the older state of the particles.
#[derive(Debug, Clone, Default)]
pub(super) struct Window {
    steps: Vec<Arc<WindowStep>>,
    /// Number of steps from the older state to the newer one; zero without a newer one.
    middle: usize,
}

impl Slam {
    /// The window that begins at the first keyframe.
    pub(super) fn window_from_here(&self, filter: &mut ParticleFilter<Particle>) -> Window {
        if self.lag() > 0 {
            for particle in filter.particles_mut() {
                particle.segment = Segment {
                    older: Some(Origin::of(particle)),
                    newer: None,
                };
            }
        }
        Window::default()
    }

    fn lag(&self) -> usize {
        match self.policies.evolution {
            crate::method::Evolution::MetropolisHastings => self.config.filter.lag as usize,
            _ => 0,
        }
    }

    /// The window with one more keyframe, and the moves when they are due.
    pub(super) fn move_segments(
        &self,
        filter: &mut ParticleFilter<Particle>,
        observation: &FrameObservation,
        mapping: &Mapping<'_>,
    ) -> Window {
        let lag = self.lag();
        if lag == 0 {
            return Window::default();
        }
        let mut window = self.state.window.clone();
        window.steps.push(Arc::new(WindowStep {
            observation: observation.clone(),
            carrier: self.carrier(),
        }));
        if window.steps.len() < window.middle + lag {
            return window;
        }
        let moves = SegmentMoves {
            driver: SegmentDriver {
                rig: &self.rig,
                likelihood: &self.likelihood,
                mapping,
                depth: InverseDepthPrior::beyond(self.config.mapping.min_depth_m),
            },
            steps: &window.steps,
            middle: window.middle,
            moves: self.config.filter.path_moves as usize,
        };
        let streams = *filter.streams();
        let r = moves.apply(filter.particles_mut(), &streams, self.state.frame as u64);
        if std::env::var("EV_ACC").is_ok() {
            eprintln!("{} {} {:?}", self.state.keyframe, window.steps.len(), r);
        }
        let shift = window.middle;
        for particle in filter.particles_mut() {
            let now = Origin::of(particle);
            let segment = &mut particle.segment;
            if let Some(newer) = segment.newer.replace(now) {
                segment.older = Some(newer);
            }
        }
        window.steps.drain(..shift);
        window.middle = window.steps.len();
        window
    }
}
