//! The unknowns: camera positions and attitudes, the scale of the visual map, constants; and where they stand in the
//! reduced system.
//!
//! The position that is estimated is that of the camera, in the unit of the visual map, as in the filter: scaling path
//! and map together changes no pixel, whatever the lever arm is. The lever arm, the scale and the constants of the
//! carrier then stand in the odometry alone.

use estimation_base::wrap;
use mono_geometry::{Se2, world_from_tilted_body};
use nalgebra::{Matrix3, Vector2, Vector3};

use crate::constants::{Constant, Constants};
use crate::problem::Problem;

/// Marks an unknown that is fixed.
pub(crate) const FIXED: usize = usize::MAX;
/// Unknowns of a pose: x, y, height of the camera, heading, roll, pitch.
pub(crate) const POSE: usize = 6;
/// Indices of the heading and of x and y.
pub(crate) const HEADING: usize = 3;
/// Index of the height.
pub(crate) const HEIGHT: usize = 2;
/// Index of roll; pitch follows.
pub(crate) const ROLL: usize = 4;
/// Index of pitch.
pub(crate) const PITCH: usize = 5;

/// Camera position and body attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraState {
    /// Camera centre in the unit of the map.
    pub(crate) centre: Vector3<f64>,
    /// Heading of the body.
    pub(crate) phi: f64,
    /// Roll of the body.
    pub(crate) roll: f64,
    /// Pitch of the body.
    pub(crate) pitch: f64,
}

impl CameraState {
    /// Rotation from body to world axes.
    pub(crate) fn world_from_body(&self) -> Matrix3<f64> {
        *world_from_tilted_body(&Se2::new(0.0, 0.0, self.phi), self.roll, self.pitch, 0.0)
            .rotation
            .matrix()
    }
}

/// All unknowns but the landmarks.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct State {
    /// One a keyframe.
    pub(crate) poses: Vec<CameraState>,
    /// Metres per unit of the map during the motion that ends at each keyframe.
    pub(crate) scales: Vec<f64>,
    /// Constants.
    pub(crate) constants: Constants,
}

impl State {
    /// Where the iteration starts.
    pub(crate) fn start(problem: &Problem) -> Self {
        let position = problem.rig.mount.body_from_camera.translation;
        let poses = problem
            .keyframes
            .iter()
            .map(|k| {
                let at = k.start.act(&position.xy());
                CameraState {
                    centre: Vector3::new(at.x, at.y, position.z),
                    phi: k.start.phi,
                    roll: 0.0,
                    pitch: 0.0,
                }
            })
            .collect();
        Self {
            poses,
            scales: vec![1.0; problem.keyframes.len()],
            constants: Constants::ZERO,
        }
    }

    /// The state after a step of the reduced system.
    pub(crate) fn moved(&self, layout: &Layout, step: &[f64]) -> Self {
        let at = |index: usize| if index == FIXED { 0.0 } else { step[index] };
        let mut moved = self.clone();
        for (pose, index) in moved.poses.iter_mut().zip(&layout.poses) {
            pose.centre += Vector3::new(at(index[0]), at(index[1]), at(index[HEIGHT]));
            pose.phi = wrap(pose.phi + at(index[HEADING]));
            pose.roll += at(index[ROLL]);
            pose.pitch += at(index[PITCH]);
        }
        for (scale, index) in moved.scales.iter_mut().zip(&layout.scales) {
            *scale += at(*index);
        }
        for constant in Constant::ALL {
            moved.constants[constant] += at(layout.constants[constant as usize]);
        }
        moved
    }
}

/// Position of the camera in the plane of the body, metres.
pub(crate) fn lever(problem: &Problem, constants: &Constants) -> Vector2<f64> {
    problem.rig.mount.body_from_camera.translation.xy()
        + Vector2::new(constants[Constant::LeverX], constants[Constant::LeverY])
}

/// Where each unknown stands in the reduced system: poses by keyframe, then scales, then constants.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    /// Six a keyframe.
    pub(crate) poses: Vec<[usize; POSE]>,
    /// One a keyframe: the scale of the motion that ends there.
    pub(crate) scales: Vec<usize>,
    /// One a constant.
    pub(crate) constants: [usize; Constant::COUNT],
    /// Number of unknowns.
    pub(crate) size: usize,
}

impl Layout {
    pub(crate) fn new(problem: &Problem) -> Self {
        let model = &problem.model;
        let mut size = 0;
        let mut next = |free: bool| {
            if free {
                size += 1;
                size - 1
            } else {
                FIXED
            }
        };
        let tilts = model.tilt_sigma > 0.0;
        let poses = problem
            .keyframes
            .iter()
            .map(|k| {
                let moves = k.motion.is_some();
                [
                    next(moves),
                    next(moves),
                    next(moves && model.slope_sigma > 0.0),
                    next(moves),
                    next(tilts),
                    next(tilts),
                ]
            })
            .collect();
        let scales = problem
            .keyframes
            .iter()
            .map(|k| next(k.motion.is_some() && model.scale_drift > 0.0))
            .collect();
        let lens = !problem.rig.camera.distortion().parameter_names().is_empty();
        let constants =
            Constant::ALL.map(|c| next(model.constants[c] > 0.0 && (lens || c != Constant::Lens)));
        Self {
            poses,
            scales,
            constants,
            size,
        }
    }
}
