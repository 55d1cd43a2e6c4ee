//! The observation likelihood: a density over the image, and the printed form.

use crate::filter::landmark::Landmark;
use crate::filter::likelihood::Likelihood;
use crate::filter::observation::{Prepared, Scoring};
use crate::filter::pixel_noise::PixelNoise;
use crate::filter::pose::CameraPose;
use crate::method::LikelihoodForm;
use mono_geometry::epipolar::EpipolarPair;
use mono_geometry::inverse_depth::LandmarkGeometry;
use mono_geometry::{PlacedCamera, Se3};
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

use super::common::*;

const EPS: f64 = 0.05;
const AREA: f64 = 320.0 * 240.0;
const VARIANCE: f64 = 0.36;

fn exact() -> Likelihood {
    Likelihood {
        outlier_share: EPS,
        form: LikelihoodForm::Exact,
    }
}

fn printed() -> Likelihood {
    Likelihood {
        form: LikelihoodForm::Printed,
        ..exact()
    }
}

/// An uncertain point, its geometry, the pose that sees it, its pixel and J G J^T by differences.
fn seen() -> (
    Landmark,
    LandmarkGeometry,
    CameraPose,
    Vector2<f64>,
    Matrix2<f64>,
) {
    let at = pose(0.3, 0.1, 0.4);
    let factor = Matrix3::new(0.02, 0.0, 0.0, 0.01, 0.015, 0.0, -0.01, 0.005, 0.01);
    let landmark = point(
        ahead(&place(&at), 0.1, -0.05, 3.0),
        factor * factor.transpose(),
    );
    let geometry = LandmarkGeometry::Point;
    let camera = place(&at);
    let mut jacobian = nalgebra::Matrix2x3::zeros();
    for j in 0..3 {
        let mut step = Vector3::zeros();
        step[j] = 1e-6;
        let d =
            pixel_of(&camera, &(landmark.mean + step)) - pixel_of(&camera, &(landmark.mean - step));
        jacobian.set_column(j, &(d / 2e-6));
    }
    let covariance = jacobian * landmark.covariance * jacobian.transpose();
    (
        landmark,
        geometry,
        at,
        pixel_of(&camera, &landmark.mean),
        covariance,
    )
}

/// Integral of exp(log) over a window of +-8 deviations around the prediction: (value, area).
fn integral(likelihood: &Likelihood) -> (f64, f64) {
    let (landmark, geometry, at, predicted, covariance) = seen();
    let sigma = (covariance + Matrix2::identity() * VARIANCE)
        .diagonal()
        .map(f64::sqrt);
    // The trapezoid rule of a Gaussian converges faster than any power: 4 points a deviation do.
    const HALF: i32 = 32;
    let step = sigma * 0.25;
    let mut sum = 0.0;
    for i in -HALF..=HALF {
        for j in -HALF..=HALF {
            let pixel = predicted + Vector2::new(f64::from(i) * step.x, f64::from(j) * step.y);
            let m = prepared(geometry, &landmark, pixel, VARIANCE, Scoring::Full);
            sum += likelihood.log(&rig(), &at, &[Some(m)]).exp();
        }
    }
    let cells = f64::from((2 * HALF + 1).pow(2));
    (sum * step.x * step.y, cells * step.x * step.y)
}

#[test]
fn exact_form_is_a_density_over_the_image() {
    let (value, area) = integral(&exact());
    let expected = (1.0 - EPS) + EPS * area / AREA;
    // The tail beyond 8 deviations is below 1e-14.
    assert!(
        (value - expected).abs() < 1e-9,
        "{value} against {expected}"
    );
    // Eq. 29 as printed is none: clipped, it does not even fall off.
    let (value, area) = integral(&printed());
    assert!(value > 0.2 * area, "{value} over {area} square pixels");
}

#[test]
fn determinant_is_in_the_exact_form_only() {
    let (landmark, geometry, at, predicted, covariance) = seen();
    let wide = Landmark {
        covariance: landmark.covariance * 9.0,
        ..landmark
    };
    let at_centre = |l: &Likelihood, landmark: &Landmark| {
        l.log(
            &rig(),
            &at,
            &[Some(prepared(
                geometry,
                landmark,
                predicted,
                VARIANCE,
                Scoring::Full,
            ))],
        )
    };
    let noise = Matrix2::identity() * VARIANCE;
    let no_outliers = Likelihood {
        outlier_share: 1e-30,
        ..exact()
    };
    let drop = at_centre(&no_outliers, &landmark) - at_centre(&no_outliers, &wide);
    let expected =
        0.5 * ((covariance * 9.0 + noise).determinant() / (covariance + noise).determinant()).ln();
    assert!(
        expected > 1.0 && (drop - expected).abs() < 1e-7,
        "{drop} {expected}"
    );
    assert_eq!(
        at_centre(&printed(), &landmark),
        at_centre(&printed(), &wide)
    );
}

#[test]
fn exact_log_is_the_mixture() {
    let (landmark, geometry, at, predicted, covariance) = seen();
    for (id, offset) in [
        Vector2::new(0.0, 0.0),
        Vector2::new(3.0, -2.0),
        Vector2::new(-6.0, 5.0),
        Vector2::new(2.0, 3.0),
    ]
    .into_iter()
    .enumerate()
    {
        let noise = noise_of(&noise_root(VARIANCE.sqrt(), id as u32));
        let s = covariance + noise.covariance();
        let m = Prepared {
            noise,
            ..prepared(
                geometry,
                &landmark,
                predicted + offset,
                VARIANCE,
                Scoring::Full,
            )
        };
        let squared = offset.dot(&s.cholesky().unwrap().solve(&offset));
        let density = (-0.5 * squared).exp() / (core::f64::consts::TAU * s.determinant().sqrt());
        let expected = ((1.0 - EPS) * density + EPS / AREA).ln();
        assert!((exact().log(&rig(), &at, &[Some(m)]) - expected).abs() < 1e-6);
    }
}

#[test]
fn wrong_match_costs_a_constant() {
    let (landmark, geometry, at, predicted, _) = seen();
    let wrong = (EPS / AREA).ln();
    for far in [50.0, 100.0, 1e4] {
        let pixel = predicted + Vector2::new(far, -far);
        let m = prepared(geometry, &landmark, pixel, VARIANCE, Scoring::Full);
        assert!(
            (exact().log(&rig(), &at, &[Some(m)]) - wrong).abs() < 1e-12,
            "{far} px"
        );
    }
    // A landmark the particle lacks, or that lies behind it, is a wrong match.
    assert_eq!(exact().log(&rig(), &at, &[None]), wrong);
    let behind = point(at.centre * 2.0 - landmark.mean, landmark.covariance);
    let m = prepared(geometry, &behind, predicted, VARIANCE, Scoring::Full);
    assert_eq!(exact().log(&rig(), &at, &[Some(m)]), wrong);
    assert_eq!(printed().log(&rig(), &at, &[None]), -1.5);
    assert_eq!(printed().log(&rig(), &at, &[Some(m)]), -1.5);
    // Matches add.
    assert_eq!(
        exact().log(&rig(), &at, &[None, None, Some(m)]),
        3.0 * wrong
    );
    assert_eq!(exact().log(&rig(), &at, &[]), 0.0);
}

#[test]
fn printed_form_clips_at_three_without_pixel_noise() {
    let (landmark, geometry, at, predicted, covariance) = seen();
    let root = covariance.cholesky().unwrap().l();
    for (deviations, expected) in [
        (0.5, -0.125),
        (1.0, -0.5),
        (1.7, -1.445),
        (1.8, -1.5),
        (30.0, -1.5),
    ] {
        let pixel = predicted + root * Vector2::new(0.6, 0.8) * deviations;
        let m = prepared(geometry, &landmark, pixel, VARIANCE, Scoring::Full);
        let log = printed().log(&rig(), &at, &[Some(m)]);
        // The floor of the printed covariance, 1e-6 px^2, and differences of 1e-6.
        assert!(
            (log - expected).abs() < 1e-5,
            "{deviations}: {log} against {expected}"
        );
    }
}

fn se3(camera: &PlacedCamera) -> Se3 {
    Se3::new(
        Rotation3::from_matrix_unchecked(camera.camera_from_world.transpose()),
        camera.centre,
    )
}

#[test]
fn printed_epipolar_term_is_the_symmetric_distance() {
    let mut rng = rng(41);
    for _ in 0..200 {
        let from = random_pose(&mut rng);
        let anchor = place(&from);
        let at = near(&mut rng, &from);
        let geometry = LandmarkGeometry::InverseDepth { anchor };
        let first = Vector2::new(uniform(&mut rng, 0.0, 320.0), uniform(&mut rng, 0.0, 240.0));
        let second = Vector2::new(uniform(&mut rng, 0.0, 320.0), uniform(&mut rng, 0.0, 240.0));
        let landmark = Landmark::from_first_sighting(
            &pinhole(),
            0,
            &first,
            &PixelNoise::round(0.5),
            OPEN_DEPTH,
        );
        let m = prepared(
            geometry,
            &landmark,
            second,
            VARIANCE,
            Scoring::AcrossEpipolar,
        );
        let pair = EpipolarPair::new(&pinhole(), &se3(&anchor), &se3(&place(&at))).unwrap();
        let expected = -0.5 * pair.symmetric_distance_px(&first, &second).unwrap();
        let log = printed().log(&rig(), &at, &[Some(m)]);
        // Two lines from rotations and a baseline of decimetres, pixels of hundreds.
        assert!(
            (log - expected).abs() < 1e-8 * (1.0 + expected.abs()),
            "{log} against {expected}"
        );
    }
    // Without a baseline there is no line and no score.
    let at = pose(0.0, 0.0, 0.2);
    let landmark = Landmark::from_first_sighting(
        &pinhole(),
        0,
        &Vector2::new(9.0, 9.0),
        &PixelNoise::round(0.5),
        OPEN_DEPTH,
    );
    let geometry = LandmarkGeometry::InverseDepth { anchor: place(&at) };
    let m = prepared(
        geometry,
        &landmark,
        Vector2::new(200.0, 30.0),
        VARIANCE,
        Scoring::AcrossEpipolar,
    );
    assert_eq!(printed().log(&rig(), &at, &[Some(m)]), 0.0);
}

#[test]
fn open_depth_is_scored_across_its_line() {
    let anchor_pose = pose(0.0, 0.0, 0.0);
    let geometry = LandmarkGeometry::InverseDepth {
        anchor: place(&anchor_pose),
    };
    let at = pose(0.2, 0.0, 0.0);
    let landmark = Landmark::from_first_sighting(
        &pinhole(),
        0,
        &Vector2::new(180.0, 120.0),
        &PixelNoise::round(0.5),
        OPEN_DEPTH,
    );
    let score = |dx: f64, dy: f64| {
        let on_line = project(
            &place(&at),
            &geometry,
            &Vector3::new(landmark.mean.x, landmark.mean.y, 0.4),
        );
        let pixel = on_line + Vector2::new(dx, dy);
        exact().log(
            &rig(),
            &at,
            &[Some(prepared(
                geometry,
                &landmark,
                pixel,
                VARIANCE,
                Scoring::AcrossEpipolar,
            ))],
        )
    };
    // Driving sideways the line is horizontal: along it nothing is told.
    for dx in [-8.0, 5.0, 8.0] {
        assert!((score(dx, 0.0) - score(0.0, 0.0)).abs() < 1e-9);
    }
    // Across it a one-dimensional density of both sightings' noise.
    let variance = VARIANCE + 0.25;
    let mixture = |d: f64| {
        let density = (-0.5 * d * d / variance).exp() / (core::f64::consts::TAU * variance).sqrt();
        ((1.0 - EPS) * density + EPS / AREA.sqrt()).ln()
    };
    for dy in [0.0, 0.7, -2.0, 40.0] {
        assert!(
            (score(3.0, dy) - mixture(dy)).abs() < 1e-9,
            "{dy} px across"
        );
    }
}
