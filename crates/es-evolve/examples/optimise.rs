//! Minimises Rosenbrock's and Rastrigin's functions in ten dimensions.

use es_evolve::{EvolveError, OptimiseParams, OptimiseStop, optimise, optimise_restarting};
use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const D: usize = 10;

type Vector = SVector<f64, D>;

/// One generator for each (generation, offspring).
fn stream(generation: usize, offspring: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    rng.set_stream((generation as u64) << 32 | offspring as u64);
    rng
}

fn rosenbrock(x: &Vector) -> f64 {
    x.as_slice()
        .windows(2)
        .map(|pair| 100.0 * (pair[1] - pair[0] * pair[0]).powi(2) + (1.0 - pair[0]).powi(2))
        .sum()
}

fn rastrigin(x: &Vector) -> f64 {
    x.iter()
        .map(|v| v * v + 10.0 * (1.0 - (TAU * v).cos()))
        .sum()
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn show(name: &str, value: f64, evaluations: usize, stop: OptimiseStop) {
    println!("{name}: {value:.1e} after {evaluations} evaluations, {stop:?}");
}

fn main() -> Result<(), EvolveError> {
    // A curved valley: one run with a covariance that learns its direction. The fitness is maximised, hence the sign.
    let fitness = |_: usize, x: &Vector| -rosenbrock(x);
    let params = OptimiseParams {
        target: -1e-10,
        ..OptimiseParams::for_dimension(D)
    };
    let found = optimise(
        &Vector::zeros(),
        &Vector::repeat(0.5),
        &fitness,
        &params,
        &stream,
    )?;
    let value = -found.log_fitness;
    show("Rosenbrock", value, found.evaluations, found.stop);

    // Some 10^10 local optima: restarts with growing populations from anywhere in the box.
    let fitness = |_: usize, x: &Vector| -rastrigin(x);
    let params = OptimiseParams {
        target: -1e-6,
        min_step_size: 1e-6,
        ..params
    };
    let start = |run: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(2 + run as u64);
        Vector::from_fn(|_, _| rng.random_range(-5.0..5.0))
    };
    let found = optimise_restarting(start, &Vector::repeat(5.0), &fitness, &params, &stream)?;
    let value = -found.log_fitness;
    show("Rastrigin", value, found.evaluations, found.stop);
    Ok(())
}
