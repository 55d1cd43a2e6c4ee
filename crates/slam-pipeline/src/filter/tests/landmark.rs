//! A landmark of unknown depth; the geometry of a landmark is tested in mono-geometry.

use crate::filter::pixel_noise::PixelNoise;
use mono_geometry::inverse_depth::LandmarkGeometry;
use nalgebra::{Vector2, Vector3};

use super::common::*;
use crate::filter::landmark::Landmark;

#[test]
fn unknown_depth_lies_beyond_what_was_driven() {
    let anchor = place(&pose(0.0, 0.0, 0.0));
    let geometry = LandmarkGeometry::InverseDepth { anchor };
    let landmark = Landmark::from_first_sighting(
        &pinhole(),
        0,
        &Vector2::new(100.0, 50.0),
        &PixelNoise::round(0.5),
        OPEN_DEPTH,
    );
    // The camera looks along world y: two metres towards the landmark.
    let driven = landmark.in_front_of(&geometry, &Vector3::new(0.3, 2.0, 0.0));
    assert!(
        (driven.mean.z * 2.0 - 0.3).abs() < 1e-12,
        "rho {}",
        driven.mean.z
    );
    assert!((driven.depth_openness() - landmark.depth_openness()).abs() < 1e-12);
    assert_eq!(driven.mean.xy(), landmark.mean.xy());
    assert_eq!(driven.covariance[(0, 0)], landmark.covariance[(0, 0)]);
    // Visible from there with all of its two-sigma range, which the prior is not.
    let far = |l: &Landmark| l.mean.z + 2.0 * l.covariance[(2, 2)].sqrt();
    assert!(far(&driven) * 2.0 < 1.0 && far(&landmark) * 2.0 > 1.0);
    for aside in [
        Vector3::new(3.0, 0.0, 0.0),
        Vector3::new(0.0, -2.0, 0.0),
        Vector3::new(0.0, 0.1, 0.0),
    ] {
        assert_eq!(landmark.in_front_of(&geometry, &aside), landmark);
    }
}
