//! Moves of the poses leave their posterior as it is, and spread the copies of a resampling.
#![cfg(feature = "es-evolve")]

use es_evolve::{EvolveError, MoveParams};
use nalgebra::{Matrix2, SVector, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{
    Command, CowMap, Deviation, FilterConfig, Frame, Gaussian, InverseMotion, Landmark,
    LandmarkParticle, MotionModel, MotionProposal, MovablePose, MoveError, MovePoses, NoMapUpdate,
    NoRejuvenation, ObservationModel, ParticleFilter, ParticleSet, PersistentPath, PoseAndMap,
    Propagation, Purpose, RangeBearing, RbpfError, Rejuvenation, StepError, Streams, Unicycle,
};
use std::collections::BTreeSet;

#[derive(Clone, Debug, PartialEq)]
struct Particle<const D: usize> {
    path: PersistentPath<SVector<f64, D>>,
    map: CowMap<Gaussian<2>>,
}

impl<const D: usize> PoseAndMap<D, 2> for Particle<D> {
    fn pose(&self) -> SVector<f64, D> {
        *self.path.last().expect("a path has a start")
    }

    fn set_pose(&mut self, pose: SVector<f64, D>) {
        self.path.push(pose);
    }

    fn landmark(&self, id: u32) -> Option<Gaussian<2>> {
        self.map.get(id).copied()
    }
}

impl<const D: usize> MovablePose<D, 2> for Particle<D> {
    fn previous_pose(&self) -> SVector<f64, D> {
        let index = self.path.len().checked_sub(2).expect("a step was made");
        *self.path.get(index).expect("inside the path")
    }

    fn replace_pose(&mut self, pose: SVector<f64, D>) {
        *self.path.last_mut().expect("a path has a start") = pose;
    }
}

/// A point in the plane, moved by a displacement.
#[derive(Clone, Copy)]
struct Drift;

impl MotionModel<2> for Drift {
    type Control = Vector2<f64>;

    fn predict(&self, pose: &Vector2<f64>, control: &Vector2<f64>) -> Gaussian<2> {
        Gaussian {
            mean: pose + control,
            covariance: Matrix2::new(0.5, 0.1, 0.1, 0.3),
        }
    }
}

impl InverseMotion<2> for Drift {
    fn local(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> Vector2<f64> {
        to - from
    }
}

/// The landmark's offset from the point, sheared.
#[derive(Clone, Copy)]
struct Offset;

const SHEAR: Matrix2<f64> = Matrix2::new(1.0, 0.5, -0.3, 2.0);

impl ObservationModel<2, 2, 2> for Offset {
    fn predict(&self, pose: &Vector2<f64>, landmark: &Vector2<f64>) -> Option<Vector2<f64>> {
        Some(SHEAR * (landmark - pose))
    }

    fn noise(&self) -> Matrix2<f64> {
        Matrix2::new(0.2, 0.02, 0.02, 0.1)
    }
}

fn landmark(x: f64, y: f64, covariance: Matrix2<f64>) -> Gaussian<2> {
    Gaussian {
        mean: Vector2::new(x, y),
        covariance,
    }
}

/// Previous pose and map, the frame, and the posterior of the pose in closed form.
fn linear_problem() -> (Particle<2>, Frame<Vector2<f64>, 2>, Gaussian<2>) {
    let map = [
        (0, landmark(2.0, 1.0, Matrix2::new(0.4, 0.1, 0.1, 0.2))),
        (40, landmark(0.5, -2.0, Matrix2::zeros())),
    ];
    let particle = Particle {
        path: [Vector2::new(0.3, -0.2)].into_iter().collect(),
        map: map.into_iter().collect(),
    };
    let frame = Frame {
        control: Vector2::new(0.5, 0.1),
        measurements: vec![
            (0, Vector2::new(1.2, 1.9)),
            (40, Vector2::new(-1.5, -3.6)),
            // not in the map: left out
            (7, Vector2::new(100.0, 100.0)),
        ],
    };
    let prior = Drift.predict(&particle.pose(), &frame.control);
    let inverse = |m: Matrix2<f64>| m.try_inverse().expect("positive definite");
    let mut information = inverse(prior.covariance);
    let mut vector = information * prior.mean;
    for (id, z) in &frame.measurements {
        let Some(landmark) = particle.landmark(*id) else {
            continue;
        };
        let noise = SHEAR * landmark.covariance * SHEAR.transpose() + Offset.noise();
        // z = SHEAR landmark - SHEAR pose + noise
        let weighted = -SHEAR.transpose() * inverse(noise);
        information += weighted * -SHEAR;
        vector += weighted * (z - SHEAR * landmark.mean);
    }
    let covariance = inverse(information);
    let posterior = Gaussian {
        mean: covariance * vector,
        covariance,
    };
    (particle, frame, posterior)
}

fn moves(steps: usize) -> MovePoses<Drift, Offset, 2, 2> {
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
fn check_posterior(name: &str, particles: &[Particle<2>], posterior: &Gaussian<2>) {
    let lower = posterior.covariance.cholesky().expect("definite").l();
    let white: Vec<Vector2<f64>> = particles
        .iter()
        .map(|particle| {
            lower
                .solve_lower_triangular(&(particle.pose() - posterior.mean))
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
    let (particle, frame, posterior) = linear_problem();
    let lower = posterior.covariance.cholesky().unwrap().l();
    let mut rng = Streams::new(1).shared(0, Purpose::Initialisation);
    let mut particles: Vec<Particle<2>> = (0..20_000)
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
        assert_eq!(particle.path.len(), 2);
        assert_eq!(particle.previous_pose(), Vector2::new(0.3, -0.2));
    }
}

/// The likelihood alone as target, which a motion model without information stands for.
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

impl InverseMotion<2> for AnyMotion {
    fn local(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> Vector2<f64> {
        to - from
    }
}

#[test]
fn without_the_prior_the_posterior_is_left() {
    let (mut particle, frame, posterior) = linear_problem();
    particle.set_pose(posterior.mean);
    let mut particles = vec![particle; 5000];
    let wrong = MovePoses {
        motion: AnyMotion,
        sensor: Offset,
        params: moves(50).params,
    };
    wrong
        .rejuvenate(&mut particles, &frame, &Streams::new(4), 0)
        .unwrap();
    let mean = particles.iter().map(|p| p.pose()).sum::<Vector2<f64>>() / 5000.0;
    let factor = posterior.covariance.cholesky().unwrap().l();
    let white = factor
        .solve_lower_triangular(&(mean - posterior.mean))
        .unwrap();
    let errors = white.norm() * 5000_f64.sqrt();
    assert!(errors > 8.0, "{errors}");
}

#[test]
fn copies_reach_the_linear_posterior() {
    let (mut particle, frame, posterior) = linear_problem();
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

const DRIVING: MovePoses<Unicycle, RangeBearing, 3, 2> = MovePoses {
    motion: VEHICLE,
    sensor: SENSOR,
    params: MoveParams {
        steps: 4,
        crossover_share: 0.5,
        mutation_scale: 1.0,
        differential_scale: 1.0,
        jitter_scale: 0.05,
        max_evaluations: usize::MAX,
    },
};

const START: Vector3<f64> = Vector3::new(0.0, 0.0, 3.1);

/// One frame of a filter that starts at heading 3.1 and turns across the cut.
fn driven<R>(rejuvenation: &R) -> (usize, Vec<LandmarkParticle<3, 2>>)
where
    R: Rejuvenation<LandmarkParticle<3, 2>, Frame<Vec<Command>, 2>>,
{
    let covariance = Matrix2::new(0.02, 0.005, 0.005, 0.01);
    let mut start = LandmarkParticle::new(START);
    for (id, x, y) in [(0, -4.0, 0.5), (1, -3.0, -2.0)] {
        let seen = Landmark {
            position: landmark(x, y, covariance),
            existence: 0.0,
        };
        start.map.insert(id, seen);
    }
    let truth = Vector3::new(-0.45, 0.1, -3.12);
    let frame = Frame {
        control: vec![Command {
            seconds: 1.0,
            speed: 0.5,
            turn: 0.05,
        }],
        measurements: [0, 1]
            .map(|id| {
                let position = start.landmark(id).expect("in the map").mean;
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
    let (spread, particles) = driven(&DRIVING);
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

#[cfg(feature = "parallel")]
#[test]
fn moves_do_not_depend_on_the_number_of_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| driven(&DRIVING))
    };
    let alone = run(1);
    for threads in [2, 3, 8] {
        assert_eq!(run(threads), alone, "{threads} threads");
    }
}

/// Moves to where it is told, whatever the measurement.
struct Stay;

impl rbpf_core::Proposal<Particle<2>, Frame<Vector2<f64>, 2>> for Stay {
    type Error = RbpfError;

    fn propose(
        &self,
        particle: &mut Particle<2>,
        _: &Frame<Vector2<f64>, 2>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RbpfError> {
        particle.set_pose(particle.pose());
        Ok(10.0 * rng.random::<f64>())
    }
}

#[test]
fn what_gives_no_target_is_named_and_nothing_moves() {
    let (particle, mut frame, _) = linear_problem();
    frame.measurements[1].1[0] = f64::NAN;
    let set = ParticleSet::new(vec![particle; 20]).unwrap();
    let mut filter =
        ParticleFilter::new(set.clone(), Streams::new(1), FilterConfig::default()).unwrap();
    let error = filter.step(0, &frame, &Stay, &moves(2), &NoMapUpdate);
    assert!(matches!(
        error.unwrap_err(),
        StepError::Rejuvenation {
            source: MoveError::Target {
                particle: 0,
                source: RbpfError::MeasurementNotFinite {
                    id: 40,
                    entry: 0,
                    ..
                }
            }
        }
    ));
    assert_eq!(filter.set(), &set);

    let (mut particle, frame, _) = linear_problem();
    particle.set_pose(Vector2::new(f64::NAN, 0.0));
    let mut particles = vec![particle];
    let error = moves(2).rejuvenate(&mut particles, &frame, &Streams::new(1), 0);
    assert!(matches!(
        error,
        Err(MoveError::Evolve(EvolveError::LogFitness { slot: 0, .. }))
    ));
    let mut none: [Particle<2>; 0] = [];
    let error = moves(2).rejuvenate(&mut none, &frame, &Streams::new(1), 0);
    assert_eq!(error, Err(MoveError::Evolve(EvolveError::EmptyPopulation)));
}
