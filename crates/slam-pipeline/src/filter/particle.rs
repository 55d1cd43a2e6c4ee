//! One hypothesis of the filter: a path, the map that follows from it, and the metric state given both.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use mono_geometry::inverse_depth::LandmarkGeometry;
use mono_geometry::{PlacedCamera, Se2};
use nalgebra::{Vector2, Vector3};
use rbpf_core::{CowMap, PersistentPath};

use super::landmark::Landmark;
use super::metric::{MetricState, ScaleNote};
use super::motion::{Departure, MotionPrior};
use super::pose::{CameraPose, PoseMatrix};

/// A keyframe of a particle's path.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Keyframe {
    /// Pose of the particle.
    pub(crate) pose: CameraPose,
    /// The camera in the particle's world and unit.
    pub(crate) camera: PlacedCamera,
    /// Its scale.
    pub(crate) scale: ScaleNote,
}

/// The world of a particle in metres as it measures it now: one scale for all, the present one.
///
/// Far from here, where the unit has drifted since, [`super::metric_path::MetricPath`] knows better.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MetricWorld {
    lever_m: Vector2<f64>,
    /// Where the camera started, which is in metres already.
    start: Vector3<f64>,
    /// Metres per unit.
    scale: f64,
}

impl MetricWorld {
    /// A position of the unit world, metres.
    #[must_use]
    pub(crate) fn position(&self, in_unit: &Vector3<f64>) -> Vector3<f64> {
        self.start + (in_unit - self.start) * self.scale
    }

    /// The body under a camera pose of the unit world, metres.
    #[must_use]
    pub(crate) fn body(&self, pose: &CameraPose) -> Se2 {
        let centre = self.position(&pose.centre);
        let (sin, cos) = pose.phi.sin_cos();
        Se2 {
            x: centre.x - (cos * self.lever_m.x - sin * self.lever_m.y),
            y: centre.y - (sin * self.lever_m.x + cos * self.lever_m.y),
            phi: pose.phi,
        }
    }
}

/// One particle. Cloning shares path and map.
#[derive(Debug, Clone)]
pub(crate) struct Particle {
    /// Pose at the last keyframe, or of this frame while it is being processed.
    pub(crate) pose: CameraPose,
    /// Keyframes so far.
    pub(crate) path: PersistentPath<Keyframe>,
    /// Landmarks.
    pub(crate) map: CowMap<Landmark>,
    /// Scale and metric position given the path.
    pub(crate) metric: MetricState,
    /// Motion prior of the frame being processed; kept for the evolution moves
    /// and for the scale, shared between copies.
    pub(crate) prior: Option<Arc<Drawn>>,
    /// Its state at the beginning of the window, from which its recent path is solved again.
    pub(crate) origin: Option<Arc<Particle>>,
}

/// The distribution from which a pose was drawn.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Drawn {
    /// Motion prior.
    pub(crate) prior: MotionPrior,
    /// Lower factor of the covariance of the proposal, tangent of the pose; it
    /// depends on prior, map and image, not on the draw.
    pub(crate) step_factor: PoseMatrix,
}

impl Particle {
    /// A particle at `pose` with an empty map.
    #[must_use]
    pub(crate) fn new(pose: CameraPose, metric: MetricState) -> Self {
        Self {
            pose,
            path: PersistentPath::new(),
            map: CowMap::new(),
            metric,
            prior: None,
            origin: None,
        }
    }

    /// Sets the particle down at `pose` with its body at `body` (metres): how it came there is not known.
    pub(crate) fn stand_at(&mut self, pose: CameraPose, body: &Se2) {
        self.pose = pose;
        self.metric.place_by_landmarks(body);
        self.prior = None;
        self.origin = None;
    }

    /// The particle as it is, without an origin of its own.
    #[must_use]
    pub(crate) fn snapshot(&self) -> Arc<Self> {
        Arc::new(Self {
            origin: None,
            prior: None,
            ..self.clone()
        })
    }

    /// Where the motion since the last filter step starts.
    #[must_use]
    pub(crate) fn departure(&self) -> Departure {
        Departure {
            pose: self.pose,
            constants: self.metric.constants(),
            constants_covariance: self.metric.constants_covariance(),
        }
    }

    /// Geometry of a landmark of this particle; `None` when its anchor is not
    /// in the path.
    #[must_use]
    pub(crate) fn geometry(&self, landmark: &Landmark) -> Option<LandmarkGeometry> {
        match landmark.anchor() {
            None => Some(LandmarkGeometry::Point),
            Some(a) => self
                .path
                .get(a as usize)
                .map(|k| LandmarkGeometry::InverseDepth { anchor: k.camera }),
        }
    }

    /// The path and map of the particle in metres.
    #[must_use]
    pub(crate) fn metric_world(&self, lever_m: Vector2<f64>) -> MetricWorld {
        MetricWorld {
            lever_m,
            start: self
                .path
                .get(0)
                .map_or_else(Vector3::zeros, |k| k.camera.centre),
            scale: self.metric.scale(),
        }
    }
}
