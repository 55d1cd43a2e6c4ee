//! The motion prior against an independent SE(2) composition and Monte Carlo.

use crate::filter::motion::{CarrierModel, NoiseFactors};
use crate::filter::particle::Particle;
use crate::filter::pose::{CameraPose, PoseMatrix, PoseStep};
use crate::odometry::Control;
use estimation_base::Manifold;
use mono_geometry::Se2;
use nalgebra::{SVector, Vector2};

use super::common::*;

const LEVER: Vector2<f64> = Vector2::new(0.25, -0.15);

fn carrier() -> CarrierModel {
    CarrierModel {
        tilt_sigma: 0.006,
        tilt_time_s: 0.5,
        slope_sigma: 0.01,
        scale_drift: 0.01,
        scale_sigma: 0.05,
        turn_bias_sigma: 0.0,
        turning_centre_sigma_m: 0.0,
        noise: NoiseFactors::NOMINAL,
    }
}

/// Camera (x, y, phi) after the body moved by `d`, composed from the body's poses in metres.
fn moved(from: &CameraPose, lever: &Vector2<f64>, scale: f64, d: [f64; 3]) -> (f64, f64, f64) {
    let turned = Se2::new(0.0, 0.0, from.phi).act(lever);
    let body = Se2::new(
        from.centre.x * scale - turned.x,
        from.centre.y * scale - turned.y,
        from.phi,
    )
    .compose(&Se2::new(d[0], d[1], d[2]));
    let camera = body.act(lever);
    (camera.x / scale, camera.y / scale, body.phi)
}

#[test]
fn mean_is_the_body_motion_with_its_lever_arm() {
    let mut rng = rng(11);
    for _ in 0..300 {
        let mut p = particle(random_pose(&mut rng));
        p.metric.mean.x = uniform(&mut rng, 0.7, 1.4);
        let d = [
            uniform(&mut rng, -0.5, 0.5),
            uniform(&mut rng, -0.1, 0.1),
            uniform(&mut rng, -1.0, 1.0),
        ];
        let prior = carrier().prior(&LEVER, &p.departure(), &control(d, [0.01, 0.01, 0.01]));
        let (x, y, phi) = moved(&p.pose, &LEVER, p.metric.mean.x, d);
        let m = &prior.mean;
        assert!((m.centre.x - x).abs() < 1e-13 && (m.centre.y - y).abs() < 1e-13);
        assert!(estimation_base::wrap(m.phi - phi).abs() < 1e-13);
        assert_eq!(m.centre.z, p.pose.centre.z);
        // A tilt decays with its time constant.
        let keep = (-0.1_f64 / 0.5).exp();
        assert!((m.roll - p.pose.roll * keep).abs() < 1e-15);
        assert!((m.pitch - p.pose.pitch * keep).abs() < 1e-15);
    }
}

#[test]
fn covariance_is_that_of_odometry_and_scale() {
    let mut rng = rng(12);
    for (case, scale) in [0.8, 1.0, 1.3].into_iter().enumerate() {
        let mut p = particle(random_pose(&mut rng));
        p.metric.mean.x = scale;
        let scale_sigma = 0.03 * scale;
        p.metric.covariance[(0, 0)] = scale_sigma * scale_sigma;
        let mut u = control([0.4, 0.02, 0.3], [0.01, 0.004, 0.02]);
        // Heading and sideways error of an arc go together.
        u.covariance[(1, 2)] = 0.5 * 0.004 * 0.02;
        u.covariance[(2, 1)] = u.covariance[(1, 2)];
        let model = carrier();
        let prior = model.prior(&LEVER, &p.departure(), &u);
        let drift = model.scale_drift * scale;
        let drifted = (scale_sigma * scale_sigma + drift * drift * u.distance_m).sqrt();
        let factor = u.covariance.cholesky().unwrap().l();
        let draws: Vec<SVector<f64, 3>> = (0..40_000)
            .map(|_| {
                let noise = factor * SVector::<f64, 3>::from_fn(|_, _| normal(&mut rng));
                let d = [0.4 + noise[0], 0.02 + noise[1], 0.3 + noise[2]];
                // The particle's unit is scale metres, whatever the true factor: only the step is scaled.
                let s = scale + drifted * normal(&mut rng);
                let unit = moved(
                    &CameraPose {
                        centre: SVector::zeros(),
                        ..p.pose
                    },
                    &LEVER,
                    1.0,
                    d,
                );
                let rest = moved(
                    &CameraPose {
                        centre: SVector::zeros(),
                        ..p.pose
                    },
                    &LEVER,
                    1.0,
                    [0.0; 3],
                );
                let step = Vector2::new(unit.0 - rest.0, unit.1 - rest.1) / s;
                let drawn = CameraPose {
                    centre: p.pose.centre + step.push(0.0),
                    phi: unit.2,
                    ..prior.mean
                };
                let local = prior.mean.local(&drawn);
                SVector::<f64, 3>::new(local[0], local[1], local[3])
            })
            .collect();
        let full = prior.factor * prior.factor.transpose();
        let planar = full
            .select_rows(&[0, 1, 3])
            .select_columns(&[0, 1, 3])
            .fixed_view::<3, 3>(0, 0)
            .into_owned();
        // Second order in 0.03 of scale and 0.02 rad of heading: a few 1e-3.
        assert_sample_covariance(&draws, &planar, 5e-3);
        // The scale's own drift alone, and what is not told by odometry.
        assert!((prior.scale_drift_variance - drift * drift * u.distance_m).abs() < 1e-18);
        let height = model.slope_sigma * u.distance_m / scale;
        assert!(
            (full[(2, 2)].sqrt() / height - 1.0).abs() < 1e-3,
            "case {case}"
        );
    }
}

#[test]
fn tilt_keeps_its_standard_deviation() {
    // keep^2 sigma^2 + added = sigma^2: the process is stationary, whatever the step.
    for dt_s in [0.01, 0.3, 4.0] {
        let u = Control {
            dt_s,
            ..control([0.1, 0.0, 0.0], [0.01; 3])
        };
        let mut p = particle(pose(0.0, 0.0, 0.0));
        p.pose.roll = 1.0;
        let prior = carrier().prior(&LEVER, &p.departure(), &u);
        let added = (prior.factor * prior.factor.transpose())[(4, 4)];
        let variance = prior.mean.roll.powi(2) * 0.006_f64.powi(2) + added;
        // The floor of a tenth of a milliradian is a 1/3600 of the variance.
        assert!(
            (variance / 0.006_f64.powi(2) - 1.0).abs() < 1e-3,
            "dt {dt_s}: {variance:e}"
        );
    }
}

fn assert_factor(name: &str, factor: &PoseMatrix) {
    for i in 0..6 {
        assert!(
            factor[(i, i)] > 0.0 && factor[(i, i)].is_finite(),
            "{name}: row {i}"
        );
        for j in i + 1..6 {
            assert_eq!(factor[(i, j)], 0.0, "{name}: not lower triangular");
        }
    }
    let covariance = factor * factor.transpose();
    assert!(covariance.cholesky().is_some(), "{name}");
}

#[test]
fn covariance_is_regular_at_rest_and_strictly_planar() {
    let p = particle(pose(0.3, 0.4, 3.1));
    let rest = Control {
        dt_s: 0.0,
        ..control([0.0; 3], [0.0; 3])
    };
    let fast = control([3.0, 0.0, 0.5], [0.5, 0.1, 0.3]);
    let planar = planar_carrier();
    for (name, model, u) in [
        ("at rest", carrier(), rest),
        ("planar at rest", planar, rest),
        ("planar and fast", planar, fast),
        ("fast", carrier(), fast),
    ] {
        let prior = model.prior(&LEVER, &p.departure(), &u);
        assert_factor(name, &prior.factor);
    }
    // The off-diagonal part is in: a turn error moves the camera on its lever.
    let prior = planar.prior(
        &LEVER,
        &p.departure(),
        &control([0.0, 0.0, 0.0], [0.0, 0.0, 0.1]),
    );
    let covariance = prior.factor * prior.factor.transpose();
    let (sin, cos) = 3.1_f64.sin_cos();
    let rate = Vector2::new(
        -sin * LEVER.x - cos * LEVER.y,
        cos * LEVER.x - sin * LEVER.y,
    );
    assert!((covariance[(0, 3)] - 0.01 * rate.x).abs() < 1e-15);
    assert!((covariance[(1, 3)] - 0.01 * rate.y).abs() < 1e-15);
    // Pinned states move by less than a micrometre.
    assert!(covariance[(2, 2)] < 1e-12 && covariance[(4, 4)] < 1e-12);
}

#[test]
fn log_density_is_the_quadratic_form_across_the_seam() {
    let p: Particle = particle(pose(0.0, 0.0, core::f64::consts::PI - 0.01));
    let prior = carrier().prior(
        &LEVER,
        &p.departure(),
        &control([0.2, 0.0, 0.005], [0.02, 0.01, 0.02]),
    );
    let covariance = prior.factor * prior.factor.transpose();
    let mut rng = rng(13);
    for _ in 0..100 {
        let step: PoseStep = prior.factor * PoseStep::from_fn(|_, _| 2.0 * normal(&mut rng));
        let at = prior.mean.retract(&step);
        let quadratic = step.dot(&covariance.cholesky().unwrap().solve(&step));
        let log = prior.log_density(&at);
        assert!(
            (log + 0.5 * quadratic).abs() < 1e-9 * (1.0 + quadratic),
            "{log} {quadratic}"
        );
    }
    assert_eq!(prior.log_density(&prior.mean), 0.0);
}

/// The gains of the constants and of the departure are the derivatives of the mean.
#[test]
fn gains_match_differences() {
    let mut rng = rng(14);
    for _ in 0..50 {
        let mut p = particle(random_pose(&mut rng));
        p.metric.mean[0] = uniform(&mut rng, 0.7, 1.4);
        p.metric.mean[3] = uniform(&mut rng, -0.1, 0.1);
        p.metric.mean[4] = uniform(&mut rng, -0.5, 0.5);
        let mut u = control([0.3, 0.05, uniform(&mut rng, -1.0, 1.0)], [0.01; 3]);
        u.turn_bias_gain = nalgebra::Vector3::new(0.002, 0.015, 0.1);
        let departure = p.departure();
        let model = carrier();
        let prior = model.prior(&LEVER, &departure, &u);
        let h = 1e-6;
        for constant in 0..3 {
            let at = |step: f64| {
                let mut d = departure;
                d.constants[constant] += step;
                prior.mean.local(&model.prior(&LEVER, &d, &u).mean)
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            // The heading of the step is linear in the bias; the position turns with it only in the lever arm.
            assert!(
                (difference - prior.gains.column(constant)).norm() < 1e-8,
                "constant {constant}: {difference} {}",
                prior.gains.column(constant)
            );
        }
        let derivative = prior.by_departure(&departure.pose);
        for axis in 0..6 {
            let at = |step: f64| {
                let mut d = departure;
                let mut tangent = PoseStep::zeros();
                tangent[axis] = step;
                d.pose = d.pose.retract(&tangent);
                prior.mean.local(&model.prior(&LEVER, &d, &u).mean)
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!(
                (difference - derivative.column(axis)).norm() < 1e-8,
                "axis {axis}"
            );
        }
    }
}

/// A body whose origin lies behind the point that does not slip moves sideways, away from the turn's centre.
#[test]
fn an_origin_behind_the_turning_centre_moves_out_of_the_curve() {
    let mut p = particle(pose(0.0, 0.0, 0.0));
    p.metric.mean[4] = 0.6;
    let turn = 0.2;
    let prior = carrier().prior(
        &Vector2::zeros(),
        &p.departure(),
        &control([0.0, 0.0, turn], [0.01; 3]),
    );
    // The turning centre stays at (0.6, 0); the origin is 0.6 m behind it along the new heading.
    assert!((prior.mean.centre.x - (0.6 - 0.6 * turn.cos())).abs() < 1e-15);
    assert!((prior.mean.centre.y + 0.6 * turn.sin()).abs() < 1e-15);
}

/// The factors act on their own body axes, whatever the heading.
#[test]
fn noise_factors_scale_the_body_axes() {
    let p = particle(pose(0.0, 0.0, 2.1));
    let u = control([0.2, 0.0, 0.0], [0.02, 0.03, 0.01]);
    let body_sigmas = |noise: NoiseFactors| {
        let model = CarrierModel { noise, ..carrier() };
        let prior = model.prior(&Vector2::zeros(), &p.departure(), &u);
        let (sin, cos) = 2.1_f64.sin_cos();
        let left = PoseStep::from([-sin, cos, 0.0, 0.0, 0.0, 0.0]);
        let covariance = prior.factor * prior.factor.transpose();
        (
            left.dot(&(covariance * left)).sqrt(),
            covariance[(3, 3)].sqrt(),
        )
    };
    let nominal = body_sigmas(NoiseFactors::NOMINAL);
    let wide = body_sigmas(NoiseFactors {
        sideways: 3.0,
        heading: 5.0,
        ..NoiseFactors::NOMINAL
    });
    // The floors of a tenth of a millimetre and milliradian do not grow.
    assert!(
        (wide.0 / nominal.0 - 3.0).abs() < 1e-3,
        "{wide:?} {nominal:?}"
    );
    assert!((wide.1 / nominal.1 - 5.0).abs() < 1e-3);
}
