//! The recent path of a particle, with all that is needed to drive it again.
//!
//! A particle remembers its own state at the beginning of the window, its *origin*. From there and the observations since
//! ([`WindowStep`]) any other path can be taken, map and metric state included ([`SegmentDriver`]). Origins share their maps
//! with the particle.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::landmark::InverseDepthPrior;
use super::mapping::Mapping;
use super::metric::MetricState;
use super::motion::CarrierModel;
use super::observation::FrameObservation;
use super::particle::{Keyframe, Particle};
use super::pose::CameraPose;
use crate::rig::Rig;

/// A keyframe of the window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct WindowStep {
    /// Its measurements.
    pub(crate) observation: FrameObservation,
    /// The carrier with the process noise that was in force.
    pub(crate) carrier: CarrierModel,
}

/// Drives particles along given paths.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SegmentDriver<'a> {
    /// Camera and mount.
    pub(crate) rig: &'a Rig,
    /// Map update.
    pub(crate) mapping: &'a Mapping<'a>,
    /// Prior of the depth of new landmarks.
    pub(crate) depth: InverseDepthPrior,
}

impl SegmentDriver<'_> {
    /// The particle that leaves `start` along `poses`, one for each of `steps`, mapping on its way.
    #[must_use]
    pub(crate) fn drive(
        &self,
        start: &Particle,
        steps: &[Arc<WindowStep>],
        poses: &[CameraPose],
    ) -> Particle {
        let mut particle = start.clone();
        for (step, pose) in steps.iter().zip(poses) {
            let prior = step.carrier.prior(
                &self.rig.lever_m(),
                &particle.departure(),
                &step.observation.control,
            );
            particle.pose = *pose;
            self.mapping
                .arrive(&mut particle, &prior, &step.observation);
        }
        particle
    }

    /// The keyframes of the same drive, and the metric state at its end.
    #[must_use]
    pub(crate) fn keyframes(
        &self,
        start: &Particle,
        steps: &[Arc<WindowStep>],
        poses: &[CameraPose],
    ) -> (Vec<Keyframe>, MetricState) {
        let mut departure = start.departure();
        let mut metric = start.metric;
        let mut keyframes = Vec::with_capacity(poses.len());
        for (step, pose) in steps.iter().zip(poses) {
            let prior =
                step.carrier
                    .prior(&self.rig.lever_m(), &departure, &step.observation.control);
            metric = metric.condition_on_pose(&prior, pose);
            keyframes.push(Keyframe {
                pose: *pose,
                camera: pose.place(self.rig),
                scale: metric.scale_note(prior.scale_drift_variance),
            });
            departure.pose = *pose;
            departure.constants = metric.constants();
            departure.constants_covariance = metric.constants_covariance();
        }
        (keyframes, metric)
    }
}

/// The last `count` poses of a particle's path.
#[must_use]
pub(crate) fn recent_poses(particle: &Particle, count: usize) -> Vec<CameraPose> {
    let length = particle.path.len();
    (length.saturating_sub(count)..length)
        .filter_map(|keyframe| particle.path.get(keyframe))
        .map(|keyframe| keyframe.pose)
        .collect()
}
