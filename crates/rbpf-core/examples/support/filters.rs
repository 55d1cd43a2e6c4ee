//! FastSLAM 1.0, FastSLAM 2.0 and the unscented filter on the simulated car, from the same traits.

use super::motion::{moved, propagate};
use super::published::PublishedProposal;
use super::simulation::{COMMAND_INTERVAL, Scan, Settings, WHEELBASE};
use nalgebra::{Matrix3, SMatrix, Vector3};
use rbpf_core::{
    ExtendedLandmarks, ExtendedProposal, FilterConfig, Frame, Gaussian, LandmarkMapping,
    LandmarkParticle, Linearisation, MapUpdate, MotionModel, MotionProposal, NoRejuvenation,
    ParticleFilter, ParticleSet, PoseAndMap, Proposal, RangeBearing, RbpfError, Streams,
    UnscentedLandmarks, UnscentedProposal, wrap_angle,
};
use std::error::Error;

type Particle = LandmarkParticle<3, 2>;

/// Which proposal, weights and landmark filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filter {
    /// Poses from the motion model, EKF landmarks.
    FastSlam1,
    /// EKF proposal, EKF landmarks, weights log N(z; z^, S) at the predicted pose (Montemerlo 2003).
    FastSlam2Published,
    /// The same with importance weights exact for the pose drawn (Bailey, Nieto, Nebot 2006).
    FastSlam2,
    /// EKF proposal, unscented landmarks.
    UnscentedLandmarks,
    /// Unscented proposal, EKF landmarks.
    UnscentedPoses,
    /// Unscented proposal and landmarks, exact weights.
    Unscented,
}

type Commands = Vec<[f64; 2]>;

/// Eq. (30) of the paper; speed and steering are noisy at every command.
#[derive(Clone, Copy, Debug)]
struct Car {
    speed_deviation: f64,
    steering_deviation: f64,
}

/// Keeps the covariance of a car that does not move positive definite, m^2 and rad^2.
const FLOOR: f64 = 1e-12;

impl MotionModel<3> for Car {
    type Control = Commands;

    fn predict(&self, pose: &Vector3<f64>, commands: &Commands) -> Gaussian<3> {
        let mut mean = *pose;
        let mut covariance = Matrix3::identity() * FLOOR;
        let variances = [
            self.speed_deviation.powi(2),
            self.steering_deviation.powi(2),
        ];
        for &[speed, steering] in commands {
            let distance = speed * COMMAND_INTERVAL;
            let (sin, cos) = (mean.z + steering).sin_cos();
            let per_distance = Vector3::new(cos, sin, steering.sin() / WHEELBASE);
            let per_angle = Vector3::new(-sin, cos, steering.cos() / WHEELBASE) * distance;
            let mut f = Matrix3::identity();
            f[(0, 2)] = -distance * sin;
            f[(1, 2)] = distance * cos;
            let g =
                SMatrix::<f64, 3, 2>::from_columns(&[per_distance * COMMAND_INTERVAL, per_angle]);
            covariance = propagate(&covariance, &f, &g, variances);
            mean += per_distance * distance;
        }
        mean.z = wrap_angle(mean.z);
        Gaussian { mean, covariance }
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        moved(pose, tangent)
    }
}

/// Runs N particles over scans and shows `each` the poses, their weights and the scan. Scans are
/// blocks of `block` (R / `block` is the noise of their
/// measurements).
///
/// # Errors
/// What the filter reports.
pub(crate) fn run_filter(
    filter: Filter,
    particles: usize,
    scans: &[Scan],
    settings: &Settings,
    block: usize,
    seed: u64,
    each: impl FnMut(&[Vector3<f64>], &[f64], &Scan),
) -> Result<(), Box<dyn Error>> {
    let motion = Car {
        speed_deviation: settings.speed_deviation,
        steering_deviation: settings.steering_deviation,
    };
    let root = (block as f64).sqrt();
    let sensor = RangeBearing::new(
        settings.range_deviation / root,
        settings.bearing_deviation / root,
    );
    let prior = MotionProposal::<_, _, 3, 2> { motion, sensor };
    let published = PublishedProposal { motion, sensor };
    let extended = ExtendedProposal::<_, _, 3, 2> {
        motion,
        sensor,
        linearisation: Linearisation::Sequential,
    };
    let unscented = UnscentedProposal::<_, _, 3, 2> {
        motion,
        sensor,
        iterations: 2,
    };
    let by_jacobians = LandmarkMapping {
        sensor,
        filter: ExtendedLandmarks,
    };
    let by_sigma_points = LandmarkMapping {
        sensor,
        filter: UnscentedLandmarks,
    };
    match filter {
        Filter::FastSlam1 => drive(particles, scans, seed, &prior, &by_jacobians, each),
        Filter::FastSlam2Published => {
            drive(particles, scans, seed, &published, &by_jacobians, each)
        }
        Filter::FastSlam2 => drive(particles, scans, seed, &extended, &by_jacobians, each),
        Filter::UnscentedLandmarks => {
            drive(particles, scans, seed, &extended, &by_sigma_points, each)
        }
        Filter::UnscentedPoses => drive(particles, scans, seed, &unscented, &by_jacobians, each),
        Filter::Unscented => drive(particles, scans, seed, &unscented, &by_sigma_points, each),
    }
}

fn drive(
    particles: usize,
    scans: &[Scan],
    seed: u64,
    proposal: &impl Proposal<Particle, Frame<Commands, 2>, Error = RbpfError>,
    mapping: &impl MapUpdate<Particle, Frame<Commands, 2>, Error = RbpfError>,
    mut each: impl FnMut(&[Vector3<f64>], &[f64], &Scan),
) -> Result<(), Box<dyn Error>> {
    // data and filter draw from different families
    let streams = Streams::new(seed + 1_000_000);
    let set = ParticleSet::new(vec![Particle::new(Vector3::zeros()); particles])?;
    let mut filter = ParticleFilter::new(set, streams, FilterConfig::default())?;
    for (number, scan) in (0..).zip(scans) {
        let frame = Frame {
            control: scan.commands.clone(),
            measurements: scan.measurements.clone(),
        };
        filter.step(number, &frame, proposal, &NoRejuvenation, mapping)?;
        let poses: Vec<_> = filter
            .set()
            .particles()
            .iter()
            .map(PoseAndMap::pose)
            .collect();
        each(&poses, &filter.set().weights(), scan);
    }
    Ok(())
}
