//! The closed forms on exact homographies.

use mono_geometry::calibration::{
    Skew, closed_form_intrinsics, focal_length_from_centre, pose_from_homography,
};
use mono_geometry::homography::Homography;
use mono_geometry::{Camera, Distortion, homography};
use nalgebra::{Matrix3, Vector2};

use super::scene::*;

#[test]
fn closed_form_is_exact_with_and_without_skew() {
    let straight = Matrix3::new(530.0, 0.0, 315.3, 0.0, 532.0, 246.1, 0.0, 0.0, 1.0);
    let mut skewed = straight;
    skewed[(0, 1)] = 7.0;
    for (k, skew, count) in [
        (straight, Skew::Zero, 2),
        (straight, Skew::Zero, 4),
        (straight, Skew::Free, 3),
        (skewed, Skew::Free, 3),
        (skewed, Skew::Free, 4),
    ] {
        let homographies = exact_homographies(&k, &tilted()[..count]);
        let found = closed_form_intrinsics(&homographies, WIDTH, HEIGHT, skew).unwrap();
        let matrix = Matrix3::new(
            found.fx, found.skew, found.cx, 0.0, found.fy, found.cy, 0.0, 0.0, 1.0,
        );
        assert!((matrix - k).amax() < 1e-8, "{matrix}");
    }
    // The sign of the skew counts, and a skew that is left out shows.
    let homographies = exact_homographies(&skewed, &tilted());
    let found = closed_form_intrinsics(&homographies, WIDTH, HEIGHT, Skew::Zero).unwrap();
    assert!((found.cx - 315.3).abs() > 0.1);
    // Too few views.
    for (skew, count) in [(Skew::Zero, 1), (Skew::Free, 2)] {
        let few = &homographies[..count];
        assert!(closed_form_intrinsics(few, WIDTH, HEIGHT, skew).is_none());
    }
    // One view three times.
    let same = vec![homographies[0]; 3];
    assert!(closed_form_intrinsics(&same, WIDTH, HEIGHT, Skew::Free).is_none());
}

#[test]
fn focal_length_from_an_assumed_centre() {
    let (cx, cy) = (319.5, 239.5);
    let k = Matrix3::new(530.0, 0.0, cx, 0.0, 530.0, cy, 0.0, 0.0, 1.0);
    for pose in tilted() {
        let homographies = exact_homographies(&k, &[pose]);
        let f = focal_length_from_centre(&homographies, WIDTH, HEIGHT).unwrap();
        assert!((f - 530.0).abs() < 1e-8, "{f}");
    }
    let parallel = exact_homographies(&k, &fronto_parallel());
    assert!(focal_length_from_centre(&parallel, WIDTH, HEIGHT).is_none());
}

#[test]
fn pose_in_closed_form_is_exact() {
    let camera = Camera::new(pinhole(530.0), Distortion::None).unwrap();
    for pose in poses(&camera, 10, 5) {
        let pixels: Vec<_> = see(&camera, &pose).into_iter().flatten().collect();
        let fit = homography::fit(&board(), &pixels).unwrap();
        let middle = Vector2::new(0.12, 0.075);
        // The scale and the sign of a homography mean nothing.
        for sign in [1.0, -3.0] {
            let h = Homography::from_matrix(&(fit.homography.matrix() * sign)).unwrap();
            let found = pose_from_homography(camera.pinhole(), &h, &middle).unwrap();
            assert!(pose.inverse().compose(&found).log().amax() < 1e-9);
        }
    }
}
