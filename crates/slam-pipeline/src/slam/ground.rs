//! The state that a keyframe starts from: that of the last keyframe, or one that an old place has corrected.

use rbpf_core::ParticleFilter;

use super::window::Window;
use super::{PoseEstimate, Slam};
use crate::filter::drift::Drift;
use crate::filter::particle::Particle;

/// The state that a keyframe builds on.
#[derive(Debug, Clone)]
pub(super) struct Ground {
    pub(super) filter: ParticleFilter<Particle>,
    pub(super) window: Window,
    /// Estimate at the last keyframe.
    pub(super) last: PoseEstimate,
    /// The joint covariance of the errors, where it has changed.
    pub(super) drift: Option<Drift>,
}

impl Ground {
    /// The particle that stands for all in the association.
    pub(super) fn reference(&self) -> &Particle {
        let set = self.filter.set();
        &set.particles()[set.best()]
    }
}

impl Slam {
    /// The state as it is. O(particles).
    pub(super) fn ground(&self) -> Ground {
        Ground {
            filter: self.state.filter.clone(),
            window: self.state.window.clone(),
            last: self.state.last,
            drift: None,
        }
    }
}
