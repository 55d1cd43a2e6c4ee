//! Zhang's calibration on simulated targets with known truth: exactness, consistency, degenerate views, warnings.

use mono_geometry::calibration::{
    Calibration, CalibrationError, CalibrationOptions, CalibrationView, CalibrationWarning,
    IntrinsicsStart, LensModel, Skew, SkipReason, Termination, calibrate, closed_form_intrinsics,
    focal_length_from_centre, pose_from_homography,
};
use mono_geometry::{Camera, Distortion, Homography, Pinhole, RobustLoss, Se3, homography, so3};
use nalgebra::{DVector, Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const WIDTH: usize = 640;
const HEIGHT: usize = 480;

fn gauss(rng: &mut ChaCha8Rng) -> Vector2<f64> {
    Vector2::new(StandardNormal.sample(rng), StandardNormal.sample(rng))
}

fn pinhole(f: f64) -> Pinhole {
    Pinhole {
        width: WIDTH,
        height: HEIGHT,
        fx: f,
        fy: f * 1.004,
        cx: 315.3,
        cy: 246.1,
    }
}

fn radtan() -> Camera {
    let lens = Distortion::Radtan {
        k1: -0.28,
        k2: 0.09,
        p1: 4e-4,
        p2: -3e-4,
        k3: 0.0,
    };
    Camera::new(pinhole(530.0), lens).unwrap()
}

fn rational() -> Camera {
    let lens = Distortion::Rational {
        k1: 0.9,
        k2: 0.2,
        p1: 5e-4,
        p2: -4e-4,
        k3: 0.01,
        k4: 1.3,
        k5: 0.5,
        k6: 0.05,
    };
    Camera::new(pinhole(320.0), lens).unwrap()
}

fn fisheye() -> Camera {
    let lens = Distortion::KannalaBrandt {
        k1: -0.012,
        k2: 0.021,
        k3: -0.014,
        k4: 0.0031,
    };
    Camera::new(pinhole(220.0), lens).unwrap()
}

fn board() -> Vec<Vector2<f64>> {
    (0..54)
        .map(|k| Vector2::new(f64::from(k % 9) * 0.03, f64::from(k / 9) * 0.03))
        .collect()
}

/// A pose that turns the middle of the board by a rotation vector and holds it at a point of the camera's axes.
fn posed(rotation: Vector3<f64>, middle: Vector3<f64>) -> Se3 {
    let rotation = so3::exp(&rotation);
    let centre = Vector3::new(0.12, 0.075, 0.0);
    Se3::new(rotation, middle - rotation * centre)
}

/// Poses with the whole board in the image, spread over it, tilted by up to about 50 degrees.
fn poses(camera: &Camera, count: usize, seed: u64) -> Vec<Se3> {
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

fn see(camera: &Camera, pose: &Se3) -> Vec<Option<Vector2<f64>>> {
    let points = board();
    let project = |b: &Vector2<f64>| camera.project(&pose.transform_point(&b.push(0.0)));
    points.iter().map(project).collect()
}

fn views(
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

fn options(model: LensModel) -> CalibrationOptions {
    CalibrationOptions {
        model,
        ..CalibrationOptions::default()
    }
}

fn run(views: &[CalibrationView], model: LensModel) -> Calibration {
    calibrate(WIDTH, HEIGHT, views, &options(model)).expect("calibrated")
}

fn errors(calibration: &Calibration, truth: &Camera) -> DVector<f64> {
    let free = calibration.parameters.len();
    let truth = truth.parameters();
    DVector::from_fn(free, |k, _| calibration.parameters[k].value - truth[k])
}

#[test]
fn noise_free_corners_give_the_camera_back() {
    for (camera, model, tolerance) in [
        (radtan(), LensModel::Radtan, 1e-9),
        (radtan(), LensModel::RadtanK3, 1e-8),
        (rational(), LensModel::Rational, 1e-4),
        (fisheye(), LensModel::KannalaBrandt, 1e-8),
    ] {
        let poses = poses(&camera, 10, 3);
        let calibration = run(&views(&camera, &poses, None), model);
        println!(
            "{model:?} {:?} {:?} {} {:e}\n{:?}",
            calibration.start,
            calibration.termination,
            calibration.cost_curve.len(),
            calibration.rms_px,
            calibration.parameters
        );
        for w in &calibration.warnings {
            println!("  {w}");
        }
        println!("{:e}", errors(&calibration, &camera).amax());
        assert!(
            calibration.rms_px < 1e-9,
            "{model:?} {}",
            calibration.rms_px
        );
        let e = errors(&calibration, &camera);
        for k in 0..4 {
            assert!(e[k].abs() < tolerance * 500.0, "{model:?} {e}");
        }
        assert!(calibration.termination.is_minimum());
        for (report, pose) in calibration.views.iter().zip(&poses) {
            let off = pose.inverse().compose(&report.camera_from_board).log();
            assert!(off.amax() < tolerance);
        }
    }
}
