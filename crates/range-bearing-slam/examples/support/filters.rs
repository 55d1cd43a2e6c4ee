//! FastSLAM 1.0, FastSLAM 2.0 and the unscented filter on the simulated car, from the same traits.

use super::motion::{Commanded, Planar, Step};
use super::published::PublishedProposal;
use super::simulation::{COMMAND_INTERVAL, Scan, Settings, WHEELBASE};
use es_evolve::MoveParams;
use nalgebra::{SMatrix, Vector3};
use range_bearing_slam::{
    ExtendedLandmarks, ExtendedProposal, Frame, LandmarkMapping, LandmarkParticle, Linearisation,
    MotionProposal, MovePoses, RangeBearing, RangeBearingError, UnscentedLandmarks,
    UnscentedProposal,
};
use rbpf_core::{
    FilterConfig, MapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, Rejuvenation,
    Streams,
};
use std::error::Error;

type Particle = LandmarkParticle<3, 2>;

/// A combination of proposal, weights and landmark filter.
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
    /// The same; after a resampling the poses make four Metropolis-Hastings moves.
    Moved,
}

type Commands = Vec<[f64; 2]>;

/// The car of Eq. (30) of the paper; speed and steering are noisy at every command.
#[derive(Clone, Copy, Debug)]
struct Car {
    speed_deviation: f64,
    steering_deviation: f64,
}

impl Commanded for Car {
    /// Speed and steering angle.
    type Command = [f64; 2];

    const FLOOR: f64 = 1e-12;

    fn step(&self, heading: f64, &[speed, steering]: &[f64; 2]) -> Step {
        let distance = speed * COMMAND_INTERVAL;
        let (sin, cos) = (heading + steering).sin_cos();
        let per_distance = Vector3::new(cos, sin, steering.sin() / WHEELBASE);
        let per_angle = Vector3::new(-sin, cos, steering.cos() / WHEELBASE) * distance;
        Step {
            displacement: per_distance * distance,
            by_noise: SMatrix::from_columns(&[per_distance * COMMAND_INTERVAL, per_angle]),
            variances: [
                self.speed_deviation.powi(2),
                self.steering_deviation.powi(2),
            ],
        }
    }
}

/// One run of a filter over scans.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trial<'a> {
    /// The filter.
    pub(crate) filter: Filter,
    /// Number of particles.
    pub(crate) particles: usize,
    /// The scans, each of a block of scans.
    pub(crate) scans: &'a [Scan],
    /// The noise of single scans.
    pub(crate) settings: &'a Settings,
    /// Number of scans in a block; R / `block` is the noise of their measurements.
    pub(crate) block: usize,
    /// Seed of the filter's random numbers.
    pub(crate) seed: u64,
}

impl Trial<'_> {
    /// Runs the filter and shows `each` the poses, their weights and the scan.
    ///
    /// # Errors
    /// Any error of the filter.
    pub(crate) fn run(
        &self,
        each: impl FnMut(&[Vector3<f64>], &[f64], &Scan),
    ) -> Result<(), Box<dyn Error>> {
        let motion = Planar(Car {
            speed_deviation: self.settings.speed_deviation,
            steering_deviation: self.settings.steering_deviation,
        });
        let root = (self.block as f64).sqrt();
        let sensor = RangeBearing::new(
            self.settings.range_deviation / root,
            self.settings.bearing_deviation / root,
        );
        let prior = MotionProposal { motion, sensor };
        let published = PublishedProposal { motion, sensor };
        let extended = ExtendedProposal {
            motion,
            sensor,
            linearisation: Linearisation::Sequential,
        };
        let unscented = UnscentedProposal {
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
        let moves = MovePoses {
            motion,
            sensor,
            params: MoveParams {
                steps: 4,
                ..MoveParams::default()
            },
        };
        let rest = NoRejuvenation;
        match self.filter {
            Filter::FastSlam1 => self.drive(&prior, &rest, &by_jacobians, each),
            Filter::FastSlam2Published => self.drive(&published, &rest, &by_jacobians, each),
            Filter::FastSlam2 => self.drive(&extended, &rest, &by_jacobians, each),
            Filter::UnscentedLandmarks => self.drive(&extended, &rest, &by_sigma_points, each),
            Filter::UnscentedPoses => self.drive(&unscented, &rest, &by_jacobians, each),
            Filter::Unscented => self.drive(&unscented, &rest, &by_sigma_points, each),
            Filter::Moved => self.drive(&unscented, &moves, &by_sigma_points, each),
        }
    }

    fn drive<R: Rejuvenation<Particle, Frame<Commands, 2>>>(
        &self,
        proposal: &impl Proposal<Particle, Frame<Commands, 2>, Error = RangeBearingError>,
        rejuvenation: &R,
        mapping: &impl MapUpdate<Particle, Frame<Commands, 2>, Error = RangeBearingError>,
        mut each: impl FnMut(&[Vector3<f64>], &[f64], &Scan),
    ) -> Result<(), Box<dyn Error>> {
        // data and filter draw from different families
        let streams = Streams::new(self.seed + 1_000_000);
        let set = ParticleSet::new(vec![Particle::new(Vector3::zeros()); self.particles])?;
        let mut filter = ParticleFilter::new(set, streams, FilterConfig::default())?;
        for (number, scan) in (0..).zip(self.scans) {
            let frame = Frame {
                control: scan.commands.clone(),
                measurements: scan.measurements.clone(),
            };
            filter.step(number, &frame, proposal, rejuvenation, mapping)?;
            let particles = filter.set().particles();
            let poses: Vec<_> = particles.iter().map(|particle| particle.pose).collect();
            each(&poses, &filter.set().weights(), scan);
        }
        Ok(())
    }
}
