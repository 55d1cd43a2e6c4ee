//! Populations do not depend on the number of threads.
#![cfg(feature = "parallel")]

use es_evolve::{
    Euclidean, EvolutionReport, MoveParams, OptimiseParams, PaperParams, StepAdaptation,
    StepFactors, evolve_paper, optimise_restarting, resample_move,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn stream(step: usize, slot: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    rng.set_stream((step as u64) << 32 | slot as u64);
    rng
}

#[test]
fn populations_do_not_depend_on_the_number_of_threads() {
    // A curved target that differs from slot to slot.
    let fitness = |slot: usize, x: &[f64; 2]| {
        let centre = 0.01 * slot as f64;
        -(x[0] - centre).powi(2) - 3.0 * (x[1] - x[0] * x[0]).powi(2)
    };
    let start: Vec<[f64; 2]> = (0..101).map(|i| [0.02 * f64::from(i), 0.5]).collect();
    let factor = [[0.5, 0.0], [0.2, 0.3]];
    let run = |threads: usize| -> [(Vec<[f64; 2]>, EvolutionReport); 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            let factors = StepFactors::Common(&factor);
            let mut published = start.clone();
            let params = PaperParams::default();
            let paper = evolve_paper(
                &Euclidean,
                &mut published,
                &fitness,
                factors,
                &params,
                &stream,
            )
            .unwrap();
            let mut moved = start.clone();
            let params = MoveParams::default();
            let mover =
                resample_move(&Euclidean, &mut moved, &fitness, factors, &params, &stream).unwrap();
            [(published, paper), (moved, mover)]
        })
    };
    let alone = run(1);
    for (population, report) in &alone {
        assert_ne!(population, &start);
        assert!(report.acceptance().is_some_and(|share| share > 0.1));
        // The reported fitness is that of the final genomes.
        for (slot, genome) in population.iter().enumerate() {
            assert_eq!(fitness(slot, genome), report.log_fitness[slot]);
        }
    }
    for threads in [2, 3, 8] {
        assert_eq!(run(threads), alone, "{threads} threads");
    }
}

#[test]
fn optima_do_not_depend_on_the_number_of_threads() {
    let fitness = |_: usize, x: &[f64; 3]| {
        -x.iter()
            .map(|v| v * v + 10.0 * (1.0 - (6.0 * v).cos()))
            .sum::<f64>()
    };
    for adaptation in [
        StepAdaptation::Isotropic,
        StepAdaptation::PerCoordinate,
        StepAdaptation::Covariance,
    ] {
        let params = OptimiseParams {
            adaptation,
            max_evaluations: 5000,
            ..OptimiseParams::for_dimension(3)
        };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let start = |run: usize| [2.0, -3.0, run as f64];
                let sizes = [1.0, 2.0, 0.5];
                optimise_restarting(&Euclidean, start, &sizes, &fitness, &params, &stream).unwrap()
            })
        };
        let alone = run(1);
        assert!(alone.evaluations <= 5000);
        assert_eq!(fitness(0, &alone.best), alone.log_fitness);
        for threads in [2, 3, 8] {
            assert_eq!(run(threads), alone, "{threads} threads");
        }
    }
}
