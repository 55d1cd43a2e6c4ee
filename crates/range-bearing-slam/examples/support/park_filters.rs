//! The car of Victoria Park and the filters on it. The trunks have no names.

use super::motion::{Commanded, Planar, Step};
use super::run::{Estimate, Method, Robot, Trial};
use super::victoria_data::Run;
use nalgebra::{SMatrix, Vector3};
use range_bearing_slam::{AssociationRules, ExistenceRules, RangeBearing, Scan};
use std::error::Error;

/// Half a metre is the offset of a trunk seen from its near side; 1.5 degrees are three steps of the
/// scanner.
const SENSOR: RangeBearing = RangeBearing {
    range_deviation: 0.5,
    bearing_deviation: 0.026,
    farthest: 30.0,
    half_angle: std::f64::consts::FRAC_PI_2,
};

/// The gate is that of 99 %; a measurement of no trunk is as likely anywhere in 30 m and pi rad. A trunk
/// that is within 20 m and not seen is less likely to be there.
const RULES: AssociationRules = AssociationRules {
    gate: 9.21,
    new_landmark: 60.0,
    log_new: -4.5,
};
const EXISTENCE: ExistenceRules = ExistenceRules {
    seen: 1.0,
    missed: -0.3,
    highest: 8.0,
    lowest: -1.0,
};

/// Standard deviations of every sample of 25 ms while the car moves, as in the paper: m/s and radians.
const SPEED_DEVIATION: f64 = 0.8;
const STEERING_DEVIATION: f64 = 0.0314;
const SAMPLE: f64 = 0.025;

/// Metres: the wheelbase, the distance of the rear left wheel from the axis, and the scanner ahead of the
/// rear axle and beside the axis.
const WHEELBASE: f64 = 2.83;
const WHEEL_OFFSET: f64 = 0.76;
const SCANNER: [f64; 2] = [3.78, 0.5];

/// The model of the data's authors: the speed is that of the rear left wheel, the pose that of the
/// scanner.
#[derive(Clone, Copy, Debug)]
struct Car;

impl Car {
    /// Change of the pose per second.
    fn rate(heading: f64, speed: f64, steering: f64) -> Vector3<f64> {
        let tan = steering.tan();
        let speed = speed / (1.0 - tan * WHEEL_OFFSET / WHEELBASE);
        let turn = speed * tan / WHEELBASE;
        let (sin, cos) = heading.sin_cos();
        let [ahead, beside] = SCANNER;
        Vector3::new(
            speed * cos - turn * (ahead * sin + beside * cos),
            speed * sin + turn * (ahead * cos - beside * sin),
            turn,
        )
    }
}

impl Commanded for Car {
    /// Seconds, speed of the rear left wheel in m/s, steering angle in radians.
    type Command = [f64; 3];

    const FLOOR: f64 = 1e-8;

    fn step(&self, heading: f64, &[seconds, speed, steering]: &[f64; 3]) -> Step {
        /// Radians; the central difference is then good to 1e-10.
        const DIFFERENCE: f64 = 1e-5;
        let ahead = Self::rate(heading, speed, steering + DIFFERENCE);
        let behind = Self::rate(heading, speed, steering - DIFFERENCE);
        // an error lasts a sample: both parts of a sample that a scan cuts in two have the same share
        let moving = if speed == 0.0 {
            0.0
        } else {
            SAMPLE / seconds.max(SAMPLE / 2.0)
        };
        Step {
            displacement: Self::rate(heading, speed, steering) * seconds,
            by_noise: SMatrix::from_columns(&[
                Self::rate(heading, 1.0, steering) * seconds,
                (ahead - behind) * (seconds / (2.0 * DIFFERENCE)),
            ]),
            variances: [
                SPEED_DEVIATION.powi(2) * moving,
                STEERING_DEVIATION.powi(2) * moving,
            ],
        }
    }
}

const ROBOT: Robot<Planar<Car>> = Robot {
    motion: Planar(Car),
    sensor: SENSOR,
    rules: RULES,
    existence: EXISTENCE,
};

/// The filters that are compared.
pub(crate) const METHODS: [Method; 3] = [
    Method::FastSlam2Published,
    Method::FastSlam2,
    Method::Unscented,
];

/// The path by wheel and steering alone.
pub(crate) fn dead_reckoning(recording: &Run) -> Estimate {
    let controls = recording.scans.iter().map(|scan| &scan.odometry);
    ROBOT.dead_reckoning(Vector3::zeros(), controls)
}

/// Runs a filter through the recording, from the pose (0, 0, 0).
///
/// # Errors
/// Any error of the filter.
pub(crate) fn estimate(
    recording: &Run,
    method: Method,
    particles: usize,
    seed: u64,
) -> Result<Estimate, Box<dyn Error>> {
    let scans: Vec<_> = recording
        .scans
        .iter()
        .map(|scan| Scan {
            control: scan.odometry.clone(),
            measurements: scan.trunks.clone(),
        })
        .collect();
    let trial = Trial {
        start: Vector3::zeros(),
        particles,
        seed,
        frames: &scans,
    };
    ROBOT.associate(method, &trial)
}
