//! The car of Victoria Park and the filters on it.

use super::motion::{moved, propagate};
use super::published::PublishedProposal;
use super::run::{Estimate, run};
use super::victoria_data::Run;
use nalgebra::{Matrix3, SMatrix, Vector3};
use rbpf_core::{
    Associating, AssociationRules, DoubtingMapping, ExistenceRules, ExtendedLandmarks,
    ExtendedProposal, Gaussian, LandmarkMapping, LandmarkParticle, Linearisation, MotionModel,
    NamingParticle, RangeBearing, Scan, UnscentedLandmarks, UnscentedProposal, wrap_angle,
};
use std::error::Error;

/// Which filter; nobody knows the trunks by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filter {
    /// FastSLAM 2.0 with its published weights.
    FastSlam2Published,
    /// FastSLAM 2.0 with exact weights.
    FastSlam2,
    /// Unscented proposal and landmarks.
    Unscented,
}

impl Filter {
    /// All of them.
    pub(crate) const ALL: [Self; 3] = [Self::FastSlam2Published, Self::FastSlam2, Self::Unscented];

    /// For tables.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::FastSlam2Published => "FastSLAM 2.0 published weights",
            Self::FastSlam2 => "FastSLAM 2.0",
            Self::Unscented => "unscented",
        }
    }
}

/// Half a metre is a trunk seen from its near side; 1.5 degrees three steps of the scanner.
const SENSOR: RangeBearing = RangeBearing {
    range_deviation: 0.5,
    bearing_deviation: 0.026,
    farthest: 30.0,
    half_angle: std::f64::consts::FRAC_PI_2,
};

/// Gate of 99 %; what belongs to no trunk is as likely anywhere in 30 m and pi rad. A trunk not seen
/// within 20 m is less likely to be there.
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

/// Of every sample of 25 ms while the car moves, as in the paper: m/s and radians.
const SPEED_DEVIATION: f64 = 0.8;
const STEERING_DEVIATION: f64 = 0.0314;
const SAMPLE: f64 = 0.025;

/// Metres: wheelbase, rear left wheel off the axis, and the scanner ahead of the rear axle and beside the axis.
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
        mean.z = wrap_angle(mean.z);
        Gaussian { mean, covariance }
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        moved(pose, tangent)
    }
}

/// The path by wheel and steering alone.
pub(crate) fn dead_reckoning(recording: &Run) -> Estimate {
    let mut pose = Vector3::zeros();
    let poses = recording
        .scans
        .iter()
        .map(|scan| {
            pose = Car.predict(&pose, &scan.odometry).mean;
            pose
        })
        .collect();
    Estimate {
        poses,
        landmarks: Vec::new(),
    }
}

/// Runs a filter through the recording, from the pose (0, 0, 0).
///
/// # Errors
/// What the filter reports.
pub(crate) fn estimate(
    recording: &Run,
    filter: Filter,
    particles: usize,
    seed: u64,
) -> Result<Estimate, Box<dyn Error>> {
    let start = NamingParticle::<3, 2, 2>::new(LandmarkParticle::new(Vector3::zeros()));
    let scans: Vec<_> = recording
        .scans
        .iter()
        .map(|scan| Scan {
            control: scan.odometry.clone(),
            measurements: scan.trunks.clone(),
        })
        .collect();
    let published = Associating {
        motion: Car,
        sensor: SENSOR,
        inner: PublishedProposal {
            motion: Car,
            sensor: SENSOR,
        },
        rules: RULES,
    };
    let extended = Associating {
        motion: Car,
        sensor: SENSOR,
        inner: ExtendedProposal::<_, _, 3, 2> {
            motion: Car,
            sensor: SENSOR,
            linearisation: Linearisation::Sequential,
        },
        rules: RULES,
    };
    let unscented = Associating {
        motion: Car,
        sensor: SENSOR,
        inner: UnscentedProposal::<_, _, 3, 2> {
            motion: Car,
            sensor: SENSOR,
            iterations: 2,
        },
        rules: RULES,
    };
    let by_jacobians = DoubtingMapping {
        mapping: LandmarkMapping {
            sensor: SENSOR,
            filter: ExtendedLandmarks,
        },
        existence: EXISTENCE,
    };
    let by_sigma_points = DoubtingMapping {
        mapping: LandmarkMapping {
            sensor: SENSOR,
            filter: UnscentedLandmarks,
        },
        existence: EXISTENCE,
    };
    let map = |naming: &NamingParticle<3, 2, 2>| naming.particle.clone();
    match filter {
        Filter::FastSlam2Published => run(
            start,
            particles,
            seed,
            &scans,
            &published,
            &by_jacobians,
            map,
        ),
        Filter::FastSlam2 => run(
            start,
            particles,
            seed,
            &scans,
            &extended,
            &by_jacobians,
            map,
        ),
        Filter::Unscented => run(
            start,
            particles,
            seed,
            &scans,
            &unscented,
            &by_sigma_points,
            map,
        ),
    }
}
