//! Wrong forms of the mover, each of which moves its target: what the rules of `resample_move` are for.
//!
//! Every case starts from independent samples of the target, so a correct move ends within four standard errors. The
//! right form is run beside the wrong one.

mod support;

use es_evolve::{AdaptiveRates, MoveParams, PaperParams, Space, StepFactors, resample_move};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use support::{Line, PlanarGroup, check_mean, generator, stream, wrap};

fn standard(x: f64) -> f64 {
    -0.5 * x * x
}

fn normals(count: usize, seed: u64) -> Vec<f64> {
    StandardNormal
        .sample_iter(generator(seed))
        .take(count)
        .collect()
}

/// Standard errors between the mean square and 1, that of the target; the square has variance 2.
fn errors_of_the_square(sample: &[f64]) -> f64 {
    let count = sample.len() as f64;
    let mean = sample.iter().map(|x| x * x).sum::<f64>() / count;
    (mean - 1.0) / (2.0 / count).sqrt()
}

/// Partners from the whole population, the slot that moves among them (partners from the moving half without the slot moved the
/// mean square by one standard error only, which shows nothing): the difference depends on its own genome, so backward
/// and forward step are not equally likely.
#[test]
fn the_slot_itself_among_the_partners_moves_the_target() {
    let (size, populations) = (4, 10_000);
    let mut wrong = normals(size * populations, 1);
    let mut rng = generator(2);
    for _ in 0..8 {
        for population in wrong.chunks_exact_mut(size) {
            let parents = population.to_vec();
            for (slot, x) in population.iter_mut().enumerate() {
                let a = rng.random_range(0..size);
                let b = (a + rng.random_range(1..size)) % size;
                let jitter: f64 = StandardNormal.sample(&mut rng);
                let gain = 2.38 / 2.0_f64.sqrt();
                let child = parents[slot] + gain * (parents[a] - parents[b]) + 0.05 * jitter;
                if rng.random::<f64>() < (standard(child) - standard(parents[slot])).exp() {
                    *x = child;
                }
            }
        }
    }
    // 17.7 measured.
    let errors = errors_of_the_square(&wrong);
    assert!(errors.abs() > 8.0, "{errors}");

    let mut right = normals(size * populations, 1);
    let target = |_: usize, x: &f64| standard(*x);
    let params = MoveParams {
        steps: 8,
        crossover_share: 1.0,
        ..MoveParams::default()
    };
    for (number, population) in right.chunks_exact_mut(size).enumerate() {
        let factors = StepFactors::Common(&[[1.0]]);
        let streams = stream(10_000 + number as u64);
        resample_move(&Line, population, &target, factors, &params, &streams).unwrap();
    }
    let errors = errors_of_the_square(&right);
    assert!(errors.abs() < 4.0, "{errors}");
}

/// Eq. 19 inside a move: whether a slot proposes depends on its fitness, and the rate of the way back is left out of the ratio.
#[test]
fn rates_that_follow_the_fitness_move_the_target() {
    let mut population = normals(20_000, 3);
    let mut rng = generator(4);
    for _ in 0..8 {
        let values: Vec<f64> = population.iter().map(|&x| standard(x)).collect();
        let params = PaperParams {
            p_m1: 1.0,
            p_m2: 0.1,
            ..PaperParams::default()
        };
        let rates = AdaptiveRates::new(&params, &values);
        for (x, value) in population.iter_mut().zip(values) {
            if rng.random::<f64>() >= rates.mutation(value) {
                continue;
            }
            let normal: f64 = StandardNormal.sample(&mut rng);
            let child = *x + 2.38 * normal;
            if rng.random::<f64>() < (standard(child) - value).exp() {
                *x = child;
            }
        }
    }
    let errors = errors_of_the_square(&population);
    // -15.4 measured.
    assert!(errors.abs() > 8.0, "{errors}");
}

/// The likelihood alone as target, prior N(0, 1) and one observation z = 1 of unit noise left out: the mover keeps what it
/// is told to keep, N(1, 1) in place of the posterior N(0.5, 0.5).
#[test]
fn a_target_without_the_prior_is_another_one() {
    let size = 20_000;
    let start = || -> Vec<f64> {
        normals(size, 5)
            .iter()
            .map(|z| 0.5 + 0.5_f64.sqrt() * z)
            .collect()
    };
    let factors = StepFactors::Common(&[[0.7]]);
    let params = MoveParams {
        steps: 30,
        ..MoveParams::default()
    };
    let mut wrong = start();
    let likelihood = |_: usize, x: &f64| standard(1.0 - x);
    resample_move(&Line, &mut wrong, &likelihood, factors, &params, &stream(6)).unwrap();
    let mean = wrong.iter().sum::<f64>() / size as f64;
    assert!((mean - 0.5) / (0.5 / size as f64).sqrt() > 50.0, "{mean}");
    check_mean("likelihood", &wrong, 1.0, 1.0);
    let mut right = start();
    let target = |_: usize, x: &f64| standard(1.0 - x) + standard(*x);
    resample_move(&Line, &mut right, &target, factors, &params, &stream(6)).unwrap();
    check_mean("posterior", &right, 0.5, 0.5);
}

/// Translation in body axes and a separate turn: the backward step is read in other axes than the forward one.
struct BodyAxes;

impl Space<3> for BodyAxes {
    type Genome = [f64; 3];

    fn retract(&self, at: &[f64; 3], step: &[f64; 3]) -> [f64; 3] {
        let (sin, cos) = at[2].sin_cos();
        [
            at[0] + cos * step[0] - sin * step[1],
            at[1] + sin * step[0] + cos * step[1],
            wrap(at[2] + step[2]),
        ]
    }

    fn local(&self, from: &[f64; 3], to: &[f64; 3]) -> [f64; 3] {
        let (sin, cos) = from[2].sin_cos();
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        [
            cos * dx + sin * dy,
            -sin * dx + cos * dy,
            wrap(to[2] - from[2]),
        ]
    }
}

/// The mover asks of a space that a step is undone by its negative. The group of the plane does it, body axes do not.
#[test]
fn a_space_whose_steps_are_not_undone_moves_the_target() {
    let deviations = [1.0, 0.1, 0.5];
    let target = |_: usize, pose: &[f64; 3]| -> f64 {
        (0..3).map(|i| standard(pose[i] / deviations[i])).sum()
    };
    let size = 20_000;
    let start: Vec<[f64; 3]> = normals(3 * size, 7)
        .chunks_exact(3)
        .map(|z| std::array::from_fn(|i| deviations[i] * z[i]))
        .collect();
    let factor = [[0.5, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.5]];
    let params = MoveParams {
        steps: 10,
        crossover_share: 0.0,
        ..MoveParams::default()
    };
    let errors = |population: &[[f64; 3]]| -> [f64; 3] {
        std::array::from_fn(|i| {
            let standardised: Vec<f64> = population
                .iter()
                .map(|pose| pose[i] / deviations[i])
                .collect();
            errors_of_the_square(&standardised)
        })
    };
    let factors = StepFactors::Common(&factor);
    let mut right = start.clone();
    resample_move(
        &PlanarGroup,
        &mut right,
        &target,
        factors,
        &params,
        &stream(8),
    )
    .unwrap();
    assert!(
        errors(&right).iter().all(|e| e.abs() < 4.0),
        "{:?}",
        errors(&right)
    );
    let mut wrong = start;
    resample_move(&BodyAxes, &mut wrong, &target, factors, &params, &stream(8)).unwrap();
    assert!(
        errors(&wrong).iter().any(|e| e.abs() > 8.0),
        "{:?}",
        errors(&wrong)
    );
}
