//! Views that do not constrain the camera, or are none: errors with counts, warnings with names.

use mono_geometry::calibration::{
    Calibration, CalibrationError, CalibrationWarning, IntrinsicsStart, LensModel, SkipReason,
    calibrate,
};
use mono_geometry::{Camera, Distortion, RobustLoss, Termination};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::scene::*;

fn all_finite(calibration: &Calibration) -> bool {
    calibration
        .camera
        .parameters()
        .iter()
        .all(|v| v.is_finite())
        && calibration.covariance.iter().all(|v| !v.is_nan())
        && calibration.correlation.iter().all(|v| v.is_finite())
        && calibration
            .parameters
            .iter()
            .all(|p| p.value.is_finite() && !p.sigma.is_nan())
        && calibration.cost_curve.iter().all(|v| v.is_finite())
        && calibration.rms_px.is_finite()
}

/// The focal length and the distances grow together: nothing in the image tells.
#[test]
fn fronto_parallel_views_leave_the_focal_length_open() {
    let camera = radtan();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for noise in [None, Some(0.1)] {
        let views = match noise {
            None => views(&camera, &fronto_parallel(), None),
            Some(sigma) => views(&camera, &fronto_parallel(), Some((sigma, &mut rng))),
        };
        let calibration = run(&views, LensModel::Radtan);
        assert!(all_finite(&calibration));
        assert!(calibration.rms_px < 0.2);
        let named = |wanted: &str| {
            calibration.warnings.iter().any(
                |w| matches!(w, CalibrationWarning::WeakParameter { name, .. } if *name == wanted),
            )
        };
        assert!(named("fx") && named("fy"), "{:?}", calibration.warnings);
        assert!(calibration.warnings.iter().any(|w| match w {
            CalibrationWarning::WeakCombination { terms, .. } =>
                terms.iter().any(|t| t.0 == "fx") && terms.iter().any(|t| t.0 == "fy"),
            _ => false,
        }));
        assert!(parallel(&calibration));
        if noise.is_none() {
            assert_eq!(calibration.start, IntrinsicsStart::FocalLengthAssumed);
            assert!(calibration.parameter("fx").unwrap().sigma > 0.1 * 530.0);
        }
    }
}

fn parallel(calibration: &Calibration) -> bool {
    let mut warnings = calibration.warnings.iter();
    warnings.any(|w| matches!(w, CalibrationWarning::ViewsNearlyParallel { .. }))
}

/// One plane gives two constraints on four parameters, however often it is seen.
#[test]
fn identical_views_leave_two_directions_open() {
    let camera = Camera::new(pinhole(530.0), Distortion::None).unwrap();
    let poses = vec![tilted()[0]; 4];
    let calibration = run(&views(&camera, &poses, None), LensModel::Pinhole);
    assert!(all_finite(&calibration));
    assert!(calibration.rms_px < 1e-6);
    assert!(calibration.condition.is_infinite());
    let open = calibration.warnings.iter().filter(|w| {
        matches!(w, CalibrationWarning::WeakCombination { sigmas_over_limit, .. } if sigmas_over_limit.is_infinite())
    });
    assert_eq!(open.count(), 2, "{:?}", calibration.warnings);
    assert!(parallel(&calibration));
    assert!(calibration.parameters.iter().any(|p| p.sigma.is_infinite()));
    assert!(
        calibration
            .views
            .iter()
            .all(|v| v.pose_covariance.is_none())
    );
}

#[test]
fn unusable_views_are_left_out_and_counted() {
    let camera = radtan();
    let mut all = views(&camera, &poses(&camera, 6, 23), None);
    all[1].corners.truncate(3);
    all[3].corners.truncate(9);
    all[4].corners.clear();
    let calibration = run(&all, LensModel::Radtan);
    let used: Vec<_> = calibration.views.iter().map(|v| v.view).collect();
    assert_eq!(used, [0, 2, 5]);
    let skipped: Vec<_> = calibration
        .warnings
        .iter()
        .filter_map(|w| match w {
            CalibrationWarning::ViewSkipped { view, reason } => Some((*view, *reason)),
            _ => None,
        })
        .collect();
    assert!(matches!(
        skipped[..],
        [
            (1, SkipReason::TooFewCorners { corners: 3 }),
            (3, SkipReason::Collinear { .. }),
            (4, SkipReason::TooFewCorners { corners: 0 }),
        ]
    ));
    let truth = camera.parameters();
    assert!((calibration.parameter("fx").unwrap().value - truth[0]).abs() < 1e-7);
    assert_eq!(
        calibrate(WIDTH, HEIGHT, &all[..2], &options(LensModel::Radtan)),
        Err(CalibrationError::TooFewViews {
            usable: 1,
            given: 2,
            required: 2
        })
    );
    assert!(matches!(
        calibrate(WIDTH, HEIGHT, &[], &options(LensModel::KannalaBrandt)),
        Err(CalibrationError::TooFewViews { usable: 0, .. })
    ));
    // Two views of four corners in general position: 16 equations for 20 unknowns.
    let mut few = views(&camera, &poses(&camera, 2, 23), None);
    for view in &mut few {
        view.corners = [0, 8, 45, 53].map(|k| view.corners[k]).to_vec();
    }
    assert_eq!(
        calibrate(WIDTH, HEIGHT, &few, &options(LensModel::Radtan)),
        Err(CalibrationError::TooFewCorners {
            corners: 8,
            equations: 16,
            parameters: 8,
            views: 2,
            unknowns: 20
        })
    );
}

/// Corners as a camera would see them through its back: a homography, but no view.
#[test]
fn corners_behind_the_camera_are_no_view() {
    let camera = Camera::new(pinhole(530.0), Distortion::None).unwrap();
    let mut all = views(&camera, &poses(&camera, 5, 29), None);
    let pose = posed(Vector3::new(0.2, 1.4, 0.0), Vector3::new(0.0, 0.0, 0.06));
    let mut behind = 0;
    for corner in &mut all[2].corners {
        let point = pose.transform_point(&corner.board_m.push(0.0));
        behind += usize::from(point.z < 0.0);
        corner.pixel = camera.pinhole().pixel(&(point.xy() / point.z));
    }
    assert!(behind > 5 && behind < 49);
    let calibration = run(&all, LensModel::Pinhole);
    assert!(matches!(
        calibration.warnings[..],
        [CalibrationWarning::ViewSkipped {
            view: 2,
            reason: SkipReason::NotVisible { .. }
        }]
    ));
    assert!(errors(&calibration, &camera).amax() < 1e-7);
}

#[test]
fn numbers_that_are_none_are_named() {
    let camera = radtan();
    let good = views(&camera, &poses(&camera, 4, 31), None);
    for (value, what) in [(f64::NAN, 0), (f64::INFINITY, 1), (0.0, 2), (f64::NAN, 2)] {
        let mut bad = good.clone();
        let corner = &mut bad[2].corners[7];
        match what {
            0 => corner.pixel.x = value,
            1 => corner.board_m.y = value,
            _ => corner.sigma_px = value,
        }
        assert_eq!(
            calibrate(WIDTH, HEIGHT, &bad, &options(LensModel::Radtan)),
            Err(CalibrationError::InvalidCorner { view: 2, corner: 7 })
        );
    }
    assert!(calibrate(0, HEIGHT, &good, &options(LensModel::Radtan)).is_err());
    let mut none = options(LensModel::Radtan);
    none.max_iterations = 0;
    assert!(calibrate(WIDTH, HEIGHT, &good, &none).is_err());
    let mut bad_loss = options(LensModel::Radtan);
    bad_loss.loss = RobustLoss::Huber { threshold: -1.0 };
    assert!(calibrate(WIDTH, HEIGHT, &good, &bad_loss).is_err());
    let mut one = options(LensModel::Radtan);
    one.max_iterations = 1;
    let stopped = calibrate(WIDTH, HEIGHT, &good, &one).unwrap();
    assert!(matches!(
        stopped.termination,
        Termination::IterationLimit { iterations: 1, .. }
    ));
    assert!(matches!(
        stopped.warnings[0],
        CalibrationWarning::NotConverged { .. }
    ));
}

#[test]
fn a_view_that_does_not_fit_is_named_and_only_it() {
    let camera = radtan();
    let mut rng = ChaCha8Rng::seed_from_u64(37);
    let mut all = views(&camera, &poses(&camera, 12, 37), Some((0.1, &mut rng)));
    for corner in &mut all[5].corners {
        corner.pixel += gauss(&mut rng);
    }
    let calibration = run(&all, LensModel::Radtan);
    let named: Vec<_> = calibration
        .warnings
        .iter()
        .map(|w| match w {
            CalibrationWarning::ViewResidual { view, .. } => *view,
            other => panic!("{other}"),
        })
        .collect();
    assert_eq!(named, [5]);
}

/// Corners near the image centre: the lens beyond them is a guess. Where the rational model has to be guessed from
/// them, numerator and denominator are interchangeable.
#[test]
fn corners_in_the_middle_do_not_show_the_lens() {
    let camera = radtan();
    let mut rng = ChaCha8Rng::seed_from_u64(47);
    let far: Vec<_> = (0..10)
        .map(|k| {
            let about = f64::from(k);
            posed(
                Vector3::new(0.6 * about.cos(), 0.6 * about.sin(), 0.1),
                Vector3::new(0.02 * about.sin(), 0.02 * about.cos(), 1.0),
            )
        })
        .collect();
    let all = views(&camera, &far, Some((0.1, &mut rng)));
    let calibration = run(&all, LensModel::Radtan);
    assert!(matches!(
        calibration.warnings[..],
        [CalibrationWarning::DistortionExtrapolated { .. }]
    ));
    assert!(calibration.max_corner_radius < 0.3);
    let calibration = run(&all, LensModel::Rational);
    assert!(calibration.warnings.iter().any(|w| matches!(
        w,
        CalibrationWarning::Correlated {
            first: "k1",
            second: "k4",
            ..
        }
    )));
    assert!(calibration.warnings.iter().any(|w| matches!(
        w,
        CalibrationWarning::WeakCombination { terms, .. } if terms.iter().any(|t| t.0.starts_with('k'))
    )));
    assert!(all_finite(&calibration));
    // The message names the parameters and gives the numbers.
    let text: Vec<_> = calibration
        .warnings
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(
        text.iter()
            .any(|t| t.contains("k2 and k3 are correlated by -0.99")),
        "{text:?}"
    );
}
