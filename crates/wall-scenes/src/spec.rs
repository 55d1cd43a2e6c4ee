//! The specification of a sequence: the experiment, its seed, its length and its noise.

use crate::calibration::CalibrationError;
use crate::camera::Lens;
use crate::carrier::Carrier;
use crate::error::SceneError;
use crate::mishaps::{FrameSpan, Mishaps};
use crate::odometry::OdometryNoise;
use crate::stops::{Stop, Stops};
use crate::timing::FrameRate;
use serde::{Deserialize, Serialize};

/// Largest number of frames of one sequence, and of its images.
const MOST_FRAMES: usize = 40_000;
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
    /// Frames of half a second, 2 to 40,000: the length of the drive with its stops, and the number of images at frame
    /// rate one.
    pub frames: usize,
    /// Standard deviation of the pixel noise at mid grey, in grey levels.
    pub noise_px: f64,
    /// Errors of the wheel odometry.
    pub odometry: OdometryNoise,
    /// Rounds of the room; the wall has none.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub laps: usize,
    /// Images per frame.
    #[serde(default, skip_serializing_if = "is_default")]
    pub frame_rate: FrameRate,
    /// Departures of the robot from its wheels.
    #[serde(default, skip_serializing_if = "is_default")]
    pub carrier: Carrier,
    /// Errors of the stated calibration.
    #[serde(default, skip_serializing_if = "is_default")]
    pub calibration: CalibrationError,
    /// Pauses and turns on the spot.
    #[serde(default, skip_serializing_if = "is_default")]
    pub stops: Stops,
    /// Two boards with the same poster in different places.
    #[serde(default, skip_serializing_if = "is_default")]
    pub twin_posters: bool,
    /// Things that happen to the robot and its camera.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mishaps: Mishaps,
    /// Focal length in pixels of an equidistant fisheye in place of the paper's camera; none for that.
    #[serde(default, skip_serializing_if = "is_default")]
    pub fisheye_px: Option<f64>,
}

fn one() -> usize {
    1
}

fn is_one(laps: &usize) -> bool {
    *laps == 1
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
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
            laps: 1,
            frame_rate: FrameRate::ONE,
            carrier: Carrier::IDEAL,
            calibration: CalibrationError::default(),
            stops: Stops::default(),
            twin_posters: false,
            mishaps: Mishaps::default(),
            fisheye_px: None,
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

    /// The room run driven `laps` times at the same speed.
    pub fn laps(seed: u64, laps: usize) -> Self {
        Self {
            laps,
            frames: 15 + 171 * laps,
            ..Self::room(seed)
        }
    }

    /// The same drive with stops, longer by their frames.
    #[must_use]
    pub fn with_stops(self, stops: Stops) -> Self {
        let driven = self.stops.driven(self.frames.saturating_sub(1));
        Self {
            stops,
            frames: (1 + driven).saturating_add(stops.added(driven)),
            ..self
        }
    }

    /// Ten thousand frames in the room: 40 laps, after every 500 frames of driving a pause of 200 frames, and after every
    /// 400 a turn on the spot of 30 frames.
    #[must_use]
    pub fn soak(seed: u64) -> Self {
        let stops = Stops {
            pause: Some(Stop {
                every: 500,
                frames: 200,
            }),
            spin: Some(Stop {
                every: 400,
                frames: 30,
            }),
        };
        Self {
            frames: 10_000,
            ..Self::laps(seed, 40).with_stops(stops)
        }
    }

    /// The lens in front of the sensor.
    pub(crate) fn lens(&self) -> Lens {
        self.fisheye_px.map_or(Lens::Pinhole, Lens::Equidistant)
    }

    /// Everything out of the ordinary in the drive, a sentence each.
    pub(crate) fn told(&self) -> Vec<String> {
        let mut told = Vec::new();
        if let Some(Stop { every, frames }) = self.stops.pause {
            told.push(format!(
                "after every {every} frames of driving the robot stands still for {frames} frames"
            ));
        }
        if let Some(Stop { every, frames }) = self.stops.spin {
            told.push(format!(
                "after every {every} frames of driving the robot turns once around on the spot in {frames} frames"
            ));
        }
        if self.twin_posters {
            told.push("two boards in different places carry the same poster".into());
        }
        told.extend(self.mishaps.told());
        told
    }

    /// Whether a scene can be built.
    ///
    /// # Errors
    /// Too few or too many frames or images, or a number that is out of its range or not finite.
    pub fn check(&self) -> Result<(), SceneError> {
        if !(2..=MOST_FRAMES).contains(&self.frames) {
            return Err(SceneError::Frames {
                given: self.frames,
                most: MOST_FRAMES,
            });
        }
        let rate = self.frame_rate;
        let (carrier, calibration) = (self.carrier, self.calibration);
        for (name, given, low, high) in [
            ("laps", self.laps as f64, 1.0, 100.0),
            ("frame rate multiple", rate.multiple as f64, 1.0, 16.0),
            ("frame rate divisor", rate.divisor as f64, 1.0, 16.0),
            ("slip in curves", carrier.curve_slip_s, 0.0, 1.0),
            ("slip ratio", carrier.slip_ratio, 0.0, 0.5),
            ("roll", carrier.roll_rad, 0.0, 0.1),
            ("pitch", carrier.pitch_rad, 0.0, 0.1),
            ("origin ahead", carrier.origin_ahead_m, -0.8, 0.8),
            ("slope", carrier.slope_rad, -0.2, 0.2),
            ("turn bias", carrier.turn_bias_radps, -0.5, 0.5),
            ("wheel radius error", carrier.wheel_radius_ratio, -0.5, 0.5),
            ("mount yaw error", calibration.mount_yaw_rad, -0.2, 0.2),
            ("focal error", calibration.focal_ratio, -0.2, 0.2),
            // The corners see 82 degrees off the axis at the shortest.
            (
                "focal length of a fisheye",
                self.fisheye_px.unwrap_or(160.0),
                140.0,
                1000.0,
            ),
        ] {
            if !(low..=high).contains(&given) {
                return Err(SceneError::OutOfRange {
                    name,
                    given,
                    low,
                    high,
                });
            }
        }
        self.check_happenings()?;
        let images = rate.images(self.frames);
        if !(2..=MOST_FRAMES).contains(&images) {
            return Err(SceneError::Frames {
                given: images,
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

    /// Stops, spans and the place of a kidnapping.
    fn check_happenings(&self) -> Result<(), SceneError> {
        let frames = self.frames as f64;
        let range = |name, given: f64, low: f64, high: f64| {
            if (low..=high).contains(&given) {
                return Ok(());
            }
            Err(SceneError::OutOfRange {
                name,
                given,
                low,
                high,
            })
        };
        for (names, stop, fewest) in [
            (
                ["frames between pauses", "frames of a pause"],
                self.stops.pause,
                1.0,
            ),
            (
                ["frames between turns", "frames of a turn on the spot"],
                self.stops.spin,
                8.0,
            ),
        ] {
            if let Some(Stop { every, frames }) = stop {
                range(names[0], every as f64, 1.0, MOST_FRAMES as f64)?;
                range(names[1], frames as f64, fewest, MOST_FRAMES as f64)?;
            }
        }
        let Mishaps {
            kidnap,
            dark,
            blocked,
            shutter_s,
            ..
        } = self.mishaps;
        range("time of the shutter", shutter_s, 0.0, 0.5)?;
        if let Some(kidnap) = kidnap {
            range(
                "frame of the kidnapping",
                kidnap.frame as f64,
                1.0,
                frames - 2.0,
            )?;
            range("distance of the kidnapping", kidnap.metres, 0.05, 100.0)?;
        }
        for (names, span) in [
            (["first dark frame", "end of the dark frames"], dark),
            (
                ["first blocked frame", "end of the blocked frames"],
                blocked,
            ),
        ] {
            if let Some(FrameSpan { from, to }) = span {
                range(names[0], from as f64, 0.0, frames - 1.0)?;
                range(names[1], to as f64, from as f64 + 1.0, frames)?;
            }
        }
        Ok(())
    }
}
