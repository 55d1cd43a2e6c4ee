//! The reported covariance: against its own errors, and against the inverse of the full normal matrix.

use mono_geometry::calibration::LensModel;
use mono_geometry::{Camera, Se3};
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::scene::*;

/// Mean normalised error squared over seeded runs, p degrees of freedom each.
fn mean_nees(
    camera: &Camera,
    model: LensModel,
    view_count: usize,
    runs: u32,
    sigma: f64,
    seed: u64,
) -> (f64, f64, usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let poses = poses(camera, view_count, seed);
    let (mut total, mut shrunk) = (0.0, 0.0);
    let mut free = 0;
    for _ in 0..runs {
        let mut views = views(camera, &poses, Some((sigma, &mut rng)));
        // The sigma given is wrong by a factor of two: only the residuals can tell.
        for corner in views.iter_mut().flat_map(|v| &mut v.corners) {
            corner.sigma_px *= 2.0;
        }
        let calibration = run(&views, model);
        assert!(
            calibration.termination.converged(),
            "{:?}",
            calibration.termination
        );
        free = calibration.parameters.len();
        let error = errors(&calibration, camera);
        // Whitened by the standard deviations: the units differ by orders of magnitude.
        let sigmas = DVector::from_fn(free, |k, _| calibration.parameters[k].sigma);
        let error = error.component_div(&sigmas);
        let factor = calibration
            .correlation
            .clone()
            .cholesky()
            .expect("positive definite");
        let nees = error.dot(&factor.solve(&error));
        total += nees;
        // The wrong form: the covariance of corners with the sigma given, not scaled by the residuals.
        shrunk += nees * calibration.variance_factor;
        for (k, parameter) in calibration.parameters.iter().enumerate() {
            let variance = calibration.covariance[(k, k)];
            assert!((parameter.sigma.powi(2) - variance).abs() <= 1e-12 * variance);
        }
    }
    (total / f64::from(runs), shrunk / f64::from(runs), free)
}

/// Mean of chi-square(p) over n runs, scaled by F with nu degrees of freedom: within 4.5 standard errors of p nu / (nu
/// - 2).
fn assert_consistent(mean: f64, free: usize, runs: u32, degrees: usize) {
    let p = free as f64;
    let expected = p * degrees as f64 / (degrees as f64 - 2.0);
    let bound = 4.5 * (2.0 * p / f64::from(runs)).sqrt();
    assert!(
        (mean - expected).abs() < bound,
        "{mean} {expected} +- {bound}"
    );
}

#[test]
fn nees_radtan_is_inside_its_band() {
    let (mean, shrunk, free) = mean_nees(&radtan(), LensModel::Radtan, 6, 100, 0.2, 41);
    assert_eq!(free, 8);
    assert_consistent(mean, free, 100, 6 * 108 - 8 - 36);
    // The wrong form, the scatter of the corners without the variance factor: far outside the same band.
    let p = free as f64;
    assert!((shrunk - p).abs() > 4.5 * (2.0 * p / 100.0).sqrt());
}

#[test]
fn nees_kannala_brandt_is_inside_its_band() {
    let (mean, _, free) = mean_nees(&fisheye(), LensModel::KannalaBrandt, 6, 100, 0.2, 42);
    assert_eq!(free, 8);
    assert_consistent(mean, free, 100, 6 * 108 - 8 - 36);
}

#[test]
fn nees_rational_is_inside_its_band() {
    // Little noise: the coefficients are nearly interchangeable, and the Gaussian holds only while the valley is
    // straight.
    let (mean, _, free) = mean_nees(&rational(), LensModel::Rational, 6, 80, 0.02, 43);
    assert_eq!(free, 12);
    assert_consistent(mean, free, 80, 6 * 108 - 12 - 36);
}

/// Covariances by the slow way: the whole Jacobian by central differences, its normal matrix inverted.
#[test]
fn covariances_are_the_blocks_of_the_full_inverse() {
    let camera = radtan();
    let mut rng = ChaCha8Rng::seed_from_u64(59);
    let mut all = views(&camera, &poses(&camera, 4, 59), Some((0.1, &mut rng)));
    for (k, corner) in all[1].corners.iter_mut().enumerate() {
        corner.sigma_px *= 1.0 + 0.02 * k as f64;
    }
    let calibration = run(&all, LensModel::Radtan);
    let (p, size) = (8, 8 + 24);
    // Steps near the standard deviations, so that the differences are neither rounding nor curvature.
    let mut steps: Vec<f64> = calibration
        .parameters
        .iter()
        .map(|c| 1e-3 * c.sigma)
        .collect();
    steps.resize(size, 1e-6);
    let residuals = |offset: &DVector<f64>| {
        let mut parameters = calibration.camera.parameters();
        for k in 0..p {
            parameters[k] += offset[k];
        }
        let camera = calibration
            .camera
            .with_parameters(parameters.as_slice())
            .unwrap();
        let mut all_residuals = Vec::new();
        for (v, (view, report)) in all.iter().zip(&calibration.views).enumerate() {
            let delta = offset.fixed_rows::<6>(p + 6 * v).into_owned();
            let pose = report.camera_from_board.compose(&Se3::exp(&delta));
            for corner in &view.corners {
                let pixel = camera
                    .project(&pose.transform_point(&corner.board_m.push(0.0)))
                    .unwrap();
                let error = (corner.pixel - pixel) / corner.sigma_px;
                all_residuals.extend([error.x, error.y]);
            }
        }
        DVector::from_vec(all_residuals)
    };
    let columns: Vec<_> = (0..size)
        .map(|k| {
            let mut offset = DVector::zeros(size);
            offset[k] = steps[k];
            (residuals(&offset) - residuals(&-offset)) / 2.0
        })
        .collect();
    let jacobian = nalgebra::DMatrix::from_columns(&columns);
    let normal = jacobian.transpose() * &jacobian;
    let inverse = normal.clone().cholesky().unwrap().inverse();
    let zero = residuals(&DVector::zeros(size));
    let degrees = 4 * 108 - size;
    let factor = zero.norm_squared() / degrees as f64;
    assert!((calibration.variance_factor / factor - 1.0).abs() < 1e-12);
    let expected = |i: usize, j: usize| inverse[(i, j)] * factor * steps[i] * steps[j];
    for i in 0..p {
        for j in 0..p {
            let size = (expected(i, i) * expected(j, j)).sqrt();
            assert!((calibration.covariance[(i, j)] - expected(i, j)).abs() < 1e-5 * size);
        }
        // The wrong form, the poses taken as known: far too small.
        let known_poses = factor * steps[i] * steps[i] / normal[(i, i)];
        assert!(known_poses < 0.5 * expected(i, i));
    }
    for (v, report) in calibration.views.iter().enumerate() {
        let covariance = report.pose_covariance.unwrap();
        for i in 0..6 {
            for j in 0..6 {
                let at = |k: usize| p + 6 * v + k;
                let size = (expected(at(i), at(i)) * expected(at(j), at(j))).sqrt();
                assert!((covariance[(i, j)] - expected(at(i), at(j))).abs() < 1e-5 * size);
            }
        }
    }
    // And a minimum: the gradient vanishes against the noise.
    assert!(
        (jacobian.transpose() * zero)
            .component_div(&normal.diagonal().map(f64::sqrt))
            .amax()
            < 1e-4
    );
}
