//! The path of a particle moved by its expected errors.
//!
//! The map needs no change: its landmarks are anchored in the keyframes of the path and move with them. Copies that
//! particles share stay shared.

use estimation_base::wrap;
use nalgebra::{Matrix3, Vector2};
use rbpf_core::MappedNodes;

use super::metric_path::MetricPath;
use super::particle::{Keyframe, Particle};
use super::revisit::Correction;

/// The errors of a path that all particles share.
#[derive(Debug, Clone)]
pub(crate) struct PathCorrection {
    /// Errors of the body poses, metres and radians.
    pub(crate) errors: Correction,
    /// Metres per unit.
    pub(crate) scale: f64,
    /// Error of the height at the present, in the unit.
    pub(crate) height: f64,
    /// Whether keyframes k and k + 1 have one unit.
    pub(crate) tied: Vec<bool>,
    /// Position of the camera in the body, metres.
    pub(crate) lever_m: Vector2<f64>,
}

impl PathCorrection {
    /// Moves paths, poses and positions of `particles`. Their origins no longer fit and are dropped.
    pub(crate) fn apply(&self, particles: &mut [Particle]) {
        let mut shared = MappedNodes::new();
        for particle in particles {
            particle.path = particle
                .path
                .mapped(&mut shared, |index, k| self.keyframe(index, k));
            let Some(last) = particle.path.last() else {
                continue;
            };
            particle.pose = last.pose;
            let now = particle.path.len() as u32 - 1;
            let body =
                MetricPath::new(particle, self.lever_m, &self.tied).body(now, &particle.pose);
            particle.metric.place_by_landmarks(&body);
            particle.origin = None;
            particle.prior = None;
        }
    }

    fn keyframe(&self, index: u32, k: &Keyframe) -> Keyframe {
        let centre = &k.camera.centre;
        let error = self.errors.at(index, &(centre.xy() * self.scale));
        let mut moved = *k;
        moved.camera.centre.x -= error.x / self.scale;
        moved.camera.centre.y -= error.y / self.scale;
        moved.camera.centre.z -= self.height * self.errors.share(index);
        let (sin, cos) = error.z.sin_cos();
        // The world turns back by the error.
        moved.camera.camera_from_world =
            k.camera.camera_from_world * Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        moved.pose.centre = moved.camera.centre;
        moved.pose.phi = wrap(k.pose.phi - error.z);
        moved
    }
}
