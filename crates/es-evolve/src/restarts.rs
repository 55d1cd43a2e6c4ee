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
