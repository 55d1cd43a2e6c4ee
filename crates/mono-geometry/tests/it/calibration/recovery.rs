//! Good views: exact recovery, no warnings, robustness.

use mono_geometry::RobustLoss;
use mono_geometry::calibration::{Calibration, IntrinsicsStart, LensModel, calibrate};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::scene::*;

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
        assert!(
            calibration.rms_px < 1e-9,
            "{model:?} {}",
            calibration.rms_px
        );
        let e = errors(&calibration, &camera);
        for k in 0..4 {
            assert!(e[k].abs() < tolerance * 500.0, "{model:?} {e}");
        }
        assert!(calibration.termination.converged());
        for (report, pose) in calibration.views.iter().zip(&poses) {
            let off = pose.inverse().compose(&report.camera_from_board).log();
            assert!(off.amax() < tolerance);
        }
    }
}

/// A lens that was left out cannot hide in the other parameters.
#[test]
fn a_missing_lens_leaves_residuals() {
    let camera = radtan();
    let views = views(&camera, &poses(&camera, 10, 3), None);
    assert!(run(&views, LensModel::Radtan).rms_px < 1e-9);
    assert!(run(&views, LensModel::Pinhole).rms_px > 1.0);
    assert!(run(&views, LensModel::KannalaBrandt).rms_px > 1e-3);
}

#[test]
fn good_views_have_no_warnings() {
    let camera = radtan();
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let poses = poses(&camera, 15, 17);
    let calibration = run(
        &views(&camera, &poses, Some((0.1, &mut rng))),
        LensModel::Radtan,
    );
    assert_eq!(calibration.warnings, Vec::new());
    assert_eq!(calibration.start, IntrinsicsStart::ClosedForm);
    assert!(calibration.cost_curve.windows(2).all(|w| w[1] < w[0]));
    assert!(calibration.cost_curve.len() < 20);
    assert_eq!(calibration.degrees_of_freedom, 15 * 108 - 8 - 90);
    // The given sigma is the true one.
    let spread = 4.5 * (2.0 / calibration.degrees_of_freedom as f64).sqrt();
    assert!((calibration.variance_factor - 1.0).abs() < spread);
    let view = &calibration.views[3];
    let squares: f64 = view.residuals_px.iter().map(Vector2::norm_squared).sum();
    assert!((view.rms_px - (squares / 54.0).sqrt()).abs() < 1e-15);
    assert!(view.mean_error_px < view.rms_px);
}

#[test]
fn a_robust_loss_survives_wrong_corners() {
    let camera = radtan();
    let mut rng = ChaCha8Rng::seed_from_u64(53);
    let mut all = views(&camera, &poses(&camera, 10, 53), Some((0.1, &mut rng)));
    for view in &mut all {
        for _ in 0..3 {
            let wrong = rng.random_range(0..54);
            view.corners[wrong].pixel += Vector2::new(4.0, -3.0);
        }
    }
    let plain = run(&all, LensModel::Radtan);
    let mut robust = options(LensModel::Radtan);
    robust.loss = RobustLoss::Cauchy { threshold: 3.0 };
    let robust = calibrate(WIDTH, HEIGHT, &all, &robust).unwrap();
    assert!(robust.termination.converged());
    let off = |c: &Calibration| (c.parameter("fx").unwrap().value - 530.0).abs();
    assert!(off(&robust) < 4.5 * robust.parameter("fx").unwrap().sigma);
    assert!(robust.parameter("fx").unwrap().sigma < 0.5 * plain.parameter("fx").unwrap().sigma);
}

/// Corners counted along the other axis: the same plane seen from behind.
#[test]
fn a_mirrored_board_is_another_pose_of_its_plane() {
    let camera = radtan();
    let mut all = views(&camera, &poses(&camera, 6, 3), None);
    for corner in &mut all[2].corners {
        corner.board_m = corner.board_m.yx();
    }
    let calibration = run(&all, LensModel::Radtan);
    assert!(calibration.rms_px < 1e-9);
    assert!(errors(&calibration, &camera).amax() < 1e-7);
}
