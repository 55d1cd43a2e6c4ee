//! Results of the frame loop as plain values: a planar pose, the fate of a keypoint, a landmark of the map.

use estimation_base::Se2;
use nalgebra::{Matrix3, Vector3};

/// Planar pose of the body in the world (metres, radians).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarPose {
    /// Metres along the world's x axis.
    pub x: f64,
    /// Metres along the world's y axis.
    pub y: f64,
    /// Heading in radians, in (-pi, pi].
    pub phi: f64,
}

pub use crate::slam::KeypointFate;

/// One landmark of the final map.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkRecord {
    /// Identity, stable over the run.
    pub id: u32,
    /// Position in the world, metres.
    pub position: Vector3<f64>,
    /// Covariance of the position, m^2.
    pub covariance: Matrix3<f64>,
    /// Frames that measured it.
    pub observations: u32,
    /// Its descriptor.
    pub descriptor: Option<Box<[u8; 128]>>,
}

impl From<PlanarPose> for Se2 {
    fn from(PlanarPose { x, y, phi }: PlanarPose) -> Self {
        Se2 { x, y, phi }
    }
}

impl From<mono_geometry::Se2> for PlanarPose {
    fn from(mono_geometry::Se2 { x, y, phi }: mono_geometry::Se2) -> Self {
        PlanarPose { x, y, phi }
    }
}
