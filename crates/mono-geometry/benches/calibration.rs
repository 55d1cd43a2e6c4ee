//! Calibration from 40 views of 54 corners; the corners of `tests/reference/opencv_calibration.py --time`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mono_geometry::calibration::{CalibrationOptions, CalibrationView, LensModel, calibrate};
use mono_geometry::homography::Homography;
use mono_geometry::{Camera, Distortion, Pinhole, Se3, homography, so3};
use nalgebra::{Vector2, Vector3};

/// Linear congruential numbers in [0, 1), the same in the script.
struct Uniform(u32);

impl Uniform {
    fn draw(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        low + (high - low) * (f64::from(self.0 >> 8) / 16_777_216.0)
    }

    fn gauss(&mut self) -> f64 {
        (0..12).map(|_| self.draw(0.0, 1.0)).sum::<f64>() - 6.0
    }
}

fn board() -> Vec<Vector2<f64>> {
    (0..54)
        .map(|k| Vector2::new(f64::from(k % 9) / 32.0, f64::from(k / 9) / 32.0))
        .collect()
}

fn views(camera: &Camera, count: usize, sigma: f64, seed: u32) -> Vec<CalibrationView> {
    let mut uniform = Uniform(seed);
    let f = camera.pinhole().fx;
    let points = board();
    let mut views = Vec::new();
    while views.len() < count {
        let tilt = uniform.draw(0.3, 0.9);
        let about = uniform.draw(0.0, std::f64::consts::TAU);
        let roll = uniform.draw(-0.3, 0.3);
        let depth = uniform.draw(0.25, 0.5) * (f / 400.0).max(0.4);
        let x = uniform.draw(-300.0, 300.0) / f;
        let y = uniform.draw(-220.0, 220.0) / f;
        let rotation = so3::exp(&Vector3::new(tilt * about.cos(), tilt * about.sin(), roll));
        let middle = Vector3::new(0.125, 0.078_125, 0.0);
        let pose = Se3::new(
            rotation,
            Vector3::new(x, y, 1.0) * depth - rotation * middle,
        );
        let pixels: Option<Vec<_>> = points
            .iter()
            .map(|b| {
                camera
                    .project(&pose.transform_point(&b.push(0.0)))
                    .filter(|p| camera.contains(p, 1.5))
            })
            .collect();
        let Some(pixels) = pixels else {
            continue;
        };
        let noisy: Vec<_> = pixels
            .iter()
            .map(|p| {
                let error = Vector2::new(uniform.gauss(), uniform.gauss()) * sigma;
                ((p + error) * 4096.0).map(f64::round) / 4096.0
            })
            .collect();
        views.push(CalibrationView::new(&points, &noisy, 1.0));
    }
    views
}

fn camera(f: f64, lens: Distortion) -> Camera {
    let pinhole = Pinhole {
        width: 640,
        height: 480,
        fx: f,
        fy: 1.004 * f,
        cx: 315.3,
        cy: 246.1,
    };
    Camera::new(pinhole, lens).expect("valid")
}

fn benches(criterion: &mut Criterion) {
    let radtan = Distortion::Radtan {
        k1: -0.28,
        k2: 0.09,
        p1: 4e-4,
        p2: -3e-4,
        k3: 0.0,
    };
    let fisheye = Distortion::KannalaBrandt {
        k1: -0.012,
        k2: 0.021,
        k3: -0.014,
        k4: 0.0031,
    };
    for (name, camera, model) in [
        (
            "calibrate_radtan_40x54",
            camera(530.0, radtan),
            LensModel::Radtan,
        ),
        (
            "calibrate_kannala_brandt_40x54",
            camera(220.0, fisheye),
            LensModel::KannalaBrandt,
        ),
    ] {
        let views = views(&camera, 40, 0.2, 9);
        let options = CalibrationOptions {
            model,
            ..CalibrationOptions::default()
        };
        let calibration = calibrate(640, 480, &views, &options).expect("calibrated");
        if model == LensModel::Radtan {
            // What OpenCV prints for the same corners: the two programs time one problem.
            let opencv_rms_px = 0.273_949_886_151_913;
            assert!((calibration.rms_px - opencv_rms_px).abs() < 1e-9);
        }
        criterion.bench_function(name, |b| {
            b.iter(|| calibrate(640, 480, black_box(&views), &options));
        });
    }
    let view = &views(&camera(530.0, radtan), 1, 0.2, 9)[0];
    let source: Vec<_> = view.corners.iter().map(|c| c.board_m).collect();
    let target: Vec<_> = view.corners.iter().map(|c| c.pixel).collect();
    criterion.bench_function("homography_fit_54", |b| {
        b.iter(|| homography::fit(black_box(&source), &target));
    });
    let corner = |k: usize| [source[k], source[k + 8], source[k + 45], source[k + 53]];
    let pixel = |k: usize| [target[k], target[k + 8], target[k + 45], target[k + 53]];
    criterion.bench_function("homography_from_four_points", |b| {
        b.iter(|| Homography::from_four_points(black_box(&corner(0)), &pixel(0)));
    });
}

criterion_group!(calibration, benches);
criterion_main!(calibration);
