//! Populations do not depend on the number of threads.

use es_evolve::{
    EvolutionReport, MoveParams, OptimiseParams, PaperParams, StepAdaptation, StepFactors,
    evolve_paper, optimise_restarting, resample_move,
};
use nalgebra::{Matrix2, Vector2, Vector3};

use crate::support;

#[test]
fn populations_do_not_depend_on_the_number_of_threads() {
    // A curved target that differs from slot to slot.
    let fitness = |slot: usize, x: &Vector2<f64>| {
        let centre = 0.01 * slot as f64;
        -(x[0] - centre).powi(2) - 3.0 * (x[1] - x[0] * x[0]).powi(2)
    };
    let start: Vec<Vector2<f64>> = (0..101)
        .map(|i| Vector2::new(0.02 * f64::from(i), 0.5))
        .collect();
    let factor = Matrix2::new(0.5, 0.0, 0.2, 0.3);
    let run = |threads: usize| -> [(Vec<Vector2<f64>>, EvolutionReport); 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            let factors = StepFactors::Common(&factor);
            let mut published = start.clone();
            let params = PaperParams::default();
            let paper = evolve_paper(
                &mut published,
                &fitness,
                factors,
                &params,
                &support::stream(3),
            )
            .unwrap();
            let mut moved = start.clone();
            let params = MoveParams::default();
            let mover =
                resample_move(&mut moved, &fitness, factors, &params, &support::stream(3)).unwrap();
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
    let fitness = |_: usize, x: &Vector3<f64>| {
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
            ..OptimiseParams::self_adaptive(3)
        };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let start = |run: usize| Vector3::new(2.0, -3.0, run as f64);
                let sizes = Vector3::new(1.0, 2.0, 0.5);
                optimise_restarting(start, &sizes, &fitness, &params, &support::stream(3)).unwrap()
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
