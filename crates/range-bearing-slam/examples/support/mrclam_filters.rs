//! The filters on the MRCLAM robots.

use super::motion::{Commanded, Planar, Step};
use super::mrclam_data::Run;
use super::run::{Estimate, Method, Robot, Trial};
use nalgebra::{SMatrix, Vector3};
use range_bearing_slam::{
    AssociationRules, ExistenceRules, Frame, LandmarkParticle, RangeBearing, Scan,
};
use std::error::Error;

/// A filter that reads the barcodes, or one that names its measurements itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Filter {
    /// Proposal and landmark filter.
    pub(crate) method: Method,
    /// Whether landmarks come with their names.
    pub(crate) reads_barcodes: bool,
}

impl Filter {
    /// The filters that are compared.
    pub(crate) const ALL: [Self; 5] = [
        Self::named(Method::FastSlam2Published),
        Self::named(Method::FastSlam2),
        Self::named(Method::Unscented),
        Self::unnamed(Method::FastSlam2),
        Self::unnamed(Method::Unscented),
    ];

    pub(crate) const fn named(method: Method) -> Self {
        Self {
            method,
            reads_barcodes: true,
        }
    }

    const fn unnamed(method: Method) -> Self {
        Self {
            method,
            reads_barcodes: false,
        }
    }

    /// The name in tables.
    pub(crate) fn name(self) -> String {
        let method = self.method.name();
        if self.reads_barcodes {
            method.to_owned()
        } else {
            format!("{method} without barcodes")
        }
    }
}

/// The sensor reads barcodes up to 8 m away, and reads those within 6 m and 0.3 rad often.
const SENSOR: RangeBearing = RangeBearing {
    range_deviation: 0.25,
    bearing_deviation: 0.04,
    farthest: 8.0,
    half_angle: 0.375,
};

/// The gate is that of 99 %; a measurement of no landmark is as likely anywhere in 6 m and 1 rad. Misread
/// barcodes make landmarks that are not there: one that is near and ahead and not seen is doubted, if
/// slowly, since barcodes are read one at a time.
const RULES: AssociationRules = AssociationRules {
    gate: 9.21,
    new_landmark: 60.0,
    log_new: -1.8,
};
const EXISTENCE: ExistenceRules = ExistenceRules {
    seen: 1.0,
    missed: -0.1,
    highest: 8.0,
    lowest: -1.0,
};

/// The robot's motion: exact arcs, with variances in proportion to the time that a command lasts.
#[derive(Clone, Copy, Debug)]
struct Create;

/// Standard deviations after one second: shares of speed and turn rate, and metres and radians whenever
/// the robot moves.
const SPEED_SHARE: f64 = 0.1;
const TURN_SHARE: f64 = 0.2;
const SPEED_FLOOR: f64 = 0.01;
const TURN_FLOOR: f64 = 0.02;

impl Commanded for Create {
    /// Seconds, forward velocity in m/s, turn rate in rad/s.
    type Command = [f64; 3];

    const FLOOR: f64 = 1e-10;

    fn step(&self, heading: f64, &[seconds, velocity, turn_rate]: &[f64; 3]) -> Step {
        let half_turn = 0.5 * turn_rate * seconds;
        // the chord of the arc over its length; the series is exact to 1e-14 there
        let chord = if half_turn.abs() < 1e-3 {
            1.0 - half_turn * half_turn / 6.0
        } else {
            half_turn.sin() / half_turn
        };
        let distance = velocity * seconds * chord;
        let (sin, cos) = (heading + half_turn).sin_cos();
        let moving = if velocity == 0.0 && turn_rate == 0.0 {
            0.0
        } else {
            seconds
        };
        Step {
            displacement: Vector3::new(distance * cos, distance * sin, turn_rate * seconds),
            // by the distance and the turn; half of the turn acts before the step
            by_noise: SMatrix::<f64, 3, 2>::new(
                cos,
                -0.5 * distance * sin,
                sin,
                0.5 * distance * cos,
                0.0,
                1.0,
            ),
            variances: [
                ((SPEED_SHARE * velocity).powi(2) + SPEED_FLOOR.powi(2)) * moving,
                ((TURN_SHARE * turn_rate).powi(2) + TURN_FLOOR.powi(2)) * moving,
            ],
        }
    }
}

const ROBOT: Robot<Planar<Create>> = Robot {
    motion: Planar(Create),
    sensor: SENSOR,
    rules: RULES,
    existence: EXISTENCE,
};

/// The path by the commands alone.
pub(crate) fn dead_reckoning(recording: &Run) -> Estimate {
    let controls = recording.instants.iter().map(|instant| &instant.odometry);
    ROBOT.dead_reckoning(recording.start, controls)
}

/// Runs a filter through the recording.
///
/// # Errors
/// Any error of the filter.
pub(crate) fn estimate(
    recording: &Run,
    filter: Filter,
    particles: usize,
    seed: u64,
) -> Result<Estimate, Box<dyn Error>> {
    let instants = recording.instants.iter();
    let start = recording.start;
    if !filter.reads_barcodes {
        let scans: Vec<_> = instants
            .map(|instant| Scan {
                control: instant.odometry.clone(),
                measurements: instant.measurements.iter().map(|&(_, z)| z).collect(),
            })
            .collect();
        let trial = Trial {
            start,
            particles,
            seed,
            frames: &scans,
        };
        return ROBOT.associate(filter.method, &trial);
    }
    let frames: Vec<_> = instants
        .map(|instant| Frame {
            control: instant.odometry.clone(),
            measurements: instant.measurements.clone(),
        })
        .collect();
    let trial = Trial {
        start,
        particles,
        seed,
        frames: &frames,
    };
    let (jacobians, sigma) = (ROBOT.by_jacobians(), ROBOT.by_sigma_points());
    let start = LandmarkParticle::new(start);
    match filter.method {
        Method::FastSlam2Published => {
            trial.run(start, &ROBOT.published(), &jacobians, Clone::clone)
        }
        Method::FastSlam2 => trial.run(start, &ROBOT.extended(), &jacobians, Clone::clone),
        Method::Unscented => trial.run(start, &ROBOT.unscented(), &sigma, Clone::clone),
    }
}
