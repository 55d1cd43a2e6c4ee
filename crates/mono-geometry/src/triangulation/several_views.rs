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
