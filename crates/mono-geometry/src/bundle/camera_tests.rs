//! An unknown camera inside the bundle: derivatives against differences, the bordered solution against the dense one.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::intrinsics::Intrinsics;
use super::normal::{Estimate, cost};
use super::pose::BundlePose;
use super::problem::Problem;
use super::tests::{dense, filled, moved, planar, spatial, steps};
use crate::camera::Camera;
use crate::distortion::Distortion;
use crate::noise_shape::NoiseShape;
use crate::robust_loss::RobustLoss;

const LENS: Distortion = Distortion::Radtan {
    k1: -0.2,
    k2: 0.05,
    p1: 1e-3,
    p2: -5e-4,
    k3: 0.0,
};

/// The small problem behind a lens, six parameters free (one of them without a prior), nothing at its minimum.
fn unknown<P: BundlePose<D>, const D: usize>(mut problem: Problem<P, D>) -> Problem<P, D> {
    let calibrated = Camera::new(problem.pinhole, LENS).expect("a camera");
    for (k, o) in problem.observations.iter_mut().enumerate() {
        if k % 3 > 0 {
            // every third stays round in the ideal picture
            let real = calibrated.distort_pixel(&o.pixel_ideal);
            (o.pixel_ideal, o.shape) = calibrated
                .undistort_with_shape(&real)
                .expect("in the field");
        }
    }
    let sigmas = vec![8.0, 6.0, 5.0, f64::INFINITY, 0.02, 0.03, 0.0, 0.0, 0.0];
    let mut intrinsics = Intrinsics::new(calibrated, sigmas);
    let off = [3.0, -2.0, 4.0, -1.0, 0.01, -0.02, 1e-4, 0.0, 1e-3];
    let parameters = calibrated.parameters() + DVector::from_row_slice(&off);
    intrinsics.estimate = calibrated
        .with_parameters(parameters.as_slice())
        .expect("a camera");
    problem.intrinsics = Some(intrinsics);
    problem
}

fn camera_of<P: BundlePose<D>, const D: usize>(problem: &Problem<P, D>) -> &Intrinsics {
    problem.intrinsics.as_ref().expect("unknown")
}

/// Whitened residuals of the pixels and of the camera's prior, written down without the normal equations.
fn residuals<P: BundlePose<D>, const D: usize>(problem: &Problem<P, D>) -> DVector<f64> {
    let camera = camera_of(problem);
    let mut all = Vec::new();
    for (k, o) in problem.observations.iter().enumerate() {
        let placed = problem.poses[o.pose]
            .world_from_body()
            .compose(&problem.body_from_camera)
            .inverse();
        let point = placed.transform_point(&problem.landmarks[o.landmark]);
        let off = camera.estimate.project(&point).expect("in view")
            - camera.calibrated.distort_pixel(&o.pixel_ideal);
        let off = if k % 3 > 0 {
            off
        } else {
            let step = |d: Vector2<f64>| camera.calibrated.distort_pixel(&(o.pixel_ideal + d));
            let h = 1e-4;
            let by = |d: Vector2<f64>| (step(d) - step(-d)) / (2.0 * h);
            let lens = Matrix2::from_columns(&[by(Vector2::x() * h), by(Vector2::y() * h)]);
            lens.try_inverse().expect("regular") * off
        };
        all.extend((off / o.sigma_px).iter());
    }
    let off = camera.estimate.parameters() - camera.calibrated.parameters();
    for (k, sigma) in camera.sigmas.iter().enumerate() {
        if *sigma > 0.0 && sigma.is_finite() {
            all.push(off[k] / sigma);
        }
    }
    DVector::from_vec(all)
}

/// Normal equations of poses, landmarks and camera, in this order.
fn bordered<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
) -> (DMatrix<f64>, DVector<f64>) {
    let (layout, _, normal) = filled(problem, RobustLoss::None);
    let (hessian, gradient) = dense(&layout, &normal);
    let (inner, border) = (gradient.len(), &normal.border);
    let size = inner + border.free.len();
    let mut all = hessian.resize(size, size, 0.0);
    let side = DMatrix::from_fn(inner, border.free.len(), |i, j| {
        if i < border.poses.nrows() {
            border.poses[(i, j)]
        } else {
            border.landmarks[(i - border.poses.nrows(), j)]
        }
    });
    let mut at = |row: usize, column: usize, block: &DMatrix<f64>| {
        all.view_mut((row, column), block.shape()).copy_from(block);
    };
    at(0, inner, &side);
    at(inner, 0, &side.transpose());
    at(inner, inner, &border.corner);
    let mut full = gradient.resize_vertically(size, 0.0);
    full.rows_mut(inner, border.free.len())
        .copy_from(&border.gradient);
    (all, full)
}

fn check_derivatives<P: BundlePose<D>, const D: usize>(problem: Problem<P, D>) {
    let mut problem = unknown(problem);
    problem.odometry.clear();
    problem.priors.clear();
    let (layout, whitening, normal) = filled(&problem, RobustLoss::None);
    let (hessian, gradient) = bordered(&problem);
    let inner = gradient.len() - normal.border.free.len();
    let at = residuals(&problem);
    let estimate = Estimate::new(&problem);
    let direct = cost(&problem, &layout, &whitening, &RobustLoss::None, &estimate);
    // the oracle's lens is a difference
    assert!((direct.expect("in view") / (0.5 * at.norm_squared()) - 1.0).abs() < 1e-7);
    let columns: Vec<_> = (0..gradient.len())
        .map(|k| {
            let by = |sign: f64| {
                let mut problem = problem.clone();
                let scale = if k < inner {
                    (problem.poses, problem.landmarks) = moved(&problem, &layout, k, sign * 1e-6);
                    1e-6
                } else {
                    let parameter = normal.border.free[k - inner];
                    let h = if parameter < 4 { 1e-4 } else { 1e-6 };
                    let camera = problem.intrinsics.as_mut().expect("unknown");
                    let mut values = camera.estimate.parameters();
                    values[parameter] += sign * h;
                    camera.estimate = camera
                        .estimate
                        .with_parameters(values.as_slice())
                        .expect("a camera");
                    h
                };
                (residuals(&problem), scale)
            };
            let ((plus, h), (minus, _)) = (by(1.0), by(-1.0));
            (plus - minus) / (2.0 * h)
        })
        .collect();
    let scales: Vec<f64> = columns.iter().map(DVector::norm).collect();
    assert!(scales[inner..].iter().all(|s| *s > 0.0));
    for (i, a) in columns.iter().enumerate() {
        let expected = a.dot(&at);
        let error = (gradient[i] - expected).abs() / (scales[i] * at.norm());
        assert!(error < 1e-6, "gradient {i}: {error}");
        for (j, b) in columns.iter().enumerate() {
            let error = (hessian[(i, j)] - a.dot(b)).abs() / (scales[i] * scales[j]);
            assert!(error < 1e-6, "{i} {j}: {error}");
        }
    }
}

#[test]
fn derivatives_by_the_camera_match_central_differences() {
    check_derivatives(planar());
    check_derivatives(spatial());
}

fn check_border<P: BundlePose<D>, const D: usize>(problem: Problem<P, D>) {
    let problem = unknown(problem);
    let (layout, _, normal) = filled(&problem, RobustLoss::None);
    let (hessian, gradient) = bordered(&problem);
    let free = D * layout.free_poses.len();
    for (damping, step, expected) in steps(&layout, &normal, &hessian, &gradient) {
        for (k, (found, expected)) in step.iter().zip(&expected).enumerate() {
            // in standard deviations each coordinate has alone
            let scale = hessian[(k, k)].sqrt();
            let error = (found - expected).abs() * scale / (1.0 + expected.abs() * scale);
            assert!(error < 1e-7, "{damping} {k}: {found} {expected}");
        }
    }
    // Scaled to a unit diagonal: pixels and lens coefficients are far apart.
    let scale = hessian.diagonal().map(f64::sqrt);
    let inverse = DMatrix::from_fn(hessian.nrows(), hessian.ncols(), |i, j| {
        hessian[(i, j)] / (scale[i] * scale[j])
    })
    .try_inverse()
    .expect("regular");
    let inverse = DMatrix::from_fn(hessian.nrows(), hessian.ncols(), |i, j| {
        inverse[(i, j)] / (scale[i] * scale[j])
    });
    let sure = super::covariance(&problem, &RobustLoss::None).expect("regular");
    let near = |found: &DMatrix<f64>, first: usize| {
        let expected = inverse.view((first, first), found.shape());
        for (i, j) in (0..found.nrows()).flat_map(|i| (0..found.ncols()).map(move |j| (i, j))) {
            let unit = (expected[(i, i)] * expected[(j, j)]).sqrt();
            assert!(
                (found[(i, j)] - expected[(i, j)]).abs() < 1e-8 * unit,
                "{first}: {i} {j}"
            );
        }
    };
    near(sure.joint(), 0);
    for l in 0..normal.v.len() {
        let block = sure.landmark(l).expect("seen from three poses");
        near(
            &DMatrix::from_column_slice(3, 3, block.as_slice()),
            free + 3 * l,
        );
    }
    let count = normal.border.free.len();
    let all = sure.intrinsics();
    near(
        &all.view((0, 0), (count, count)).into_owned(),
        hessian.nrows() - count,
    );
    assert_eq!(all.shape(), (9, 9));
    assert_eq!(all.view((count, 0), (9 - count, 9)).amax(), 0.0);
}

#[test]
fn the_bordered_solution_is_the_dense_one() {
    check_border(planar());
    check_border(spatial());
}

/// The change that a lens makes to the noise is undone by going back through it.
#[test]
fn noise_behind_the_lens_is_round_in_the_real_picture() {
    let problem = unknown(planar());
    let camera = camera_of(&problem);
    for (k, o) in problem.observations.iter().enumerate() {
        let (real, shape) = camera.real_pixel(&o.pixel_ideal, &o.shape);
        assert!((real - camera.calibrated.distort_pixel(&o.pixel_ideal)).norm() < 1e-12);
        assert_eq!(shape == NoiseShape::ROUND, k % 3 > 0);
    }
}
