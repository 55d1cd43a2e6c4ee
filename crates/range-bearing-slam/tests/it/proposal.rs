//! The proposals draw from the posterior in the linear Gaussian case, and agree with each other in a
//! nonlinear one.

use crate::fixtures::{Drift, Offset, gaussian, linear_problem, particle, posterior, proposal_rng};
use crate::motion::moved;
use estimation_base::wrap;
use nalgebra::{Matrix2, SMatrix, Vector1, Vector2, Vector3};
use range_bearing_slam::{
    ExtendedProposal, Frame, Gaussian, LandmarkParticle, Linearisation, MotionModel,
    MotionProposal, ObservationModel, RangeBearingError, UnscentedProposal,
};
use rbpf_core::{ParticleSet, Proposal};
use std::f64::consts::TAU;

#[test]
fn the_proposal_is_the_posterior_in_the_linear_case() {
    let (particle, frame) = linear_problem();
    let Gaussian { mean, covariance } = posterior(&particle, &frame);
    let unscented = UnscentedProposal {
        motion: Drift,
        sensor: Offset,
        iterations: 2,
    };
    let extended = ExtendedProposal {
        motion: Drift,
        sensor: Offset,
        linearisation: Linearisation::Sequential,
    };
    let proposals: [&dyn Proposal<_, _, Error = RangeBearingError>; 2] = [&unscented, &extended];
    for proposal in proposals {
        let n = 4000_u32;
        let (mut sum, mut squares) = (Vector2::zeros(), Matrix2::zeros());
        for draw in 0..n {
            let mut moved = particle.clone();
            let mut rng = proposal_rng(12, u64::from(draw));
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
                wrap(pose[2] + control[1]),
            ),
            covariance: SMatrix::from_diagonal(&Vector3::new(0.04, 0.04, 0.01)),
        }
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        moved(pose, tangent)
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
        let bearing = wrap(offset.y.atan2(offset.x) - pose[2]);
        (range < self.longest).then(|| Vector2::new(range, bearing))
    }

    fn noise(&self) -> Matrix2<f64> {
        Matrix2::from_diagonal(&Vector2::new(0.01, 0.0004))
    }

    fn innovation(&self, measured: &Vector2<f64>, predicted: &Vector2<f64>) -> Vector2<f64> {
        let mut d = measured - predicted;
        d[1] = wrap(d[1]);
        d
    }
}

fn nonlinear_problem() -> (LandmarkParticle<3, 2>, Frame<Vector2<f64>, 2>) {
    let covariance = Matrix2::new(0.02, 0.005, 0.005, 0.01);
    let particle = particle(
        Vector3::new(0.0, 0.0, 3.1),
        [
            (0, gaussian(-4.0, 0.5, covariance)),
            (1, gaussian(-3.0, -2.0, covariance)),
        ],
    );
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
    let conventional = MotionProposal {
        motion: Drive,
        sensor,
    };
    let unscented = UnscentedProposal {
        motion: Drive,
        sensor,
        iterations: 2,
    };
    let weights = |proposal: &dyn Proposal<_, _, Error = RangeBearingError>, n: u64| -> Vec<f64> {
        (0..n)
            .map(|draw| {
                let mut moved = particle.clone();
                let mut rng = proposal_rng(13, draw);
                proposal
                    .propose(&mut moved, &frame, &mut rng)
                    .expect("valid problem")
            })
            .collect()
    };
    let estimate = |logs: &[f64]| {
        let n = logs.len() as f64;
        let mut set = ParticleSet::new(vec![(); logs.len()]).expect("not empty");
        // of equal weights before: the logarithm of the mean
        let mean = set.reweight(logs).expect("finite");
        let relative_variance = n / set.effective_count() - 1.0;
        (
            mean,
            (relative_variance / n).sqrt(),
            set.effective_count() / n,
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
    let proposal = UnscentedProposal {
        motion: Drive,
        sensor: blind,
        iterations: 2,
    };
    let mut rng = proposal_rng(1, 0);
    let mut moved = particle.clone();
    assert_eq!(
        proposal.propose(&mut moved, &frame, &mut rng),
        Ok(f64::NEG_INFINITY)
    );

    let sensor = RangeBearing { longest: 50.0 };
    frame.measurements[0].1[0] = f64::NAN;
    let before = particle.clone();
    let mut moved = particle;
    let unscented = UnscentedProposal {
        motion: Drive,
        sensor,
        iterations: 2,
    };
    let error = unscented.propose(&mut moved, &frame, &mut rng);
    assert!(matches!(
        error,
        Err(RangeBearingError::MeasurementNotFinite { id: 0, entry: 0, value }) if value.is_nan()
    ));
    let conventional = MotionProposal {
        motion: Drive,
        sensor,
    };
    let error = conventional.propose(&mut moved, &frame, &mut rng);
    assert!(matches!(
        error,
        Err(RangeBearingError::MeasurementNotFinite { id: 0, entry: 0, value }) if value.is_nan()
    ));
    assert_eq!(moved, before);
}

/// A robot on a line, for one landmark by hand: prior N(0, 1), landmark N(3, 0.5), R = 0.25, z = 2.
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

/// Innovation variance 1 + 0.5 + 0.25 = 1.75; without the landmark's covariance it would be 1.25.
#[test]
fn the_landmark_covariance_is_in_the_evidence() {
    let proposal = UnscentedProposal {
        motion: Still,
        sensor: Gap,
        iterations: 1,
    };
    let frame = Frame {
        control: (),
        measurements: vec![(0, Vector1::new(2.0))],
    };
    for draw in 0..10 {
        let position = Gaussian {
            mean: Vector1::new(3.0),
            covariance: SMatrix::<f64, 1, 1>::new(0.5),
        };
        let mut line = particle(Vector1::new(0.0), [(0, position)]);
        let increment = proposal
            .propose(&mut line, &frame, &mut proposal_rng(1, draw))
            .unwrap();
        let expected = -0.5 * (1.0 / 1.75 + (TAU * 1.75).ln());
        assert!((increment - expected).abs() < 1e-12);
    }
}
