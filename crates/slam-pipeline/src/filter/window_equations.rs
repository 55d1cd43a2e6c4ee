//! The normal equations of a window: poses, constants of the carrier and landmarks, these eliminated.
//!
//! Factors are the motion prior of every step, the Gaussian of each landmark, and every match that scores, both
//! coordinates, Huber weighted. Landmarks are eliminated (Schur complement) and follow every step.

use std::sync::Arc;

use estimation_base::Manifold;
use mono_geometry::inverse_depth::{LandmarkGeometry, turned_anchor, turned_camera};
use mono_geometry::{PlacedCamera, tilted_body_axes};
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};

use super::motion::{CONSTANTS, Departure};
use super::particle::Particle;
use super::pose::{CameraPose, POSE_DIM, PoseMatrix, PoseStep};
use super::segment::WindowStep;
use super::window_landmarks::Track;
use crate::rig::Rig;

/// Cost of a sighting whose landmark the pose cannot see.
pub(crate) const UNSEEN_COST: f64 = 20.0;
/// Variance that keeps a constant which is known exactly out of a division by zero.
const LEAST_CONSTANT_VARIANCE: f64 = 1e-14;

/// Derivative of a pixel with respect to a pose tangent.
type PoseJacobian = SMatrix<f64, 2, POSE_DIM>;

/// The measurements of a window and the state at its beginning.
pub(crate) struct WindowProblem<'a> {
    /// Camera and mount.
    pub(crate) rig: &'a Rig,
    /// The state at the beginning.
    pub(crate) start: &'a Particle,
    /// The keyframes of the window.
    pub(crate) steps: &'a [Arc<WindowStep>],
    /// The landmarks seen in it.
    pub(crate) tracks: Vec<Track>,
}

/// The unknowns of a window.
#[derive(Clone)]
pub(crate) struct Unknowns {
    /// One pose a step.
    pub(crate) poses: Vec<CameraPose>,
    /// The constants of the carrier.
    pub(crate) constants: Vector3<f64>,
    /// The parameters of each landmark.
    pub(crate) landmarks: Vec<Vector3<f64>>,
}

/// A pose that may be unknown.
#[derive(Clone, Copy)]
pub(crate) struct Node {
    pub(crate) camera: PlacedCamera,
    /// Index of the unknown and the angular velocities (world axes) of heading, roll and pitch.
    unknown: Option<(usize, Matrix3<f64>)>,
}

/// One landmark's part of the normal equations.
pub(crate) struct Elimination {
    /// Products of the derivatives by pose and by landmark, for each pose of the window that it depends on.
    pub(crate) blocks: Vec<(usize, SMatrix<f64, POSE_DIM, 3>)>,
    /// Information of the landmark given the poses.
    pub(crate) information: Matrix3<f64>,
    inverse: Matrix3<f64>,
    /// Gradient of the landmark.
    pub(crate) vector: Vector3<f64>,
    cost: f64,
}

/// The normal equations of poses and constants.
pub(crate) struct NormalEquations {
    /// Their matrix.
    pub(crate) precision: DMatrix<f64>,
    /// Their right-hand side.
    pub(crate) vector: DVector<f64>,
    /// The parts by which each landmark follows a step; `None` for one that took no part.
    pub(crate) eliminated: Vec<Option<Elimination>>,
    /// Half the sum of the squared residuals, Huber's function of the sightings; up to a constant.
    pub(crate) cost: f64,
}

impl WindowProblem<'_> {
    pub(crate) fn node(&self, poses: &[CameraPose], keyframe: u32) -> Option<Node> {
        let before = self.start.path.len();
        match (keyframe as usize).checked_sub(before) {
            Some(step) => poses.get(step).map(|pose| Node {
                camera: pose.place(self.rig),
                unknown: Some((step, tilted_body_axes(pose.phi, pose.pitch))),
            }),
            None => self.start.path.get(keyframe as usize).map(|k| Node {
                camera: k.camera,
                unknown: None,
            }),
        }
    }

    /// The poses of the window, in order.
    pub(crate) fn nodes(&self, poses: &[CameraPose]) -> Option<Vec<Node>> {
        let before = self.start.path.len();
        (before..before + self.steps.len())
            .map(|keyframe| self.node(poses, keyframe as u32))
            .collect()
    }

    /// The normal equations at `at`; `None` when the motion has no covariance.
    #[must_use]
    pub(crate) fn normal_equations(&self, at: &Unknowns) -> Option<NormalEquations> {
        let n = POSE_DIM * self.steps.len();
        let mut precision = DMatrix::zeros(n + CONSTANTS, n + CONSTANTS);
        let mut vector = DVector::zeros(n + CONSTANTS);
        let mut cost = self.add_motion(at, &mut precision, &mut vector)?;
        let nodes = self.nodes(&at.poses)?;
        let mut eliminated = Vec::with_capacity(self.tracks.len());
        for (track, mean) in self.tracks.iter().zip(&at.landmarks) {
            let part = self.eliminate(at, track, mean, &nodes, &mut precision, &mut vector);
            if let Some(part) = &part {
                cost += part.cost;
                let weighted: Vec<_> = part
                    .blocks
                    .iter()
                    .map(|(k, e)| (*k, e, e * part.inverse))
                    .collect();
                for (a, _, ea) in &weighted {
                    let mut rows = vector.fixed_rows_mut::<POSE_DIM>(POSE_DIM * a);
                    rows -= ea * part.vector;
                    for (b, eb, _) in &weighted {
                        let mut block = precision
                            .fixed_view_mut::<POSE_DIM, POSE_DIM>(POSE_DIM * a, POSE_DIM * b);
                        block -= ea * eb.transpose();
                    }
                }
            }
            eliminated.push(part);
        }
        Some(NormalEquations {
            precision,
            vector,
            eliminated,
            cost,
        })
    }

    /// Adds the factors of the motion and returns their cost.
    fn add_motion(
        &self,
        at: &Unknowns,
        precision: &mut DMatrix<f64>,
        vector: &mut DVector<f64>,
    ) -> Option<f64> {
        let n = POSE_DIM * self.steps.len();
        let floor = Matrix3::identity() * LEAST_CONSTANT_VARIANCE;
        let information = (self.start.metric.constants_covariance() + floor)
            .cholesky()?
            .inverse();
        let mut corner = precision.fixed_view_mut::<CONSTANTS, CONSTANTS>(n, n);
        corner += information;
        let mut rows = vector.fixed_rows_mut::<CONSTANTS>(n);
        let off = self.start.metric.constants() - at.constants;
        rows += information * off;
        let mut cost = 0.5 * off.dot(&(information * off));
        let mut from = self.start.pose;
        for (k, (step, pose)) in self.steps.iter().zip(&at.poses).enumerate() {
            let prior = step.carrier.prior(
                &self.rig.lever_m(),
                &Departure {
                    pose: from,
                    constants: at.constants,
                    constants_covariance: Matrix3::zeros(),
                },
                &step.observation.control,
            );
            let whiten = prior
                .factor
                .solve_lower_triangular(&PoseMatrix::identity())?;
            let residual: PoseStep = whiten * prior.mean.local(pose);
            cost += 0.5 * residual.norm_squared();
            let own = whiten;
            let before = -whiten * prior.by_departure(&from);
            let constants = -whiten * prior.gains;
            let row = POSE_DIM * k;
            add_block(precision, vector, &residual, &[(row, own)], n, &constants);
            if k > 0 {
                let other = row - POSE_DIM;
                let mut rows = vector.fixed_rows_mut::<POSE_DIM>(other);
                rows -= before.tr_mul(&residual);
                let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(other, other);
                block += before.tr_mul(&before);
                let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(other, row);
                block += before.tr_mul(&own);
                let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(row, other);
                block += own.tr_mul(&before);
                let cross = before.tr_mul(&constants);
                let mut block = precision.fixed_view_mut::<POSE_DIM, CONSTANTS>(other, n);
                block += cross;
                let mut block = precision.fixed_view_mut::<CONSTANTS, POSE_DIM>(n, other);
                block += cross.transpose();
            }
            from = *pose;
        }
        Some(cost)
    }

    /// Adds the sightings of a landmark and returns what its elimination needs; `None` when it is not seen from the poses.
    fn eliminate(
        &self,
        at: &Unknowns,
        track: &Track,
        mean: &Vector3<f64>,
        nodes: &[Node],
        precision: &mut DMatrix<f64>,
        vector: &mut DVector<f64>,
    ) -> Option<Elimination> {
        let anchor = match track.parametrisation.anchor() {
            None => None,
            Some(keyframe) => Some(self.node(&at.poses, keyframe)?),
        };
        let geometry = anchor.map_or(LandmarkGeometry::Point, |a| {
            LandmarkGeometry::InverseDepth { anchor: a.camera }
        });
        let pinhole = self.rig.pinhole();
        let ray = geometry.ray(mean);
        let mut information = track.prior_information;
        let mut own = track.prior_vector - track.prior_information * mean;
        let mut blocks: Vec<(usize, SMatrix<f64, POSE_DIM, 3>)> =
            Vec::with_capacity(track.sightings.len() + 1);
        let mut cost = mean.dot(&(track.prior_information * mean * 0.5 - track.prior_vector));
        for sighting in &track.sightings {
            let node = &nodes[sighting.step];
            let Some(predicted) = ray.project(pinhole, &node.camera) else {
                cost += UNSEEN_COST;
                continue;
            };
            let whitening = &sighting.whitening;
            let by_landmark =
                whitening.rows(geometry.parameter_jacobian(pinhole, &node.camera, mean)?);
            let residual = whitening.rows(sighting.pixel - predicted);
            let (weight, part) = sighting.weigh(residual.norm());
            cost += part;
            let direction = ray.base + (ray.origin - node.camera.centre) * ray.rate;
            let q = node.camera.camera_from_world * direction;
            let by_direction = whitening.rows(SMatrix::<f64, 2, 3>::new(
                pinhole.fx / q.z,
                0.0,
                -pinhole.fx * q.x / (q.z * q.z),
                0.0,
                pinhole.fy / q.z,
                -pinhole.fy * q.y / (q.z * q.z),
            )) * node.camera.camera_from_world;
            let mut poses: Vec<(usize, PoseJacobian)> = Vec::with_capacity(2);
            if let Some((k, rates)) = node.unknown {
                let mut j = PoseJacobian::zeros();
                j.fixed_view_mut::<2, 3>(0, 0)
                    .copy_from(&(by_direction * -ray.rate));
                j.fixed_view_mut::<2, 3>(0, 3)
                    .copy_from(&(by_direction * turned_camera(&direction, &rates)));
                poses.push((k, j));
            }
            if let Some(Node {
                unknown: Some((a, rates)),
                ..
            }) = anchor
            {
                let mut j = PoseJacobian::zeros();
                j.fixed_view_mut::<2, 3>(0, 0)
                    .copy_from(&(by_direction * ray.rate));
                j.fixed_view_mut::<2, 3>(0, 3)
                    .copy_from(&(by_direction * turned_anchor(&ray.base, &rates)));
                if let Some(same) = poses.iter_mut().find(|(k, _)| *k == a) {
                    same.1 += j;
                } else {
                    poses.push((a, j));
                }
            }
            information += by_landmark.tr_mul(&by_landmark) * weight;
            own += by_landmark.tr_mul(&residual) * weight;
            for (k, j) in &poses {
                let product = j.tr_mul(&by_landmark) * weight;
                match blocks.iter_mut().rev().find(|(known, _)| known == k) {
                    Some((_, block)) => *block += product,
                    None => blocks.push((*k, product)),
                }
                let mut rows = vector.fixed_rows_mut::<POSE_DIM>(POSE_DIM * k);
                rows += j.tr_mul(&residual) * weight;
                for (l, i) in &poses {
                    let mut block =
                        precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(POSE_DIM * k, POSE_DIM * l);
                    block += j.tr_mul(i) * weight;
                }
            }
        }
        let inverse = information.cholesky()?.inverse();
        Some(Elimination {
            blocks,
            information,
            inverse,
            vector: own,
            cost,
        })
    }
}

impl Unknowns {
    /// The unknowns after a step of poses and constants, the landmarks following it.
    #[must_use]
    pub(crate) fn after(&self, step: &DVector<f64>, eliminated: &[Option<Elimination>]) -> Self {
        let mut next = self.clone();
        for (k, pose) in next.poses.iter_mut().enumerate() {
            *pose = pose.retract(&step.fixed_rows::<POSE_DIM>(POSE_DIM * k).into_owned());
        }
        next.constants += step.fixed_rows::<CONSTANTS>(POSE_DIM * self.poses.len());
        for (mean, part) in next.landmarks.iter_mut().zip(eliminated) {
            let Some(part) = part else { continue };
            let mut rest = part.vector;
            for (k, block) in &part.blocks {
                rest -= block.tr_mul(&step.fixed_rows::<POSE_DIM>(POSE_DIM * k));
            }
            *mean += part.inverse * rest;
        }
        next
    }
}

fn add_block(
    precision: &mut DMatrix<f64>,
    vector: &mut DVector<f64>,
    residual: &PoseStep,
    own: &[(usize, PoseMatrix)],
    n: usize,
    constants: &SMatrix<f64, POSE_DIM, CONSTANTS>,
) {
    for (at, jacobian) in own {
        let mut rows = vector.fixed_rows_mut::<POSE_DIM>(*at);
        rows -= jacobian.tr_mul(residual);
        let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(*at, *at);
        block += jacobian.tr_mul(jacobian);
        let cross = jacobian.tr_mul(constants);
        let mut block = precision.fixed_view_mut::<POSE_DIM, CONSTANTS>(*at, n);
        block += cross;
        let mut block = precision.fixed_view_mut::<CONSTANTS, POSE_DIM>(n, *at);
        block += cross.transpose();
    }
    let mut rows = vector.fixed_rows_mut::<CONSTANTS>(n);
    rows -= constants.tr_mul(residual);
    let mut block = precision.fixed_view_mut::<CONSTANTS, CONSTANTS>(n, n);
    block += constants.tr_mul(constants);
}
