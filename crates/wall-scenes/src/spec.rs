//! The specification of a sequence: the experiment, its seed, its length and its noise.

use crate::error::SceneError;
use crate::trajectory::OdometryNoise;
use serde::{Deserialize, Serialize};

/// Largest number of frames of one sequence.
const MOST_FRAMES: usize = 5000;
/// Largest standard deviation of any noise, in its own unit.
const MOST_NOISE: f64 = 64.0;

/// The two experiments of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SceneKind {
    /// Straight along a wall.
    Wall,
    /// A closed loop in a room.
    Room,
}

/// Everything that determines a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SceneSpec {
    /// Which experiment.
    pub kind: SceneKind,
    /// Seed of geometry, skins, steering and noise.
    pub seed: u64,
    /// Number of images, 2 to 5000.
    pub frames: usize,
    /// Standard deviation of the pixel noise at mid grey, in grey levels.
    pub noise_px: f64,
    /// Errors of the wheel odometry.
    pub odometry: OdometryNoise,
}

impl SceneSpec {
    /// The paper's wall run: 38 frames.
    pub fn wall(seed: u64) -> Self {
        Self {
            kind: SceneKind::Wall,
            seed,
            frames: 38,
            noise_px: 2.0,
            odometry: OdometryNoise::PAPER,
        }
    }

    /// The paper's room run: 186 frames.
    pub fn room(seed: u64) -> Self {
        Self {
            kind: SceneKind::Room,
            frames: 186,
            ..Self::wall(seed)
        }
    }

    /// Whether a scene can be built.
    ///
    /// # Errors
    /// Too few or too many frames, or a noise that is negative or not finite.
    pub fn check(&self) -> Result<(), SceneError> {
        if !(2..=MOST_FRAMES).contains(&self.frames) {
            return Err(SceneError::Frames {
                given: self.frames,
                most: MOST_FRAMES,
            });
        }
        let noise = self.odometry;
        for (name, given) in [
            ("pixel noise", self.noise_px),
            ("odometry speed noise", noise.speed_ratio),
            ("odometry heading noise", noise.heading_rad),
            ("odometry speed bias", noise.speed_bias_ratio),
            ("odometry turn bias", noise.turn_bias_radps),
        ] {
            if !(0.0..=MOST_NOISE).contains(&given) {
                return Err(SceneError::Noise {
                    name,
                    given,
                    most: MOST_NOISE,
                });
            }
        }
        Ok(())
    }
}
