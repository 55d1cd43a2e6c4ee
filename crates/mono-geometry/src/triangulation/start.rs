//! Where the iteration starts: the point from rays with known poses, without iterating.
//!
//! Two linear problems stand for the nonlinear one. [`midpoint`] minimises the distance of the point from the rays,
//! (sum (I - d d^T)) X = sum (I - d d^T) c with c the cameras' positions and d the unit rays. [`linear`] stacks the two
//! equations z_c [u v 1]^T = M [X 1]^T of each view (Eq. 22-24) and takes the null vector. Neither error is in pixels: a
//! far camera weighs as much as a near one, so both are starts, not answers.
//!
//! Degenerate: parallel rays fix no point (`None`). A midpoint may fall behind a camera where the linear solution does
//! not, and the other way round: the driver takes the one in front. Source: Hartley and Sturm (1997), Hartley and
//! Zisserman (2004), 12.2.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::observation::{Observation, require_in_front};
use crate::camera::Pinhole;
use crate::linalg::{cholesky, null_vector};

/// The point nearest to all rays, in metres: (sum (I - d d^T)) X = sum (I - d d^T) c.
///
/// `None` if the rays are parallel. O(views).
#[must_use]
pub fn midpoint(pinhole: &Pinhole, observations: &[Observation]) -> Option<Vector3<f64>> {
    let mut matrix = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for observation in observations {
        let world_from_camera = observation.camera_from_world.inverse();
        let ray = world_from_camera.rotation * pinhole.bearing(&observation.pixel_ideal);
        let across = Matrix3::identity() - ray * ray.transpose();
        matrix += across;
        right += across * world_from_camera.translation;
    }
    let point = cholesky(&matrix).ok()?.solve(&right);
    point.iter().all(|v| v.is_finite()).then_some(point)
}

/// The linear solution of Eq. 22-24 with each view's own projection matrix (direct linear transformation).
///
/// `None` for a point at infinity or views that fix no point. O(views).
#[must_use]
pub fn linear(pinhole: &Pinhole, observations: &[Observation]) -> Option<Vector3<f64>> {
    if observations.len() < 2 {
        return None;
    }
    // Origin at the first camera: far from the world's origin the homogeneous scale would drown.
    let origin = observations[0].camera_from_world.inverse().translation;
    let mut rows = DMatrix::zeros(2 * observations.len(), 4);
    for (view, observation) in observations.iter().enumerate() {
        let normalized = pinhole.normalize(&observation.pixel_ideal);
        let rotation = observation.camera_from_world.rotation.matrix();
        let translation = observation.camera_from_world.transform_point(&origin);
        for axis in 0..2 {
            let row = 2 * view + axis;
            for column in 0..3 {
                rows[(row, column)] =
                    normalized[axis] * rotation[(2, column)] - rotation[(axis, column)];
            }
            rows[(row, 3)] = normalized[axis] * translation.z - translation[axis];
        }
    }
    let null = null_vector(&rows).ok()?;
    if null.rank < 3 {
        return None;
    }
    let scale = null.vector[3];
    let point = null.vector.fixed_rows::<3>(0) / scale + origin;
    point.iter().all(|v| v.is_finite()).then_some(point)
}

/// The midpoint if it is in front of every camera, else the linear solution, else whichever exists.
pub(super) fn start(pinhole: &Pinhole, observations: &[Observation]) -> Option<Vector3<f64>> {
    let near = midpoint(pinhole, observations);
    if near.is_some_and(|point| require_in_front(observations, &point).is_ok()) {
        return near;
    }
    let algebraic = linear(pinhole, observations);
    if algebraic.is_some_and(|point| require_in_front(observations, &point).is_ok()) {
        return algebraic;
    }
    near.or(algebraic)
}
