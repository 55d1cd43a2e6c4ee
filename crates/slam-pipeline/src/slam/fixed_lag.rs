//! Smoothing of the recent path, when it is due.
//!
//! Every `lag` keyframes the path of all particles since their origins, up to `window` keyframes, is solved again (see
//! [`crate::filter::fixed_lag`]). The first window reaches back to the start, whose depths are only known once there is parallax,
//! and the particles share its beginning. After a robot was lost they may differ; then at most [`ORIGINS`] states are kept, drawn
//! in proportion to the weights: each costs a local batch.

use std::sync::Arc;

use nalgebra::DMatrix;
use rbpf_core::{ParticleFilter, Purpose};

use super::window::Window;
use super::{FrameReport, Slam, SlamError, filter_error};
use crate::filter::fixed_lag::{FixedLag, origins};
use crate::filter::landmark::InverseDepthPrior;
use crate::filter::mapping::Mapping;
use crate::filter::observation::FrameObservation;
use crate::filter::particle::Particle;
use crate::filter::segment::{SegmentDriver, WindowStep};
use crate::method::Evolution;

/// The note of a frame whose smoothing left some particles as they were.
const UNSETTLED: &str = "a local batch did not settle: its particles keep their recent path";
/// States in which a window begins, at most.
const ORIGINS: usize = 4;

/// A window that was solved again.
pub(super) struct Settled {
    /// Its first keyframe.
    pub(super) first: u32,
    /// Covariance of its body poses, where it settled.
    pub(super) covariance: Option<DMatrix<f64>>,
    /// Keyframes that have left it since, along its mean.
    pub(super) gone: usize,
}

impl Slam {
    /// The window that begins at this keyframe.
    pub(super) fn window_from_here(&self, filter: &mut ParticleFilter<Particle>) -> Window {
        if self.lag() > 0 {
            // At the start all particles are the same.
            let one = (self.state.keyframe == 0).then(|| filter.set().particles()[0].snapshot());
            for particle in filter.particles_mut() {
                particle.origin = Some(one.clone().unwrap_or_else(|| particle.snapshot()));
            }
        }
        Window::default()
    }

    /// The window with one more keyframe, smoothed when it is due.
    pub(super) fn smooth(
        &self,
        filter: &mut ParticleFilter<Particle>,
        mut window: Window,
        observation: &FrameObservation,
        mapping: &Mapping<'_>,
        report: &mut FrameReport,
    ) -> Result<(Window, Option<Settled>), SlamError> {
        let lag = self.lag();
        if lag == 0 {
            return Ok((Window::default(), None));
        }
        if filter.set().particles().iter().any(|p| p.origin.is_none()) {
            return Ok((self.window_from_here(filter), None));
        }
        window.steps.push(Arc::new(WindowStep {
            observation: observation.clone(),
            carrier: self.carrier(),
        }));
        if window.steps.len() < window.solved + lag {
            return Ok((window, None));
        }
        let frame = self.state.frame;
        let streams = *filter.streams();
        let driver = SegmentDriver {
            rig: &self.rig,
            mapping,
            depth: InverseDepthPrior::beyond(self.config.mapping.min_depth_m),
        };
        if origins(filter.set().particles()) > ORIGINS {
            let mut rng = streams.shared(frame as u64, Purpose::Thinning);
            filter
                .thin(frame as u64, ORIGINS, &mut rng)
                .map_err(|e| filter_error(frame, e))?;
        }
        // The window keeps its length.
        let most = self.config.filter.window as usize;
        let gone = (window.steps.len() + lag)
            .saturating_sub(most)
            .min(window.steps.len() - 1);
        let smoother = FixedLag {
            driver,
            steps: &window.steps,
            leaving: gone,
        };
        let log_weights = filter.set().log_weights().to_vec();
        let smoothed = smoother.smooth(filter.particles_mut(), &log_weights);
        filter
            .reweight(&smoothed.log_increments)
            .map_err(|e| filter_error(frame, e))?;
        if smoothed.unsettled > 0 {
            report.notes.push(UNSETTLED.to_owned());
        }
        let settled = Settled {
            first: self.state.keyframe + 1 - window.steps.len() as u32,
            covariance: smoothed.covariance,
            gone,
        };
        window.steps.drain(..gone);
        window.solved = window.steps.len();
        Ok((window, Some(settled)))
    }

    /// Keyframes between smoothings; zero for a method that has none.
    pub(super) fn lag(&self) -> usize {
        match self.policies.evolution {
            Evolution::MetropolisHastings => self.config.filter.lag as usize,
            Evolution::Printed | Evolution::Off => 0,
        }
    }
}
