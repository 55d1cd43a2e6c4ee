//! The same corners through OpenCV's calibration: same minimum, same standard deviations, same error a view.
//!
//! Numbers and format: `reference/opencv_calibration.py`.

use mono_geometry::calibration::{
    Calibration, CalibrationOptions, CalibrationView, LensModel, calibrate,
};
use nalgebra::Vector2;

const REFERENCE: &str = include_str!("../reference/opencv_calibration.txt");

struct Case {
    views: Vec<CalibrationView>,
    parameters: Vec<f64>,
    sigmas: Vec<f64>,
    errors: Vec<f64>,
    rms: f64,
}

fn case(name: &str) -> Case {
    let mut case = Case {
        views: Vec::new(),
        parameters: Vec::new(),
        sigmas: Vec::new(),
        errors: Vec::new(),
        rms: f64::NAN,
    };
    let board: Vec<_> = (0..54)
        .map(|k| Vector2::new(f64::from(k % 9) / 32.0, f64::from(k / 9) / 32.0))
        .collect();
    let mut lines = REFERENCE
        .lines()
        .skip_while(|l| !l.starts_with(&format!("case {name} ")));
    lines.next().expect("the case");
    for line in lines.take_while(|l| !l.starts_with("case")) {
        let (key, rest) = line.split_once(' ').unwrap_or((line, ""));
        let numbers: Vec<f64> = rest
            .split_whitespace()
            .map(|n| n.parse().expect("a number"))
            .collect();
        match key {
            "view" => {
                let pixels: Vec<_> = numbers
                    .chunks(2)
                    .map(|p| Vector2::new(p[0], p[1]) / 4096.0)
                    .collect();
                case.views.push(CalibrationView::new(&board, &pixels, 1.0));
            }
            "parameters" => case.parameters = numbers,
            "sigmas" => case.sigmas = numbers,
            "errors" => case.errors = numbers,
            "rms" => case.rms = numbers[0],
            _ => {}
        }
    }
    case
}

fn run(case: &Case, model: LensModel) -> Calibration {
    let options = CalibrationOptions {
        model,
        ..CalibrationOptions::default()
    };
    calibrate(640, 480, &case.views, &options).expect("calibrated")
}

/// Both optimisers stop a millionth of a standard deviation from the minimum; the largest difference seen is 2e-6.
const SHARE_OF_SIGMA: f64 = 1e-5;
/// Standard deviations change with the parameters: the largest difference seen is 5e-7.
const RELATIVE: f64 = 1e-6;

fn compare(name: &str, model: LensModel) {
    let case = case(name);
    assert_eq!(case.views.len(), 8);
    let ours = run(&case, model);
    assert!(ours.termination.converged(), "{:?}", ours.termination);
    for (k, parameter) in ours.parameters.iter().enumerate() {
        let off = (parameter.value - case.parameters[k]).abs();
        assert!(
            off < SHARE_OF_SIGMA * parameter.sigma,
            "{parameter:?} {}",
            case.parameters[k]
        );
    }
    for (ours, theirs) in ours.parameters.iter().zip(&case.sigmas) {
        assert!(
            (ours.sigma / theirs - 1.0).abs() < RELATIVE,
            "{ours:?} {theirs}"
        );
    }
    for (ours, theirs) in ours.views.iter().zip(&case.errors) {
        assert!((ours.rms_px - theirs).abs() < RELATIVE * theirs);
    }
    assert!((ours.rms_px - case.rms).abs() < RELATIVE * case.rms);
    // At a minimum the cost differs by the square of that.
    assert!(
        ours.rms_px <= case.rms * (1.0 + 1e-12),
        "{} {}",
        ours.rms_px,
        case.rms
    );
}

#[test]
fn val_opencv_calibrate_radtan() {
    compare("radtan", LensModel::Radtan);
}

#[test]
fn val_opencv_calibrate_radtan_with_k3() {
    compare("radtan_k3", LensModel::RadtanK3);
}

#[test]
fn val_opencv_calibrate_rational() {
    compare("rational", LensModel::Rational);
}

#[test]
fn val_opencv_calibrate_kannala_brandt() {
    compare("kannala_brandt", LensModel::KannalaBrandt);
}
