//! Odometry: the exact arc against integration, the bias of the printed form, covariances against Monte Carlo.

use mono_geometry::motion::{
    ControlNoise, OdometrySample, accumulate, exact_arc, held_between, paper_euler,
};
use mono_geometry::{GeometryError, Se2};
use nalgebra::{Matrix3, Vector2, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn sample(t_s: f64, v_mps: f64, omega_radps: f64) -> OdometrySample {
    OdometrySample {
        t_s,
        v_mps,
        omega_radps,
    }
}

#[test]
fn arc_is_the_limit_of_small_straight_steps() {
    for (v, omega, dt) in [
        (0.5, 0.8, 1.0),
        (-1.0, 2.0, 3.0),
        (0.3, 1e-9, 2.0),
        (1.0, 0.0, 1.0),
        (0.0, 1.0, 1.0),
    ] {
        let steps = 20_000;
        let mut pose = Se2::identity();
        let h = dt / f64::from(steps);
        for _ in 0..steps {
            // Midpoint rule: the error of the whole is of order h^2.
            let half = Se2::new(0.0, 0.0, 0.5 * omega * h);
            pose = pose
                .compose(&half)
                .compose(&Se2::new(v * h, 0.0, 0.0))
                .compose(&half);
        }
        let error = pose.between(&exact_arc(v, omega, dt)).log().norm();
        assert!(error < 1e-8, "{v} {omega} {dt}: {error}");
    }
}

/// The sideways displacement of a nearly straight step is v omega dt^2 / 2, to full relative precision.
#[test]
fn small_turns_do_not_cancel() {
    for omega in [1e-3, 1e-6, 1e-9, 1e-12, 1e-100] {
        let arc = exact_arc(2.0, omega, 1.0);
        assert!((arc.y / omega - 1.0).abs() < 1e-6_f64.min(omega * omega) + 4.0 * f64::EPSILON);
        assert!((arc.x - 2.0).abs() <= omega * omega);
    }
}

/// The printed step goes in the direction of the final heading: off by omega dt / 2, to the side of the turn.
#[test]
fn printed_form_is_biased_by_half_the_turn() {
    for turn in [0.02, -0.1, 0.4] {
        let exact = exact_arc(1.0, turn, 1.0);
        let paper = paper_euler(1.0, turn, 1.0);
        let bias = paper.y.atan2(paper.x) - exact.y.atan2(exact.x);
        assert!((bias - 0.5 * turn).abs() < 1e-14);
        assert_eq!(paper.phi, exact.phi);
    }
    // Composed with a pose it is Eq. 25 to the letter.
    let (phi, v, omega, dt) = (0.7_f64, 0.4, 0.3, 0.5);
    let next = Se2::new(1.0, 2.0, phi).compose(&paper_euler(v, omega, dt));
    let heading: f64 = phi + omega * dt;
    assert!((next.x - (1.0 + v * dt * heading.cos())).abs() < 1e-15);
    assert!((next.y - (2.0 + v * dt * heading.sin())).abs() < 1e-15);
    // Along a circle every printed step is the true chord turned by half the step's turn, and so is the whole path: the
    // error grows with the distance travelled and does not average out.
    let (step, turn) = (0.1, 0.05_f64);
    let mut exact = Se2::identity();
    let mut paper = Se2::identity();
    for _ in 0..60 {
        exact = exact.compose(&exact_arc(step, turn, 1.0));
        paper = paper.compose(&paper_euler(step, turn, 1.0));
    }
    let stretch = 0.5 * turn / (0.5 * turn).sin();
    let turned = Se2::new(0.0, 0.0, 0.5 * turn).act(&Vector2::new(exact.x, exact.y)) * stretch;
    assert!((turned - Vector2::new(paper.x, paper.y)).norm() < 1e-13);
    assert!((paper.x - exact.x).hypot(paper.y - exact.y) > 0.09);
}

fn noise() -> ControlNoise {
    ControlNoise {
        forward_per_sqrt_m: 0.03,
        forward_per_sqrt_s: 0.005,
        sideways_per_sqrt_m: 0.012,
        turn_per_sqrt_rad: 0.03,
        turn_per_sqrt_m: 0.01,
        turn_per_sqrt_s: 0.005,
    }
}

/// 20 000 noisy runs: mean and covariance in the tangent agree with the first-order recursion within sampling error.
#[test]
fn covariance_matches_monte_carlo() {
    let runs = [
        vec![(sample(0.0, 0.5, 0.0), 0.3)],
        vec![(sample(0.0, 0.5, 0.8), 0.5); 4],
        vec![
            (sample(0.0, 1.0, -1.5), 0.4),
            (sample(0.4, -0.5, 0.3), 0.7),
            (sample(1.1, 0.0, 2.0), 0.6),
        ],
        vec![(sample(0.0, 0.4, 0.2), 0.05); 20],
    ];
    let mut rng = ChaCha8Rng::seed_from_u64(20);
    for run in runs {
        let increment = accumulate(&run, &noise()).unwrap();
        let trials = 20_000;
        let mut sum = Vector3::zeros();
        let mut outer = Matrix3::zeros();
        for _ in 0..trials {
            let mut pose = Se2::identity();
            for (odometry, duration) in &run {
                let sigma = noise()
                    .variances(odometry.v_mps, odometry.omega_radps, *duration)
                    .map(|v| v.sqrt() / duration);
                let draw = Vector3::from_fn(|_, _| {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    z
                });
                let control = Vector3::new(odometry.v_mps, 0.0, odometry.omega_radps)
                    + sigma.component_mul(&draw);
                pose = pose.compose(&Se2::exp(&(control * *duration)));
            }
            let delta = increment.mean.between(&pose).log();
            sum += delta;
            outer += delta * delta.transpose();
        }
        let count = f64::from(trials);
        let covariance = outer / count;
        let mean = sum / count;
        for i in 0..3 {
            let sigma = increment.covariance[(i, i)].sqrt();
            // Second-order bias is below 2 % of sigma at these noises; sampling error of the mean 4 / sqrt(n).
            assert!(
                mean[i].abs() < sigma * (4.0 / count.sqrt() + 0.02),
                "mean {i}: {mean}"
            );
            for j in 0..3 {
                let scale = (increment.covariance[(i, i)] * increment.covariance[(j, j)]).sqrt();
                let error = (covariance[(i, j)] - increment.covariance[(i, j)]).abs() / scale;
                // A correlation estimate has standard deviation at most sqrt(2 / n).
                assert!(error < 4.5 * (2.0 / count).sqrt() + 0.01, "{i}{j}: {error}");
            }
        }
    }
}

/// A straight run in closed form: heading noise early on becomes sideways error at the end.
#[test]
fn straight_run_closed_form() {
    let only_heading = ControlNoise {
        turn_per_sqrt_s: 0.1,
        ..ControlNoise::ZERO
    };
    let run = vec![(sample(0.0, 1.0, 0.0), 1.0), (sample(1.0, 1.0, 0.0), 1.0)];
    let increment = accumulate(&run, &only_heading).unwrap();
    // Noise n1 turns evenly over the first metre: y = n1 (1/2 + 1) at the end; n2: y = n2 / 2. In body axes of the end
    // of the mean, which is straight.
    let q = 0.01;
    let expected = Matrix3::new(
        0.0,
        0.0,
        0.0, //
        0.0,
        q * (2.25 + 0.25),
        q * (1.5 + 0.5), //
        0.0,
        q * (1.5 + 0.5),
        2.0 * q,
    );
    assert!((increment.covariance - expected).amax() < 1e-16);
}

#[test]
fn splitting_the_run_changes_nothing() {
    let run = vec![
        (sample(0.0, 1.0, -1.5), 0.4),
        (sample(0.4, -0.5, 0.3), 0.7),
        (sample(1.1, 0.0, 2.0), 0.6),
    ];
    let whole = accumulate(&run, &noise()).unwrap();
    let parts = accumulate(&run[..1], &noise())
        .unwrap()
        .then(&accumulate(&run[1..], &noise()).unwrap());
    assert!((whole.covariance - parts.covariance).amax() < 1e-17);
    assert!(whole.mean.between(&parts.mean).log().norm() < 1e-15);
}

/// The noise is a process in time and distance: ten times as many rows of the same drive have the same covariance.
#[test]
fn regress_covariance_does_not_depend_on_the_row_rate() {
    for (v, omega) in [(0.5, 0.0), (0.4, 0.8), (-0.3, -1.5), (0.0, 0.7), (0.0, 0.0)] {
        let rows = |n: usize| vec![(sample(0.0, v, omega), 2.0 / n as f64); n];
        let slow = accumulate(&rows(20), &noise()).unwrap();
        let fast = accumulate(&rows(400), &noise()).unwrap();
        assert!(slow.mean.between(&fast.mean).log().norm() < 1e-13);
        assert!((slow.turn_bias_gain - fast.turn_bias_gain).norm() < 1e-13);
        // Within a row the noise is constant: what that is worth falls with the square of the row's length, a thousandth
        // at 0.1 s.
        let error = (slow.covariance - fast.covariance).amax();
        assert!(
            error < 2e-3 * fast.covariance.amax(),
            "{v} {omega}: {error:e}"
        );
    }
}

/// The gain of a constant error of the turning rate is the derivative of the motion.
#[test]
fn turn_bias_gain_matches_differences() {
    let run = [
        (1.0, -1.5, 0.4),
        (-0.5, 0.3, 0.7),
        (0.0, 2.0, 0.6),
        (0.8, 1e-9, 0.5),
    ];
    let with = |bias: f64| {
        let rows: Vec<_> = run
            .iter()
            .map(|(v, omega, dt)| (sample(0.0, *v, omega + bias), *dt))
            .collect();
        accumulate(&rows, &ControlNoise::ZERO).unwrap()
    };
    let h = 1e-6;
    let difference = (with(0.0).mean.between(&with(h).mean).log()
        - with(0.0).mean.between(&with(-h).mean).log())
        / (2.0 * h);
    assert!((difference - with(0.0).turn_bias_gain).norm() < 1e-9);
    // The heading gains the whole time, and not the time that the robot moves.
    assert!((with(0.0).turn_bias_gain.z - 2.2).abs() < 1e-15);
}

#[test]
fn a_robot_at_rest_is_uncertain_by_its_time_alone() {
    let increment = accumulate(&[(sample(0.0, 0.0, 0.0), 4.0)], &noise()).unwrap();
    assert_eq!(increment.mean, Se2::identity());
    let expected = Matrix3::from_diagonal(&Vector3::new(4.0 * 25e-6, 0.0, 4.0 * 25e-6));
    assert!((increment.covariance - expected).amax() < 1e-18);
    let none = accumulate(&[], &noise()).unwrap();
    assert_eq!(
        (none.mean, none.covariance),
        (Se2::identity(), Matrix3::zeros())
    );
}

#[test]
fn absurd_odometry_is_an_error_that_names_it() {
    for (v, omega, dt) in [
        (f64::NAN, 0.0, 1.0),
        (0.0, f64::INFINITY, 1.0),
        (0.0, 0.0, -1.0),
        (0.0, 0.0, f64::NAN),
    ] {
        let error = accumulate(&[(sample(0.0, v, omega), dt)], &noise()).unwrap_err();
        assert!(matches!(error, GeometryError::InvalidParameter { .. }));
    }
    let negative = ControlNoise {
        turn_per_sqrt_rad: -0.1,
        ..ControlNoise::ZERO
    };
    let error = accumulate(&[], &negative).unwrap_err();
    assert_eq!(
        error.to_string(),
        "turn_per_sqrt_rad is -0.1, required: finite and not negative"
    );
}

#[test]
fn samples_hold_until_the_next() {
    let samples = [
        sample(1.0, 0.1, 0.0),
        sample(2.0, 0.2, 0.0),
        sample(2.5, 0.3, 0.0),
        sample(4.0, 0.4, 0.0),
    ];
    let held = |a, b| -> Vec<(f64, f64)> {
        held_between(&samples, a, b)
            .iter()
            .map(|(s, d)| (s.v_mps, *d))
            .collect()
    };
    assert_eq!(held(1.5, 3.0), vec![(0.1, 0.5), (0.2, 0.5), (0.3, 0.5)]);
    assert_eq!(held(2.0, 2.5), vec![(0.2, 0.5)]);
    assert_eq!(held(0.0, 1.5), vec![(0.1, 0.5)]);
    assert_eq!(held(5.0, 7.0), vec![(0.4, 2.0)]);
    assert_eq!(held(0.0, 1.0), vec![]);
    assert_eq!(held(3.0, 3.0), vec![]);
    assert_eq!(held(3.0, 2.0), vec![]);
    assert!(held_between(&[], 0.0, 1.0).is_empty());
    // Duplicate times: the later row counts.
    let twins = [sample(1.0, 0.1, 0.0), sample(1.0, 0.9, 0.0)];
    assert_eq!(held_between(&twins, 1.0, 2.0), vec![(twins[1], 1.0)]);
    assert_eq!(held_between(&twins, 0.0, 2.0), vec![(twins[1], 1.0)]);
}

/// One second of the same motion as rows at `rate` hertz.
fn rows(v_mps: f64, omega_radps: f64, rate: u32) -> Vec<(OdometrySample, f64)> {
    let dt = 1.0 / f64::from(rate);
    (0..rate)
        .map(|row| (sample(f64::from(row) * dt, v_mps, omega_radps), dt))
        .collect()
}

/// Straight on, white noise of the turn rate of density q gives var(phi) = q T, cov(y, phi) = v q T^2 / 2 and
/// var(y) = v^2 q T^3 / 3; n rows, each an arc, leave out 1 / (4 n^2) of the last.
#[test]
fn the_covariance_of_a_straight_does_not_depend_on_the_row_rate() {
    let (v, q) = (0.8, 0.04_f64.powi(2));
    let turning = ControlNoise {
        turn_per_sqrt_s: q.sqrt(),
        ..ControlNoise::ZERO
    };
    for rate in [10, 50, 200] {
        let covariance = accumulate(&rows(v, 0.0, rate), &turning)
            .unwrap()
            .covariance;
        let close = |value: f64, expected: f64| {
            assert!(
                (value / expected - 1.0).abs() < 1e-12,
                "{rate} Hz: {value} for {expected}"
            );
        };
        close(covariance[(2, 2)], q);
        close(covariance[(1, 2)], v * q / 2.0);
        let left_out = 1.0 / (4.0 * f64::from(rate).powi(2));
        close(covariance[(1, 1)], v * v * q / 3.0 * (1.0 - left_out));
    }
    // The same standard deviation for every row, whatever it lasts, is another noise at every rate.
    let per_row = |rate: u32| f64::from(rate) * (0.04 / f64::from(rate)).powi(2);
    assert!(per_row(10) / per_row(200) > 19.0);
}

/// Every kind of noise, on an arc: the rates agree to the second order of a row's share of the whole.
#[test]
fn the_covariance_of_an_arc_does_not_depend_on_the_row_rate() {
    let fine = accumulate(&rows(0.8, 0.9, 5000), &noise())
        .unwrap()
        .covariance;
    for rate in [10, 50, 200] {
        let covariance = accumulate(&rows(0.8, 0.9, rate), &noise())
            .unwrap()
            .covariance;
        let off = (covariance - fine).amax() / fine.amax();
        assert!(off < 1.0 / f64::from(rate).powi(2), "{rate} Hz: {off}");
    }
}
