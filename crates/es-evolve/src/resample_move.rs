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
//! When not to use: to find the best genome. This does not climb.

use rand::{Rng, RngExt};

use crate::error::{check_probability, check_scale};
use crate::slots::{Child, evaluate, evolve_copy, map_ordered, metropolis, settle};
use crate::step::standard_normal;
use crate::{EvolutionReport, EvolveError, LogFitness, Space, StepFactors, StopReason};

/// Optimal random-walk scale times the root of the dimension.
const OPTIMAL_SCALE: f64 = 2.38;

/// Settings of [`resample_move`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MoveParams {
    /// Steps; each moves every slot once. Default 4.
    pub steps: usize,
    /// Probability that a slot proposes a crossover rather than a mutation, 0..=1. Default 0.5.
    pub crossover_share: f64,
    /// Size of mutations relative to the optimum 2.38 / sqrt(D) in units of the step factor, at least 0. Default 1.
    pub mutation_scale: f64,
    /// Size of differences relative to the optimum 2.38 / sqrt(2 D), at least 0. Default 1.
    pub differential_scale: f64,
    /// Size of the random part of crossover in units of the step factor, at least 0. It must be positive for crossover
    /// alone to reach everywhere. Default 0.05.
    pub jitter_scale: f64,
    /// Most calls of the fitness. Default `usize::MAX`.
    pub max_evaluations: usize,
}

impl Default for MoveParams {
    fn default() -> Self {
        Self {
            steps: 4,
            crossover_share: 0.5,
            mutation_scale: 1.0,
            differential_scale: 1.0,
            jitter_scale: 0.05,
            max_evaluations: usize::MAX,
        }
    }
}

impl MoveParams {
    fn check(&self) -> Result<(), EvolveError> {
        check_probability("crossover_share", self.crossover_share)?;
        check_scale("mutation_scale", self.mutation_scale)?;
        check_scale("differential_scale", self.differential_scale)?;
        check_scale("jitter_scale", self.jitter_scale)
    }
}

/// Moves every slot by Metropolis-Hastings steps that leave exp(log-fitness of the slot) invariant.
///
/// `factors` hold the factor L of each slot's step covariance; the slot's posterior covariance is the best choice, as
/// long as it was not computed from the genomes being moved. `streams(step, slot)` gives the generator of a slot
/// in a step; no (step, slot) is asked for twice, so the result does not depend on the number of threads.
/// Exactly N (1 + `steps`) evaluations unless the budget ends the run.
///
/// # Errors
/// [`EvolveError::EmptyPopulation`], a parameter or factor out of range, a budget below N, or [`EvolveError::LogFitness`];
/// the population is then what it was.
pub fn resample_move<const D: usize, S: Space<D>, R: Rng>(
    space: &S,
    population: &mut [S::Genome],
    fitness: &impl LogFitness<S::Genome>,
    factors: StepFactors<'_, D>,
    params: &MoveParams,
    streams: &(impl Fn(usize, usize) -> R + Sync),
) -> Result<EvolutionReport, EvolveError> {
    params.check()?;
    let budget = params.max_evaluations;
    evolve_copy(
        population,
        fitness,
        factors,
        budget,
        |population, report| {
            let size = population.len();
            // Even and odd rather than front and back: resampling leaves copies side by side.
            let even: Vec<usize> = (0..size).step_by(2).collect();
            let odd: Vec<usize> = (1..size).step_by(2).collect();
            for step in 0..params.steps {
                for (moving, resting) in [(&even, &odd), (&odd, &even)] {
                    if !report.affords(moving.len(), params.max_evaluations) {
                        return Ok(());
                    }
                    let values = &report.log_fitness;
                    let parents = &*population;
                    let children = map_ordered(moving, |&slot| {
                        let mut rng = streams(step, slot);
                        let (change, from_crossover) =
                            propose(space, parents, resting, factors, slot, params, &mut rng);
                        let genome = space.retract(&parents[slot], &change);
                        let log_fitness = evaluate(fitness, slot, &genome)?;
                        Ok(Child {
                            slot,
                            genome,
                            log_fitness,
                            accepted: metropolis(log_fitness, values[slot], rng.random()),
                            from_crossover,
                        })
                    });
                    let children = children
                        .into_iter()
                        .collect::<Result<Vec<_>, EvolveError>>()?;
                    settle(children, population, report);
                }
                report.stop = StopReason::Steps { steps: step + 1 };
            }
            Ok(())
        },
    )
}

/// The step a slot tries, symmetric about zero and blind to the moving half, and whether it is a crossover.
fn propose<const D: usize, S: Space<D>>(
    space: &S,
    parents: &[S::Genome],
    resting: &[usize],
    factors: StepFactors<'_, D>,
    slot: usize,
    params: &MoveParams,
    rng: &mut impl Rng,
) -> ([f64; D], bool) {
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
    let difference = space.local(&parents[resting[b]], &parents[resting[a]]);
    let jitter = factors.apply(slot, params.jitter_scale, &standard_normal(rng));
    (
        std::array::from_fn(|i| gain * difference[i] + jitter[i]),
        true,
    )
}
