//! A robot in the plane with a range-bearing sensor: particle, sensor, FastSLAM 2.0 and the landmark
//! filters, on the traits of the crate.

use nalgebra::{Const, DimMin, Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{
    CowMap, Frame, Gaussian, MapUpdate, MotionModel, ObservationModel, PoseAndMap, Proposal,
    RbpfError, wrap_angle,
};
use std::f64::consts::TAU;
use ukf::{SigmaPoints, UkfError, unscented_transform};

/// A pose and the landmarks seen along its path.
#[derive(Clone, Debug)]
pub(crate) struct Particle {
    /// x, y in metres, heading in radians.
    pub(crate) pose: Vector3<f64>,
    /// By landmark id.
    pub(crate) map: CowMap<Gaussian<2>>,
}

impl Particle {
    /// A particle without landmarks.
    pub(crate) const fn new(pose: Vector3<f64>) -> Self {
        Self {
            pose,
            map: CowMap::new(),
        }
    }
}

impl PoseAndMap<3, 2> for Particle {
    fn pose(&self) -> Vector3<f64> {
        self.pose
    }

    fn set_pose(&mut self, pose: Vector3<f64>) {
        self.pose = pose;
    }

    fn landmark(&self, id: u32) -> Option<Gaussian<2>> {
        self.map.get(id).copied()
    }
}

/// Range in metres and bearing in radians, with their standard deviations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RangeBearing {
    /// Metres.
    pub(crate) range_deviation: f64,
    /// Radians.
    pub(crate) bearing_deviation: f64,
}

impl ObservationModel<3, 2, 2> for RangeBearing {
    fn predict(&self, pose: &Vector3<f64>, landmark: &Vector2<f64>) -> Option<Vector2<f64>> {
        Some(measure(pose, landmark))
    }

    fn noise(&self) -> Matrix2<f64> {
        Matrix2::from_diagonal(
            &Vector2::new(self.range_deviation, self.bearing_deviation).map(|s| s * s),
        )
    }

    fn innovation(&self, measured: &Vector2<f64>, predicted: &Vector2<f64>) -> Vector2<f64> {
        let difference = measured - predicted;
        Vector2::new(difference.x, wrap_angle(difference.y))
    }
}

/// Range and bearing of `landmark` from `pose`.
pub(crate) fn measure(pose: &Vector3<f64>, landmark: &Vector2<f64>) -> Vector2<f64> {
    let offset = landmark - pose.xy();
    Vector2::new(offset.norm(), wrap_angle(offset.y.atan2(offset.x) - pose.z))
}

/// d z / d pose and d z / d landmark.
pub(crate) fn jacobians(
    pose: &Vector3<f64>,
    landmark: &Vector2<f64>,
) -> (Matrix2x3<f64>, Matrix2<f64>) {
    let d = landmark - pose.xy();
    let squared = d.norm_squared();
    let range = squared.sqrt();
    let of_landmark = Matrix2::new(d.x / range, d.y / range, -d.y / squared, d.x / squared);
    let of_pose = Matrix2x3::from_columns(&[
        -of_landmark.column(0),
        -of_landmark.column(1),
        Vector2::new(0.0, -1.0),
    ]);
    (of_pose, of_landmark)
}

/// What FastSLAM 2.0 weighs a particle with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weights {
    /// log N(z; z^, S) at the predicted pose, one landmark after the other (Montemerlo 2003).
    Published,
    /// log p(z | s) p(s | s_prev, u) / q(s) of the pose drawn (Bailey, Nieto, Nebot 2006).
    Exact,
}

/// FastSLAM 2.0: the landmarks of a frame update the predicted pose one after the other, each linearised
/// at what the ones before left; then the pose is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExtendedProposal<A> {
    /// p(s | s_prev, u).
    pub(crate) motion: A,
    /// p(z | s, landmark).
    pub(crate) sensor: RangeBearing,
    /// Which weights.
    pub(crate) weights: Weights,
}

impl<A: MotionModel<3>> Proposal<Particle, Frame<A::Control, 2>> for ExtendedProposal<A> {
    type Error = RbpfError;

    fn propose(
        &self,
        particle: &mut Particle,
        frame: &Frame<A::Control, 2>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RbpfError> {
        let predicted = self.motion.predict(&particle.pose, &frame.control);
        let known = || {
            frame.measurements.iter().filter_map(|(id, measured)| {
                particle.map.get(*id).map(|landmark| (landmark, measured))
            })
        };
        // N(innovation; 0, ...) with the landmark's own covariance, at a pose taken as known
        let innovation = |pose: &Vector3<f64>, landmark: &Gaussian<2>, measured: &Vector2<f64>| {
            let (of_pose, of_landmark) = jacobians(pose, &landmark.mean);
            let noise =
                of_landmark * landmark.covariance * of_landmark.transpose() + self.sensor.noise();
            (
                self.sensor
                    .innovation(measured, &measure(pose, &landmark.mean)),
                of_pose,
                noise,
            )
        };

        let (mut mean, mut covariance) = (predicted.mean, predicted.covariance);
        let mut published = 0.0;
        for (landmark, measured) in known() {
            let (difference, h, noise) = innovation(&mean, landmark, measured);
            let (gain, s) = gain(&covariance, &h, &noise)?;
            published += log_density(&difference, &s)?;
            mean = self.motion.retract(&mean, &(gain * difference));
            covariance = joseph(&covariance, &gain, &h, &noise);
        }
        let root = covariance.cholesky().ok_or(NOT_FINITE)?.l();
        let draw = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let pose = self.motion.retract(&mean, &(root * draw));
        let weight = match self.weights {
            Weights::Published => published,
            Weights::Exact => {
                let mut likelihood = 0.0;
                for (landmark, measured) in known() {
                    let (difference, _, noise) = innovation(&pose, landmark, measured);
                    likelihood += log_density(&difference, &noise)?;
                }
                let mut step = pose - predicted.mean;
                step.z = wrap_angle(step.z);
                let log_root: f64 = root.diagonal().iter().map(|entry| entry.ln()).sum();
                let proposal = -0.5 * (draw.norm_squared() + 3.0 * TAU.ln()) - log_root;
                likelihood + log_density(&step, &predicted.covariance)? - proposal
            }
        };
        particle.pose = pose;
        Ok(weight)
    }
}

/// How landmarks are started and updated, given the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Landmarks {
    /// By Jacobians.
    Extended,
    /// By sigma points.
    Unscented,
}

/// Known landmarks are updated with the pose drawn, unknown ones started.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mapping {
    /// p(z | s, landmark).
    pub(crate) sensor: RangeBearing,
    /// Which filter.
    pub(crate) landmarks: Landmarks,
}

impl<C> MapUpdate<Particle, Frame<C, 2>> for Mapping {
    type Error = RbpfError;

    fn update_map(&self, particle: &mut Particle, frame: &Frame<C, 2>) -> Result<(), RbpfError> {
        let pose = particle.pose;
        for (id, measured) in &frame.measurements {
            if let Some(landmark) = particle.map.get_mut(*id) {
                *landmark = self.update(&pose, landmark, measured)?;
            } else {
                particle.map.insert(*id, self.start(&pose, measured)?);
            }
        }
        Ok(())
    }
}

impl Mapping {
    fn start(
        &self,
        pose: &Vector3<f64>,
        measured: &Vector2<f64>,
    ) -> Result<Gaussian<2>, RbpfError> {
        let noise = self.sensor.noise();
        let locate = |z: &Vector2<f64>| {
            let (sin, cos) = (pose.z + z.y).sin_cos();
            pose.xy() + Vector2::new(cos, sin) * z.x
        };
        Ok(match self.landmarks {
            Landmarks::Extended => {
                let (sin, cos) = (pose.z + measured.y).sin_cos();
                let j = Matrix2::new(cos, -measured.x * sin, sin, measured.x * cos);
                Gaussian {
                    mean: locate(measured),
                    covariance: j * noise * j.transpose(),
                }
            }
            Landmarks::Unscented => {
                let at = unscented_transform(measured, &noise, &SigmaPoints::default(), locate)
                    .map_err(not_finite)?;
                Gaussian {
                    mean: at.mean,
                    covariance: at.covariance,
                }
            }
        })
    }

    fn update(
        &self,
        pose: &Vector3<f64>,
        landmark: &Gaussian<2>,
        measured: &Vector2<f64>,
    ) -> Result<Gaussian<2>, RbpfError> {
        let noise = self.sensor.noise();
        match self.landmarks {
            Landmarks::Extended => {
                let (_, h) = jacobians(pose, &landmark.mean);
                let difference = self
                    .sensor
                    .innovation(measured, &measure(pose, &landmark.mean));
                let (gain, _) = gain(&landmark.covariance, &h, &noise)?;
                Ok(Gaussian {
                    mean: landmark.mean + gain * difference,
                    covariance: joseph(&landmark.covariance, &gain, &h, &noise),
                })
            }
            Landmarks::Unscented => {
                let residual = unscented_transform(
                    &landmark.mean,
                    &landmark.covariance,
                    &SigmaPoints::default(),
                    |at| self.sensor.innovation(measured, &measure(pose, at)),
                )
                .map_err(not_finite)?;
                let s = residual.covariance + noise;
                let factor = s.cholesky().ok_or(NOT_FINITE)?;
                let gain = factor
                    .solve(&residual.cross_covariance.transpose())
                    .transpose();
                let covariance = landmark.covariance - gain * s * gain.transpose();
                Ok(Gaussian {
                    mean: landmark.mean - gain * residual.mean,
                    covariance: symmetric(&covariance),
                })
            }
        }
    }
}

const NOT_FINITE: RbpfError = RbpfError::NotFinite {
    what: "pose or landmark",
};

const fn not_finite(_: UkfError) -> RbpfError {
    NOT_FINITE
}

/// Kalman gain and innovation covariance.
fn gain<const N: usize>(
    covariance: &SMatrix<f64, N, N>,
    h: &SMatrix<f64, 2, N>,
    noise: &Matrix2<f64>,
) -> Result<(SMatrix<f64, N, 2>, Matrix2<f64>), RbpfError> {
    let s = symmetric(&(h * covariance * h.transpose() + noise));
    let factor = s.cholesky().ok_or(NOT_FINITE)?;
    Ok((factor.solve(&(h * covariance)).transpose(), s))
}

/// Joseph form.
fn joseph<const N: usize>(
    covariance: &SMatrix<f64, N, N>,
    gain: &SMatrix<f64, N, 2>,
    h: &SMatrix<f64, 2, N>,
    noise: &Matrix2<f64>,
) -> SMatrix<f64, N, N> {
    let rest = SMatrix::<f64, N, N>::identity() - gain * h;
    symmetric(&(rest * covariance * rest.transpose() + gain * noise * gain.transpose()))
}

/// log N(difference; 0, covariance).
pub(crate) fn log_density<const N: usize>(
    difference: &SVector<f64, N>,
    covariance: &SMatrix<f64, N, N>,
) -> Result<f64, RbpfError>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let factor = covariance.cholesky().ok_or(NOT_FINITE)?;
    let log_root: f64 = factor.l().diagonal().iter().map(|entry| entry.ln()).sum();
    Ok(-0.5 * (difference.dot(&factor.solve(difference)) + N as f64 * TAU.ln()) - log_root)
}

fn symmetric<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (matrix + matrix.transpose()) * 0.5
}

/// Only for the motion models beside this file: P' = F P F^T + G Q G^T.
pub(crate) fn propagate(
    covariance: &Matrix3<f64>,
    f: &Matrix3<f64>,
    g: &SMatrix<f64, 3, 2>,
    variances: [f64; 2],
) -> Matrix3<f64> {
    let q = Matrix2::from_diagonal(&Vector2::from(variances));
    symmetric(&(f * covariance * f.transpose() + g * q * g.transpose()))
}
