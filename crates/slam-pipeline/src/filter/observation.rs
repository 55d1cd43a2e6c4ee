//! What one frame measured, the same for every particle.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::landmark::{Landmark, LandmarkGeometry, Lens};
use super::motion::Control;
use super::particle::Particle;
use super::pose::PlacedCamera;

/// How a match enters the pose: decided once for all particles, so that their
/// weights compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scoring {
    /// Both pixel coordinates.
    Full,
    /// Only the coordinate across the epipolar line: the depth is still open.
    /// A free depth would pay nothing for a shorter step and shrink the world.
    AcrossEpipolar,
    /// Not at all; the landmark alone learns from it.
    MapOnly,
}

/// One keypoint matched to one landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatchedFeature {
    /// Landmark.
    pub id: u32,
    /// Measured pixel, undistorted.
    pub pixel: Vector2<f64>,
    /// Variance of each pixel coordinate.
    pub variance_px2: f64,
    /// How it enters the pose.
    pub scoring: Scoring,
    /// The landmark before its second sighting, the same in every particle;
    /// `None` once the particles hold it.
    pub prototype: Option<Landmark>,
}

/// A landmark that starts from two views (delayed methods).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Initialisation {
    /// Landmark.
    pub id: u32,
    /// First sighting: keyframe and ideal pixel.
    pub first: (u32, Vector2<f64>),
    /// Ideal pixel in this frame.
    pub second: Vector2<f64>,
    /// Pixel noise.
    pub sigma_px: f64,
}

/// Everything a filter step needs from one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameObservation {
    /// Odometry since the last filter step.
    pub control: Control,
    /// Matches, in order of landmark id.
    pub matches: Vec<MatchedFeature>,
    /// Landmarks that start from two views with this frame.
    pub initialised: Vec<Initialisation>,
    /// Landmarks that leave the map with this frame.
    pub removed: Vec<u32>,
}

/// A match with the landmark as one particle knows it.
#[derive(Debug, Clone, Copy)]
pub struct Prepared {
    /// Geometry of the landmark in the particle.
    pub geometry: LandmarkGeometry,
    /// Parameters.
    pub mean: Vector3<f64>,
    /// Covariance of the parameters.
    pub covariance: Matrix3<f64>,
    /// Measured pixel.
    pub pixel: Vector2<f64>,
    /// Its variance.
    pub variance_px2: f64,
    /// How it enters the pose.
    pub scoring: Scoring,
}

impl Prepared {
    /// Parameters at which to linearise: those of the mean, or of the depth the
    /// pixel shows when the depth is open.
    #[must_use]
    pub fn focus(&self, lens: &Lens, camera: &PlacedCamera) -> Vector3<f64> {
        if self.scoring == Scoring::AcrossEpipolar {
            let highest = self.mean.z + 4.0 * self.covariance[(2, 2)].sqrt();
            lens.refocus(camera, &self.geometry, &self.mean, &self.pixel, highest)
        } else {
            self.mean
        }
    }

    /// sigma_rho when the depth is open, that is sigma_rho / rho above `threshold`.
    #[must_use]
    pub fn open_sigma(&self, threshold: f64) -> Option<f64> {
        let sigma = self.covariance[(2, 2)].sqrt();
        (self.geometry.is_inverse_depth() && sigma > threshold * self.mean.z.abs()).then_some(sigma)
    }
}

impl FrameObservation {
    /// The matches that enter the pose of `particle`, in order; `None` where the
    /// particle lacks the landmark.
    #[must_use]
    pub fn prepare(&self, particle: &Particle) -> Vec<Option<Prepared>> {
        self.matches
            .iter()
            .filter(|m| m.scoring != Scoring::MapOnly)
            .map(|m| {
                let landmark = particle.map.get(m.id).or(m.prototype.as_ref())?;
                Some(Prepared {
                    geometry: particle.geometry(landmark)?,
                    mean: landmark.mean,
                    covariance: landmark.covariance,
                    pixel: m.pixel,
                    variance_px2: m.variance_px2,
                    scoring: m.scoring,
                })
            })
            .collect()
    }
}
