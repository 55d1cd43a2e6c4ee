//! The filters on the MRCLAM robots.

use super::motion::{moved, propagate};
use super::mrclam_data::Run;
use super::published::PublishedProposal;
use super::run::{Estimate, run};
use nalgebra::{Matrix3, SMatrix, Vector3};
use rbpf_core::{
    Associating, AssociationRules, DoubtingMapping, ExistenceRules, ExtendedLandmarks,
    ExtendedProposal, Frame, Gaussian, LandmarkMapping, LandmarkParticle, Linearisation,
    MotionModel, NamingParticle, RangeBearing, Scan, UnscentedLandmarks, UnscentedProposal,
    wrap_angle,
};
use std::error::Error;

/// Which filter, and whether it reads the barcodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filter {
    /// FastSLAM 2.0 with its published weights.
    FastSlam2Published,
    /// FastSLAM 2.0 with exact weights.
    FastSlam2,
    /// Unscented proposal and landmarks.
    Unscented,
    /// FastSLAM 2.0 that finds out itself what it sees.
    FastSlam2Associating,
    /// Unscented, and finds out itself.
    UnscentedAssociating,
}

impl Filter {
    /// All of them.
    pub(crate) const ALL: [Self; 5] = [
        Self::FastSlam2Published,
        Self::FastSlam2,
        Self::Unscented,
        Self::FastSlam2Associating,
        Self::UnscentedAssociating,
    ];

    /// Whether landmarks come with their names.
    pub(crate) const fn reads_barcodes(self) -> bool {
        !matches!(
            self,
            Self::FastSlam2Associating | Self::UnscentedAssociating
        )
    }

    /// For tables.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::FastSlam2Published => "FastSLAM 2.0 published weights",
            Self::FastSlam2 => "FastSLAM 2.0",
            Self::Unscented => "unscented",
            Self::FastSlam2Associating => "FastSLAM 2.0 without barcodes",
            Self::UnscentedAssociating => "unscented without barcodes",
        }
    }
}

/// Barcodes are read up to 8 m away, those within 6 m and 0.3 rad often.
const SENSOR: RangeBearing = RangeBearing {
    range_deviation: 0.25,
    bearing_deviation: 0.04,
    farthest: 8.0,
    half_angle: 0.375,
};

/// Gate of 99 %; what belongs to no landmark is as likely anywhere in 6 m and 1 rad. Misread barcodes make landmarks
/// that are not there: one that is near and ahead and not seen is doubted, if slowly, since barcodes are read one at a time.
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

/// (seconds, forward velocity m/s, turn rate rad/s), one after the other.
type Commands = Vec<[f64; 3]>;

/// Exact arcs; the error of a command lasts as long as the command is the same second.
#[derive(Clone, Copy, Debug)]
struct Create;

/// Standard deviations after one second: share of the speed, share of the turn rate, and metres and radians whenever the robot moves.
const SPEED_SHARE: f64 = 0.1;
const TURN_SHARE: f64 = 0.2;
const SPEED_FLOOR: f64 = 0.01;
const TURN_FLOOR: f64 = 0.02;

impl MotionModel<3> for Create {
    type Control = Commands;

    fn predict(&self, pose: &Vector3<f64>, commands: &Commands) -> Gaussian<3> {
        let mut mean = *pose;
        let mut covariance = Matrix3::identity() * 1e-10;
        for &[seconds, velocity, turn_rate] in commands {
            let half_turn = 0.5 * turn_rate * seconds;
            // chord of the arc over its length; the series is exact to 1e-14 there
            let chord = if half_turn.abs() < 1e-3 {
                1.0 - half_turn * half_turn / 6.0
            } else {
                half_turn.sin() / half_turn
            };
            let distance = velocity * seconds * chord;
            let (sin, cos) = (mean.z + half_turn).sin_cos();
            let moving = if velocity == 0.0 && turn_rate == 0.0 {
                0.0
            } else {
                seconds
            };
            let variances = [
                ((SPEED_SHARE * velocity).powi(2) + SPEED_FLOOR.powi(2)) * moving,
                ((TURN_SHARE * turn_rate).powi(2) + TURN_FLOOR.powi(2)) * moving,
            ];
            let mut f = Matrix3::identity();
            f[(0, 2)] = -distance * sin;
            f[(1, 2)] = distance * cos;
            // of the distance and of the turn; half of the turn acts before the step
            let g = SMatrix::<f64, 3, 2>::new(
                cos,
                -0.5 * distance * sin,
                sin,
                0.5 * distance * cos,
                0.0,
                1.0,
            );
            covariance = propagate(&covariance, &f, &g, variances);
            mean += Vector3::new(distance * cos, distance * sin, turn_rate * seconds);
        }
        mean.z = wrap_angle(mean.z);
        Gaussian { mean, covariance }
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        moved(pose, tangent)
    }
}

/// The path by the commands alone.
pub(crate) fn dead_reckoning(recording: &Run) -> Estimate {
    let mut pose = recording.start;
    let poses = recording
        .instants
        .iter()
        .map(|instant| {
            pose = Create.predict(&pose, &instant.odometry).mean;
            pose
        })
        .collect();
    Estimate {
        poses,
        landmarks: Vec::new(),
    }
}

/// Runs a filter through the recording.
///
/// # Errors
/// What the filter reports.
pub(crate) fn estimate(
    recording: &Run,
    filter: Filter,
    particles: usize,
    seed: u64,
) -> Result<Estimate, Box<dyn Error>> {
    let start = LandmarkParticle::new(recording.start);
    let naming = NamingParticle::<3, 2, 2>::new(start.clone());
    let named: Vec<_> = recording
        .instants
        .iter()
        .map(|instant| Frame {
            control: instant.odometry.clone(),
            measurements: instant.measurements.clone(),
        })
        .collect();
    let unnamed: Vec<_> = named
        .iter()
        .map(|frame| Scan {
            control: frame.control.clone(),
            measurements: frame
                .measurements
                .iter()
                .map(|&(_, measured)| measured)
                .collect(),
        })
        .collect();
    let published = PublishedProposal {
        motion: Create,
        sensor: SENSOR,
    };
    let extended = ExtendedProposal::<_, _, 3, 2> {
        motion: Create,
        sensor: SENSOR,
        linearisation: Linearisation::Sequential,
    };
    let unscented = UnscentedProposal::<_, _, 3, 2> {
        motion: Create,
        sensor: SENSOR,
        iterations: 2,
    };
    let by_jacobians = LandmarkMapping {
        sensor: SENSOR,
        filter: ExtendedLandmarks,
    };
    let by_sigma_points = LandmarkMapping {
        sensor: SENSOR,
        filter: UnscentedLandmarks,
    };
    match filter {
        Filter::FastSlam2Published => run(
            start,
            particles,
            seed,
            &named,
            &published,
            &by_jacobians,
            Clone::clone,
        ),
        Filter::FastSlam2 => run(
            start,
            particles,
            seed,
            &named,
            &extended,
            &by_jacobians,
            Clone::clone,
        ),
        Filter::Unscented => run(
            start,
            particles,
            seed,
            &named,
            &unscented,
            &by_sigma_points,
            Clone::clone,
        ),
        Filter::FastSlam2Associating => run(
            naming,
            particles,
            seed,
            &unnamed,
            &Associating {
                motion: Create,
                sensor: SENSOR,
                inner: extended,
                rules: RULES,
            },
            &DoubtingMapping {
                mapping: by_jacobians,
                existence: EXISTENCE,
            },
            |naming| naming.particle.clone(),
        ),
        Filter::UnscentedAssociating => run(
            naming,
            particles,
            seed,
            &unnamed,
            &Associating {
                motion: Create,
                sensor: SENSOR,
                inner: unscented,
                rules: RULES,
            },
            &DoubtingMapping {
                mapping: by_sigma_points,
                existence: EXISTENCE,
            },
            |naming| naming.particle.clone(),
        ),
    }
}
