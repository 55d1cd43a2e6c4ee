//! Moves of the poses leave their posterior as it is, and spread the copies of a resampling.

use crate::fixtures::{
    Displaced, Drift, Offset, Point, gaussian, linear_problem, particle, posterior,
};
use es_evolve::{EvolveError, MoveParams};
use nalgebra::{Matrix2, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use range_bearing_slam::{
    Command, Deviation, Frame, Gaussian, LandmarkParticle, MotionModel, MotionProposal, MoveError,
    MovePoses, ObservationModel, Propagation, RangeBearing, RangeBearingError, Unicycle,
};
use rbpf_core::{
    FilterConfig, NoMapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, Purpose,
    Rejuvenation, StepError, Streams,
};
use std::collections::BTreeSet;
use std::convert::Infallible;

fn moves(steps: usize) -> MovePoses<Drift, Offset> {
    MovePoses {
        motion: Drift,
        sensor: Offset,
        params: MoveParams {
            steps,
            ..MoveParams::default()
        },
    }
}

/// Mean, covariance and quantiles of independent samples, within four standard errors.
fn check_posterior(name: &str, particles: &[Point], posterior: &Gaussian<2>) {
    let lower = posterior.covariance.cholesky().expect("definite").l();
    let white: Vec<Vector2<f64>> = particles
        .iter()
        .map(|particle| {
            lower
                .solve_lower_triangular(&(particle.pose - posterior.mean))
                .expect("positive diagonal")
        })
        .collect();
    let check = |what: &str, value: &dyn Fn(&Vector2<f64>) -> f64, mean: f64, variance: f64| {
        let count = white.len() as f64;
        let sampled = white.iter().map(value).sum::<f64>() / count;
        let bound = 4.0 * (variance / count).sqrt();
        assert!(
            (sampled - mean).abs() < bound,
            "{name}, {what}: {sampled}, expected {mean} within {bound}"
        );
    };
    for i in 0..2 {
        check("mean", &|w| w[i], 0.0, 1.0);
        check("square", &|w| w[i] * w[i], 1.0, 2.0);
        for (quantile, p) in [(-1.644_853_627, 0.05), (0.0, 0.5), (1.644_853_627, 0.95)] {
            let below = |w: &Vector2<f64>| f64::from(u8::from(w[i] < quantile));
            check("quantile", &below, p, p * (1.0 - p));
        }
    }
    check("product", &|w| w[0] * w[1], 0.0, 1.0);
}

#[test]
fn the_linear_posterior_stays() {
    let (particle, frame) = linear_problem();
    let start = particle.pose;
    let posterior = posterior(&particle, &frame);
    let lower = posterior.covariance.cholesky().unwrap().l();
    let mut rng = Streams::new(1).shared(0, Purpose::Initialisation);
    let mut particles: Vec<Point> = (0..20_000)
        .map(|_| {
            let normal = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            let mut sample = particle.clone();
            sample.set_pose(posterior.mean + lower * normal);
            sample
        })
        .collect();
    let before = particles.clone();
    let streams = Streams::new(2);
    let report = moves(4)
        .rejuvenate(&mut particles, &frame, &streams, 3)
        .unwrap();
    // The steps fit the posterior: acceptance near the 0.35 of the optimum in two dimensions.
    let acceptance = report.acceptance().unwrap();
    assert!((0.25..0.5).contains(&acceptance), "{acceptance}");
    let kept = particles.iter().zip(&before).filter(|(a, b)| a == b);
    assert!(kept.count() < before.len() / 3);
    check_posterior("stays", &particles, &posterior);
    for particle in &particles {
        assert_eq!(particle.path.len(), 0);
        assert_eq!(particle.previous_pose, start);
    }
}

/// A motion model without information, which makes the likelihood alone the target.
#[derive(Clone, Copy)]
struct AnyMotion;

impl MotionModel<2> for AnyMotion {
    type Control = Vector2<f64>;

    fn predict(&self, pose: &Vector2<f64>, control: &Vector2<f64>) -> Gaussian<2> {
        Gaussian {
            covariance: Matrix2::identity() * 1e6,
            ..Drift.predict(pose, control)
        }
    }
}

#[test]
fn without_the_prior_the_posterior_is_left() {
    let (mut particle, frame) = linear_problem();
    let posterior = posterior(&particle, &frame);
    particle.set_pose(posterior.mean);
    let mut particles = vec![particle; 10_000];
    let wrong = MovePoses {
        motion: AnyMotion,
        sensor: Offset,
        params: moves(50).params,
    };
    wrong
        .rejuvenate(&mut particles, &frame, &Streams::new(4), 0)
        .unwrap();
    let mean = particles.iter().map(|p| p.pose).sum::<Vector2<f64>>() / 10_000.0;
    let factor = posterior.covariance.cholesky().unwrap().l();
    let white = factor
        .solve_lower_triangular(&(mean - posterior.mean))
        .unwrap();
    let errors = white.norm() * 10_000_f64.sqrt();
    assert!(errors > 8.0, "{errors}");
}

#[test]
fn copies_reach_the_linear_posterior() {
    let (mut particle, frame) = linear_problem();
    let posterior = posterior(&particle, &frame);
    particle.set_pose(Vector2::new(0.0, 0.0));
    let mut particles = vec![particle; 5000];
    let streams = Streams::new(4);
    moves(50)
        .rejuvenate(&mut particles, &frame, &streams, 0)
        .unwrap();
    check_posterior("reached", &particles, &posterior);
}

const SENSOR: RangeBearing = RangeBearing::new(0.1, 0.02);

const VEHICLE: Unicycle = Unicycle {
    speed: Deviation {
        fixed: 0.1,
        share: 0.0,
    },
    turn_rate: Deviation {
        fixed: 0.1,
        share: 0.0,
    },
    floor: [0.2, 0.2, 0.01],
    propagation: Propagation::Jacobians,
};

fn driving() -> MovePoses<Unicycle, RangeBearing> {
    MovePoses {
        motion: VEHICLE,
        sensor: SENSOR,
        params: MoveParams::default(),
    }
}

const START: Vector3<f64> = Vector3::new(0.0, 0.0, 3.1);

/// One frame of a filter that starts at heading 3.1 and turns across the cut.
fn driven<R>(rejuvenation: &R) -> (usize, Vec<LandmarkParticle<3, 2>>)
where
    R: Rejuvenation<LandmarkParticle<3, 2>, Frame<Vec<Command>, 2>>,
{
    let covariance = Matrix2::new(0.02, 0.005, 0.005, 0.01);
    let start = particle(
        START,
        [
            (0, gaussian(-4.0, 0.5, covariance)),
            (1, gaussian(-3.0, -2.0, covariance)),
        ],
    );
    let truth = Vector3::new(-0.45, 0.1, -3.12);
    let frame = Frame {
        control: vec![Command {
            seconds: 1.0,
            speed: 0.5,
            turn: 0.05,
        }],
        measurements: [0, 1]
            .map(|id| {
                let position = start.map.get(id).expect("in the map").position.mean;
                (id, SENSOR.predict(&truth, &position).expect("always seen"))
            })
            .to_vec(),
    };
    let proposal = MotionProposal {
        motion: VEHICLE,
        sensor: SENSOR,
    };
    let set = ParticleSet::new(vec![start; 200]).expect("not empty");
    let mut filter =
        ParticleFilter::new(set, Streams::new(6), FilterConfig::default()).expect("in range");
    let report = filter
        .step(0, &frame, &proposal, rejuvenation, &NoMapUpdate)
        .expect("finite");
    assert!(report.resampled());
    let poses: BTreeSet<[u64; 3]> = filter
        .set()
        .particles()
        .iter()
        .map(|particle| particle.pose.map(f64::to_bits).into())
        .collect();
    (poses.len(), filter.set().particles().to_vec())
}

#[test]
fn unique_poses_rise_after_resampling() {
    let (copies, _) = driven(&NoRejuvenation);
    let (spread, particles) = driven(&driving());
    // with acceptance 0.4 and four steps seven slots of eight move
    assert!(
        copies < 80 && spread > 2 * copies,
        "{copies} before, {spread} after"
    );
    for particle in &particles {
        assert!(particle.pose.z.abs() <= std::f64::consts::PI);
        assert_eq!(particle.previous_pose, START);
    }
}

#[test]
fn moves_do_not_depend_on_the_number_of_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| driven(&driving()))
    };
    let alone = run(1);
    for threads in [2, 3, 8] {
        assert_eq!(run(threads), alone, "{threads} threads");
    }
}

/// Leaves the pose as it is, whatever the measurement, with uneven weights.
struct Stay;

impl Proposal<Point, Displaced> for Stay {
    type Error = Infallible;

    fn propose(
        &self,
        particle: &mut Point,
        _: &Displaced,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, Infallible> {
        particle.set_pose(particle.pose);
        Ok(10.0 * rng.random::<f64>())
    }
}

#[test]
fn what_gives_no_target_is_named_and_nothing_moves() {
    let (particle, mut frame) = linear_problem();
    frame.measurements[2].1[0] = f64::NAN;
    let set = ParticleSet::new(vec![particle; 20]).unwrap();
    let mut filter =
        ParticleFilter::new(set.clone(), Streams::new(1), FilterConfig::default()).unwrap();
    let error = filter.step(0, &frame, &Stay, &moves(2), &NoMapUpdate);
    assert!(matches!(
        error.unwrap_err(),
        StepError::Rejuvenation {
            source: MoveError::Target {
                particle: 0,
                source: RangeBearingError::MeasurementNotFinite {
                    id: 40,
                    entry: 0,
                    ..
                }
            }
        }
    ));
    assert_eq!(filter.set(), &set);

    let (mut particle, frame) = linear_problem();
    particle.set_pose(Vector2::new(f64::NAN, 0.0));
    let mut particles = vec![particle];
    let error = moves(2).rejuvenate(&mut particles, &frame, &Streams::new(1), 0);
    assert!(matches!(
        error,
        Err(MoveError::Evolve(EvolveError::LogFitness { slot: 0, .. }))
    ));
    let mut none: [Point; 0] = [];
    let error = moves(2).rejuvenate(&mut none, &frame, &Streams::new(1), 0);
    assert_eq!(error, Err(MoveError::Evolve(EvolveError::EmptyPopulation)));
}
