//! `resample_move` leaves its target invariant.
//!
//! Populations start as independent samples of the target. Moves couple slots only through symmetric proposals, so after any number of steps
//! the slots are independent samples still, and the standard errors of their statistics are the textbook ones. All bounds are
//! four standard errors. Starts far from the target show that the moves do move.

use es_evolve::{MoveParams, StepFactors, resample_move};
use estimation_base::{Se2, wrap};
use nalgebra::{Matrix1, Matrix3, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, Normal, StandardNormal};

use crate::support::{check_mean, generator, stream};

/// Shares of crossover that exercise mutation alone, the mixture (at 2e5 samples), and crossover alone, with the
/// sizes of their populations.
const CASES: [(f64, usize); 3] = [(0.0, 10_000), (0.5, 200_000), (1.0, 10_000)];

fn params(steps: usize, crossover_share: f64) -> MoveParams {
    MoveParams {
        steps,
        crossover_share,
        ..MoveParams::default()
    }
}

#[test]
fn a_gaussian_stays_whatever_the_operators() {
    let (mean, deviation) = (0.5, 0.5_f64.sqrt());
    let target = move |_: usize, x: &f64| -0.5 * ((x - mean) / deviation).powi(2);
    let normal = Normal::new(mean, deviation).unwrap();
    for (share, size) in CASES {
        let start: Vec<f64> = normal.sample_iter(&mut generator(1)).take(size).collect();
        let mut population = start.clone();
        let factor = Matrix1::new(deviation);
        let report = resample_move(
            &mut population,
            &target,
            StepFactors::Common(&factor),
            &params(4, share),
            &stream(2),
        )
        .unwrap();
        let kept = start
            .iter()
            .zip(&population)
            .filter(|(a, b)| a == b)
            .count();
        // Four tries, accepted with probability 0.44: a tenth stays where it was.
        assert!(kept < size / 5, "{kept} never moved");
        assert!(report.acceptance().unwrap() > 0.2);
        let standardised: Vec<f64> = population.iter().map(|x| (x - mean) / deviation).collect();
        check_normal(&format!("share {share}"), &standardised);
    }
}

#[test]
fn each_slot_keeps_its_own_target() {
    // Three interleaved targets, so that a child judged by another slot's fitness would show.
    let moments = |slot: usize| [(0.0, 1.0), (1.5, 0.5), (-1.0, 2.0)][slot % 3];
    let target = move |slot: usize, x: &f64| {
        let (mean, deviation) = moments(slot);
        -0.5 * ((x - mean) / deviation).powi(2)
    };
    for (share, size) in CASES {
        let mut rng = generator(3);
        let mut population: Vec<f64> = (0..size)
            .map(|slot| {
                let (mean, deviation) = moments(slot);
                let z: f64 = StandardNormal.sample(&mut rng);
                mean + deviation * z
            })
            .collect();
        let factors: Vec<_> = (0..size)
            .map(|slot| Matrix1::new(moments(slot).1))
            .collect();
        resample_move(
            &mut population,
            &target,
            StepFactors::PerSlot(&factors),
            &params(4, share),
            &stream(4),
        )
        .unwrap();
        for kind in 0..3 {
            let standardised: Vec<f64> = (kind..size)
                .step_by(3)
                .map(|slot| (population[slot] - moments(slot).0) / moments(slot).1)
                .collect();
            check_normal(&format!("share {share}, kind {kind}"), &standardised);
        }
    }
}

#[test]
fn a_correlated_gaussian_stays_and_is_reached_from_copies() {
    let mean = Vector3::new(1.0, -2.0, 0.5);
    // Correlation 0.95 between the first two, scales a hundredfold apart.
    let covariance = Matrix3::new(1.0, 0.19, 0.001, 0.19, 0.04, 0.0004, 0.001, 0.0004, 1e-4);
    let factor = covariance.cholesky().unwrap().l();
    let whiten = move |x: &Vector3<f64>| -> Vector3<f64> {
        factor
            .solve_lower_triangular(&(x - mean))
            .expect("the diagonal is positive")
    };
    let target = |_: usize, x: &Vector3<f64>| -0.5 * whiten(x).norm_squared();
    let check = |name: &str, population: &[Vector3<f64>]| {
        let white: Vec<Vector3<f64>> = population.iter().map(whiten).collect();
        for i in 0..3 {
            let component: Vec<f64> = white.iter().map(|w| w[i]).collect();
            check_normal(&format!("{name}, component {i}"), &component);
            // The product of two independent standard normals has mean 0 and variance 1.
            let product: Vec<f64> = white.iter().map(|w| w[i] * w[(i + 1) % 3]).collect();
            check_mean(&format!("{name}, product {i}"), &product, 0.0, 1.0);
        }
    };
    for (share, size) in CASES {
        let mut rng = generator(5);
        let mut population: Vec<Vector3<f64>> = (0..size)
            .map(|_| {
                let z = Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng));
                mean + factor * z
            })
            .collect();
        let moved = params(4, share);
        let factors = StepFactors::Common(&factor);
        resample_move(&mut population, &target, factors, &moved, &stream(6)).unwrap();
        check(&format!("share {share}"), &population);
    }
    // From copies of one point: the chains mix in about ten steps, after a hundred the start is forgotten.
    let mut population = vec![Vector3::new(1.5, -1.9, 0.5); 2500];
    let factors = StepFactors::Common(&factor);
    resample_move(
        &mut population,
        &target,
        factors,
        &params(100, 0.5),
        &stream(7),
    )
    .unwrap();
    check("from copies", &population);
}

#[test]
fn a_pose_on_the_circle_stays() {
    // Heading: von Mises around 3.0, so its mass lies across the cut at pi. Position: a Gaussian in body axes of
    // a point seen from the pose, so position and heading depend on each other.
    let (centre, concentration) = (3.0, 2.0);
    let (offset, deviation) = ([2.0, -1.0], [0.3, 0.1]);
    let body = move |pose: &Se2| {
        let (sin, cos) = pose.phi.sin_cos();
        [
            (cos * pose.x + sin * pose.y - offset[0]) / deviation[0],
            (-sin * pose.x + cos * pose.y - offset[1]) / deviation[1],
        ]
    };
    let target = move |_: usize, pose: &Se2| {
        let [u, v] = body(pose);
        concentration * (pose.phi - centre).cos() - 0.5 * (u * u + v * v)
    };
    // Moments of the von Mises distribution by the trapezoidal rule, exact to rounding for periodic integrands.
    let moment = |f: &dyn Fn(f64) -> f64| -> f64 {
        let angles = (0..200).map(|k| std::f64::consts::TAU * f64::from(k) / 200.0);
        let (mut weighted, mut total) = (0.0, 0.0);
        for angle in angles {
            let density = (concentration * angle.cos()).exp();
            weighted += f(angle) * density;
            total += density;
        }
        weighted / total
    };
    let mean_cos = moment(&f64::cos);
    let variance_cos = moment(&|a| (a.cos() - mean_cos).powi(2));
    let variance_sin = moment(&|a| a.sin().powi(2));
    let within = |angle: f64| f64::from(u8::from(angle.abs() < 0.5));
    let share_within = moment_of_interval(concentration, 0.5);

    for (share, size) in CASES {
        let mut rng = generator(8);
        let mut population: Vec<Se2> = (0..size)
            .map(|_| {
                let turn = loop {
                    let angle: f64 = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
                    if rng.random::<f64>() < (concentration * (angle.cos() - 1.0)).exp() {
                        break angle;
                    }
                };
                let heading = wrap(centre + turn);
                let (sin, cos) = heading.sin_cos();
                let z: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                let [u, v] = std::array::from_fn(|i| offset[i] + deviation[i] * z[i]);
                Se2::new(cos * u - sin * v, sin * u + cos * v, heading)
            })
            .collect();
        let factor = Matrix3::new(0.3, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.1, 0.4);
        let report = resample_move(
            &mut population,
            &target,
            StepFactors::Common(&factor),
            &params(4, share),
            &stream(9),
        )
        .unwrap();
        assert!(
            report.acceptance().unwrap() > 0.03,
            "{:?}",
            report.acceptance()
        );
        assert!(
            population
                .iter()
                .all(|pose| pose.phi.abs() <= std::f64::consts::PI)
        );
        let turns: Vec<f64> = population
            .iter()
            .map(|pose| wrap(pose.phi - centre))
            .collect();
        let statistic = |f: &dyn Fn(f64) -> f64| turns.iter().map(|&t| f(t)).collect::<Vec<_>>();
        check_mean("cos", &statistic(&f64::cos), mean_cos, variance_cos);
        check_mean("sin", &statistic(&f64::sin), 0.0, variance_sin);
        let variance = share_within * (1.0 - share_within);
        check_mean("interval", &statistic(&within), share_within, variance);
        for axis in 0..2 {
            let component: Vec<f64> = population.iter().map(|pose| body(pose)[axis]).collect();
            check_normal(&format!("share {share}, axis {axis}"), &component);
            // Independent of the heading: the mean of the product is zero.
            let product: Vec<f64> = component
                .iter()
                .zip(&turns)
                .map(|(c, t)| c * t.sin())
                .collect();
            check_mean("product", &product, 0.0, variance_sin);
        }
    }
}

/// Probability that a von Mises angle lies within `half_width` of its centre (Simpson's rule, error below 1e-9).
fn moment_of_interval(concentration: f64, half_width: f64) -> f64 {
    let integral = |half: f64| {
        let panels = 2000;
        let step = 2.0 * half / f64::from(panels);
        let density = |k: i32| (concentration * (-half + step * f64::from(k)).cos()).exp();
        let inner: f64 = (1..panels)
            .map(|k| if k % 2 == 1 { 4.0 } else { 2.0 } * density(k))
            .sum();
        step / 3.0 * (density(0) + inner + density(panels))
    };
    integral(half_width) / integral(std::f64::consts::PI)
}

#[test]
fn tiny_populations_stay_and_mutate_where_they_cannot_cross() {
    let target = |_: usize, x: &f64| -0.5 * x * x;
    for size in 1..=5_usize {
        // Many independent populations of the same size, each with its own streams.
        let populations = 6000;
        let mut rng = generator(10);
        let mut all = Vec::new();
        let mut crossovers = 0;
        for population_number in 0..populations {
            let mut population: Vec<f64> =
                (0..size).map(|_| StandardNormal.sample(&mut rng)).collect();
            let report = resample_move(
                &mut population,
                &target,
                StepFactors::Common(&const { Matrix1::new(1.0) }),
                &params(4, 1.0),
                &stream(1000 + population_number),
            )
            .unwrap();
            crossovers += report.proposed_crossovers;
            assert_eq!(
                report.proposed_crossovers + report.proposed_mutations,
                4 * size
            );
            all.extend(population);
        }
        // Slots whose resting half holds two or more.
        let able = match size {
            1 | 2 => 0,
            3 => 1,
            _ => size,
        };
        assert_eq!(crossovers, populations as usize * 4 * able, "size {size}");
        check_normal(&format!("size {size}"), &all);
    }
}

#[test]
fn an_impossible_region_stays_empty_and_an_impossible_start_is_left() {
    // Half-normal: mean sqrt(2 / pi), variance 1 - 2 / pi.
    let target = |_: usize, x: &f64| {
        if *x < 0.0 {
            f64::NEG_INFINITY
        } else {
            -0.5 * x * x
        }
    };
    let mut population = vec![-0.5; 4000];
    let report = resample_move(
        &mut population,
        &target,
        StepFactors::Common(&const { Matrix1::new(1.0) }),
        &params(60, 0.5),
        &stream(11),
    )
    .unwrap();
    assert!(population.iter().all(|&x| x >= 0.0));
    assert!(report.log_fitness.iter().all(|value| value.is_finite()));
    let expected = std::f64::consts::FRAC_2_PI;
    check_mean("half-normal", &population, expected.sqrt(), 1.0 - expected);
}

/// Mean, variance and five quantiles of independent standard normal samples, each within four standard errors.
fn check_normal(name: &str, sample: &[f64]) {
    check_mean(name, sample, 0.0, 1.0);
    // The square of a standard normal has mean 1 and variance 2.
    let squares: Vec<f64> = sample.iter().map(|x| x * x).collect();
    check_mean(&format!("{name}, square"), &squares, 1.0, 2.0);
    // The share below a quantile is a binomial proportion.
    for (quantile, probability) in [
        (-1.644_853_627, 0.05),
        (-0.674_489_750, 0.25),
        (0.0, 0.5),
        (0.674_489_750, 0.75),
        (1.644_853_627, 0.95),
    ] {
        let below: Vec<f64> = sample
            .iter()
            .map(|&x| f64::from(u8::from(x < quantile)))
            .collect();
        let variance = probability * (1.0 - probability);
        check_mean(
            &format!("{name}, quantile {probability}"),
            &below,
            probability,
            variance,
        );
    }
}
