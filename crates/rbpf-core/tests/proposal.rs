//! The generic proposals: exact weights in the linear Gaussian case, and agreement with each other in
//! a nonlinear one.

use nalgebra::{DMatrix, DVector, Matrix2, SMatrix, SVector, Vector1, Vector2, Vector3};
use rbpf_core::{
    CowMap, Frame, Gaussian, MotionModel, MotionProposal, ObservationModel, PoseAndMap, Proposal,
    Purpose, RbpfError, Streams, UnscentedProposal, log_likelihood, log_sum_exp, wrap_angle,
};
use std::f64::consts::TAU;

#[derive(Clone, Debug, PartialEq)]
struct Particle<const D: usize> {
    pose: SVector<f64, D>,
    map: CowMap<Gaussian<2>>,
}

impl<const D: usize> PoseAndMap<D, 2> for Particle<D> {
    fn pose(&self) -> SVector<f64, D> {
        self.pose
    }

    fn set_pose(&mut self, pose: SVector<f64, D>) {
        self.pose = pose;
    }

    fn landmark(&self, id: u32) -> Option<Gaussian<2>> {
        self.map.get(id).copied()
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

fn linear_problem() -> (Particle<2>, Frame<Vector2<f64>, 2>) {
    let landmark = |x, y, p| Gaussian {
        mean: Vector2::new(x, y),
        covariance: p,
    };
    let map = [
        (0, landmark(2.0, 1.0, Matrix2::new(0.4, 0.1, 0.1, 0.2))),
        (5, landmark(-1.0, 3.0, Matrix2::new(0.1, 0.0, 0.0, 0.3))),
        (40, landmark(0.5, -2.0, Matrix2::zeros())),
    ];
    let particle = Particle {
        pose: Vector2::new(0.3, -0.2),
        map: map.into_iter().collect(),
    };
    let frame = Frame {
        control: Vector2::new(0.5, 0.1),
        measurements: vec![
            (0, Vector2::new(1.2, 1.9)),
            (5, Vector2::new(-0.1, 7.0)),
            (40, Vector2::new(-1.5, -3.6)),
            // not in the map: left out
            (7, Vector2::new(100.0, 100.0)),
        ],
    };
    (particle, frame)
}

/// log N(z; z^, S) with all measurements stacked: S has the pose's covariance in every block.
fn log_evidence(particle: &Particle<2>, frame: &Frame<Vector2<f64>, 2>) -> f64 {
    let predicted = Drift.predict(&particle.pose, &frame.control);
    let known: Vec<_> = frame
        .measurements
        .iter()
        .filter_map(|(id, z)| particle.landmark(*id).map(|landmark| (landmark, *z)))
        .collect();
    let size = 2 * known.len();
    let (mut s, mut d) = (DMatrix::zeros(size, size), DVector::zeros(size));
    for (i, (landmark, z)) in known.iter().enumerate() {
        d.fixed_rows_mut::<2>(2 * i)
            .copy_from(&(z - SHEAR * (landmark.mean - predicted.mean)));
        for j in 0..known.len() {
            let mut block = predicted.covariance;
            if i == j {
                block += landmark.covariance;
            }
            let mut block = SHEAR * block * SHEAR.transpose();
            if i == j {
                block += Offset.noise();
            }
            s.fixed_view_mut::<2, 2>(2 * i, 2 * j).copy_from(&block);
        }
    }
    let nis = d.dot(&s.clone().lu().solve(&d).expect("regular"));
    -0.5 * (nis + s.determinant().ln() + size as f64 * TAU.ln())
}

#[test]
fn the_linear_increment_is_the_evidence_for_every_draw() {
    let (particle, frame) = linear_problem();
    let evidence = log_evidence(&particle, &frame);
    let streams = Streams::new(11);
    let mut likelihoods = vec![];
    for iterations in [1, 3] {
        let proposal = UnscentedProposal::<_, _, 2, 2> {
            motion: Drift,
            sensor: Offset,
            iterations,
        };
        for draw in 0..50 {
            let mut moved = particle.clone();
            let mut rng = streams.stream(0, draw, Purpose::Proposal);
            let increment = proposal.propose(&mut moved, &frame, &mut rng).unwrap();
            assert!(
                (increment - evidence).abs() < 1e-10,
                "{increment} {evidence}"
            );
            assert_ne!(moved.pose, particle.pose);
            let pose = moved.pose;
            likelihoods.push(log_likelihood(&Offset, &moved, &pose, &frame.measurements).unwrap());
        }
    }
    // the likelihood alone fails the same test, by far, for nearly every draw
    let far = likelihoods
        .iter()
        .filter(|l| (*l - evidence).abs() > 0.1)
        .count();
    assert!(far > 80, "{far}");
}

#[test]
fn the_proposal_is_the_posterior_in_the_linear_case() {
    let (particle, frame) = linear_problem();
    let predicted = Drift.predict(&particle.pose, &frame.control);
    let mut information = predicted.covariance.try_inverse().unwrap();
    let mut vector = information * predicted.mean;
    for (id, z) in &frame.measurements {
        let Some(landmark) = particle.landmark(*id) else {
            continue;
        };
        let noise = SHEAR * landmark.covariance * SHEAR.transpose() + Offset.noise();
        let weighted = SHEAR.transpose() * noise.try_inverse().unwrap();
        information += weighted * SHEAR;
        vector += weighted * (SHEAR * landmark.mean - z);
    }
    let covariance = information.try_inverse().unwrap();
    let mean = covariance * vector;
    let proposal = UnscentedProposal::<_, _, 2, 2> {
        motion: Drift,
        sensor: Offset,
        iterations: 2,
    };
    let (n, streams) = (4000_u32, Streams::new(12));
    let (mut sum, mut squares) = (Vector2::zeros(), Matrix2::zeros());
    for draw in 0..n {
        let mut moved = particle.clone();
        let mut rng = streams.stream(0, u64::from(draw), Purpose::Proposal);
        proposal.propose(&mut moved, &frame, &mut rng).unwrap();
        let d = moved.pose - mean;
        sum += d;
        squares += d * d.transpose();
    }
    // standard errors: sqrt(P_ii / n), sqrt((P_ii P_jj + P_ij^2) / n)
    let n = f64::from(n);
    for i in 0..2 {
        assert!((sum[i] / n).abs() < 4.5 * (covariance[(i, i)] / n).sqrt());
        for j in 0..2 {
            let product = covariance[(i, i)] * covariance[(j, j)] + covariance[(i, j)].powi(2);
            let difference = squares[(i, j)] / n - covariance[(i, j)];
            assert!(
                difference.abs() < 4.5 * (product / n).sqrt(),
                "{i} {j} {difference}"
            );
        }
    }
}

/// A robot with a heading that has just crossed pi, and a range-bearing sensor.
#[derive(Clone, Copy)]
struct Drive;

impl MotionModel<3> for Drive {
    type Control = Vector2<f64>;

    fn predict(&self, pose: &Vector3<f64>, control: &Vector2<f64>) -> Gaussian<3> {
        let heading = pose[2] + 0.5 * control[1];
        Gaussian {
            mean: Vector3::new(
                pose[0] + control[0] * heading.cos(),
                pose[1] + control[0] * heading.sin(),
                wrap_angle(pose[2] + control[1]),
            ),
            covariance: SMatrix::from_diagonal(&Vector3::new(0.04, 0.04, 0.01)),
        }
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        let mut moved = pose + tangent;
        moved[2] = wrap_angle(moved[2]);
        moved
    }
}

#[derive(Clone, Copy)]
struct RangeBearing {
    longest: f64,
}

impl ObservationModel<3, 2, 2> for RangeBearing {
    fn predict(&self, pose: &Vector3<f64>, landmark: &Vector2<f64>) -> Option<Vector2<f64>> {
        let offset = landmark - pose.fixed_rows::<2>(0);
        let range = offset.norm();
        let bearing = wrap_angle(offset.y.atan2(offset.x) - pose[2]);
        (range < self.longest).then(|| Vector2::new(range, bearing))
    }

    fn noise(&self) -> Matrix2<f64> {
        Matrix2::from_diagonal(&Vector2::new(0.01, 0.0004))
    }

    fn innovation(&self, measured: &Vector2<f64>, predicted: &Vector2<f64>) -> Vector2<f64> {
        let mut d = measured - predicted;
        d[1] = wrap_angle(d[1]);
        d
    }
}

fn nonlinear_problem() -> (Particle<3>, Frame<Vector2<f64>, 2>) {
    let landmark = |x, y| Gaussian {
        mean: Vector2::new(x, y),
        covariance: Matrix2::new(0.02, 0.005, 0.005, 0.01),
    };
    let particle = Particle {
        pose: Vector3::new(0.0, 0.0, 3.1),
        map: [(0, landmark(-4.0, 0.5)), (1, landmark(-3.0, -2.0))]
            .into_iter()
            .collect(),
    };
    let truth = Vector3::new(-0.45, 0.1, -3.12);
    let sensor = RangeBearing { longest: 50.0 };
    let seen = |x, y| {
        sensor
            .predict(&truth, &Vector2::new(x, y))
            .expect("in range")
    };
    let frame = Frame {
        control: Vector2::new(0.4, 0.05),
        measurements: vec![(0, seen(-3.95, 0.45)), (1, seen(-3.0, -1.9))],
    };
    (particle, frame)
}

/// Importance sampling is unbiased: mean weight = evidence, whatever the proposal. Both must
/// agree within their standard errors, and the unscented weights must be far more even.
#[test]
fn both_proposals_estimate_the_same_evidence() {
    let (particle, frame) = nonlinear_problem();
    let sensor = RangeBearing { longest: 50.0 };
    let conventional = MotionProposal::<_, _, 3, 2> {
        motion: Drive,
        sensor,
    };
    let unscented = UnscentedProposal::<_, _, 3, 2> {
        motion: Drive,
        sensor,
        iterations: 2,
    };
    let streams = Streams::new(13);
    let weights = |proposal: &dyn Proposal<_, _, Error = RbpfError>, n: u64| -> Vec<f64> {
        (0..n)
            .map(|draw| {
                let mut moved = particle.clone();
                let mut rng = streams.stream(0, draw, Purpose::Proposal);
                proposal
                    .propose(&mut moved, &frame, &mut rng)
                    .expect("valid problem")
            })
            .collect()
    };
    let estimate = |logs: &[f64]| {
        let n = logs.len() as f64;
        let mean = log_sum_exp(logs) - n.ln();
        let relative_variance = n / rbpf_core::effective_count(logs) - 1.0;
        (
            mean,
            (relative_variance / n).sqrt(),
            rbpf_core::effective_count(logs) / n,
        )
    };
    let (prior_mean, prior_error, prior_share) = estimate(&weights(&conventional, 60_000));
    let (mean, error, share) = estimate(&weights(&unscented, 4_000));
    let bound = 4.5 * prior_error.hypot(error);
    assert!(
        (prior_mean - mean).abs() < bound,
        "{prior_mean} {mean} within {bound}"
    );
    assert!(
        bound < 0.2 && share > 0.9 && prior_share < 0.3,
        "{bound} {share} {prior_share}"
    );
}

#[test]
fn what_cannot_be_predicted_has_weight_zero_and_nan_is_an_error() {
    let (particle, mut frame) = nonlinear_problem();
    let blind = RangeBearing { longest: 1.0 };
    let proposal = UnscentedProposal::<_, _, 3, 2> {
        motion: Drive,
        sensor: blind,
        iterations: 2,
    };
    let mut rng = Streams::new(1).stream(0, 0, Purpose::Proposal);
    let mut moved = particle.clone();
    assert_eq!(
        proposal.propose(&mut moved, &frame, &mut rng),
        Ok(f64::NEG_INFINITY)
    );

    let sensor = RangeBearing { longest: 50.0 };
    frame.measurements[0].1[0] = f64::NAN;
    let before = particle.clone();
    let mut moved = particle;
    let unscented = UnscentedProposal::<_, _, 3, 2> {
        motion: Drive,
        sensor,
        iterations: 2,
    };
    let error = unscented.propose(&mut moved, &frame, &mut rng);
    assert!(matches!(
        error,
        Err(RbpfError::MeasurementNotFinite { id: 0, entry: 0, value }) if value.is_nan()
    ));
    let conventional = MotionProposal::<_, _, 3, 2> {
        motion: Drive,
        sensor,
    };
    let error = conventional.propose(&mut moved, &frame, &mut rng);
    assert!(matches!(
        error,
        Err(RbpfError::MeasurementNotFinite { id: 0, entry: 0, value }) if value.is_nan()
    ));
    assert_eq!(moved, before);
}

/// One dimension, one landmark, by hand: prior N(0, 1), landmark N(3, 0.5), R = 0.25, z = 2.
#[derive(Clone, Copy)]
struct Still;

impl MotionModel<1> for Still {
    type Control = ();

    fn predict(&self, pose: &Vector1<f64>, (): &()) -> Gaussian<1> {
        Gaussian {
            mean: *pose,
            covariance: SMatrix::<f64, 1, 1>::new(1.0),
        }
    }
}

#[derive(Clone, Copy)]
struct Gap;

impl ObservationModel<1, 1, 1> for Gap {
    fn predict(&self, pose: &Vector1<f64>, landmark: &Vector1<f64>) -> Option<Vector1<f64>> {
        Some(landmark - pose)
    }

    fn noise(&self) -> SMatrix<f64, 1, 1> {
        SMatrix::<f64, 1, 1>::new(0.25)
    }
}

#[derive(Clone)]
struct Line {
    pose: f64,
}

impl PoseAndMap<1, 1> for Line {
    fn pose(&self) -> Vector1<f64> {
        Vector1::new(self.pose)
    }

    fn set_pose(&mut self, pose: Vector1<f64>) {
        self.pose = pose[0];
    }

    fn landmark(&self, _: u32) -> Option<Gaussian<1>> {
        Some(Gaussian {
            mean: Vector1::new(3.0),
            covariance: SMatrix::<f64, 1, 1>::new(0.5),
        })
    }
}

/// Innovation variance 1 + 0.5 + 0.25 = 1.75; without the landmark's covariance it would be 1.25.
#[test]
fn the_landmark_covariance_is_in_the_evidence() {
    let proposal = UnscentedProposal::<_, _, 1, 1> {
        motion: Still,
        sensor: Gap,
        iterations: 1,
    };
    let frame = Frame {
        control: (),
        measurements: vec![(0, Vector1::new(2.0))],
    };
    for draw in 0..10 {
        let mut line = Line { pose: 0.0 };
        let mut rng = Streams::new(1).stream(0, draw, Purpose::Proposal);
        let increment = proposal.propose(&mut line, &frame, &mut rng).unwrap();
        let expected = -0.5 * (1.0 / 1.75 + (TAU * 1.75).ln());
        assert!((increment - expected).abs() < 1e-12);
    }
}
