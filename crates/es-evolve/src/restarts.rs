//! Restarts with a growing population (IPOP; Auger and Hansen 2005).
//!
//! Problem: a run that ended in a local optimum says nothing of the others. Each further run starts elsewhere with twice the
//! parents and offspring: a larger population averages over more of a rugged function and sees less of its detail.

use estimation_base::Manifold;
use nalgebra::SVector;
use rand::Rng;

use crate::error::EvolveError;
use crate::optimise::{OptimiseParams, OptimiseStop, Optimum, optimise};

/// [`optimise`], again and again with doubled populations, until the target is reached or the budget does not allow
/// another generation.
///
/// `start(run)` gives the genome run 0, 1, ... starts from, best drawn over the region where the optimum may lie. `params`
/// are those of the first run, its budget that of all runs: keep it finite. Generations are numbered through for `streams`. The
/// best genome is that of all runs, with the generations and evaluations of all; centre, step sizes and reason to
/// stop are those of the last.
///
/// # Errors
/// As [`optimise`], of any run.
///
/// ```
/// use es_evolve::{OptimiseParams, OptimiseStop, optimise_restarting};
/// use nalgebra::Vector2;
/// use rand::{RngExt, SeedableRng};
/// use rand_chacha::ChaCha8Rng;
///
/// let streams = |generation: usize, offspring: usize| {
///     let mut rng = ChaCha8Rng::seed_from_u64(42);
///     rng.set_stream((generation as u64) << 32 | offspring as u64);
///     rng
/// };
/// // Rastrigin's function: a hundred local optima, the best at zero.
/// let wave = |x: f64| x * x + 10.0 * (1.0 - (std::f64::consts::TAU * x).cos());
/// let log_fitness = |_: usize, x: &Vector2<f64>| -(wave(x[0]) + wave(x[1]));
/// let start = |run: usize| {
///     let mut rng = ChaCha8Rng::seed_from_u64(run as u64);
///     Vector2::from_fn(|_, _| rng.random_range(-5.0..5.0))
/// };
/// let params = OptimiseParams { target: -1e-6, max_evaluations: 100_000, ..OptimiseParams::for_dimension(2) };
/// let found = optimise_restarting(start, &Vector2::new(2.0, 2.0), &log_fitness, &params, &streams)?;
/// assert!(matches!(found.stop, OptimiseStop::Target { .. }));
/// assert!(found.best.norm() < 1e-3);
/// # Ok::<(), es_evolve::EvolveError>(())
/// ```
pub fn optimise_restarting<const D: usize, G, R>(
    start: impl Fn(usize) -> G,
    step_sizes: &SVector<f64, D>,
    fitness: &(impl Fn(usize, &G) -> f64 + Sync),
    params: &OptimiseParams,
    streams: &(impl Fn(usize, usize) -> R + Sync),
) -> Result<Optimum<G, D>, EvolveError>
where
    G: Manifold<D> + Send + Sync,
    R: Rng,
{
    let mut params = *params;
    let max_evaluations = params.max_evaluations;
    let mut total = optimise(&start(0), step_sizes, fitness, &params, streams)?;
    let mut run = 1;
    loop {
        params.parents *= 2;
        params.offspring *= 2;
        params.max_evaluations = max_evaluations - total.evaluations;
        if matches!(total.stop, OptimiseStop::Target { .. }) {
            return Ok(total);
        }
        if params.offspring > params.max_evaluations {
            let evaluations = total.evaluations;
            total.stop = OptimiseStop::Budget {
                evaluations,
                max_evaluations,
            };
            return Ok(total);
        }
        let done = total.generations;
        let numbered = |generation: usize, slot: usize| streams(done + generation, slot);
        let mut next = optimise(&start(run), step_sizes, fitness, &params, &numbered)?;
        next.generations += total.generations;
        next.evaluations += total.evaluations;
        if next.log_fitness < total.log_fitness {
            next.log_fitness = total.log_fitness;
            next.best = total.best;
        }
        total = next;
        run += 1;
    }
}
