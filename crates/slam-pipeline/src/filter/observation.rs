//! The measurements of one frame, the same for every particle.

use mono_geometry::Pinhole;
use mono_geometry::inverse_depth::{LandmarkGeometry, LandmarkView};
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::landmark::Landmark;
use super::particle::Particle;
use super::pixel_noise::PixelNoise;
use crate::odometry::Control;

/// How a match enters the pose: decided once for all particles, so that their
/// weights compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Scoring {
    /// Both pixel coordinates.
    Full,
    /// Only the coordinate across the epipolar line, because the depth is still open.
    /// A free depth would pay nothing for a shorter step and shrink the world.
    AcrossEpipolar,
    /// Neither of them; only the landmark is updated by it.
    MapOnly,
}

/// One keypoint matched to one landmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct MatchedFeature {
    /// Landmark.
    pub(crate) id: u32,
    /// Measured pixel, undistorted.
    pub(crate) pixel: Vector2<f64>,
    /// Its noise.
    pub(crate) noise: PixelNoise,
    /// How it enters the pose.
    pub(crate) scoring: Scoring,
    /// The landmark before its second sighting, the same in every particle;
    /// `None` once the particles hold it.
    pub(crate) prototype: Option<Landmark>,
}

/// A sighting at a keyframe.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Sighting {
    /// Keyframe index.
    pub(crate) keyframe: u32,
    /// Ideal pixel.
    pub(crate) pixel: Vector2<f64>,
}

/// A landmark that starts from two views (delayed methods).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Initialisation {
    /// Landmark.
    pub(crate) id: u32,
    /// First sighting.
    pub(crate) first: Sighting,
    /// Ideal pixel in this frame.
    pub(crate) second: Vector2<f64>,
    /// Noises of the two pixels.
    pub(crate) noise: [PixelNoise; 2],
}

/// Everything a filter step needs from one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct FrameObservation {
    /// Odometry since the last filter step.
    pub(crate) control: Control,
    /// Matches, in order of landmark id.
    pub(crate) matches: Vec<MatchedFeature>,
    /// Landmarks that start from two views with this frame.
    pub(crate) initialised: Vec<Initialisation>,
    /// Landmarks that leave the map with this frame.
    pub(crate) removed: Vec<u32>,
}

/// A match with the landmark as one particle knows it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Prepared {
    /// Geometry of the landmark in the particle.
    pub(crate) geometry: LandmarkGeometry,
    /// Parameters.
    pub(crate) mean: Vector3<f64>,
    /// Covariance of the parameters.
    pub(crate) covariance: Matrix3<f64>,
    /// Measured pixel.
    pub(crate) pixel: Vector2<f64>,
    /// Its noise.
    pub(crate) noise: PixelNoise,
    /// How it enters the pose.
    pub(crate) scoring: Scoring,
}

impl Prepared {
    /// Parameters at which to linearise, in the camera of `view`: those of the mean, or of the depth the
    /// pixel shows when the depth is open.
    #[must_use]
    #[inline]
    pub(crate) fn focus(&self, pinhole: &Pinhole, view: &LandmarkView) -> Vector3<f64> {
        if self.scoring == Scoring::AcrossEpipolar && self.geometry.anchor().is_some() {
            let highest = self.mean.z + 4.0 * self.covariance[(2, 2)].sqrt();
            view.refocus(pinhole, &self.mean, &self.pixel, highest)
        } else {
            self.mean
        }
    }

    /// The standard deviation of the inverse depth, if its ratio to the inverse depth is above `threshold`; `None` for
    /// a depth that is closed.
    #[must_use]
    pub(crate) fn open_sigma(&self, threshold: f64) -> Option<f64> {
        let sigma = self.covariance[(2, 2)].sqrt();
        (self.geometry.anchor().is_some() && sigma > threshold * self.mean.z.abs()).then_some(sigma)
    }
}

impl FrameObservation {
    /// The matches that enter the pose of `particle`, in order; `None` where the
    /// particle lacks the landmark.
    #[must_use]
    pub(crate) fn prepare(&self, particle: &Particle) -> Vec<Option<Prepared>> {
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
                    noise: m.noise,
                    scoring: m.scoring,
                })
            })
            .collect()
    }
}
