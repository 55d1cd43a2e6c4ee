//! The normal equations of a window: poses, constants of the carrier and landmarks, these eliminated.
//!
//! Factors are the motion prior of every step, the Gaussian of each landmark, and every match that scores, both
//! coordinates, Huber weighted. Landmarks are eliminated (Schur complement) and follow every step.

use std::ops::Range;
use std::sync::Arc;

use estimation_base::Manifold;
use mono_geometry::inverse_depth::{turned_anchor, turned_camera};
use mono_geometry::{PlacedCamera, tilted_body_axes};
use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, SMatrix, Vector2, Vector3};
use rayon::prelude::*;

use super::motion::{CONSTANTS, Departure};
use super::particle::Particle;
use super::pose::{CameraPose, POSE_DIM, PoseMatrix, PoseStep};
use super::segment::WindowStep;
use super::window_landmarks::Track;
use super::window_sight::Target;
use crate::rig::Rig;

/// Cost of a sighting whose landmark the pose cannot see.
pub(crate) const UNSEEN_COST: f64 = 20.0;
/// Variance that keeps a constant which is known exactly out of a division by zero.
const LEAST_CONSTANT_VARIANCE: f64 = 1e-14;

/// Parts of the landmarks whose sums are taken side by side before they are added up: the order of the sums does not depend on
/// the number of threads.
const PARTS: usize = 4;

/// Derivative of a pixel with respect to a pose tangent.
type PoseJacobian = SMatrix<f64, 2, POSE_DIM>;
/// Product of the derivatives by a pose and by a landmark.
pub(crate) type PoseBlock = SMatrix<f64, POSE_DIM, 3>;

/// The first unknown of pose `k`: the constants come before all poses, so that the factor of the poses alone, with the constants
/// eliminated, is a corner of that of all unknowns.
pub(crate) const fn row_of(k: usize) -> usize {
    CONSTANTS + POSE_DIM * k
}

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

/// A pose of the window.
pub(crate) struct Node {
    pub(crate) camera: PlacedCamera,
    /// Angular velocities (world axes) of heading, roll and pitch.
    rates: Matrix3<f64>,
}

/// One landmark's part of the normal equations.
pub(crate) struct Elimination {
    /// Its place in [`Sums::blocks`].
    range: Range<usize>,
    /// Information of the landmark given the poses.
    pub(crate) information: Matrix3<f64>,
    inverse: Matrix3<f64>,
    /// Gradient of the landmark.
    pub(crate) vector: Vector3<f64>,
}

/// Sums over some landmarks.
struct Sums {
    /// The matrix of the normal equations, its lower triangle.
    precision: DMatrix<f64>,
    /// Their right-hand side.
    vector: DVector<f64>,
    /// Products of the derivatives by pose and by landmark, for each landmark and each pose of the window that it depends on.
    blocks: Vec<(usize, PoseBlock)>,
    /// The parts by which each landmark follows a step; `None` for one that took no part.
    eliminated: Vec<Option<Elimination>>,
    /// Half the sum of the squared residuals, Huber's function of the sightings; up to a constant.
    cost: f64,
}

/// The normal equations of constants and poses.
pub(crate) struct NormalEquations {
    /// The lower triangle of their matrix.
    pub(crate) precision: DMatrix<f64>,
    /// Their right-hand side.
    pub(crate) vector: DVector<f64>,
    /// Half the sum of the squared residuals, Huber's function of the sightings; up to a constant.
    pub(crate) cost: f64,
    landmarks: Vec<Sums>,
}

impl WindowProblem<'_> {
    /// The poses of the window, in order.
    pub(crate) fn nodes(&self, poses: &[CameraPose]) -> Vec<Node> {
        let node = |pose: &CameraPose| Node {
            camera: pose.place(self.rig),
            rates: tilted_body_axes(pose.phi, pose.pitch),
        };
        poses.iter().map(node).collect()
    }

    /// The camera of a keyframe, and its place in the window if it is not before it.
    pub(crate) fn camera(
        &self,
        nodes: &[Node],
        keyframe: u32,
    ) -> Option<(PlacedCamera, Option<usize>)> {
        match (keyframe as usize).checked_sub(self.start.path.len()) {
            Some(step) => nodes.get(step).map(|node| (node.camera, Some(step))),
            None => (self.start.path.get(keyframe as usize)).map(|k| (k.camera, None)),
        }
    }

    /// The normal equations at `at`; `None` when the motion has no covariance.
    #[must_use]
    pub(crate) fn normal_equations(&self, at: &Unknowns) -> Option<NormalEquations> {
        let n = row_of(self.steps.len());
        let mut precision = DMatrix::zeros(n, n);
        let mut vector = DVector::zeros(n);
        let mut cost = self.add_motion(at, &mut precision, &mut vector)?;
        let nodes = self.nodes(&at.poses);
        let size = self.tracks.len().div_ceil(PARTS).max(1);
        let landmarks: Vec<Sums> = self
            .tracks
            .par_chunks(size)
            .zip(at.landmarks.par_chunks(size))
            .map(|(tracks, means)| {
                let mut sums = Sums::none(n);
                for (track, mean) in tracks.iter().zip(means) {
                    let part = self.add_landmark(track, mean, &nodes, &mut sums);
                    sums.eliminated.push(part);
                }
                sums
            })
            .collect();
        for sums in &landmarks {
            precision += &sums.precision;
            vector += &sums.vector;
            cost += sums.cost;
        }
        Some(NormalEquations {
            precision,
            vector,
            cost,
            landmarks,
        })
    }

    /// Adds the factors of the motion and returns their cost.
    fn add_motion(
        &self,
        at: &Unknowns,
        precision: &mut DMatrix<f64>,
        vector: &mut DVector<f64>,
    ) -> Option<f64> {
        let floor = Matrix3::identity() * LEAST_CONSTANT_VARIANCE;
        let information = (self.start.metric.constants_covariance() + floor)
            .cholesky()?
            .inverse();
        let mut corner = precision.fixed_view_mut::<CONSTANTS, CONSTANTS>(0, 0);
        corner += information;
        let mut rows = vector.fixed_rows_mut::<CONSTANTS>(0);
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
            let row = row_of(k);
            add_motion_of(precision, vector, &residual, row, &own, &constants);
            let mut rows = vector.fixed_rows_mut::<CONSTANTS>(0);
            rows -= constants.tr_mul(&residual);
            let mut corner = precision.fixed_view_mut::<CONSTANTS, CONSTANTS>(0, 0);
            corner += constants.tr_mul(&constants);
            if k > 0 {
                let other = row_of(k - 1);
                add_motion_of(precision, vector, &residual, other, &before, &constants);
                let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(row, other);
                block += own.tr_mul(&before);
            }
            from = *pose;
        }
        Some(cost)
    }

    /// Adds a landmark, eliminated, and returns what it needs to follow a step; `None` when it is not seen from the poses.
    fn add_landmark(
        &self,
        track: &Track,
        mean: &Vector3<f64>,
        nodes: &[Node],
        sums: &mut Sums,
    ) -> Option<Elimination> {
        let anchor = match track.parametrisation.anchor() {
            None => None,
            Some(keyframe) => Some(self.camera(nodes, keyframe)?),
        };
        let target = Target::new(anchor.as_ref().map(|(camera, _)| camera), mean);
        let anchor = anchor.and_then(|(_, step)| step);
        let pinhole = self.rig.pinhole();
        let mut information = track.prior_information;
        let mut own = track.prior_vector - track.prior_information * mean;
        let mut cost = mean.dot(&(track.prior_information * mean * 0.5 - track.prior_vector));
        let first = sums.blocks.len();
        let mut of_anchor = PoseSums::default();
        if let Some(a) = anchor {
            sums.blocks.push((a, PoseBlock::zeros()));
        }
        for sighting in &track.sightings {
            let (k, node) = (sighting.step, &nodes[sighting.step]);
            let Some(sight) = target.sight(pinhole, &node.camera, sighting) else {
                cost += UNSEEN_COST;
                continue;
            };
            cost += sight.cost;
            let weight = sight.weight;
            let residual = sight.residual * weight;
            let by_landmark = sight.by_landmark * weight;
            information += by_landmark.tr_mul(&sight.by_landmark);
            own += by_landmark.tr_mul(&sight.residual);
            let turned = turned_camera(&sight.direction, &node.rates);
            let by_pose = pose_jacobian(&sight.by_direction, -target.ray.rate, &turned);
            if let Some(a) = anchor {
                let turned = turned_anchor(&target.ray.base, &nodes[a].rates);
                let by_anchor = pose_jacobian(&sight.by_direction, target.ray.rate, &turned);
                if a == k {
                    of_anchor.add(&(by_pose + by_anchor), weight, &residual, &by_landmark);
                    continue;
                }
                of_anchor.add(&by_anchor, weight, &residual, &by_landmark);
                sums.add_cross(k, a, &(by_pose * weight).tr_mul(&by_anchor));
            }
            let mut of_pose = PoseSums::default();
            of_pose.add(&by_pose, weight, &residual, &by_landmark);
            sums.add_pose(k, &of_pose);
            sums.blocks.push((k, of_pose.by_landmark));
        }
        if let Some(a) = anchor {
            sums.add_pose(a, &of_anchor);
            sums.blocks[first].1 = of_anchor.by_landmark;
        }
        sums.blocks[first..].sort_by_key(|(k, _)| *k);
        let Some(factor) = information.cholesky() else {
            sums.blocks.truncate(first);
            return None;
        };
        let part = Elimination {
            range: first..sums.blocks.len(),
            information,
            inverse: factor.inverse(),
            vector: own,
        };
        sums.cost += cost;
        sums.eliminate(&part);
        Some(part)
    }
}

impl Unknowns {
    /// The unknowns after a step of constants and poses, the landmarks following it.
    #[must_use]
    pub(crate) fn after(&self, step: &DVector<f64>, normal: &NormalEquations) -> Self {
        let mut next = self.clone();
        for (k, pose) in next.poses.iter_mut().enumerate() {
            *pose = pose.retract(&step.fixed_rows::<POSE_DIM>(row_of(k)).into_owned());
        }
        next.constants += step.fixed_rows::<CONSTANTS>(0);
        for (mean, part) in next.landmarks.iter_mut().zip(normal.eliminated()) {
            let Some((part, blocks)) = part else { continue };
            let mut rest = part.vector;
            for (k, block) in blocks {
                rest -= block.tr_mul(&step.fixed_rows::<POSE_DIM>(row_of(*k)));
            }
            *mean += part.inverse * rest;
        }
        next
    }
}

impl NormalEquations {
    /// The parts by which each landmark follows a step, with the products of its derivatives by pose and by landmark; `None` for
    /// one that took no part.
    pub(crate) fn eliminated(
        &self,
    ) -> impl Iterator<Item = Option<(&Elimination, &[(usize, PoseBlock)])>> {
        self.landmarks.iter().flat_map(|sums| {
            sums.eliminated.iter().map(|part| {
                part.as_ref()
                    .map(|part| (part, &sums.blocks[part.range.clone()]))
            })
        })
    }
}

/// The sums of one pose over sightings of one landmark.
#[derive(Default)]
struct PoseSums {
    precision: PoseMatrix,
    vector: PoseStep,
    by_landmark: PoseBlock,
}

impl PoseSums {
    /// Adds a sighting with these derivatives; `residual` and `by_landmark` are weighted already.
    #[inline]
    fn add(
        &mut self,
        by_pose: &PoseJacobian,
        weight: f64,
        residual: &Vector2<f64>,
        by_landmark: &Matrix2x3<f64>,
    ) {
        self.precision += (by_pose * weight).tr_mul(by_pose);
        self.vector += by_pose.tr_mul(residual);
        self.by_landmark += by_pose.tr_mul(by_landmark);
    }
}

impl Sums {
    /// Of no landmarks, for `n` unknowns.
    fn none(n: usize) -> Self {
        Self {
            precision: DMatrix::zeros(n, n),
            vector: DVector::zeros(n),
            blocks: Vec::new(),
            eliminated: Vec::new(),
            cost: 0.0,
        }
    }

    #[inline]
    fn add_pose(&mut self, k: usize, of_pose: &PoseSums) {
        let row = row_of(k);
        let mut block = self
            .precision
            .fixed_view_mut::<POSE_DIM, POSE_DIM>(row, row);
        block += of_pose.precision;
        let mut rows = self.vector.fixed_rows_mut::<POSE_DIM>(row);
        rows += of_pose.vector;
    }

    /// Adds `cross` to the rows of pose `k` and the columns of pose `l`, or its transpose to the other triangle.
    #[inline]
    fn add_cross(&mut self, k: usize, l: usize, cross: &PoseMatrix) {
        let (row, column) = (row_of(k.max(l)), row_of(k.min(l)));
        let mut block = self
            .precision
            .fixed_view_mut::<POSE_DIM, POSE_DIM>(row, column);
        if k > l {
            block += cross;
        } else {
            block += cross.transpose();
        }
    }

    /// Takes a landmark out of the equations of the poses that it depends on (Schur complement).
    fn eliminate(&mut self, part: &Elimination) {
        let Self {
            precision,
            vector,
            blocks,
            ..
        } = self;
        let blocks = &blocks[part.range.clone()];
        for (i, (l, right)) in blocks.iter().enumerate() {
            let weighted = right * part.inverse;
            let mut rows = vector.fixed_rows_mut::<POSE_DIM>(row_of(*l));
            rows -= weighted * part.vector;
            // They ascend: these are rows of the lower triangle.
            for (k, left) in &blocks[i..] {
                for c in 0..POSE_DIM {
                    let mut column =
                        precision.fixed_view_mut::<POSE_DIM, 1>(row_of(*k), row_of(*l) + c);
                    column -= left.column(0) * weighted[(c, 0)]
                        + left.column(1) * weighted[(c, 1)]
                        + left.column(2) * weighted[(c, 2)];
                }
            }
        }
    }
}

/// Adds the factor of a motion for the pose at `row`.
fn add_motion_of(
    precision: &mut DMatrix<f64>,
    vector: &mut DVector<f64>,
    residual: &PoseStep,
    row: usize,
    by_pose: &PoseMatrix,
    by_constants: &SMatrix<f64, POSE_DIM, CONSTANTS>,
) {
    let mut rows = vector.fixed_rows_mut::<POSE_DIM>(row);
    rows -= by_pose.tr_mul(residual);
    let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(row, row);
    block += by_pose.tr_mul(by_pose);
    let mut block = precision.fixed_view_mut::<POSE_DIM, CONSTANTS>(row, 0);
    block += by_pose.tr_mul(by_constants);
}

/// Derivative of a pixel by a pose, from those of the pixel by the direction and of the direction by the pose.
#[inline]
fn pose_jacobian(
    by_direction: &Matrix2x3<f64>,
    by_centre: f64,
    by_turn: &Matrix3<f64>,
) -> PoseJacobian {
    let mut jacobian = PoseJacobian::zeros();
    jacobian
        .fixed_view_mut::<2, 3>(0, 0)
        .copy_from(&(by_direction * by_centre));
    jacobian
        .fixed_view_mut::<2, 3>(0, 3)
        .copy_from(&(by_direction * by_turn));
    jacobian
}
