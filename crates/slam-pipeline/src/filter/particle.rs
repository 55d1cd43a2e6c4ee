//! One hypothesis: a path, the map that follows from it, and what is left open
//! given both, the local metric scale.
//!
//! A camera sees no length: scaling the camera path and the map by one factor
//! changes no pixel. Only odometry measures it, and given the path its
//! information about the factor is Gaussian. So the particle's path and map
//! live in a unit of their own, and the particle carries
//! y = (s, p_x, p_y) ~ N(mean, covariance): metres per unit and the metric
//! position of the body, conditional on the path. Sampling the path and solving
//! y in closed form is one more Rao-Blackwellisation; it costs nothing in the
//! size of the map and renews the scale from every odometry reading.
//! Methods without it start with a zero covariance, which keeps s = 1.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector2, Vector3};
use rbpf_core::{CowMap, PersistentPath};

use super::landmark::{Landmark, LandmarkGeometry};
use super::motion::{MotionPrior, PoseMatrix};
use super::pose::{CameraPose, PlacedCamera, PoseStep};
use crate::record::PlanarPose;

/// A keyframe of a particle's path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keyframe {
    /// The camera in the particle's world and unit.
    pub camera: PlacedCamera,
    /// Body pose in metres.
    pub body: PlanarPose,
    /// Metres per unit when the keyframe was made.
    pub scale: f64,
}

/// Gaussian over (metres per unit, metric body x, metric body y) given the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MetricState {
    /// Mean.
    pub mean: Vector3<f64>,
    /// Covariance.
    pub covariance: Matrix3<f64>,
}

impl MetricState {
    /// One metre per unit with standard deviation `scale_sigma`, at the origin.
    #[must_use]
    pub fn new(scale_sigma: f64) -> Self {
        let mut covariance = Matrix3::zeros();
        covariance[(0, 0)] = scale_sigma * scale_sigma;
        Self {
            mean: Vector3::new(1.0, 0.0, 0.0),
            covariance,
        }
    }

    /// The state after the pose of the frame is known.
    ///
    /// `prior` is the motion prior the pose was proposed under; its gain
    /// g = d pose / d s makes (pose, s) jointly Gaussian, so knowing the pose is
    /// a linear measurement of s. Then p += s dc - (R_t - R_{t-1}) l.
    #[must_use]
    pub fn condition_on_pose(&self, prior: &MotionPrior, pose: &CameraPose) -> Self {
        let mut mean = self.mean;
        let mut covariance = self.covariance;
        covariance[(0, 0)] += prior.scale_drift_variance;
        if covariance[(0, 0)] > 0.0 {
            let innovation: PoseStep = prior.mean.local(pose);
            // Whitened by the factor of P = A A^T: one solve serves K and S.
            if let (Some(w_innovation), Some(w_gain)) = (
                prior.factor.solve_lower_triangular(&innovation),
                prior.factor.solve_lower_triangular(&prior.scale_gain),
            ) {
                let cross = covariance.column(0).into_owned();
                let gain = cross * w_gain.dot(&w_innovation);
                mean += gain;
                covariance -= cross * cross.transpose() * w_gain.norm_squared();
            }
        }
        let step = Vector2::new(
            pose.centre.x - prior.from.centre.x,
            pose.centre.y - prior.from.centre.y,
        );
        let turn = prior.lever_displacement(pose.phi);
        let transition = Matrix3::new(1.0, 0.0, 0.0, step.x, 1.0, 0.0, step.y, 0.0, 1.0);
        let mut mean = transition * mean;
        mean.y -= turn.x;
        mean.z -= turn.y;
        let covariance = transition * covariance * transition.transpose();
        Self {
            mean,
            covariance: (covariance + covariance.transpose()) * 0.5,
        }
    }

    /// The metric body pose with heading `phi`.
    #[must_use]
    pub fn body(&self, phi: f64) -> PlanarPose {
        PlanarPose {
            x: self.mean.y,
            y: self.mean.z,
            phi,
        }
    }
}

/// One particle. Cloning shares path and map.
#[derive(Debug, Clone)]
pub struct Particle {
    /// Pose at the last keyframe, or of this frame while it is being processed.
    pub pose: CameraPose,
    /// Keyframes so far.
    pub path: PersistentPath<Keyframe>,
    /// Landmarks.
    pub map: CowMap<Landmark>,
    /// Scale and metric position given the path.
    pub metric: MetricState,
    /// Motion prior of the frame being processed; kept for the evolution moves
    /// and for the scale, shared between copies.
    pub prior: Option<Arc<Drawn>>,
}

/// What a pose was drawn from.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// Motion prior.
    pub prior: MotionPrior,
    /// Lower factor of the covariance of the proposal, tangent of the pose; it
    /// depends on prior, map and image, not on the draw.
    pub step_factor: PoseMatrix,
}

impl Particle {
    /// A particle at `pose` with an empty map.
    #[must_use]
    pub fn new(pose: CameraPose, metric: MetricState) -> Self {
        Self {
            pose,
            path: PersistentPath::new(),
            map: CowMap::new(),
            metric,
            prior: None,
        }
    }

    /// Geometry of a landmark of this particle; `None` when its anchor is not
    /// in the path.
    #[must_use]
    pub fn geometry(&self, landmark: &Landmark) -> Option<LandmarkGeometry> {
        match landmark.anchor() {
            None => Some(LandmarkGeometry::new(None)),
            Some(a) => self
                .path
                .get(a as usize)
                .map(|k| LandmarkGeometry::new(Some(&k.camera))),
        }
    }

    /// World position and covariance of a landmark in metres; `None` while its
    /// depth is not positive.
    ///
    /// `mount` is the camera's position in the body, metres. Lengths are converted at the anchor with the particle's present scale.
    #[must_use]
    pub fn metric_point(
        &self,
        landmark: &Landmark,
        mount: &Vector3<f64>,
    ) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let anchor = match landmark.anchor() {
            Some(a) => Some(self.path.get(a as usize)?),
            None => None,
        };
        let (point, covariance) = landmark.to_point(anchor.map(|k| &k.camera))?;
        let Some(keyframe) = anchor else {
            return Some((point, covariance));
        };
        let (sin, cos) = keyframe.body.phi.sin_cos();
        let camera_metric = Vector3::new(
            keyframe.body.x + cos * mount.x - sin * mount.y,
            keyframe.body.y + sin * mount.x + cos * mount.y,
            // The path starts at the mount's height, which is in metres already.
            mount.z + (keyframe.camera.centre.z - mount.z) * keyframe.scale,
        );
        let s = self.metric.mean.x;
        Some((
            camera_metric + (point - keyframe.camera.centre) * s,
            covariance * (s * s),
        ))
    }
}
