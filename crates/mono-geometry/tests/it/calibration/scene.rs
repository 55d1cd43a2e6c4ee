//! Simulated targets: cameras, boards, poses, corners with and without noise.

use mono_geometry::calibration::{
    Calibration, CalibrationOptions, CalibrationView, LensModel, calibrate,
};
use mono_geometry::homography::Homography;
use mono_geometry::{Camera, Distortion, Pinhole, Se3, so3};
use nalgebra::{DVector, Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub(crate) const WIDTH: usize = 640;

pub(crate) const HEIGHT: usize = 480;

pub(crate) fn gauss(rng: &mut ChaCha8Rng) -> Vector2<f64> {
    Vector2::new(StandardNormal.sample(rng), StandardNormal.sample(rng))
}

pub(crate) fn pinhole(f: f64) -> Pinhole {
    Pinhole {
        width: WIDTH,
        height: HEIGHT,
        fx: f,
        fy: f * 1.004,
        cx: 315.3,
        cy: 246.1,
    }
}

pub(crate) fn radtan() -> Camera {
    let lens = Distortion::Radtan {
        k1: -0.28,
        k2: 0.09,
        p1: 4e-4,
        p2: -3e-4,
        k3: 0.0,
    };
    Camera::new(pinhole(530.0), lens).expect("valid")
}

pub(crate) fn rational() -> Camera {
    // Numerator and denominator have no root nearly in common: the coefficients can be told apart.
    let lens = Distortion::Rational {
        k1: 0.22,
        k2: 0.68,
        p1: 5e-4,
        p2: -4e-4,
        k3: 0.105,
        k4: 0.78,
        k5: 0.547,
        k6: 0.219,
    };
    Camera::new(pinhole(260.0), lens).expect("valid")
}

pub(crate) fn fisheye() -> Camera {
    let lens = Distortion::KannalaBrandt {
        k1: -0.012,
        k2: 0.021,
        k3: -0.014,
        k4: 0.0031,
    };
    Camera::new(pinhole(220.0), lens).expect("valid")
}

pub(crate) fn board() -> Vec<Vector2<f64>> {
    (0..54)
        .map(|k| Vector2::new(f64::from(k % 9) * 0.03, f64::from(k / 9) * 0.03))
        .collect()
}

/// A pose that turns the middle of the board by a rotation vector and holds it at a point of the camera's axes.
pub(crate) fn posed(rotation: Vector3<f64>, middle: Vector3<f64>) -> Se3 {
    let rotation = so3::exp(&rotation);
    let centre = Vector3::new(0.12, 0.075, 0.0);
    Se3::new(rotation, middle - rotation * centre)
}

/// Poses with the whole board in the image, spread over it, tilted by up to about 50 degrees.
pub(crate) fn poses(camera: &Camera, count: usize, seed: u64) -> Vec<Se3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut poses = Vec::new();
    let reach = 180.0 / camera.pinhole().fx;
    while poses.len() < count {
        let tilt = rng.random_range(0.3..0.9);
        let about = rng.random_range(0.0..std::f64::consts::TAU);
        let roll = rng.random_range(-0.3..0.3);
        let depth = rng.random_range(0.25..0.5) * (camera.pinhole().fx / 400.0).max(0.4);
        let x = rng.random_range(-1.7 * reach..1.7 * reach);
        let y = rng.random_range(-1.2 * reach..1.2 * reach);
        let pose = posed(
            Vector3::new(tilt * about.cos(), tilt * about.sin(), roll),
            Vector3::new(x * depth, y * depth, depth),
        );
        if see(camera, &pose)
            .iter()
            .all(|p| p.is_some_and(|p| camera.contains(&p, 1.0)))
        {
            poses.push(pose);
        }
    }
    poses
}

pub(crate) fn see(camera: &Camera, pose: &Se3) -> Vec<Option<Vector2<f64>>> {
    let points = board();
    let project = |b: &Vector2<f64>| camera.project(&pose.transform_point(&b.push(0.0)));
    points.iter().map(project).collect()
}

pub(crate) fn views(
    camera: &Camera,
    poses: &[Se3],
    noise: Option<(f64, &mut ChaCha8Rng)>,
) -> Vec<CalibrationView> {
    let mut noise = noise;
    let sigma = noise.as_ref().map_or(1.0, |n| n.0);
    poses
        .iter()
        .map(|pose| {
            let pixels: Vec<_> = see(camera, pose)
                .into_iter()
                .map(|p| {
                    let error = noise
                        .as_mut()
                        .map_or(Vector2::zeros(), |(sigma, rng)| gauss(rng) * *sigma);
                    p.expect("visible") + error
                })
                .collect();
            CalibrationView::new(&board(), &pixels, sigma)
        })
        .collect()
}

pub(crate) fn options(model: LensModel) -> CalibrationOptions {
    CalibrationOptions {
        model,
        ..CalibrationOptions::default()
    }
}

pub(crate) fn run(views: &[CalibrationView], model: LensModel) -> Calibration {
    calibrate(WIDTH, HEIGHT, views, &options(model)).expect("calibrated")
}

pub(crate) fn errors(calibration: &Calibration, truth: &Camera) -> DVector<f64> {
    let free = calibration.parameters.len();
    let truth = truth.parameters();
    DVector::from_fn(free, |k, _| calibration.parameters[k].value - truth[k])
}

/// K [r1 r2 t] of exact poses, K any upper triangle.
pub(crate) fn exact_homographies(intrinsics: &Matrix3<f64>, poses: &[Se3]) -> Vec<Homography> {
    poses
        .iter()
        .map(|pose| {
            let rotation = pose.rotation.matrix();
            let columns = [
                rotation.column(0).into_owned(),
                rotation.column(1).into_owned(),
                pose.translation,
            ];
            Homography::from_matrix(&(intrinsics * Matrix3::from_columns(&columns))).expect("valid")
        })
        .collect()
}

pub(crate) fn tilted() -> Vec<Se3> {
    [(0.6, 0.1), (-0.2, 0.7), (0.4, -0.5), (0.1, -0.8)]
        .map(|(a, b)| posed(Vector3::new(a, b, 0.2), Vector3::new(0.02, -0.01, 0.5)))
        .to_vec()
}

/// Boards parallel to the image, at several places and distances.
pub(crate) fn fronto_parallel() -> Vec<Se3> {
    [
        (-0.1, 0.05, 0.5, 0.0),
        (0.1, -0.02, 0.6, 0.5),
        (0.0, 0.0, 0.7, -0.4),
        (0.05, 0.1, 0.55, 1.0),
    ]
    .map(|(x, y, z, roll)| posed(Vector3::new(0.0, 0.0, roll), Vector3::new(x, y, z)))
    .to_vec()
}
