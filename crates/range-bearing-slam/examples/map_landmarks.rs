//! A point robot in the plane maps four landmarks from noisy offsets. The conventional filter draws
//! from the odometry, the unscented one takes the measurements into account; both weights are exact.
//!
//! `cargo run -p range-bearing-slam --example map_landmarks`

use nalgebra::{Matrix2, Vector2};
use rand::RngExt;
use rand_distr::StandardNormal;
use range_bearing_slam::{
    Frame, Gaussian, InverseObservation, LandmarkMapping, LandmarkParticle, MotionModel,
    MotionProposal, ObservationModel, RangeBearingError, UnscentedLandmarks, UnscentedProposal,
};
use rbpf_core::{
    FilterConfig, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, Purpose, Streams,
};
use std::error::Error;

type Particle = LandmarkParticle<2, 2>;
type Observation = Frame<Vector2<f64>, 2>;

const ODOMETRY_DEVIATION: f64 = 0.15;
const OFFSET_DEVIATION: f64 = 0.05;
const LANDMARKS: [Vector2<f64>; 4] = [
    Vector2::new(1.0, 3.0),
    Vector2::new(4.0, -2.0),
    Vector2::new(6.0, 2.0),
    Vector2::new(9.0, 0.0),
];

#[derive(Clone, Copy)]
struct Odometry;

impl MotionModel<2> for Odometry {
    type Control = Vector2<f64>;

    fn predict(&self, pose: &Vector2<f64>, control: &Vector2<f64>) -> Gaussian<2> {
        let variance = ODOMETRY_DEVIATION * ODOMETRY_DEVIATION;
        Gaussian {
            mean: pose + control,
            covariance: Matrix2::identity() * variance,
        }
    }
}

#[derive(Clone, Copy)]
struct Offset;

impl ObservationModel<2, 2, 2> for Offset {
    fn predict(&self, pose: &Vector2<f64>, landmark: &Vector2<f64>) -> Option<Vector2<f64>> {
        Some(landmark - pose)
    }

    fn noise(&self) -> Matrix2<f64> {
        Matrix2::identity() * (OFFSET_DEVIATION * OFFSET_DEVIATION)
    }
}

impl InverseObservation<2, 2, 2> for Offset {
    fn locate(&self, pose: &Vector2<f64>, offset: &Vector2<f64>) -> Option<Vector2<f64>> {
        Some(pose + offset)
    }

    fn locate_jacobian(&self, _: &Vector2<f64>, _: &Vector2<f64>) -> Option<Matrix2<f64>> {
        Some(Matrix2::identity())
    }
}

/// Drives along x and measures the landmarks within four metres.
fn simulate(seed: u64) -> (Vec<Vector2<f64>>, Vec<Observation>) {
    let streams = Streams::new(seed);
    let mut truth = Vector2::zeros();
    let mut path = Vec::new();
    let mut frames = Vec::new();
    for k in 0..40 {
        let mut odometry_rng = streams.shared(k, Purpose::OdometryNoise);
        let control = Vector2::new(0.25, 0.0);
        truth += control
            + Vector2::from_fn(|_, _| odometry_rng.sample::<f64, _>(StandardNormal))
                * ODOMETRY_DEVIATION;
        let mut rng = streams.shared(k, Purpose::MeasurementNoise);
        let measurements = (0..)
            .zip(LANDMARKS)
            .map(|(id, landmark)| (id, landmark - truth))
            .filter(|(_, offset)| offset.norm() < 4.0)
            .map(|(id, offset)| {
                let noise = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
                (id, offset + noise * OFFSET_DEVIATION)
            })
            .collect();
        path.push(truth);
        frames.push(Frame {
            control,
            measurements,
        });
    }
    (path, frames)
}

/// Number of runs, each with a seed of its own.
const SEEDS: u32 = 20;

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn run(
    name: &str,
    proposal: &impl Proposal<Particle, Observation, Error = RangeBearingError>,
) -> Result<(), Box<dyn Error>> {
    let (mut squared, mut resampled, mut n_eff, mut poses) = (0.0, 0, 0.0, 0.0);
    for seed in 0..u64::from(SEEDS) {
        let (truth, frames) = simulate(seed);
        let mapping = LandmarkMapping {
            sensor: Offset,
            filter: UnscentedLandmarks,
        };
        let set = ParticleSet::new(vec![Particle::new(Vector2::zeros()); 30])?;
        let mut filter = ParticleFilter::new(set, Streams::new(seed), FilterConfig::default())?;
        for (number, (frame, truth)) in (0..).zip(frames.iter().zip(&truth)) {
            let report = filter.step(number, frame, proposal, &NoRejuvenation, &mapping)?;
            resampled += u32::from(report.resampled());
            n_eff += report.n_eff;
            let x = filter.set().weighted_mean(|particle| particle.pose.x)?;
            let y = filter.set().weighted_mean(|particle| particle.pose.y)?;
            squared += (Vector2::new(x, y) - truth).norm_squared();
            poses += 1.0;
        }
    }
    println!(
        "{name}: pose RMSE {:.3} m, mean N_eff {:.1} of 30, resampled {:.1} times in 40 frames",
        (squared / poses).sqrt(),
        n_eff / poses,
        f64::from(resampled) / f64::from(SEEDS),
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    run(
        "motion   ",
        &MotionProposal {
            motion: Odometry,
            sensor: Offset,
        },
    )?;
    let unscented = UnscentedProposal {
        motion: Odometry,
        sensor: Offset,
        iterations: 2,
    };
    run("unscented", &unscented)
}
