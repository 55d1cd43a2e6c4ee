//! Residuals, cost and normal equations of a bundle at one estimate.
//!
//! cost = 1/2 sum rho(|r|^2) over the pixels + 1/2 sum |e|^2 over measured motions and priors, every residual divided by
//! its standard deviation (whitened). The Hessian of Gauss and Newton in blocks, U for poses, V for landmarks, W for a
//! pose and a landmark, each pixel weighted by rho':
//!
//! > (U  W; W^T  V) (dp; dl) = -(g_p; g_l).
//!
//! With x = X_c / Z, J_c the 2x3 derivative of the pixel by the point in camera axes and R = R_camera_from_body,
//! the derivative by the landmark is J_c R_camera_from_world, and by the pose J_c R (-I, hat(p_body)).

use nalgebra::{Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::border::{Border, BorderPixel};
use super::layout::{Layout, NO_LINK};
use super::pose::BundlePose;
use super::problem::{Problem, odometry_error, prior_error};
use super::reduced::Reduced;
use crate::camera::{Camera, ParameterJacobian, Pinhole};
use crate::error::{GeometryError, bad};
use crate::linalg::cholesky;
use crate::robust_loss::RobustLoss;
use crate::se3::Se3;

/// Poses and landmarks being adjusted.
#[derive(Debug, Clone)]
pub(super) struct Estimate<P> {
    pub(super) poses: Vec<P>,
    pub(super) landmarks: Vec<Vector3<f64>>,
    /// The camera, where it is unknown.
    pub(super) camera: Option<Camera>,
    /// `camera_from_world` of every pose, kept in step.
    cameras: Vec<(Matrix3<f64>, Vector3<f64>)>,
}

impl<P: Copy> Estimate<P> {
    pub(super) fn new<const D: usize>(problem: &Problem<P, D>) -> Self
    where
        P: BundlePose<D>,
    {
        let mut estimate = Self {
            poses: problem.poses.clone(),
            landmarks: problem.landmarks.clone(),
            camera: problem.unknown_camera().map(|i| i.estimate),
            cameras: vec![(Matrix3::zeros(), Vector3::zeros()); problem.poses.len()],
        };
        estimate.place(&problem.body_from_camera);
        estimate
    }

    /// Brings the cameras in step with the poses.
    pub(super) fn place<const D: usize>(&mut self, body_from_camera: &Se3)
    where
        P: BundlePose<D>,
    {
        for (pose, camera) in self.poses.iter().zip(&mut self.cameras) {
            let placed = pose.world_from_body().compose(body_from_camera).inverse();
            *camera = (placed.rotation.into_inner(), placed.translation);
        }
    }

    /// Landmarks behind a camera that sees them go to where they were before a step from `from`, as seen by the camera
    /// in the middle of those: near enough to the start to be in front, and it follows a path that bends as a whole.
    pub(super) fn bring_to_front(&mut self, from: &Self, layout: &Layout) {
        for (landmark, range) in layout.starts.windows(2).enumerate() {
            let seen = &layout.sightings[range[0].sighting..range[1].sighting];
            let point = self.landmarks[landmark];
            let behind = seen.iter().any(|s| {
                let (rotation, translation) = &self.cameras[s.pose];
                let depth = (rotation * point + translation).z;
                // NaN is not in front.
                !matches!(depth.partial_cmp(&0.0), Some(std::cmp::Ordering::Greater))
            });
            if let Some(middle) = seen.get(seen.len() / 2).filter(|_| behind) {
                let (rotation, translation) = &from.cameras[middle.pose];
                let in_camera = rotation * from.landmarks[landmark] + translation;
                let (rotation, translation) = &self.cameras[middle.pose];
                self.landmarks[landmark] = rotation.tr_mul(&(in_camera - translation));
            }
        }
    }
}

/// Lower factors of the covariances, computed once.
#[derive(Debug)]
pub(super) struct Whitening<const D: usize> {
    pub(super) odometry: Vec<SMatrix<f64, D, D>>,
    pub(super) priors: Vec<SMatrix<f64, D, D>>,
}

impl<const D: usize> Whitening<D> {
    pub(super) fn new<P: BundlePose<D>>(problem: &Problem<P, D>) -> Result<Self, GeometryError> {
        let lower = |covariance: &SMatrix<f64, D, D>| cholesky(covariance).map(|c| c.l());
        Ok(Self {
            odometry: problem
                .odometry
                .iter()
                .map(|f| lower(&f.covariance))
                .collect::<Result<_, _>>()?,
            priors: problem
                .priors
                .iter()
                .map(|f| lower(&f.covariance))
                .collect::<Result<_, _>>()?,
        })
    }
}

/// A landmark that is not in front of a camera that sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Behind {
    /// Index of the observation in the caller's list.
    observation: usize,
    depth_m: f64,
}

impl From<Behind> for GeometryError {
    fn from(behind: Behind) -> Self {
        bad(
            "observation",
            behind.observation,
            "depth of the landmark (m)",
            behind.depth_m,
            "above 0, with a finite pixel",
        )
    }
}

/// Cost alone. O(observations + factors).
pub(super) fn cost<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
    layout: &Layout,
    whitening: &Whitening<D>,
    loss: &RobustLoss,
    estimate: &Estimate<P>,
) -> Result<f64, Behind> {
    let mut twice = 0.0;
    for (range, point) in layout.starts.windows(2).zip(&estimate.landmarks) {
        for seen in &layout.sightings[range[0].sighting..range[1].sighting] {
            let (rotation, translation) = &estimate.cameras[seen.pose];
            let in_camera = rotation * point + translation;
            let pixel = match &estimate.camera {
                None => project(&problem.pinhole, &in_camera),
                Some(camera) => camera.project_unbounded(&in_camera),
            };
            let pixel = pixel.ok_or(Behind {
                observation: seen.given,
                depth_m: in_camera.z,
            })?;
            let residual = seen.shape.residual(&seen.pixel, &pixel, seen.sigma_px);
            twice += loss.at(residual.norm_squared()).rho;
        }
    }
    for (factor, lower) in problem.odometry.iter().zip(&whitening.odometry) {
        let (from, to) = (&estimate.poses[factor.from], &estimate.poses[factor.to]);
        twice += odometry_error(factor, from, to, lower).0.norm_squared();
    }
    for (prior, lower) in problem.priors.iter().zip(&whitening.priors) {
        twice += prior_error(prior, &estimate.poses[prior.pose], lower)
            .0
            .norm_squared();
    }
    if let (Some(camera), Some(intrinsics)) = (&estimate.camera, problem.unknown_camera()) {
        twice += intrinsics.prior_cost(camera);
    }
    Ok(0.5 * twice)
}

/// The normal equations in blocks; buffers are filled again at every estimate.
#[derive(Debug)]
pub(super) struct Normal<const D: usize> {
    /// Lower triangle of U with the odometry's blocks off its diagonal; D times free poses.
    pub(super) u: Reduced,
    pub(super) pose_gradient: Vec<f64>,
    pub(super) v: Vec<Matrix3<f64>>,
    pub(super) landmark_gradient: Vec<Vector3<f64>>,
    /// One block a link.
    pub(super) w: Vec<SMatrix<f64, D, 3>>,
    /// The rows and columns of an unknown camera.
    pub(super) border: Border,
    /// Diagonal blocks of U from the pixels, and their gradients, by pose.
    pose_blocks: Vec<(SMatrix<f64, D, D>, SVector<f64, D>)>,
}

impl<const D: usize> Normal<D> {
    pub(super) fn new(layout: &Layout) -> Self {
        let size = D * layout.free_poses.len();
        let landmarks = layout.starts.len() - 1;
        Self {
            u: Reduced::new(layout, D),
            pose_gradient: vec![0.0; size],
            v: vec![Matrix3::zeros(); landmarks],
            landmark_gradient: vec![Vector3::zeros(); landmarks],
            w: vec![SMatrix::zeros(); layout.links.len()],
            border: Border::new(layout, size),
            pose_blocks: vec![(SMatrix::zeros(), SVector::zeros()); layout.free_index.len()],
        }
    }

    /// Fills the blocks at an estimate. O(observations D^2 + factors D^3), no allocation.
    pub(super) fn fill<P: BundlePose<D>>(
        &mut self,
        problem: &Problem<P, D>,
        layout: &Layout,
        whitening: &Whitening<D>,
        loss: &RobustLoss,
        estimate: &Estimate<P>,
    ) -> Result<(), Behind> {
        self.border.clear();
        self.fill_pixels(problem, layout, loss, estimate)?;
        if let (Some(camera), Some(intrinsics)) = (&estimate.camera, problem.unknown_camera()) {
            let (information, gradient) = intrinsics.prior(camera);
            self.border.add_prior(&information, &gradient);
        }
        self.u.clear();
        self.pose_gradient.fill(0.0);
        for (free, &pose) in layout.free_poses.iter().enumerate() {
            let (hessian, gradient) = self.pose_blocks[pose];
            self.add_block(free, free, &hessian);
            self.add_gradient(free, &gradient);
        }
        for (factor, lower) in problem.odometry.iter().zip(&whitening.odometry) {
            let (from, to) = (&estimate.poses[factor.from], &estimate.poses[factor.to]);
            let (error, by_from, by_to) = odometry_error(factor, from, to, lower);
            let (row, column) = (layout.free_index[factor.from], layout.free_index[factor.to]);
            for (free, jacobian) in [(row, &by_from), (column, &by_to)] {
                if let Some(free) = free {
                    self.add_block(free, free, &(jacobian.transpose() * jacobian));
                    self.add_gradient(free, &(jacobian.transpose() * error));
                }
            }
            match (row, column) {
                (Some(f), Some(t)) if f > t => {
                    self.add_block(f, t, &(by_from.transpose() * by_to));
                }
                (Some(f), Some(t)) => self.add_block(t, f, &(by_to.transpose() * by_from)),
                _ => {}
            }
        }
        for (prior, lower) in problem.priors.iter().zip(&whitening.priors) {
            if let Some(free) = layout.free_index[prior.pose] {
                let (error, jacobian) = prior_error(prior, &estimate.poses[prior.pose], lower);
                self.add_block(free, free, &(jacobian.transpose() * jacobian));
                self.add_gradient(free, &(jacobian.transpose() * error));
            }
        }
        Ok(())
    }

    fn fill_pixels<P: BundlePose<D>>(
        &mut self,
        problem: &Problem<P, D>,
        layout: &Layout,
        loss: &RobustLoss,
        estimate: &Estimate<P>,
    ) -> Result<(), Behind> {
        let body_from_camera = problem.body_from_camera.rotation.into_inner();
        let camera_from_body = body_from_camera.transpose();
        let lever = problem.body_from_camera.translation;
        self.pose_blocks.fill((SMatrix::zeros(), SVector::zeros()));
        self.w.fill(SMatrix::zeros());
        for (landmark, range) in layout.starts.windows(2).enumerate() {
            let point = estimate.landmarks[landmark];
            let mut v = Matrix3::zeros();
            let mut gradient = Vector3::zeros();
            for seen in &layout.sightings[range[0].sighting..range[1].sighting] {
                let (rotation, translation) = &estimate.cameras[seen.pose];
                let in_camera = rotation * point + translation;
                let linear = match &estimate.camera {
                    None => linearise(&problem.pinhole, &in_camera)
                        .map(|(pixel, jacobian)| (pixel, jacobian, None)),
                    Some(camera) => camera
                        .project_unbounded_with_jacobians(&in_camera)
                        .map(|(pixel, jacobian, by)| (pixel, jacobian, Some(by))),
                };
                let (pixel, by_camera, by_parameters) = linear.ok_or(Behind {
                    observation: seen.given,
                    depth_m: in_camera.z,
                })?;
                let whitened = |by: &ParameterJacobian| {
                    seen.shape
                        .whitened(&seen.pixel, &pixel, by, seen.sigma_px)
                        .1
                };
                let by_parameters = by_parameters.map(|by| whitened(&by));
                let (fit, by_camera) =
                    seen.shape
                        .whitened(&seen.pixel, &pixel, &by_camera, seen.sigma_px);
                // the bundle's residuals are prediction less measurement
                let residual = -fit;
                let weight = loss.at(residual.norm_squared()).weight;
                let by_point = by_camera * rotation;
                let weighted_point = by_point * weight;
                v += by_point.tr_mul(&weighted_point);
                gradient += weighted_point.tr_mul(&residual);
                let gathered = by_parameters.map(|by_parameters| {
                    let seen = BorderPixel {
                        residual,
                        by_parameters,
                        weight,
                    };
                    self.border.add_pixel(landmark, &by_point, &seen)
                });
                if seen.link != NO_LINK {
                    let by_body = by_camera * camera_from_body;
                    let in_body = body_from_camera * in_camera + lever;
                    let rows =
                        [0, 1].map(|axis| P::pull_back(&by_body.row(axis).transpose(), &in_body));
                    let (hessian, pose_gradient) = &mut self.pose_blocks[seen.pose];
                    let w = &mut self.w[seen.link];
                    for axis in 0..2 {
                        let row = rows[axis];
                        let weighted = row * weight;
                        *pose_gradient += weighted * residual[axis];
                        if let Some(by_parameters) = &gathered {
                            let free = layout.links[seen.link];
                            self.border
                                .add_pose_row(free, &weighted, by_parameters, axis);
                        }
                        for column in 0..D {
                            for i in column..D {
                                hessian[(i, column)] += weighted[i] * row[column];
                            }
                        }
                        for column in 0..3 {
                            for i in 0..D {
                                w[(i, column)] += weighted[i] * by_point[(axis, column)];
                            }
                        }
                    }
                }
            }
            self.v[landmark] = v;
            self.landmark_gradient[landmark] = gradient;
        }
        Ok(())
    }

    /// Adds to the lower triangle: block row `row` >= `column`, of diagonal blocks the lower half.
    fn add_block(&mut self, row: usize, column: usize, block: &SMatrix<f64, D, D>) {
        for j in 0..D {
            let first = if row == column { j } else { 0 };
            for i in first..D {
                self.u.add(row * D + i, column * D + j, block[(i, j)]);
            }
        }
    }

    fn add_gradient(&mut self, free: usize, gradient: &SVector<f64, D>) {
        for i in 0..D {
            self.pose_gradient[free * D + i] += gradient[i];
        }
    }
}

/// Predicted minus seen pixel; `None` behind the camera or where the pixel overflows.
#[inline]
fn project(pinhole: &Pinhole, in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
    let inverse_depth = 1.0 / in_camera.z;
    let pixel = Vector2::new(
        pinhole.fx * (in_camera.x * inverse_depth) + pinhole.cx,
        pinhole.fy * (in_camera.y * inverse_depth) + pinhole.cy,
    );
    (in_camera.z > 0.0 && (pixel.x + pixel.y).is_finite()).then_some(pixel)
}

/// [`project`] with the derivative by the point in camera axes.
#[inline]
fn linearise(
    pinhole: &Pinhole,
    in_camera: &Vector3<f64>,
) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
    let pixel = project(pinhole, in_camera)?;
    let inverse_depth = 1.0 / in_camera.z;
    let (fx, fy) = (pinhole.fx * inverse_depth, pinhole.fy * inverse_depth);
    let jacobian = Matrix2x3::new(
        fx,
        0.0,
        -fx * (in_camera.x * inverse_depth),
        0.0,
        fy,
        -fy * (in_camera.y * inverse_depth),
    );
    Some((pixel, jacobian))
}
