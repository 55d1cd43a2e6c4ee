//! The car of Victoria Park and the filters on it. Nobody knows the trunks by name.

use super::motion::{between, moved, propagate};
use super::run::{Estimate, Method, Robot, Trial};
use super::victoria_data::Run;
use estimation_base::wrap;
use nalgebra::{Matrix3, SMatrix, Vector3};
use range_bearing_slam::{
    AssociationRules, ExistenceRules, Gaussian, MotionModel, RangeBearing, Scan,
};
use std::error::Error;

/// Half a metre is a trunk seen from its near side; 1.5 degrees three steps of the scanner.
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

type Commands = Vec<[f64; 3]>;

/// The model of the data's authors: speed of the rear left wheel and steering, pose at the scanner.
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

impl MotionModel<3> for Car {
    type Control = Commands;

    fn predict(&self, pose: &Vector3<f64>, commands: &Commands) -> Gaussian<3> {
        /// Radians; the central difference is then good to 1e-10.
        const STEP: f64 = 1e-5;
        let mut mean = *pose;
        let mut covariance = Matrix3::identity() * 1e-8;
        for &[seconds, speed, steering] in commands {
            let step = Self::rate(mean.z, speed, steering) * seconds;
            let mut f = Matrix3::identity();
            f[(0, 2)] = -step.y;
            f[(1, 2)] = step.x;
            let ahead = Self::rate(mean.z, speed, steering + STEP);
            let behind = Self::rate(mean.z, speed, steering - STEP);
            let g = SMatrix::<f64, 3, 2>::from_columns(&[
                Self::rate(mean.z, 1.0, steering) * seconds,
                (ahead - behind) * (seconds / (2.0 * STEP)),
            ]);
            // an error lasts a sample: part of one that a scan cut in two has the same share in both
            let moving = if speed == 0.0 {
                0.0
            } else {
                SAMPLE / seconds.max(SAMPLE / 2.0)
            };
            let variances = [
                SPEED_DEVIATION.powi(2) * moving,
                STEERING_DEVIATION.powi(2) * moving,
            ];
            covariance = propagate(&covariance, &f, &g, variances);
            mean += step;
        }
        mean.z = wrap(mean.z);
        Gaussian { mean, covariance }
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        moved(pose, tangent)
    }

    fn local(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
        between(from, to)
    }
}

const ROBOT: Robot<Car> = Robot {
    motion: Car,
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
