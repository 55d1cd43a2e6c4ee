//! Importance weights: exact in the linear case for every proposal, and the wrong forms fail.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rbpf_core::{
    ExtendedProposal, FilterConfig, Frame, Gaussian, Landmark, LandmarkParticle, Linearisation,
    MotionModel, MotionProposal, NoMapUpdate, NoRejuvenation, ObservationJacobians,
    ObservationModel, ParticleFilter, ParticleSet, Proposal, Purpose, RbpfError, Streams,
    UnscentedProposal, linearised_log_likelihood,
};
use std::f64::consts::TAU;

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

impl ObservationJacobians<2, 2, 2> for Offset {
    fn jacobians(
        &self,
        _: &Vector2<f64>,
        _: &Vector2<f64>,
    ) -> Option<(Matrix2<f64>, Matrix2<f64>)> {
        Some((-SHEAR, SHEAR))
    }
}

type Particle = LandmarkParticle<2, 2>;
type Observed = Frame<Vector2<f64>, 2>;

fn problem() -> (Particle, Observed) {
    let mut particle = Particle::new(Vector2::new(0.3, -0.2));
    for (id, x, y, covariance) in [
        (0, 2.0, 1.0, Matrix2::new(0.4, 0.1, 0.1, 0.2)),
        (5, -1.0, 3.0, Matrix2::new(0.1, 0.0, 0.0, 0.3)),
        (40, 0.5, -2.0, Matrix2::new(0.3, -0.1, -0.1, 0.3)),
    ] {
        let position = Gaussian {
            mean: Vector2::new(x, y),
            covariance,
        };
        let existence = 0.0;
        particle.map.insert(
            id,
            Landmark {
                position,
                existence,
            },
        );
    }
    let frame = Frame {
        control: Vector2::new(0.5, 0.1),
        measurements: vec![
            (0, Vector2::new(1.2, 1.9)),
            (5, Vector2::new(-0.1, 7.0)),
            (40, Vector2::new(-1.5, -3.6)),
        ],
    };
    (particle, frame)
}

/// log N(z; z^, S), all measurements stacked: S has the pose's covariance in every block.
fn log_evidence(particle: &Particle, frame: &Observed) -> f64 {
    let predicted = Drift.predict(&particle.pose, &frame.control);
    let size = 2 * frame.measurements.len();
    let (mut s, mut d) = (DMatrix::zeros(size, size), DVector::zeros(size));
    for (i, (id, z)) in frame.measurements.iter().enumerate() {
        let landmark = particle.map.get(*id).expect("held").position;
        d.fixed_rows_mut::<2>(2 * i)
            .copy_from(&(z - SHEAR * (landmark.mean - predicted.mean)));
        for j in 0..frame.measurements.len() {
            let mut block = predicted.covariance;
            let mut noise = Matrix2::zeros();
            if i == j {
                block += landmark.covariance;
                noise = Offset.noise();
            }
            let block = SHEAR * block * SHEAR.transpose() + noise;
            s.fixed_view_mut::<2, 2>(2 * i, 2 * j).copy_from(&block);
        }
    }
    let nis = d.dot(&s.clone().lu().solve(&d).expect("regular"));
    -0.5 * (nis + s.determinant().ln() + size as f64 * TAU.ln())
}

const fn extended(linearisation: Linearisation) -> ExtendedProposal<Drift, Offset, 2, 2> {
    ExtendedProposal {
        motion: Drift,
        sensor: Offset,
        linearisation,
    }
}

/// Increments of `n` draws, and the likelihoods alone of the poses drawn.
fn draws(
    proposal: &impl Proposal<Particle, Observed, Error = RbpfError>,
    n: u64,
) -> (Vec<f64>, Vec<f64>) {
    let (particle, frame) = problem();
    (0..n)
        .map(|draw| {
            let mut moved = particle.clone();
            let mut rng = Streams::new(3).stream(0, draw, Purpose::Proposal);
            let increment = proposal
                .propose(&mut moved, &frame, &mut rng)
                .expect("valid problem");
            let pose = moved.pose;
            let likelihood = linearised_log_likelihood(&Offset, &moved, &pose, &frame.measurements)
                .expect("valid problem");
            (increment, likelihood)
        })
        .unzip()
}

/// Mean of exp(log - reference) with its standard error.
fn mean_ratio(logs: &[f64], reference: f64) -> (f64, f64) {
    let n = logs.len() as f64;
    let ratios: Vec<f64> = logs.iter().map(|log| (log - reference).exp()).collect();
    let mean = ratios.iter().sum::<f64>() / n;
    let variance = ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[test]
fn the_linear_increment_is_the_evidence_for_every_draw() {
    let (particle, frame) = problem();
    let evidence = log_evidence(&particle, &frame);
    for linearisation in [
        Linearisation::Sequential,
        Linearisation::Together(1),
        Linearisation::Together(3),
    ] {
        for increment in draws(&extended(linearisation), 50).0 {
            assert!((increment - evidence).abs() < 1e-10, "{linearisation:?}");
        }
    }
    let unscented = UnscentedProposal::<_, _, 2, 2> {
        motion: Drift,
        sensor: Offset,
        iterations: 2,
    };
    for increment in draws(&unscented, 50).0 {
        assert!((increment - evidence).abs() < 1e-10);
    }
}

/// Whatever is drawn from, the mean of exp(increment) is the evidence. The likelihood alone is
/// right for the motion proposal only: for draws that have seen the measurement it is too large.
#[test]
fn the_mean_weight_is_the_evidence_and_the_likelihood_alone_is_not() {
    let (particle, frame) = problem();
    let evidence = log_evidence(&particle, &frame);
    let motion = MotionProposal::<_, _, 2, 2> {
        motion: Drift,
        sensor: Offset,
    };
    let (increments, likelihoods) = draws(&motion, 40_000);
    let (mean, error) = mean_ratio(&increments, evidence);
    assert!((mean - 1.0).abs() < 4.5 * error, "{mean} {error}");
    assert!(error < 0.03, "too weak: {error}");
    let (mean, error) = mean_ratio(&likelihoods, evidence);
    assert!((mean - 1.0).abs() < 4.5 * error, "{mean} {error}");

    let (_, likelihoods) = draws(&extended(Linearisation::Sequential), 4000);
    let (mean, error) = mean_ratio(&likelihoods, evidence);
    assert!((mean - 1.0).abs() > 20.0 * error, "{mean} {error}");
}

/// Two frames without resampling: the carried weights give the posterior of the pose under both;
/// forgetting the first gives another, many standard errors away. Unit walk from N(0, 1), measured
/// with variance r at -1.5 and then at 2, seen from a prior that is sampled.
#[test]
fn dropping_the_previous_weight_fails() {
    #[derive(Clone, Copy)]
    struct Walk;
    impl Proposal<f64, f64> for Walk {
        type Error = RbpfError;
        fn propose(
            &self,
            x: &mut f64,
            z: &f64,
            rng: &mut rand_chacha::ChaCha8Rng,
        ) -> Result<f64, RbpfError> {
            use rand::RngExt;
            *x += rng.sample::<f64, _>(rand_distr::StandardNormal);
            Ok(-(z - *x).powi(2))
        }
    }
    let (measurements, r) = ([-1.5, 2.0], 0.5);
    let (mut mean, mut variance) = (0.0, 0.0);
    for z in measurements {
        variance += 1.0;
        let gain = variance / (variance + r);
        mean += gain * (z - mean);
        variance -= gain * variance;
    }
    let estimate = |seed, shift: f64, forget: bool| {
        let set = ParticleSet::from_parts(vec![0.0; 400], vec![shift; 400], (0..400).collect())
            .expect("valid set");
        let config = FilterConfig {
            resampling_threshold: 0.0,
            ..FilterConfig::default()
        };
        let mut filter = ParticleFilter::new(set, Streams::new(seed), config).expect("valid");
        for (frame, z) in (0..).zip(measurements) {
            if forget {
                let particles = filter.set().particles().to_vec();
                let set = ParticleSet::new(particles).expect("valid set");
                filter = ParticleFilter::new(set, Streams::new(seed), config).expect("valid");
            }
            filter
                .step(frame, &z, &Walk, &NoRejuvenation, &NoMapUpdate)
                .expect("valid step");
        }
        filter.set().weighted_mean(|x| *x).expect("normalised")
    };
    let over_seeds = |forget| {
        let values: Vec<f64> = (0..100).map(|seed| estimate(seed, 0.0, forget)).collect();
        let n = values.len() as f64;
        let average = values.iter().sum::<f64>() / n;
        let spread = values.iter().map(|v| (v - average).powi(2)).sum::<f64>() / (n - 1.0);
        (average, (spread / n).sqrt())
    };
    // the bias of a ratio of sums over 400 particles is about the variance over 400, inside the error
    let (carried, error) = over_seeds(false);
    assert!(
        (carried - mean).abs() < 4.5 * error,
        "{carried} {mean} {error}"
    );
    let (forgotten, error) = over_seeds(true);
    assert!(
        (forgotten - mean).abs() > 20.0 * error,
        "{forgotten} {mean} {error}"
    );
    // a constant on all log weights: eps * 1e4 on each, over weights that sum to one
    for shift in [-1e4, 1e4] {
        assert!((estimate(1, shift, false) - estimate(1, 0.0, false)).abs() < 1e-10);
    }
}
