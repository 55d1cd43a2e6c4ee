//! The new draw of the recent path, when it is due.
//!
//! Every `lag` keyframes the path of all particles since their older state, up to twice the lag, is drawn again (see
//! [`crate::filter::redraw`]). Then the newer state becomes the older one and the present state the newer one. The first
//! window reaches back to the start, whose depths are only known once there is parallax.

use std::sync::Arc;

use rbpf_core::ParticleFilter;

use super::window::Window;
use super::{FrameReport, Slam, SlamError, filter_error};
use crate::filter::landmark::InverseDepthPrior;
use crate::filter::mapping::Mapping;
use crate::filter::observation::FrameObservation;
use crate::filter::particle::{Particle, Segment};
use crate::filter::redraw::PathRedraw;
use crate::filter::segment::{SegmentDriver, WindowStep};
use crate::method::Evolution;

/// The note of a frame whose new draw left some particles as they were.
const UNSETTLED: &str = "a local batch did not settle: its particles keep their recent path";

impl Slam {
    /// The window that begins at the first keyframe.
    pub(super) fn window_from_here(&self, filter: &mut ParticleFilter<Particle>) -> Window {
        if self.lag() > 0 {
            for particle in filter.particles_mut() {
                particle.segment = Segment {
                    older: Some(particle.snapshot()),
                    newer: None,
                };
            }
        }
        Window::default()
    }

    /// The window with one more keyframe, after the new draw when it is due.
    pub(super) fn redraw(
        &self,
        filter: &mut ParticleFilter<Particle>,
        mut window: Window,
        observation: &FrameObservation,
        mapping: &Mapping<'_>,
        report: &mut FrameReport,
    ) -> Result<Window, SlamError> {
        let lag = self.lag();
        if lag == 0 {
            return Ok(Window::default());
        }
        window.steps.push(Arc::new(WindowStep {
            observation: observation.clone(),
            carrier: self.carrier(),
        }));
        if window.steps.len() < window.middle + lag {
            return Ok(window);
        }
        let redraw = PathRedraw {
            driver: SegmentDriver {
                rig: &self.rig,
                mapping,
                depth: InverseDepthPrior::beyond(self.config.mapping.min_depth_m),
            },
            steps: &window.steps,
            middle: window.middle,
        };
        let log_weights = filter.set().log_weights().to_vec();
        let streams = *filter.streams();
        let frame = self.state.frame;
        let redrawn = redraw.apply(filter.particles_mut(), &log_weights, &streams, frame as u64);
        filter
            .reweight(&redrawn.log_increments)
            .map_err(|e| filter_error(frame, e))?;
        if redrawn.unsettled > 0 {
            report.notes.push(UNSETTLED.to_owned());
        }
        for particle in filter.particles_mut() {
            let now = particle.snapshot();
            if let Some(newer) = particle.segment.newer.replace(now) {
                particle.segment.older = Some(newer);
            }
        }
        window.steps.drain(..window.middle);
        window.middle = window.steps.len();
        Ok(window)
    }

    /// Keyframes between new draws; zero for a method that has none.
    fn lag(&self) -> usize {
        match self.policies.evolution {
            Evolution::MetropolisHastings => self.config.filter.lag as usize,
            Evolution::Printed | Evolution::Off => 0,
        }
    }
}
