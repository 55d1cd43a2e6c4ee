//! Localisation in a known map: a robot that may be anywhere in a hall finds itself by the ranges of beacons that look alike.
//!
//! `cargo run -p rbpf-core --example known_map`
//!
//! Particles are poses; nothing is mapped, so `NoMapUpdate` stands in its place. The set begins with thousands of poses all over
//! the hall and shrinks to hundreds when they agree (KLD-sampling). Half-way the robot is carried to another place: weights that
//! turn out far too small for long say so, and the set is spread over the hall again.

#![expect(clippy::print_stdout, reason = "an example shows its result")]

use std::convert::Infallible;
use std::error::Error;
use std::f64::consts::PI;

use estimation_base::{Se2, wrap};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{
    FilterConfig, KldSampling, NoMapUpdate, NoRejuvenation, ParticleCount, ParticleFilter,
    ParticleSet, Proposal, Purpose, RbpfError, Streams,
};

/// The hall, metres.
const HALL: [f64; 2] = [20.0, 12.0];
/// Where the beacons stand; a range does not tell which one it belongs to.
const BEACONS: [[f64; 2]; 4] = [[1.0, 1.0], [18.0, 2.0], [14.0, 11.0], [3.0, 9.0]];
const SIGMA_M: f64 = 0.15;
/// Frames of unlikely measurements after which the set is spread again.
const PATIENCE: u32 = 3;

/// Driven since the last frame (metres, radians), and the ranges in no order.
type Frame = ([f64; 2], Vec<f64>);

struct InTheHall;

impl Proposal<Se2, Frame> for InTheHall {
    type Error = Infallible;

    /// Draws from the odometry; each range belongs to the beacon that explains it best.
    fn propose(
        &self,
        pose: &mut Se2,
        frame: &Frame,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, Infallible> {
        let mut noise = |sigma: f64| sigma * rng.sample::<f64, _>(StandardNormal);
        let [metres, turn] = frame.0;
        let step = Se2::new(metres + noise(0.02), noise(0.01), turn + noise(0.02));
        *pose = pose.compose(&step);
        if !(0.0..HALL[0]).contains(&pose.x) || !(0.0..HALL[1]).contains(&pose.y) {
            return Ok(f64::NEG_INFINITY);
        }
        Ok(frame
            .1
            .iter()
            .map(|range| log_likelihood(pose, *range))
            .sum())
    }
}

/// Heavy tails: a range that no beacon explains costs what one of three sigma costs.
fn log_likelihood(pose: &Se2, range: f64) -> f64 {
    let distance = |beacon: &[f64; 2]| (beacon[0] - pose.x).hypot(beacon[1] - pose.y);
    let nearest = BEACONS
        .iter()
        .map(|beacon| ((distance(beacon) - range) / SIGMA_M).abs())
        .fold(3.0, f64::min);
    -0.5 * nearest * nearest
}

fn anywhere(rng: &mut ChaCha8Rng) -> Se2 {
    Se2::new(
        rng.random_range(0.0..HALL[0]),
        rng.random_range(0.0..HALL[1]),
        rng.random_range(-PI..PI),
    )
}

fn filter(streams: Streams, frame: u64) -> Result<ParticleFilter<Se2>, RbpfError> {
    let mut rng = streams.shared(frame, Purpose::Initialisation);
    let set = ParticleSet::new((0..20_000).map(|_| anywhere(&mut rng)).collect())?;
    let sampling = KldSampling {
        error: 0.05,
        quantile: 2.326,
        widths: vec![0.5, 0.5, PI / 8.0],
        min_particles: 300,
        max_particles: 20_000,
    };
    ParticleFilter::new(set, streams, FilterConfig::default())?.with_particle_count(
        ParticleCount::Kld {
            sampling,
            pose: |p| vec![p.x, p.y, p.phi],
        },
    )
}

fn main() -> Result<(), Box<dyn Error>> {
    let streams = Streams::new(3);
    let mut world = streams.shared(0, Purpose::MeasurementNoise);
    let mut robot = Se2::new(10.0, 4.0, 0.0);
    let mut filter = filter(streams, 0)?;
    let mut unlikely = 0;
    println!("frame  particles  error_m  spread_m");
    for frame in 0..80_u64 {
        // A circle of 2.5 m.
        let turn = 0.1;
        robot = robot.compose(&Se2::new(0.25, 0.0, turn));
        if frame == 40 {
            robot = Se2::new(14.0, 7.0, 3.0);
            println!("the robot is carried away");
        }
        let ranges = BEACONS.map(|beacon| {
            let noise: f64 = world.sample(StandardNormal);
            (beacon[0] - robot.x).hypot(beacon[1] - robot.y) + SIGMA_M * noise
        });
        let seen = ([0.25, turn], ranges.to_vec());
        let report = filter.step(frame, &seen, &InTheHall, &NoRejuvenation, &NoMapUpdate)?;

        // Four ranges cost 0.5 each on average; six in all is what agreement hardly ever costs.
        unlikely = if report.log_evidence < -6.0 && filter.set().particles().len() < 5000 {
            unlikely + 1
        } else {
            0
        };
        if unlikely == PATIENCE {
            println!("lost: the set is spread over the hall");
            filter = self::filter(streams, frame + 1)?;
            unlikely = 0;
        }
        if frame % 8 == 7 {
            let set = filter.set();
            let mean = [set.weighted_mean(|p| p.x)?, set.weighted_mean(|p| p.y)?];
            let spread =
                set.weighted_mean(|p| (p.x - mean[0]).powi(2) + (p.y - mean[1]).powi(2))?;
            println!(
                "{frame:>5}{:>11}{:>9.2}{:>10.2}",
                set.particles().len(),
                (mean[0] - robot.x).hypot(mean[1] - robot.y),
                spread.sqrt()
            );
        }
    }
    let heading = filter.set().weighted_mean(|p| wrap(p.phi - robot.phi))?;
    println!("heading off by {heading:.3} rad in the end");
    Ok(())
}
