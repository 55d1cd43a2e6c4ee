//! The problem: what was measured, where the iteration starts, and what is believed before.

use mono_geometry::{RobustLoss, Se2};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use slam_pipeline::config::{Method, OdometrySection, ValidConfig};
use slam_pipeline::{OdometryInterval, Rig};

use crate::constants::{Constant, Constants};
use crate::error::BatchError;

/// A pose to be estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct Keyframe {
    /// Body pose at which the iteration starts, metres and radians.
    pub start: Se2,
    /// Odometry since the keyframe before; `None` for the first keyframe of a drive, whose `start` is its pose.
    pub motion: Option<Vec<OdometryInterval>>,
}

/// One measurement of a landmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sighting {
    /// Index of the keyframe.
    pub keyframe: usize,
    /// Where it was found in the image, lens included.
    pub pixel: Vector2<f64>,
    /// Size of the keypoint, standard deviation of its blur, pixels: see [`slam_pipeline::keypoint_sigma_px`]. 0 where it is not
    /// known.
    pub size_px: f64,
}

/// All measurements of one landmark, by ascending keyframe.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Identity of the landmark.
    pub landmark: u32,
    /// Its sightings.
    pub sightings: Vec<Sighting>,
}

/// Noise and priors.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Standard deviation of a pixel coordinate of the smallest keypoints, where the keypoint was found.
    pub sigma_px: f64,
    /// Loss of the length of a whitened pixel residual.
    pub loss: RobustLoss,
    /// Noise of the odometry, row by row.
    pub odometry: OdometrySection,
    /// Standard deviation of roll and pitch, radians; zero for a strictly planar carrier.
    pub tilt_sigma: f64,
    /// Correlation time of roll and pitch, seconds.
    pub tilt_time_s: f64,
    /// Standard deviation of the slope of the floor; zero keeps the height.
    pub slope_sigma: f64,
    /// Standard deviation of the metres per unit of the visual map at the start; not used where `scale_drift` is zero.
    pub scale_sigma: f64,
    /// Drift of the metres per unit of the visual map, per square root of a metre; zero for a rigid map in metres.
    pub scale_drift: f64,
    /// Standard deviation of a constant error of the wheels' scale, relative. It is not estimated, because no image tells
    /// it: it widens the covariance of the positions. Where a lever arm may tell it, free [`Constant::WheelScale`]
    /// instead.
    pub scale_bias: f64,
    /// Nearest depth of a landmark that is plausible, metres.
    pub min_depth_m: f64,
    /// Standard deviations of the constants before the drive; zero fixes a constant.
    pub constants: Constants,
    /// Iterations at most.
    pub max_iterations: usize,
}

/// Threshold of the loss: the consensus has gated the matches before, so the bend is where two coordinates of a good
/// match hardly ever come.
const HUBER_SIGMAS: f64 = 2.5;
/// The turning centre of a table-top or room robot of which nothing more is said. A filter pays for this freedom with the
/// heading that its wheels know; the batch does not.
const TURNING_CENTRE_SIGMA_M: f64 = 0.1;

/// The noise of pixels in a batch over that in the filter. The batch is one rigid whole, which bends where camera and mount are
/// not what `camera.toml` says; with the noise of single keypoints it would bend for tenths of a pixel.
const RIGID_FACTOR: f64 = 2.0;

impl Model {
    /// The model that the filter believes, from its configuration, with a turning centre that is free by at least
    /// 0.1 m.
    #[must_use]
    pub fn of(config: &ValidConfig) -> Self {
        let tilts = config.filter.method == Method::Exact;
        let on = |value: f64| if tilts { value } else { 0.0 };
        Self {
            sigma_px: RIGID_FACTOR * config.features.sigma_px,
            loss: RobustLoss::Huber {
                threshold: HUBER_SIGMAS,
            },
            odometry: config.odometry.clone(),
            tilt_sigma: on(config.carrier.tilt_sigma),
            tilt_time_s: config.carrier.tilt_time_s,
            slope_sigma: on(config.carrier.slope_sigma),
            scale_sigma: on(config.carrier.scale_sigma),
            scale_drift: on(config.carrier.scale_drift),
            scale_bias: config.odometry.scale_bias,
            min_depth_m: config.mapping.min_depth_m,
            constants: Constants::ZERO
                .with(
                    Constant::TurningCentre,
                    config
                        .carrier
                        .turning_centre_sigma_m
                        .max(TURNING_CENTRE_SIGMA_M),
                )
                .with(Constant::TurnRateBias, config.carrier.turn_bias_sigma),
            max_iterations: 100,
        }
    }
}

/// A problem to solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// The camera on the robot.
    pub rig: Rig,
    /// Poses in the order of driving; several drives of one robot follow one another.
    pub keyframes: Vec<Keyframe>,
    /// Measurements.
    pub tracks: Vec<Track>,
    /// Noise and priors.
    pub model: Model,
}

impl Problem {
    /// Adds the keyframes and tracks of another drive of the same robot, to be solved together with this one: constants
    /// are shared, poses and landmarks are not. Noise and priors stay those of this problem.
    pub fn append(&mut self, drive: Self) {
        let before = self.keyframes.len();
        let next = self
            .tracks
            .iter()
            .map(|t| t.landmark.saturating_add(1))
            .max()
            .unwrap_or(0);
        self.keyframes.extend(drive.keyframes);
        self.tracks
            .extend(drive.tracks.into_iter().map(|mut track| {
                track.landmark = track.landmark.saturating_add(next);
                for sighting in &mut track.sightings {
                    sighting.keyframe += before;
                }
                track
            }));
    }

    /// Whether every number is usable.
    ///
    /// # Errors
    /// [`BatchError`] for the first that is not. O(sightings).
    pub fn check(&self) -> Result<(), BatchError> {
        let keyframes = self.keyframes.len();
        if keyframes < 2 {
            return Err(BatchError::TooFewKeyframes { found: keyframes });
        }
        if self.keyframes[0].motion.is_some() {
            return Err(BatchError::NoStart);
        }
        for keyframe in &self.keyframes {
            let Se2 { x, y, phi } = keyframe.start;
            for value in [x, y, phi] {
                within("start of a keyframe", value, "finite", |_| true)?;
            }
        }
        for track in &self.tracks {
            let mut next = 0;
            for sighting in &track.sightings {
                if sighting.keyframe < next || sighting.keyframe >= keyframes {
                    return Err(BatchError::Sighting {
                        landmark: track.landmark,
                        keyframe: sighting.keyframe,
                        keyframes,
                    });
                }
                next = sighting.keyframe + 1;
                for value in sighting.pixel.iter() {
                    within("pixel of a sighting", *value, "finite", |_| true)?;
                }
                within(
                    "size of a keypoint",
                    sighting.size_px,
                    "finite and not below 0",
                    |v| v >= 0.0,
                )?;
            }
        }
        self.model.check()
    }
}

impl Model {
    fn check(&self) -> Result<(), BatchError> {
        self.loss.check()?;
        within("sigma_px", self.sigma_px, "finite and above 0", |v| v > 0.0)?;
        within("min_depth_m", self.min_depth_m, "finite and above 0", |v| {
            v > 0.0
        })?;
        for (name, value) in [
            ("tilt_sigma", self.tilt_sigma),
            ("tilt_time_s", self.tilt_time_s),
            ("slope_sigma", self.slope_sigma),
            ("scale_sigma", self.scale_sigma),
            ("scale_drift", self.scale_drift),
            ("scale_bias", self.scale_bias),
        ] {
            within(name, value, "finite and not negative", |v| v >= 0.0)?;
        }
        for (constant, sigma) in self.constants.iter() {
            within(constant.name(), sigma, "finite and not negative", |v| {
                v >= 0.0
            })?;
        }
        Ok(())
    }
}

fn within(
    name: &'static str,
    value: f64,
    required: &'static str,
    good: impl Fn(f64) -> bool,
) -> Result<(), BatchError> {
    if value.is_finite() && good(value) {
        Ok(())
    } else {
        Err(BatchError::OutOfRange {
            name,
            value,
            required,
        })
    }
}
