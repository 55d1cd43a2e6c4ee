//! A map as it outlives its run: what localisation and going on need, in metres.
//!
//! Landmarks stay anchored in the keyframes that saw them first, because their uncertainty is simple only there. Poses and
//! depths are those of the best particle, brought from its own unit to metres.

use mono_geometry::{Camera, Se2, Se3};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// A keyframe of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownKeyframe {
    /// Pose of the camera in the world, metres.
    pub world_from_camera: Se3,
    /// Pose of the body in the world, metres and radians.
    pub body: Se2,
    /// Covariance of the body pose over (x, y, phi): m^2, m rad, rad^2.
    pub covariance: Matrix3<f64>,
}

/// A landmark of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownLandmark {
    /// Identity in the run that made the map, ascending in [`KnownMap::landmarks`].
    pub id: u32,
    /// Index of the keyframe whose camera its parameters refer to.
    pub anchor: u32,
    /// (alpha, beta, rho): the point is at ((alpha, beta, 1) / rho) in the axes of the anchor camera, rho in 1/m.
    pub parameters: Vector3<f64>,
    /// Covariance of the parameters given the anchor.
    pub covariance: Matrix3<f64>,
    /// Descriptor of its last sighting.
    pub descriptor: [u8; 128],
    /// Number of keyframes that measured it.
    pub observations: u32,
    /// Belief that it exists, log odds.
    pub existence: f64,
    /// Direction from the camera to it at its last sighting, world axes, unit length; zero if it was seen once.
    pub last_direction: Vector3<f64>,
}

/// The joint covariance of the errors of some keyframes of a map, spread over all of it.
///
/// An error (dx, dy, dphi) is that of the body pose in world axes: m, m, rad.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KnownErrors {
    /// Indices of the keyframes, ascending.
    pub keyframes: Vec<u32>,
    /// Lower triangle by rows: row i holds cov(e_i, e_0) ... cov(e_i, e_i).
    pub rows: Vec<Vec<Matrix3<f64>>>,
}

/// A map that outlives its run.
///
/// The anchors of its landmarks are indices of its keyframes.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownMap {
    /// The camera that saw the landmarks.
    pub camera: Camera,
    /// Keyframes in the order of their times.
    pub keyframes: Vec<KnownKeyframe>,
    /// Errors of keyframes that the path has in common: drift, without that of the calibration and of the wheels' scale.
    pub errors: KnownErrors,
    /// Landmarks in order of their ids.
    pub landmarks: Vec<KnownLandmark>,
}

/// The use that a run makes of a map it begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum MapUse {
    /// New landmarks are added and old ones refined and forgotten.
    Extend,
    /// The map stays as it is.
    Localise,
}
