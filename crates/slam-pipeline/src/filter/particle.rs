//! One hypothesis of the filter: a path, the map that follows from it, and the metric state given both.

use std::sync::Arc;

use mono_geometry::inverse_depth::LandmarkGeometry;
use mono_geometry::{PlacedCamera, Se2};
use nalgebra::Vector3;
use rbpf_core::{CowMap, PersistentPath};

use super::landmark::{Landmark, PointEstimate};
use super::metric::MetricState;
use super::motion::{Departure, MotionPrior};
use super::pose::{CameraPose, PoseMatrix};

/// A keyframe of a particle's path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Keyframe {
    /// Pose of the particle.
    pub(crate) pose: CameraPose,
    /// The camera in the particle's world and unit.
    pub(crate) camera: PlacedCamera,
    /// Body pose in metres.
    pub(crate) body: Se2,
    /// Metres per unit when the keyframe was made.
    pub(crate) scale: f64,
}

/// The earlier states of a particle, from which its recent path may be driven again.
#[derive(Debug, Clone, Default)]
pub(crate) struct Segment {
    /// The state at the beginning of the window.
    pub(crate) older: Option<Arc<Particle>>,
    /// The state at its middle.
    pub(crate) newer: Option<Arc<Particle>>,
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
    /// Its earlier states, from which the recent path may be driven again.
    pub(crate) segment: Segment,
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
            segment: Segment::default(),
        }
    }

    /// The particle as it is, without earlier states of its own.
    #[must_use]
    pub(crate) fn snapshot(&self) -> Arc<Self> {
        Arc::new(Self {
            segment: Segment::default(),
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

    /// World position of a landmark in metres, with its covariance; `None` while its depth is not positive.
    ///
    /// `position_in_body` is that of the camera, metres. Lengths are converted at the anchor of the landmark with the
    /// particle's present scale.
    #[must_use]
    pub(crate) fn metric_point(
        &self,
        landmark: &Landmark,
        position_in_body: &Vector3<f64>,
    ) -> Option<PointEstimate> {
        let point = landmark.point(&self.geometry(landmark)?)?;
        let Some(anchor) = landmark.anchor() else {
            return Some(point);
        };
        let keyframe = self.path.get(anchor as usize)?;
        let mount = position_in_body;
        let (sin, cos) = keyframe.body.phi.sin_cos();
        let camera_metric = Vector3::new(
            keyframe.body.x + cos * mount.x - sin * mount.y,
            keyframe.body.y + sin * mount.x + cos * mount.y,
            // The path starts at the mount's height, which is in metres already.
            mount.z + (keyframe.camera.centre.z - mount.z) * keyframe.scale,
        );
        let s = self.metric.scale();
        Some(PointEstimate {
            position: camera_metric + (point.position - keyframe.camera.centre) * s,
            covariance: point.covariance * (s * s),
        })
    }
}
