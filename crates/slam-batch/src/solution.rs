//! The solution: poses with covariances, constants with sigmas, landmarks, and how well all of it fits.
//!
//! The body positions in metres follow from the camera centres by the recursion of the metric state of the filter,
//!
//! > p_2 = p_1 + s (c_2 - c_1) - (R_2 - R_1) l',
//!
//! turned by the yaw of the mount at the end, and so do their derivatives by all unknowns: with C the joint covariance,
//! the rows J_k and J_k C are carried from keyframe to keyframe, O(unknowns) each.

use mono_geometry::Se2;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Vector2, Vector3};
use slam_pipeline::PoseEstimate;

use crate::constants::{Constant, Constants};
use crate::fold::rotation;
use crate::problem::Problem;
use crate::process_noise::NoiseFactors;
use crate::state::{FIXED, HEADING, Layout, State, lever};

/// How well a solution fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Negative log posterior up to a constant, the loss included.
    pub cost: f64,
    /// Sum of the losses of the pixels: twice their share of the cost.
    pub pixel_chi_square: f64,
    /// Sum of squares of odometry and priors.
    pub motion_chi_square: f64,
    /// Sightings used.
    pub sightings: usize,
    /// Pixel coordinates less unknowns, landmarks included; odometry and priors weigh against their own.
    pub degrees_of_freedom: usize,
}

/// A constant after the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearnedConstant {
    /// Which one.
    pub constant: Constant,
    /// Deviation from nominal.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Standard deviation before the drive.
    pub prior_sigma: f64,
}

/// Attitude and height of the carrier at a keyframe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude {
    /// Radians.
    pub roll: f64,
    /// Radians.
    pub pitch: f64,
    /// Height above that of the start, metres.
    pub height_m: f64,
    /// Metres per unit of the visual map during the motion that ends here.
    pub scale: f64,
}

/// A landmark of the solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BatchLandmark {
    /// Identity.
    pub id: u32,
    /// Position, metres.
    pub position: Vector3<f64>,
}

/// The solution of a problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Body pose of every keyframe, with its planar marginal of the joint covariance.
    pub poses: Vec<PoseEstimate>,
    /// Tilt, height and scale of every keyframe.
    pub attitudes: Vec<Attitude>,
    /// Constants that were not fixed.
    pub constants: Vec<LearnedConstant>,
    /// Landmarks at a finite distance.
    pub landmarks: Vec<BatchLandmark>,
    /// Process noise over the stated one; above one where the residuals asked for it.
    pub noise: NoiseFactors,
    /// How well it fits.
    pub fit: Fit,
    /// Iterations made.
    pub iterations: usize,
    /// Whether the last step promised nothing; otherwise the limit ended the iteration.
    pub converged: bool,
}

impl Solution {
    /// The value of a constant; zero where it was fixed.
    #[must_use]
    pub fn constant(&self, constant: Constant) -> f64 {
        self.learned(constant).map_or(0.0, |c| c.value)
    }

    /// A constant that was not fixed.
    #[must_use]
    pub fn learned(&self, constant: Constant) -> Option<&LearnedConstant> {
        self.constants.iter().find(|c| c.constant == constant)
    }

    pub(crate) fn new(
        problem: &Problem,
        layout: &Layout,
        state: &State,
        placed: Vec<(u32, usize, Vector3<f64>)>,
        covariance: &DMatrix<f64>,
        fit: Fit,
        iterations: usize,
        converged: bool,
    ) -> Self {
        let poses = metric_poses(problem, layout, state, covariance);
        let body_height = problem.rig.mount.body_from_camera.translation.z;
        let attitudes = state
            .poses
            .iter()
            .zip(&state.scales)
            .map(|(p, scale)| Attitude {
                roll: p.roll,
                pitch: p.pitch,
                height_m: (p.centre.z - body_height) * scale,
                scale: *scale,
            })
            .collect();
        let constants = Constant::ALL
            .into_iter()
            .filter_map(|constant| {
                let index = layout.constants[constant as usize];
                (index != FIXED).then(|| LearnedConstant {
                    constant,
                    value: state.constants[constant],
                    sigma: covariance[(index, index)].sqrt(),
                    prior_sigma: problem.model.constants[constant],
                })
            })
            .collect();
        let world = rotation(state.constants[Constant::MountYaw]);
        let arm = lever(problem, &state.constants);
        let landmarks = placed
            .into_iter()
            .map(|(id, anchor, point)| {
                let pose = &poses[anchor].pose;
                let camera = Vector2::new(pose.x, pose.y) + rotation(pose.phi) * arm;
                let relative = (point - state.poses[anchor].centre) * state.scales[anchor];
                let planar = camera + world * relative.xy();
                BatchLandmark {
                    id,
                    position: Vector3::new(
                        planar.x,
                        planar.y,
                        state.poses[anchor].centre.z * state.scales[anchor] + relative.z,
                    ),
                }
            })
            .collect();
        Self {
            poses,
            attitudes,
            constants,
            landmarks,
            noise: NoiseFactors::NOMINAL,
            fit,
            iterations,
            converged,
        }
    }
}

/// d(x, y) / d unknowns of a position, and its product with the covariance.
struct Rows<'a> {
    covariance: &'a DMatrix<f64>,
    rows: [DVector<f64>; 2],
    products: [DVector<f64>; 2],
}

impl<'a> Rows<'a> {
    fn zero(covariance: &'a DMatrix<f64>) -> Self {
        let zero = || DVector::zeros(covariance.nrows());
        Self {
            covariance,
            rows: [zero(), zero()],
            products: [zero(), zero()],
        }
    }

    /// Adds `by` times the unknown at `index`.
    fn add(&mut self, index: usize, by: Vector2<f64>) {
        if index == FIXED {
            return;
        }
        for axis in 0..2 {
            self.rows[axis][index] += by[axis];
            self.products[axis].axpy(by[axis], &self.covariance.column(index), 1.0);
        }
    }

    /// Marginal of the position turned by `world`, whose yaw stands at `yaw`, and the heading.
    fn marginal(
        &self,
        world: &Matrix2<f64>,
        position: &Vector2<f64>,
        yaw: usize,
        heading: usize,
    ) -> Matrix3<f64> {
        let mut own = Self {
            covariance: self.covariance,
            rows: self.rows.clone(),
            products: self.products.clone(),
        };
        // d (R(delta) p) / d delta, in the axes before the turn.
        own.add(yaw, Vector2::new(-position.y, position.x));
        let mut marginal = Matrix3::zeros();
        let mut planar = Matrix2::zeros();
        for i in 0..2 {
            for j in 0..2 {
                planar[(i, j)] = own.products[i].dot(&own.rows[j]);
            }
        }
        let planar = world * planar * world.transpose();
        for i in 0..2 {
            for j in 0..2 {
                marginal[(i, j)] = 0.5 * (planar[(i, j)] + planar[(j, i)]);
            }
        }
        if heading != FIXED {
            let cross = world * Vector2::new(own.products[0][heading], own.products[1][heading]);
            for i in 0..2 {
                marginal[(i, 2)] = cross[i];
                marginal[(2, i)] = cross[i];
            }
            marginal[(2, 2)] = self.covariance[(heading, heading)];
        }
        marginal
    }
}

fn metric_poses(
    problem: &Problem,
    layout: &Layout,
    state: &State,
    covariance: &DMatrix<f64>,
) -> Vec<PoseEstimate> {
    let constants: &Constants = &state.constants;
    let yaw = constants[Constant::MountYaw];
    let nominal = rotation(-yaw);
    let arm = lever(problem, constants);
    let swung = nominal * arm;
    let index_of = |constant: Constant| layout.constants[constant as usize];
    let mut rows = Rows::zero(covariance);
    let mut position = Vector2::zeros();
    let mut poses = Vec::with_capacity(state.poses.len());
    // The start of the drive, in the axes of the nominal mount and in the world.
    let mut start = Se2::identity();
    for (k, pose) in state.poses.iter().enumerate() {
        if problem.keyframes[k].motion.is_none() {
            start = problem.keyframes[k].start;
            position = Vector2::zeros();
            rows = Rows::zero(covariance);
        } else {
            let before = &state.poses[k - 1];
            let scale = state.scales[k];
            let step = (pose.centre - before.centre).xy();
            let turned = rotation(pose.phi) - rotation(before.phi);
            position += step * scale - turned * swung;
            let left = |v: Vector2<f64>| Vector2::new(-v.y, v.x);
            for axis in 0..2 {
                let mut by = Vector2::zeros();
                by[axis] = scale;
                rows.add(layout.poses[k][axis], by);
                rows.add(layout.poses[k - 1][axis], -by);
            }
            rows.add(layout.scales[k], step);
            rows.add(layout.poses[k][HEADING], -left(rotation(pose.phi) * swung));
            rows.add(
                layout.poses[k - 1][HEADING],
                left(rotation(before.phi) * swung),
            );
            rows.add(index_of(Constant::MountYaw), turned * left(swung));
            let by_arm = turned * nominal;
            rows.add(index_of(Constant::LeverX), -by_arm.column(0));
            rows.add(index_of(Constant::LeverY), -by_arm.column(1));
        }
        let world = rotation(yaw);
        let at = world * position;
        let marginal = rows.marginal(
            &world,
            &position,
            index_of(Constant::MountYaw),
            layout.poses[k][HEADING],
        );
        let longer = Vector3::new(at.x, at.y, 0.0) * problem.model.scale_bias;
        poses.push(PoseEstimate {
            pose: Se2::new(start.x + at.x, start.y + at.y, pose.phi),
            covariance: marginal + longer * longer.transpose(),
        });
    }
    poses
}
