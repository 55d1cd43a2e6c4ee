//! The point of several views: parallax, start, Gauss-Newton, acceptance.

use super::accept::accept;
use super::observation::{
    Acceptance, Observation, Rejection, Triangulated, check, ray_parallax, require_in_front,
    require_parallax,
};
use super::{refine, start};
use crate::camera::Pinhole;

/// The point that minimises the reprojection error, if it is to be believed. O(views^2) for the parallax, O(views) per
/// step.
///
/// # Errors
/// The [`Rejection`] with the measured value and the one required.
///
/// ```
/// use mono_geometry::triangulation::{Acceptance, Observation, triangulate};
/// use mono_geometry::{Mount, NoiseShape, Pinhole, Se2};
/// use nalgebra::Vector3;
///
/// let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 320.0, cy: 240.0 };
/// let mount = Mount::forward();
/// let landmark = Vector3::new(4.0, 0.5, 0.2);
/// // Two bodies 0.4 m apart look along x at the landmark.
/// let sightings = [-0.2, 0.2].map(|y| {
///     let camera_from_world = mount.world_from_camera(&Se2::new(0.0, y, 0.0), 0.0, 0.0, 0.0).inverse();
///     let pixel_ideal = pinhole.project(&camera_from_world.transform_point(&landmark)).expect("in front");
///     Observation { camera_from_world, pixel_ideal, sigma_px: 0.5, shape: NoiseShape::ROUND }
/// });
/// let found = triangulate(&pinhole, &sightings, &Acceptance::default())?;
/// assert!((found.point - landmark).norm() < 1e-9);
/// assert!(found.covariance[(0, 0)].sqrt() < 0.1);
/// # Ok::<(), mono_geometry::triangulation::Rejection>(())
/// ```
pub fn triangulate(
    pinhole: &Pinhole,
    observations: &[Observation],
    acceptance: &Acceptance,
) -> Result<Triangulated, Rejection> {
    check(observations)?;
    let ray_parallax_rad = require_parallax(ray_parallax(pinhole, observations), acceptance)?;
    let start = start::start(pinhole, observations).ok_or(Rejection::ParallaxTooSmall {
        parallax_rad: ray_parallax_rad,
        required_rad: acceptance.min_parallax_rad,
    })?;
    require_in_front(observations, &start)?;
    let minimum = refine::refine(pinhole, observations, &start, acceptance)?;
    accept(observations, &minimum, acceptance)
}
