//! Behind a fisheye the errors of poses and landmarks are as large as their covariances say, if the noise of every match is
//! that which the lens makes of it in each direction; with one variance for both directions they are not.

use estimation_base::Manifold;
use mono_geometry::inverse_depth::LandmarkGeometry;
use mono_geometry::{Camera, Distortion, Pinhole, PlacedCamera};
use nalgebra::{Matrix2, Matrix3, SVector, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use ukf::{SigmaPoints, assess_consistency, normalized_error_squared};

use super::common::*;
use crate::filter::landmark::Landmark;
use crate::filter::landmark_moments::AxisPoints;
use crate::filter::landmark_update::LandmarkUpdate;
use crate::filter::linearised::pose_posterior;
use crate::filter::observation::{Prepared, Scoring};
use crate::filter::pixel_noise::PixelNoise;
use crate::rig::Rig;

const SIGMA_PX: f64 = 0.6;
/// Tangent of the angle off the axis at the rim: 61 degrees, where the noise is 4.3 times as large along the radius and 1.7 times
/// across it.
const RIM: f64 = 1.8;

/// How a match states its noise.
#[derive(Clone, Copy)]
enum Stated {
    /// In every direction.
    Shape,
    /// As one variance, the geometric mean of those of its axes.
    Area,
}

fn fisheye() -> Rig {
    let pinhole = Pinhole {
        fx: 150.0,
        fy: 150.0,
        ..PINHOLE
    };
    let lens = Distortion::KannalaBrandt {
        k1: 0.0,
        k2: 0.0,
        k3: 0.0,
        k4: 0.0,
    };
    Rig {
        camera: Camera::new(pinhole, lens).unwrap(),
        mount: rig().mount,
    }
}

/// The ideal pixel of a keypoint found where `at` is seen, and its noise.
fn sighting(
    rig: &Rig,
    camera: &PlacedCamera,
    at: &Vector3<f64>,
    stated: Stated,
    rng: &mut ChaCha8Rng,
) -> (Vector2<f64>, PixelNoise) {
    let in_camera = camera.camera_from_world * (at - camera.centre);
    let real = rig.camera.project(&in_camera).unwrap();
    let found = real + Vector2::from_fn(|_, _| SIGMA_PX * normal(rng));
    let (ideal, shape) = rig.camera.undistort_with_shape(&found).unwrap();
    let noise = PixelNoise::shaped(&shape, SIGMA_PX);
    let noise = match stated {
        Stated::Shape => noise,
        Stated::Area => PixelNoise::of(Matrix2::from_diagonal_element(
            noise.covariance().determinant().sqrt(),
        )),
    };
    (ideal, noise)
}

/// A place on the rays within the rim.
fn within_rim(rng: &mut ChaCha8Rng) -> (f64, f64) {
    loop {
        let (a, b) = (uniform(rng, -RIM, RIM), uniform(rng, -RIM, RIM));
        if a.hypot(b) < RIM {
            return (a, b);
        }
    }
}

/// Mean normalised squared error of poses from 60 known points, of 6 numbers, and its band at one in a thousand.
fn poses(stated: Stated) -> (f64, [f64; 2]) {
    let rig = fisheye();
    let errors = (0..400)
        .map(|seed| {
            let mut rng = rng(900 + seed);
            let carrier = crate::filter::motion::CarrierModel {
                tilt_sigma: 3e-3,
                tilt_time_s: 0.01,
                slope_sigma: 0.02,
                ..planar_carrier()
            };
            let p = particle(pose(0.4, -0.3, 0.2));
            let u = control([0.2, 0.0, 0.02], [1e-2, 1e-2, 1e-2]);
            let prior = carrier.prior(&rig.lever_m(), &p.departure(), &u);
            let drawn = SVector::from_fn(|_, _| normal(&mut rng));
            let camera = prior.mean.retract(&(prior.factor * drawn)).place(&rig);
            let matches: Vec<Option<Prepared>> = (0..60)
                .map(|_| {
                    let (a, b) = within_rim(&mut rng);
                    let at = ahead(&camera, a, b, uniform(&mut rng, 1.0, 3.0));
                    let (pixel, noise) = sighting(&rig, &camera, &at, stated, &mut rng);
                    let known = point(at, Matrix3::from_diagonal_element(1e-10));
                    let m = prepared(LandmarkGeometry::Point, &known, pixel, 1.0, Scoring::Full);
                    Some(Prepared { noise, ..m })
                })
                .collect();
            let posterior = pose_posterior(&rig, &prior, &matches, 3);
            let covariance = posterior.factor * posterior.factor.transpose();
            normalized_error_squared(&(posterior.mean - drawn), &covariance).unwrap()
        })
        .collect::<Vec<f64>>();
    let verdict = assess_consistency(errors, 6, 0.999).unwrap();
    (verdict.mean, [verdict.lower, verdict.upper])
}

/// The same of landmarks seen from six places, of 3 numbers.
fn landmarks(stated: Stated) -> (f64, [f64; 2]) {
    let rig = fisheye();
    let update = LandmarkUpdate {
        pinhole: rig.pinhole(),
        points: AxisPoints::new(&SigmaPoints::default()),
    };
    let camera = |i: u32| {
        let i = f64::from(i);
        pose(0.1 * i, 0.01 * i, 0.02 * i).place(&rig)
    };
    let anchor = camera(0);
    let geometry = LandmarkGeometry::InverseDepth { anchor };
    let mut rng = rng(77);
    let mut errors = Vec::new();
    for _ in 0..1500 {
        let (a, b) = within_rim(&mut rng);
        let truth = Vector3::new(a, b, uniform(&mut rng, 0.2, 1.0));
        let at = ahead(&anchor, a, b, 1.0 / truth.z);
        let (pixel, noise) = sighting(&rig, &anchor, &at, stated, &mut rng);
        let prototype = Landmark::from_first_sighting(rig.pinhole(), 0, &pixel, &noise, OPEN_DEPTH);
        let (pixel, noise) = sighting(&rig, &camera(1), &at, stated, &mut rng);
        let mut landmark = update.first(&geometry.view(&camera(1)), &prototype, &pixel, &noise);
        for i in 2..6 {
            let (pixel, noise) = sighting(&rig, &camera(i), &at, stated, &mut rng);
            landmark = landmark
                .and_then(|l| update.update(&geometry.view(&camera(i)), &l, &pixel, &noise));
        }
        if let Some(l) = landmark {
            errors.push(normalized_error_squared(&(l.mean - truth), &l.covariance).unwrap());
        }
    }
    let verdict = assess_consistency(errors, 3, 0.999).unwrap();
    (verdict.mean, [verdict.lower, verdict.upper])
}

#[test]
fn regress_poses_behind_a_fisheye_have_the_errors_their_covariance_says() {
    let (shaped, band) = poses(Stated::Shape);
    let (by_area, _) = poses(Stated::Area);
    assert!((band[0]..band[1]).contains(&shaped), "{shaped} of {band:?}");
    assert!(by_area > band[1] + 0.5, "{by_area} of {band:?}");
}

#[test]
fn regress_landmarks_behind_a_fisheye_have_the_errors_their_covariance_says() {
    let (shaped, band) = landmarks(Stated::Shape);
    let (by_area, _) = landmarks(Stated::Area);
    assert!((band[0]..band[1]).contains(&shaped), "{shaped} of {band:?}");
    assert!(by_area > band[1] + 0.2, "{by_area} of {band:?}");
}
