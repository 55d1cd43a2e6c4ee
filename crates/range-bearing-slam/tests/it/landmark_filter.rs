//! The landmark filters equal the Kalman update where the sensor is linear, and are close to the truth
//! where it is not.

use crate::fixtures::{Offset, SHEAR, gaussian};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use range_bearing_slam::{
    ExtendedLandmarks, Gaussian, InverseObservation, LandmarkFilter, ObservationJacobians,
    ObservationModel, RangeBearing, UnscentedLandmarks,
};
use rbpf_core::{Purpose, Streams};
use std::f64::consts::{PI, TAU};

/// Every landmark filter there is.
fn all<S, const D: usize>() -> Vec<(&'static str, Box<dyn LandmarkFilter<S, D, 2, 2>>)>
where
    S: ObservationJacobians<D, 2, 2> + InverseObservation<D, 2, 2>,
{
    vec![
        ("extended", Box::new(ExtendedLandmarks)),
        ("unscented", Box::new(UnscentedLandmarks)),
    ]
}

/// Against the information form, which shares no step with either filter. Numbers of order one, a few
/// dozen operations: 1e-13.
#[test]
fn a_linear_sensor_gives_the_kalman_update() {
    let inverse = |m: Matrix2<f64>| m.try_inverse().unwrap();
    let (pose, z) = (Vector2::new(0.3, -0.2), Vector2::new(1.2, 1.9));
    let noise = Offset.noise();
    let prior = gaussian(2.0, 1.0, Matrix2::new(0.4, 0.1, 0.1, 0.2));
    let weighted = SHEAR.transpose() * inverse(noise);
    let covariance = inverse(inverse(prior.covariance) + weighted * SHEAR);
    let mean =
        covariance * (inverse(prior.covariance) * prior.mean + weighted * (z + SHEAR * pose));
    let innovation = z - SHEAR * (prior.mean - pose);
    let s = SHEAR * prior.covariance * SHEAR.transpose() + noise;
    let nis = innovation.dot(&(inverse(s) * innovation));
    let log_likelihood = -0.5 * (nis + s.determinant().ln()) - TAU.ln();
    for (name, filter) in all::<Offset, 2>() {
        let update = filter.update(&Offset, &pose, &z, &prior).unwrap().unwrap();
        assert!((update.posterior.mean - mean).amax() < 1e-13, "{name}");
        let difference = update.posterior.covariance - covariance;
        assert!(difference.amax() < 1e-13, "{name}: {difference}");
        assert!((update.nis - nis).abs() < 1e-13, "{name}");
        assert!((update.log_likelihood - log_likelihood).abs() < 1e-13);
        // S without R, as printed in the paper, is another update by far
        let without = inverse(s - noise);
        let gain = prior.covariance * SHEAR.transpose() * without;
        assert!((prior.mean + gain * innovation - mean).amax() > 0.1);

        let start = filter.start(&Offset, &pose, &z).unwrap().unwrap();
        let back = inverse(SHEAR);
        assert!((start.mean - pose - back * z).amax() < 1e-13);
        let difference = start.covariance - back * noise * back.transpose();
        assert!(difference.amax() < 1e-13, "{name}");
        // a known landmark stays, an update of nothing known is a start
        let known = Gaussian {
            covariance: Matrix2::zeros(),
            ..prior
        };
        let update = filter.update(&Offset, &pose, &z, &known).unwrap().unwrap();
        assert_eq!(update.posterior, known);
        let unknown = Gaussian {
            covariance: Matrix2::identity() * 1e6,
            ..prior
        };
        let update = filter
            .update(&Offset, &pose, &z, &unknown)
            .unwrap()
            .unwrap();
        // the prior weighs 1e-6 of the measurement, some units away
        assert!((update.posterior.mean - start.mean).amax() < 1e-5, "{name}");
        assert!((update.posterior.covariance - start.covariance).amax() < 1e-5);
    }
}

/// A landmark at range r and bearing deviation s lies on a bent strip. Against draws, along and across the line of
/// sight. With t the range deviation the first terms that the filters miss are
///
/// - mean: r s^2 / 2 by Jacobians, r s^6 / 120 by sigma points;
/// - variance across: r^2 s^4 by Jacobians, s^2 t^2 + r^2 s^6 / 3 by sigma points;
/// - variance along: r^2 s^4 / 2 + s^2 t^2 for both, from either side (beta = 2 counts the bend twice).
#[test]
fn a_start_agrees_with_draws() {
    let (r, t, s) = (10.0_f64, 0.3_f64, 0.1_f64);
    let sensor = RangeBearing::new(t, s);
    let pose = Vector3::new(3.0, -4.0, 2.5);
    let z = Vector2::new(r, 0.8);
    // along and across the line of sight
    let (sin, cos) = (pose.z + z.y).sin_cos();
    let axes = Matrix2::new(cos, sin, -sin, cos);
    let mut rng = Streams::new(21).shared(0, Purpose::MeasurementNoise);
    let n = 400_000_u32;
    let draws: Vec<Vector2<f64>> = (0..n)
        .map(|_| {
            let mut draw = || rng.sample::<f64, _>(StandardNormal);
            let seen = z + Vector2::new(t * draw(), s * draw());
            axes * (sensor.locate(&pose, &seen).unwrap() - pose.xy())
        })
        .collect();
    let n = f64::from(n);
    let mean = draws.iter().sum::<Vector2<f64>>() / n;
    let scatter = |d: &Vector2<f64>| (d - mean) * (d - mean).transpose();
    let covariance = draws.iter().map(scatter).sum::<Matrix2<f64>>() / n;
    // five standard errors of a variance, var^2 (kurtosis - 1) / n, the kurtosis near 3 and below 6
    let error = |k: usize| 5.0 * covariance[(k, k)] * (5.0 / n).sqrt();
    let cross_error = 5.0 * (covariance[(0, 0)] * covariance[(1, 1)] * 3.0 / n).sqrt();
    for (name, filter) in all::<RangeBearing, 3>() {
        let start = filter.start(&sensor, &pose, &z).unwrap().unwrap();
        let shift = axes * (start.mean - pose.xy()) - mean;
        let difference = axes * start.covariance * axes.transpose() - covariance;
        let (mean_bias, across_bias) = if name == "extended" {
            (r * s.powi(2) / 2.0, r.powi(2) * s.powi(4))
        } else {
            (
                r * s.powi(6) / 120.0,
                s.powi(2) * t.powi(2) + r.powi(2) * s.powi(6) / 3.0,
            )
        };
        let along_bias = r.powi(2) * s.powi(4) / 2.0 + s.powi(2) * t.powi(2);
        let mean_error = |k: usize| 5.0 * (covariance[(k, k)] / n).sqrt();
        assert!(shift.x.abs() < mean_bias + mean_error(0), "{name} {shift}");
        assert!(shift.y.abs() < mean_error(1), "{name} {shift}");
        assert!(
            difference[(0, 0)].abs() < along_bias + error(0)
                && difference[(1, 1)].abs() < across_bias + error(1)
                && difference[(0, 1)].abs() < cross_error,
            "{name} {difference}"
        );
        if name == "extended" {
            // what sigma points are for
            assert!(shift.x > 0.9 * mean_bias && mean_bias > 10.0 * mean_error(0));
        }
    }
    // the bounds are far below what a wrong start would miss: the range variance left out
    assert!(t.powi(2) > 5.0 * (r.powi(2) * s.powi(4) / 2.0 + s.powi(2) * t.powi(2) + error(0)));
}

/// Central differences over a relative step e = 1e-5 of the distance r (of a radian for angles): truncation 2 e^2,
/// rounding 8 eps (coordinate / r + pi) / e; rows and columns scale with r.
#[test]
fn sensor_jacobians_are_the_differences_at_any_value() {
    let sensor = RangeBearing::new(0.1, 0.02);
    let mut rng = Streams::new(22).shared(0, Purpose::MeasurementNoise);
    let e = 1e-5;
    let headings = [0.0, PI, -PI, PI - 1e-7, 1e-7 - PI, PI / 2.0];
    // the distance and, seen from the pose, the direction: ahead, behind (bearing +-pi), along the axes
    let directions = [0.0, PI, -PI, PI + 1e-9, PI / 2.0, -PI / 2.0, 1e-9];
    let mut cases = vec![];
    for heading in headings {
        for direction in directions {
            for r in [1e-3, 1.0, 1e4] {
                cases.push((Vector3::new(1.0, -2.0, heading), direction, r));
            }
        }
    }
    for _ in 0..500 {
        let mut number = |scale: f64| scale * (2.0 * rng.random::<f64>() - 1.0);
        let pose = Vector3::new(number(100.0), number(100.0), number(PI));
        cases.push((pose, number(PI), 10_f64.powf(number(3.0))));
    }
    for (pose, direction, r) in cases {
        let (sin, cos) = (pose.z + direction).sin_cos();
        let landmark = pose.xy() + Vector2::new(cos, sin) * r;
        let size = pose.xy().amax() + r;
        let bound = 2.0 * e * e + 8.0 * f64::EPSILON * (size / r + PI) / e;
        let case = format!("{pose} {direction} {r}");
        let (h, g) = sensor.jacobians(&pose, &landmark).unwrap();
        let steps = Vector3::new(e * r, e * r, e);
        let between = |before: Option<Vector2<f64>>, after: Option<Vector2<f64>>| {
            sensor.innovation(&after.unwrap(), &before.unwrap())
        };
        let mut differences = Matrix2x3::zeros();
        for k in 0..3 {
            let step = Vector3::ith(k, steps[k]);
            let difference = between(
                sensor.predict(&(pose - step), &landmark),
                sensor.predict(&(pose + step), &landmark),
            );
            differences.set_column(k, &(difference / (2.0 * e)));
        }
        // in units of r for the range, of r for steps of the position
        let units = Matrix2::new(1.0 / r, 0.0, 0.0, 1.0);
        let scaled = units * h * nalgebra::Matrix3::from_diagonal(&(steps / e));
        assert!((units * differences - scaled).amax() < bound, "{case}");
        let mut differences = Matrix2::zeros();
        for k in 0..2 {
            let step = Vector2::ith(k, e * r);
            let difference = between(
                sensor.predict(&pose, &(landmark - step)),
                sensor.predict(&pose, &(landmark + step)),
            );
            differences.set_column(k, &(difference / (2.0 * e)));
        }
        assert!(
            (units * differences - units * g * r).amax() < bound,
            "{case}"
        );

        // the inverse: of order r in both columns
        let seen = sensor.predict(&pose, &landmark).unwrap();
        let j = sensor.locate_jacobian(&pose, &seen).unwrap();
        let mut differences = Matrix2::zeros();
        for (k, step) in [Vector2::new(e * r, 0.0), Vector2::new(0.0, e)]
            .iter()
            .enumerate()
        {
            let [before, after] =
                [seen - step, seen + step].map(|z| sensor.locate(&pose, &z).unwrap());
            differences.set_column(k, &((after - before) / (2.0 * e * r)));
        }
        let scaled = j * Matrix2::new(1.0, 0.0, 0.0, 1.0 / r);
        assert!((differences - scaled).amax() < bound, "{case}");
        assert!(
            (j * g - Matrix2::identity()).amax() < 32.0 * f64::EPSILON * (size / r + 1.0),
            "{case}"
        );
    }
}
