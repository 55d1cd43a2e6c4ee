//! Landmarks, particles, and a linear Gaussian problem whose answers have closed forms.

use nalgebra::{DMatrix, DVector, Matrix2, SVector, Vector2};
use rand_chacha::ChaCha8Rng;
use range_bearing_slam::{
    Frame, Gaussian, InverseObservation, Landmark, LandmarkParticle, MotionModel,
    ObservationJacobians, ObservationModel,
};
use rbpf_core::{Purpose, Streams};
use std::f64::consts::TAU;

pub(crate) fn gaussian(x: f64, y: f64, covariance: Matrix2<f64>) -> Gaussian<2> {
    Gaussian {
        mean: Vector2::new(x, y),
        covariance,
    }
}

/// A landmark of even odds of existence.
pub(crate) fn landmark<const K: usize>(position: Gaussian<K>) -> Landmark<K> {
    Landmark {
        position,
        existence: 0.0,
    }
}

/// A particle with these landmarks.
pub(crate) fn particle<const D: usize, const K: usize>(
    pose: SVector<f64, D>,
    landmarks: impl IntoIterator<Item = (u32, Gaussian<K>)>,
) -> LandmarkParticle<D, K> {
    let mut particle = LandmarkParticle::new(pose);
    particle.map = landmarks
        .into_iter()
        .map(|(id, position)| (id, landmark(position)))
        .collect();
    particle
}

/// The random numbers of one proposal.
pub(crate) fn proposal_rng(seed: u64, draw: u64) -> ChaCha8Rng {
    Streams::new(seed).stream(0, draw, Purpose::Proposal)
}

/// A point in the plane, moved by a displacement.
#[derive(Clone, Copy)]
pub(crate) struct Drift;

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
pub(crate) struct Offset;

pub(crate) const SHEAR: Matrix2<f64> = Matrix2::new(1.0, 0.5, -0.3, 2.0);

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

impl InverseObservation<2, 2, 2> for Offset {
    fn locate(&self, pose: &Vector2<f64>, z: &Vector2<f64>) -> Option<Vector2<f64>> {
        Some(pose + SHEAR.try_inverse()? * z)
    }

    fn locate_jacobian(&self, _: &Vector2<f64>, _: &Vector2<f64>) -> Option<Matrix2<f64>> {
        SHEAR.try_inverse()
    }
}

pub(crate) type Point = LandmarkParticle<2, 2>;
pub(crate) type Displaced = Frame<Vector2<f64>, 2>;

/// A point with three landmarks, one of them known exactly, and a frame that measures them and a fourth
/// one that is not in the map.
pub(crate) fn linear_problem() -> (Point, Displaced) {
    let map = [
        (0, gaussian(2.0, 1.0, Matrix2::new(0.4, 0.1, 0.1, 0.2))),
        (5, gaussian(-1.0, 3.0, Matrix2::new(0.1, 0.0, 0.0, 0.3))),
        (40, gaussian(0.5, -2.0, Matrix2::zeros())),
    ];
    let frame = Frame {
        control: Vector2::new(0.5, 0.1),
        measurements: vec![
            (0, Vector2::new(1.2, 1.9)),
            (5, Vector2::new(-0.1, 7.0)),
            (40, Vector2::new(-1.5, -3.6)),
            (7, Vector2::new(100.0, 100.0)),
        ],
    };
    (particle(Vector2::new(0.3, -0.2), map), frame)
}

/// The measured landmarks that the particle holds, with their measurements.
fn held(particle: &Point, frame: &Displaced) -> Vec<(Gaussian<2>, Vector2<f64>)> {
    let held = |(id, z): &(u32, Vector2<f64>)| Some((particle.map.get(*id)?.position, *z));
    frame.measurements.iter().filter_map(held).collect()
}

/// log N(z; z^, S) with all measurements stacked: S has the pose's covariance in every block.
pub(crate) fn log_evidence(particle: &Point, frame: &Displaced) -> f64 {
    let predicted = Drift.predict(&particle.pose, &frame.control);
    let known = held(particle, frame);
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

/// log p(z | s, map) at the particle's pose: the factors N(z; z^, S) of the landmarks it holds.
pub(crate) fn log_likelihood(particle: &Point, frame: &Displaced) -> f64 {
    let of_landmark = |(landmark, z): (Gaussian<2>, Vector2<f64>)| {
        let s = SHEAR * landmark.covariance * SHEAR.transpose() + Offset.noise();
        let d = z - SHEAR * (landmark.mean - particle.pose);
        let inverse = s.try_inverse().expect("regular");
        -0.5 * (d.dot(&(inverse * d)) + s.determinant().ln()) - TAU.ln()
    };
    held(particle, frame).into_iter().map(of_landmark).sum()
}

/// p(s | z, s_prev, u, map) in the information form.
pub(crate) fn posterior(particle: &Point, frame: &Displaced) -> Gaussian<2> {
    let inverse = |m: Matrix2<f64>| m.try_inverse().expect("regular");
    let prior = Drift.predict(&particle.pose, &frame.control);
    let mut information = inverse(prior.covariance);
    let mut vector = information * prior.mean;
    for (landmark, z) in held(particle, frame) {
        let noise = SHEAR * landmark.covariance * SHEAR.transpose() + Offset.noise();
        // z = SHEAR landmark - SHEAR pose + noise
        let weighted = -SHEAR.transpose() * inverse(noise);
        information += weighted * -SHEAR;
        vector += weighted * (z - SHEAR * landmark.mean);
    }
    let covariance = inverse(information);
    Gaussian {
        mean: covariance * vector,
        covariance,
    }
}
