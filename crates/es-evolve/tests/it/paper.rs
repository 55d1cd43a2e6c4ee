//! The published operators: what they are, and that they do not keep a distribution.
//!
//! Prior N(0, 1), one observation z = 1 of unit noise: the posterior is N(0.5, 0.5), the likelihood alone is
//! proportional to N(1, 1). Populations start as independent samples of the posterior, so a method that keeps it
//! ends within a few standard errors of mean 0.5 and variance 0.5.

use std::f64::consts::PI;

use es_evolve::{
    EvolutionReport, EvolveError, MoveParams, PaperParams, StepFactors, StopReason, evolve_paper,
    resample_move,
};
use estimation_base::{Se2, wrap};
use nalgebra::{ArrayStorage, Matrix1, Matrix3};
use rand_distr::{Distribution, Normal};

use crate::support::{check_mean, generator, stream};

const SIZE: usize = 20_000;

fn likelihood(_: usize, x: &f64) -> f64 {
    -0.5 * (1.0 - x).powi(2)
}

fn posterior_samples() -> Vec<f64> {
    let posterior = Normal::new(0.5, 0.5_f64.sqrt()).expect("the deviation is positive");
    posterior
        .sample_iter(&mut generator(1))
        .take(SIZE)
        .collect()
}

fn rates(p_c: f64, p_m: f64) -> PaperParams {
    PaperParams {
        p_c1: p_c,
        p_c2: p_c,
        p_m1: p_m,
        p_m2: p_m,
        ..PaperParams::default()
    }
}

fn run(factor: f64, params: &PaperParams) -> (f64, f64, EvolutionReport) {
    let mut population = posterior_samples();
    let factor = Matrix1::new(factor);
    let report = evolve_paper(
        &mut population,
        &likelihood,
        StepFactors::Common(&factor),
        params,
        &stream(2),
    )
    .expect("the likelihood is finite");
    let count = SIZE as f64;
    let mean = population.iter().sum::<f64>() / count;
    let variance = population.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
    (mean, variance, report)
}

/// Steps of standard deviation 0.3: with these, eight steps of a prototype gave the figures below.
const DEVIATION: f64 = 0.3;

/// The figures are given to two digits and come from a population of unknown size.
const FIGURE_TOLERANCE: f64 = 0.02;

#[test]
fn val_crossover_contracts_and_climbs() {
    let (mean, variance, report) = run(DEVIATION, &rates(1.0, 0.0));
    assert_eq!(report.proposed_crossovers, 8 * SIZE);
    assert_eq!(report.proposed_mutations, 0);
    // A method that kept N(0.5, 0.5) would be off by a few of these.
    let mean_error = (0.5 / SIZE as f64).sqrt();
    let variance_error = 0.5 * (2.0 / SIZE as f64).sqrt();
    assert!(mean - 0.5 > 20.0 * mean_error, "mean {mean}");
    assert!(
        0.5 - variance > 20.0 * variance_error,
        "variance {variance}"
    );
    assert!((mean - 0.77).abs() < FIGURE_TOLERANCE, "mean {mean}");
    assert!(
        (variance - 0.20).abs() < FIGURE_TOLERANCE,
        "variance {variance}"
    );
}

#[test]
fn val_mutation_on_the_likelihood_drifts_to_the_likelihood() {
    let (mean, variance, report) = run(DEVIATION, &rates(0.0, 1.0));
    assert_eq!(report.proposed_mutations, 8 * SIZE);
    assert_eq!(report.proposed_crossovers, 0);
    assert!((mean - 0.65).abs() < FIGURE_TOLERANCE, "mean {mean}");
    assert!(
        (variance - 0.72).abs() < FIGURE_TOLERANCE,
        "variance {variance}"
    );
}

#[test]
fn the_published_rates_do_not_keep_the_posterior_where_the_mover_does() {
    let (mean, variance, _) = run(DEVIATION, &PaperParams::default());
    let mean_error = (0.5 / SIZE as f64).sqrt();
    let variance_error = 0.5 * (2.0 / SIZE as f64).sqrt();
    assert!(mean - 0.5 > 20.0 * mean_error, "mean {mean}");
    assert!(
        0.5 - variance > 20.0 * variance_error,
        "variance {variance}"
    );

    let mut population = posterior_samples();
    let target = |slot: usize, x: &f64| likelihood(slot, x) - 0.5 * x * x;
    let factor = Matrix1::new(DEVIATION);
    let params = MoveParams {
        steps: 8,
        ..MoveParams::default()
    };
    let factors = StepFactors::Common(&factor);
    resample_move(&mut population, &target, factors, &params, &stream(3)).unwrap();
    check_mean("mover", &population, 0.5, 0.5);
    let squares: Vec<f64> = population.iter().map(|x| (x - 0.5).powi(2)).collect();
    check_mean("mover, square", &squares, 0.5, 0.5);
}

#[test]
fn a_child_is_judged_against_the_better_parent() {
    // Parents of fitness 1 and 1/4, any blend 1/2: accepted half the time against the better, always against the worse.
    let fitness = |_: usize, x: &f64| match *x {
        0.0 => 0.0,
        1.0 => -(4.0_f64.ln()),
        _ => -(2.0_f64.ln()),
    };
    let params = PaperParams {
        steps: 1,
        ..rates(1.0, 0.0)
    };
    let mut accepted = Vec::new();
    for pair in 0..4000 {
        let mut population = [0.0, 1.0];
        let factors = StepFactors::Common(&const { Matrix1::new(0.0) });
        let streams = stream(100 + pair);
        let report = evolve_paper(&mut population, &fitness, factors, &params, &streams).unwrap();
        assert_eq!(report.proposed_crossovers, 2);
        accepted.push(report.accepted_crossovers as f64 / 2.0);
    }
    // Two independent decisions a pair: variance 1/4 / 2.
    check_mean("accepted", &accepted, 0.5, 0.125);
}

#[test]
fn blends_without_noise_keep_the_sum_of_the_parents() {
    // Equal fitness accepts everything; kappa p1 + (1 - kappa) p2 and its mirror add up to p1 + p2.
    let start: Vec<f64> = (0..100).map(f64::from).collect();
    let mut population = start.clone();
    let flat = |_: usize, _: &f64| 0.0;
    let factors = StepFactors::Common(&const { Matrix1::new(0.0) });
    let params = rates(1.0, 0.0);
    let report = evolve_paper(&mut population, &flat, factors, &params, &stream(4)).unwrap();
    assert_eq!(report.accepted_crossovers, 800);
    let sum: f64 = population.iter().sum();
    // 800 blends of values below 100.
    assert!((sum - 4950.0).abs() < 800.0 * 100.0 * f64::EPSILON, "{sum}");
    assert_ne!(population, start);
    assert!(population.iter().all(|&x| (0.0..=99.0).contains(&x)));
}

#[test]
fn headings_blend_across_the_cut() {
    // Half the population at +179 degrees, half at -179: every blend lies within a degree of the cut.
    let degree = PI / 180.0;
    let mut population: Vec<Se2> = (0..50)
        .map(|i| Se2::new(0.0, 0.0, if i % 2 == 0 { PI - degree } else { degree - PI }))
        .collect();
    let flat = |_: usize, _: &Se2| 0.0;
    let factors =
        StepFactors::Common(&const { Matrix3::from_array_storage(ArrayStorage([[0.0; 3]; 3])) });
    let params = rates(1.0, 0.0);
    evolve_paper(&mut population, &flat, factors, &params, &stream(5)).unwrap();
    for pose in &population {
        assert!(
            wrap(pose.phi - PI).abs() <= degree * (1.0 + 1e-9),
            "{}",
            pose.phi
        );
    }
}

#[test]
fn equal_fitness_uses_the_first_rates() {
    // Eq. 19 is 0/0 here; read literally it would be NaN and nothing would ever mate or mutate.
    for value in [0.0, -1e4, f64::NEG_INFINITY] {
        let mut population = vec![0.0; 5000];
        let flat = |_: usize, _: &f64| value;
        let factors = StepFactors::Common(&const { Matrix1::new(1.0) });
        let params = PaperParams {
            steps: 1,
            ..PaperParams::default()
        };
        let report = evolve_paper(&mut population, &flat, factors, &params, &stream(6)).unwrap();
        let near = |count: f64, trials: f64, p: f64| {
            let bound = 4.0 * (p * (1.0 - p) / trials).sqrt();
            assert!(
                (count / trials - p).abs() < bound,
                "{count} of {trials}, expected {p}"
            );
        };
        near(report.proposed_crossovers as f64 / 2.0, 2500.0, 0.85);
        near(report.proposed_mutations as f64, 5000.0, 0.1);
    }
}

#[test]
fn a_shift_of_the_log_fitness_changes_nothing() {
    // Values like -1e5 underflow as plain fitness. A power of two as the shift keeps the sums nearly exact.
    let run = |shift: f64| {
        let mut population = posterior_samples();
        population.truncate(500);
        let fitness = |slot: usize, x: &f64| likelihood(slot, x) + shift;
        let factors = StepFactors::Common(&const { Matrix1::new(0.3) });
        let params = PaperParams::default();
        evolve_paper(&mut population, &fitness, factors, &params, &stream(7)).unwrap();
        population
    };
    let plain = run(0.0);
    assert_ne!(plain, posterior_samples()[..500]);
    assert_eq!(run(-65_536.0), plain);
    assert_eq!(run(65_536.0), plain);
}

#[test]
fn budgets_end_a_run_between_phases() {
    let mut population = vec![0.25; 10];
    let factors = StepFactors::Common(&const { Matrix1::new(1.0) });
    let with = |max_evaluations| PaperParams {
        max_evaluations,
        ..rates(1.0, 0.0)
    };
    let mut run = |max_evaluations| {
        let params = with(max_evaluations);
        evolve_paper(&mut population, &likelihood, factors, &params, &stream(8)).unwrap()
    };
    let report = run(10);
    assert_eq!((report.evaluations, report.log_fitness.len()), (10, 10));
    assert_eq!(report.acceptance(), None);
    let report = run(29);
    let expected = StopReason::Budget {
        evaluations: 20,
        next_phase: 10,
        max_evaluations: 29,
    };
    assert_eq!((report.evaluations, report.stop), (20, expected));
    // Mutations at rate zero cost nothing but must fit: the eighth step ends at 10 + 8 * 10 and needs room for 10 more.
    let report = run(100);
    assert_eq!(
        (report.evaluations, report.stop),
        (90, StopReason::Steps { steps: 8 })
    );
}

#[test]
fn wrong_input_is_named() {
    let factors = StepFactors::Common(&const { Matrix1::new(1.0) });
    let run = |population: &mut [f64], params: &PaperParams| {
        evolve_paper(population, &likelihood, factors, params, &stream(9))
    };
    let error = run(&mut [], &PaperParams::default()).unwrap_err();
    assert_eq!(error, EvolveError::EmptyPopulation);
    let error = run(&mut [0.0], &rates(1.5, 0.0)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "p_c1 must lie between 0 and 1, given 1.5"
    );
    assert!(run(&mut [0.0], &rates(0.0, f64::NAN)).is_err());
    let error = run(&mut [0.0, f64::NAN], &PaperParams::default()).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("log-fitness of slot 1 must be finite")
    );

    let bad = MoveParams {
        jitter_scale: -1.0,
        ..MoveParams::default()
    };
    let moved = resample_move(&mut [0.0], &likelihood, factors, &bad, &stream(9));
    assert_eq!(
        moved.unwrap_err().to_string(),
        "jitter_scale must be finite and at least 0, given -1"
    );
    for max_evaluations in [0, 1] {
        let poor = MoveParams {
            max_evaluations,
            ..MoveParams::default()
        };
        let moved = resample_move(&mut [0.0; 2], &likelihood, factors, &poor, &stream(9));
        assert_eq!(
            moved.unwrap_err().to_string(),
            format!("at least 2 evaluations are required, {max_evaluations} allowed")
        );
    }
    // A fitness that turns NaN only where a child lands.
    let cliff = |_: usize, x: &f64| if *x == 0.0 { 0.0 } else { f64::NAN };
    let params = MoveParams::default();
    let moved = resample_move(&mut [0.0, 0.0, 0.0], &cliff, factors, &params, &stream(9));
    assert!(matches!(
        moved,
        Err(EvolveError::LogFitness { slot: 0, .. })
    ));
}

/// A fitness that turns NaN late: whatever was moved before is undone.
#[test]
fn after_an_error_the_population_is_what_it_was() {
    let start: Vec<f64> = (0..20).map(|i| 0.01 * f64::from(i)).collect();
    let cliff = |_: usize, x: &f64| if *x < 2.5 { *x } else { f64::NAN };
    let factors = StepFactors::Common(&const { Matrix1::new(0.3) });
    let mut moved = start.clone();
    let params = MoveParams {
        steps: 100,
        ..MoveParams::default()
    };
    let error = resample_move(&mut moved, &cliff, factors, &params, &stream(10));
    assert!(error.is_err());
    assert_eq!(moved, start);
    let params = PaperParams {
        steps: 1000,
        ..PaperParams::default()
    };
    let error = evolve_paper(&mut moved, &cliff, factors, &params, &stream(10));
    assert!(error.is_err());
    assert_eq!(moved, start);
}
