//! A linear Gaussian SLAM problem has a Kalman filter over pose and all landmarks; the particle filter
//! must converge to it.

use nalgebra::{Matrix1, SMatrix, SVector, Vector1};
use rand::RngExt;
use rand_distr::StandardNormal;
use range_bearing_slam::{
    ExtendedLandmarks, ExtendedProposal, Frame, Gaussian, InverseObservation, LandmarkMapping,
    LandmarkParticle, Linearisation, MotionModel, ObservationJacobians, ObservationModel,
};
use rbpf_core::{FilterConfig, NoRejuvenation, ParticleFilter, ParticleSet, Purpose, Streams};

const LANDMARKS: [f64; 4] = [1.0, 2.5, 4.0, 6.0];
/// Pose and landmarks.
const JOINT: usize = 1 + LANDMARKS.len();
const Q: f64 = 0.04;
const R: f64 = 0.09;
const FRAMES: u64 = 20;

#[derive(Clone, Copy)]
struct Line;

impl MotionModel<1> for Line {
    type Control = f64;

    fn predict(&self, pose: &Vector1<f64>, control: &f64) -> Gaussian<1> {
        Gaussian {
            mean: pose.add_scalar(*control),
            covariance: Matrix1::new(Q),
        }
    }
}

impl ObservationModel<1, 1, 1> for Line {
    fn predict(&self, pose: &Vector1<f64>, landmark: &Vector1<f64>) -> Option<Vector1<f64>> {
        Some(landmark - pose)
    }

    fn noise(&self) -> Matrix1<f64> {
        Matrix1::new(R)
    }
}

impl ObservationJacobians<1, 1, 1> for Line {
    fn jacobians(
        &self,
        _: &Vector1<f64>,
        _: &Vector1<f64>,
    ) -> Option<(Matrix1<f64>, Matrix1<f64>)> {
        Some((Matrix1::new(-1.0), Matrix1::new(1.0)))
    }
}

impl InverseObservation<1, 1, 1> for Line {
    fn locate(&self, pose: &Vector1<f64>, z: &Vector1<f64>) -> Option<Vector1<f64>> {
        Some(pose + z)
    }

    fn locate_jacobian(&self, _: &Vector1<f64>, _: &Vector1<f64>) -> Option<Matrix1<f64>> {
        Some(Matrix1::new(1.0))
    }
}

type Joint = SVector<f64, JOINT>;
type JointCovariance = SMatrix<f64, JOINT, JOINT>;

/// There and back; each frame measures every other landmark, after all have been seen at once.
fn frames() -> Vec<Frame<f64, 1>> {
    let streams = Streams::new(77);
    let mut truth = 0.0;
    (0..FRAMES)
        .map(|t| {
            let mut rng = streams.shared(t, Purpose::MeasurementNoise);
            let mut normal = || rng.sample::<f64, _>(StandardNormal);
            let control = if t < FRAMES / 2 { 0.3 } else { -0.3 };
            truth += control + Q.sqrt() * normal();
            let measurements = (0..)
                .zip(LANDMARKS)
                .filter(|(id, _)| t == 0 || (u64::from(*id) + t) % 2 == 0)
                .map(|(id, at)| (id, Vector1::new(at - truth + R.sqrt() * normal())))
                .collect();
            Frame {
                control,
                measurements,
            }
        })
        .collect()
}

/// The joint filter; a landmark starts at pose + z with variance P_pose + R, correlated with the pose.
fn kalman(frames: &[Frame<f64, 1>]) -> (Joint, JointCovariance) {
    let (mut mean, mut p) = (Joint::zeros(), JointCovariance::zeros());
    for (t, frame) in frames.iter().enumerate() {
        mean[0] += frame.control;
        p[(0, 0)] += Q;
        for (id, z) in &frame.measurements {
            let k = 1 + *id as usize;
            if t == 0 {
                mean[k] = mean[0] + z[0];
                let row = p.row(0).into_owned();
                p.set_row(k, &row);
                let column = p.column(0).into_owned();
                p.set_column(k, &column);
                p[(k, k)] = p[(0, 0)] + R;
                continue;
            }
            let mut h = Joint::zeros();
            (h[0], h[k]) = (-1.0, 1.0);
            let ph = p * h;
            let s = h.dot(&ph) + R;
            mean += ph * ((z[0] - h.dot(&mean)) / s);
            p -= ph * ph.transpose() / s;
        }
    }
    (mean, p)
}

/// Moments of the mixture: covariance = mean of the covariances + covariance of the means.
fn particle_filter(frames: &[Frame<f64, 1>], n: usize, seed: u64) -> (Joint, JointCovariance) {
    let set = ParticleSet::new(vec![LandmarkParticle::new(Vector1::zeros()); n]).expect("n > 0");
    let mut filter =
        ParticleFilter::new(set, Streams::new(seed), FilterConfig::default()).expect("valid");
    let proposal = ExtendedProposal {
        motion: Line,
        sensor: Line,
        linearisation: Linearisation::Sequential,
    };
    let mapping = LandmarkMapping {
        sensor: Line,
        filter: ExtendedLandmarks,
    };
    for (t, frame) in (0..).zip(frames) {
        filter
            .step(t, frame, &proposal, &NoRejuvenation, &mapping)
            .expect("valid frame");
    }
    let states: Vec<(Joint, Joint)> = filter
        .set()
        .particles()
        .iter()
        .map(|particle| {
            let (mut mean, mut variance) = (Joint::zeros(), Joint::zeros());
            mean[0] = particle.pose[0];
            for (id, landmark) in &particle.map {
                mean[1 + id as usize] = landmark.position.mean[0];
                variance[1 + id as usize] = landmark.position.covariance[0];
            }
            (mean, variance)
        })
        .collect();
    let weights = filter.set().weights();
    let mut mean = Joint::zeros();
    for ((state, _), weight) in states.iter().zip(&weights) {
        mean += state * *weight;
    }
    let mut covariance = JointCovariance::zeros();
    for ((state, variance), weight) in states.iter().zip(&weights) {
        let d = state - mean;
        covariance += (d * d.transpose() + JointCovariance::from_diagonal(variance)) * *weight;
    }
    (mean, covariance)
}

/// Root mean square over seeds of |mean - Kalman| and |covariance - Kalman| in N, each fitted by a line
/// in logarithms. Monte Carlo says slope -1/2. A root mean square over s seeds of about JOINT strongly
/// correlated entries has a relative error of about 1/sqrt(2 s), 0.13 for s = 30; over three points
/// 2.3 apart in ln N the slope then has standard error 0.13 / sqrt(2 * 2.3^2) = 0.04, and 5 of them are 0.2.
#[test]
fn mean_and_covariance_converge_at_the_root_of_n() {
    let frames = frames();
    let (mean, covariance) = kalman(&frames);
    let seeds = 30;
    let sizes = [30, 300, 3000];
    let mut logs = vec![];
    for n in sizes {
        let (mut of_mean, mut of_covariance) = (0.0, 0.0);
        for seed in 0..seeds {
            let (m, c) = particle_filter(&frames, n, seed);
            of_mean += (m - mean).norm_squared();
            of_covariance += (c - covariance).norm_squared();
        }
        let root = |sum: f64| (sum / seeds as f64).sqrt().ln();
        logs.push([root(of_mean), root(of_covariance)]);
    }
    for (k, what) in ["mean", "covariance"].into_iter().enumerate() {
        // three points equally spaced in log N: the fitted slope is that of the outer two
        let slope = (logs[2][k] - logs[0][k]) / 100_f64.ln();
        let errors: Vec<f64> = logs.iter().map(|log| log[k].exp()).collect();
        assert!(
            (-0.7..=-0.3).contains(&slope),
            "{what}: slope {slope}, errors {errors:?}"
        );
    }
    // far below the posterior deviations at N = 3000
    assert!(logs[2][0].exp() < 0.3 * covariance.trace().sqrt());
}
