//! Metropolis-Hastings moves of a population (resample-move; Gilks and Berzuini 2001): a sampler.
//!
//! Problem: after resampling many genomes are copies. Moves that leave the target of each slot, exp(log-fitness
//! of that slot), invariant restore the spread and keep the weights at 1/N.
//!
//! One step moves the slots with even numbers, then those with odd numbers. Every slot i of the moving half proposes one of
//! - crossover, with probability `crossover_share`: c = s_i + g (s_a - s_b) + e, with a and b two different slots of
//!   the half at rest (differential evolution Markov chain, ter Braak 2006; halves as in Goodman and Weare 2010);
//! - mutation: c = s_i + e, a random walk;
//!
//! e ~ N(0, scale^2 L L^T), and accepts it with probability min(1, exp(log f_i(c) - log f_i(s_i))). Both proposals are symmetric: the
//! difference has the same distribution as its negative, and does not depend on the half that moves. So each half-step leaves the product of the
//! targets invariant, whether the slots' targets are equal or not. The choice of operator does not look at the genomes.
//! Steps are optimal for Gaussian targets with covariance L L^T at scale 2.38 / sqrt(D) for the walk (Roberts, Gelman and Gilks
//! 1997) and g = 2.38 / sqrt(2 D) for the difference; the parameters are relative to these.
//!
//! Degenerate cases: a resting half of fewer than two slots (N of 1 and 2; for N = 3 the even half) allows no
//! crossover and its slots mutate. Copies among a and b give a zero difference, then e alone moves. A genome that is
//! impossible in its slot accepts any possible child.
//!
//! The proposals are as likely backward as forward only if the genome's [`Manifold`] satisfies two conditions besides its
//! laws:
//! - a step is undone by its negative: `g.retract(v).retract(-v) == g`;
//! - `retract` keeps volumes in the coordinates in which the fitness is a density.
//!
//! Plain addition with wrapped angles satisfies both, and so does the group exponential of SE(2) with a density in (x, y,
//! heading). A translation in body axes with a separate turn does not: its backward step is read in other axes than its
//! forward step.
//!
//! When not to use: to find the best genome. This does not climb.

use estimation_base::Manifold;
use nalgebra::SVector;
use rand::{Rng, RngExt};

use crate::error::EvolveError;
use crate::params::MoveParams;
use crate::report::EvolutionReport;
use crate::slots::evolve_copy;
use crate::step::{StepFactors, standard_normal};

/// Optimal random-walk scale times the root of the dimension.
const OPTIMAL_SCALE: f64 = 2.38;

/// Moves every slot by Metropolis-Hastings steps that leave exp(log-fitness of the slot) invariant.
///
/// `fitness(slot, genome)` is the log-density of the slot's target, up to a constant of the slot; for that a
/// step of the genome must be undone by its negative, and `retract` must keep volumes in the coordinates of the density
/// (additive coordinates with wrapped angles do, and SE(2) by its exponential; body axes with a separate turn do not).
/// `factors` hold the factor L of each slot's step covariance; the slot's posterior covariance is the best choice, as
/// long as it was not computed from the genomes being moved. `streams(step, slot)` gives the generator of a slot
/// in a step; no (step, slot) is asked for twice, so the result does not depend on the number of threads.
/// Exactly N (1 + `steps`) evaluations unless the budget ends the run.
///
/// # Errors
/// [`EvolveError::EmptyPopulation`], a parameter or factor out of range, a budget below N, or [`EvolveError::LogFitness`];
/// the population is then what it was.
pub fn resample_move<const D: usize, G, R>(
    population: &mut [G],
    fitness: &(impl Fn(usize, &G) -> f64 + Sync),
    factors: StepFactors<'_, D>,
    params: &MoveParams,
    streams: &(impl Fn(usize, usize) -> R + Sync),
) -> Result<EvolutionReport, EvolveError>
where
    G: Manifold<D> + Send + Sync,
    R: Rng,
{
    params.check()?;
    // Even and odd rather than front and back: resampling leaves copies side by side.
    let even: Vec<usize> = (0..population.len()).step_by(2).collect();
    let odd: Vec<usize> = (1..population.len()).step_by(2).collect();
    let budget = params.max_evaluations;
    evolve_copy(population, fitness, factors, budget, |run| {
        for step in 0..params.steps {
            for (moving, resting) in [(&even, &odd), (&odd, &even)] {
                let moved = run.phase(moving, 1, |parents, &slot| {
                    let mut rng = streams(step, slot);
                    let (change, from_crossover) =
                        propose(parents.genomes, resting, factors, slot, params, &mut rng);
                    let present = parents.log_fitness[slot];
                    parents
                        .child(slot, &change, present, from_crossover, &mut rng)
                        .map(Some)
                })?;
                if !moved {
                    return Ok(());
                }
            }
            run.finish_step(step + 1);
        }
        Ok(())
    })
}

/// The step a slot tries, symmetric about zero and blind to the moving half, and whether it is a crossover.
fn propose<const D: usize, G: Manifold<D>>(
    parents: &[G],
    resting: &[usize],
    factors: StepFactors<'_, D>,
    slot: usize,
    params: &MoveParams,
    rng: &mut impl Rng,
) -> (SVector<f64, D>, bool) {
    let dimension = D as f64;
    let wants_crossover = rng.random::<f64>() < params.crossover_share;
    if !wants_crossover || resting.len() < 2 {
        let scale = params.mutation_scale * OPTIMAL_SCALE / dimension.sqrt();
        return (factors.apply(slot, scale, &standard_normal(rng)), false);
    }
    let a = rng.random_range(0..resting.len());
    // One of the others, all equally likely.
    let b = (a + rng.random_range(1..resting.len())) % resting.len();
    let gain = params.differential_scale * OPTIMAL_SCALE / (2.0 * dimension).sqrt();
    let difference = parents[resting[b]].local(&parents[resting[a]]);
    let jitter = factors.apply(slot, params.jitter_scale, &standard_normal(rng));
    (difference * gain + jitter, true)
}
