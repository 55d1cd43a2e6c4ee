//! The marginalised scale and metric position of a particle.

use crate::filter::metric::MetricState;
use crate::filter::motion::CarrierModel;
use crate::filter::particle::Particle;
use estimation_base::Manifold;
use nalgebra::Vector2;

use super::common::*;

fn open_scale(scale_sigma: f64) -> CarrierModel {
    CarrierModel {
        scale_sigma,
        ..planar_carrier()
    }
}

#[test]
fn scale_is_the_weighted_least_squares_of_odometry_on_images() {
    // Straight steps of visual length c_k: odometry reads d_k = s c_k + e_k, so with prior N(1, v)
    // 1 / v_n = 1 / v + sum c^2 / q and s_n = v_n (1 / v + sum c d / q).
    // The filter linearises 1 / s at every step; with s - 1 of 2e-3 and e / c of 1e-3 the left-out
    // second order is a few 1e-6 of s, a hundredth of the posterior deviation.
    let (true_scale, v, read_sigma) = (1.002, 0.02_f64.powi(2), 2e-4);
    let mut rng = rng(21);
    let model = open_scale(0.02);
    let mut p = Particle::new(pose(0.0, 0.0, 0.0), MetricState::new(&model));
    let (mut information, mut vector) = (1.0 / v, 1.0 / v);
    let mut floor_free = 0.0;
    for _ in 0..12 {
        let c = uniform(&mut rng, 0.1, 0.3);
        let d = true_scale * c + read_sigma * normal(&mut rng);
        let prior = model.prior(
            &Vector2::zeros(),
            &p.departure(),
            &control([d, 0.0, 0.0], [read_sigma, 1e-3, 1e-3]),
        );
        // What the reading is worth includes the floor of the prior.
        let q = read_sigma * read_sigma + (1e-4 * p.metric.scale()).powi(2);
        information += c * c / q;
        vector += c * d / q;
        let mut next = prior.mean;
        next.centre.x = p.pose.centre.x + c;
        p.metric = p.metric.condition_on_pose(&prior, &next);
        p.pose = next;
        floor_free += c;
    }
    let (mean, sigma) = (vector / information, (1.0 / information).sqrt());
    let got = p.metric;
    assert!(sigma < 0.02 / 30.0, "the steps tell much: {sigma:e}");
    assert!(
        (got.scale() - mean).abs() < 0.05 * sigma,
        "{} against {mean}, sigma {sigma:e}",
        got.scale()
    );
    assert!((got.constants_covariance()[(0, 0)].sqrt() / sigma - 1.0).abs() < 0.01);
    // Given the path, the position is the scale times the path: fully correlated with it.
    assert!((got.position().x - got.scale() * floor_free).abs() < 1e-9);
    assert!(
        (got.position_covariance()[(0, 0)].sqrt()
            - floor_free * got.constants_covariance()[(0, 0)].sqrt())
        .abs()
            < 1e-9
    );
    assert!(got.position_covariance()[(1, 1)].abs() < 1e-18);
}

#[test]
fn without_scale_variance_the_body_is_the_camera_less_its_lever() {
    let mut rng = rng(22);
    let lever = Vector2::new(0.3, -0.2);
    let model = planar_carrier();
    let mut p = Particle::new(pose(lever.x, lever.y, 0.0), MetricState::new(&model));
    for _ in 0..100 {
        let d = [
            uniform(&mut rng, 0.0, 0.3),
            0.0,
            uniform(&mut rng, -0.4, 0.4),
        ];
        let prior = model.prior(&lever, &p.departure(), &control(d, [0.02, 0.01, 0.05]));
        let next = prior
            .mean
            .retract(&(prior.factor * nalgebra::SVector::from_fn(|_, _| normal(&mut rng))));
        p.metric = p.metric.condition_on_pose(&prior, &next);
        p.pose = next;
        let (sin, cos) = next.phi.sin_cos();
        let body = p.metric.body(next.phi);
        assert!((body.x - (next.centre.x - cos * lever.x + sin * lever.y)).abs() < 1e-12);
        assert!((body.y - (next.centre.y - sin * lever.x - cos * lever.y)).abs() < 1e-12);
        assert_eq!(p.metric.scale(), 1.0);
        assert_eq!(p.metric.covariance, nalgebra::SMatrix::<f64, 5, 5>::zeros());
    }
}

#[test]
fn turning_in_place_moves_the_camera_and_not_the_body() {
    let lever = Vector2::new(0.0, 0.4);
    let model = open_scale(0.05);
    let mut p = Particle::new(pose(lever.x, lever.y, 0.0), MetricState::new(&model));
    for _ in 0..63 {
        let prior = model.prior(
            &lever,
            &p.departure(),
            &control([0.0, 0.0, 0.1], [0.0, 0.0, 0.01]),
        );
        let next = prior.mean;
        p.metric = p.metric.condition_on_pose(&prior, &next);
        p.pose = next;
        let body = p.metric.body(next.phi);
        assert!(body.x.hypot(body.y) < 1e-12, "body at {body:?}");
    }
    assert!((p.pose.centre.xy() - lever).norm() < 0.01, "once around");
    // The lever arm is known in metres, so turning tells the scale: 0.4 m of arc each 0.1 mm sure.
    assert!(p.metric.constants_covariance()[(0, 0)].sqrt() < 0.05 / 5.0);
}

#[test]
fn covariance_stays_positive_over_a_thousand_steps() {
    let mut rng = rng(23);
    let lever = Vector2::new(0.2, 0.1);
    let model = CarrierModel {
        scale_drift: 0.01,
        ..open_scale(0.05)
    };
    let mut p = Particle::new(pose(lever.x, lever.y, 0.0), MetricState::new(&model));
    for step in 0..1000 {
        let d = [
            uniform(&mut rng, 0.0, 0.3),
            0.0,
            uniform(&mut rng, -0.3, 0.3),
        ];
        let prior = model.prior(
            &lever,
            &p.departure(),
            &control(d, [0.05 * d[0], 1e-3, 0.012]),
        );
        // Images leave a tenth of the prior's spread.
        let noise = nalgebra::SVector::from_fn(|_, _| 0.1 * normal(&mut rng));
        let next = prior.mean.retract(&(prior.factor * noise));
        p.metric = p.metric.condition_on_pose(&prior, &next);
        p.pose = next;
        let covariance = p.metric.covariance;
        assert_eq!(covariance, covariance.transpose(), "step {step}");
        let lowest = covariance.symmetric_eigenvalues().min();
        assert!(
            lowest > -1e-14 * covariance.norm(),
            "step {step}: {lowest:e}"
        );
        assert!(covariance[(0, 0)] > 0.0 && covariance.iter().all(|v| v.is_finite()));
        assert!(
            (0.5..2.0).contains(&p.metric.scale()),
            "step {step}: scale {}",
            p.metric.scale()
        );
    }
}

/// The constants and the position are those of weighted least squares over all steps, solved at once.
#[test]
fn val_constants_are_those_of_batch_least_squares() {
    let mut rng = rng(24);
    let lever = Vector2::new(0.2, -0.1);
    let model = CarrierModel {
        turn_bias_sigma: 0.01,
        turning_centre_sigma_m: 0.2,
        ..open_scale(0.02)
    };
    // Small constants, so that the linearisation of the filter and that of the batch are one.
    let truth = nalgebra::Vector3::new(1.0005, 2e-3, 0.01);
    let mut p = Particle::new(pose(lever.x, lever.y, 0.0), MetricState::new(&model));
    let first = p.metric.constants();
    let mut information = p.metric.constants_covariance().try_inverse().unwrap();
    let mut vector = nalgebra::Vector3::zeros();
    for _ in 0..40 {
        let u = control(
            [
                uniform(&mut rng, 0.0, 0.3),
                0.0,
                uniform(&mut rng, -0.4, 0.4),
            ],
            [2e-3, 1e-3, 2e-3],
        );
        // The pose that the true constants make, with the noise of the odometry.
        let mut departure = p.departure();
        departure.constants = truth;
        departure.constants_covariance.fill(0.0);
        let exact = model.prior(&lever, &departure, &u);
        let noise = nalgebra::SVector::from_fn(|_, _| normal(&mut rng));
        let next = exact.mean.retract(&(exact.factor * noise));
        // Linear in the constants about their first values.
        departure.constants = first;
        let linear = model.prior(&lever, &departure, &u);
        let weighted = linear.factor.solve_lower_triangular(&linear.gains).unwrap();
        let innovation = linear
            .factor
            .solve_lower_triangular(&linear.mean.local(&next))
            .unwrap();
        information += weighted.tr_mul(&weighted);
        vector += weighted.tr_mul(&innovation);
        let prior = model.prior(&lever, &p.departure(), &u);
        p.metric = p.metric.condition_on_pose(&prior, &next);
        p.pose = next;
    }
    let covariance = information.try_inverse().unwrap();
    let mean = first + covariance * vector;
    let got = p.metric;
    for i in 0..3 {
        let sigma = covariance[(i, i)].sqrt();
        assert!(
            (got.constants()[i] - mean[i]).abs() < 0.05 * sigma,
            "constant {i}: {} against {} +- {sigma}",
            got.constants()[i],
            mean[i]
        );
        assert!((got.constants_covariance()[(i, i)].sqrt() / sigma - 1.0).abs() < 0.02);
        assert!((got.constants()[i] - truth[i]).abs() < 4.0 * sigma);
        assert!(
            sigma < 0.7 * model_sigma(&model, i),
            "the steps tell of {i}"
        );
    }
}

fn model_sigma(model: &CarrierModel, constant: usize) -> f64 {
    [
        model.scale_sigma,
        model.turn_bias_sigma,
        model.turning_centre_sigma_m,
    ][constant]
}
