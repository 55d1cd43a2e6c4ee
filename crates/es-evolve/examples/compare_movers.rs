//! Shows how each variant changes samples of a known posterior.
//!
//! Prior N(0, 1), one observation z = 1 with unit noise: the posterior is N(0.5, 0.5).

use es_evolve::{EvolveError, MoveParams, PaperParams, StepFactors, evolve_paper, resample_move};
use nalgebra::Matrix1;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

fn stream(step: usize, slot: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    rng.set_stream((step as u64) << 32 | slot as u64);
    rng
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn show(name: &str, population: &[f64]) {
    let count = population.len() as f64;
    let mean = population.iter().sum::<f64>() / count;
    let variance = population.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
    println!("{name:<34} mean {mean:.3}   variance {variance:.3}");
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let posterior = Normal::new(0.5, 0.5_f64.sqrt())?;
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let samples: Vec<f64> = posterior.sample_iter(&mut rng).take(20_000).collect();
    let likelihood = |_: usize, x: &f64| -0.5 * (1.0 - x).powi(2);
    let target = |_: usize, x: &f64| -0.5 * (1.0 - x).powi(2) - 0.5 * x.powi(2);
    let factor = Matrix1::new(0.3);
    let factors = StepFactors::Common(&factor);

    show("posterior samples", &samples);
    let paper = |p_c: f64, p_m: f64| -> Result<Vec<f64>, EvolveError> {
        let params = PaperParams {
            p_c1: p_c,
            p_c2: p_c,
            p_m1: p_m,
            p_m2: p_m,
            ..PaperParams::default()
        };
        let mut population = samples.clone();
        evolve_paper(&mut population, &likelihood, factors, &params, &stream)?;
        Ok(population)
    };
    show("paper, crossover only", &paper(1.0, 0.0)?);
    show("paper, mutation only", &paper(0.0, 1.0)?);
    let mut population = samples.clone();
    let params = PaperParams::default();
    evolve_paper(&mut population, &likelihood, factors, &params, &stream)?;
    show("paper, as published", &population);
    let mut population = samples.clone();
    let params = MoveParams::default();
    resample_move(&mut population, &target, factors, &params, &stream)?;
    show("resample-move", &population);
    Ok(())
}
