//! The published evolution strategy (Li, Hong, Cai and Luo 2006, II.D, Eq. 17-19): an optimiser.
//!
//! Problem: after resampling many genomes are copies. The paper mixes and perturbs them by their likelihood.
//! The equation for accepting a worse child of crossover is lost in print; by analogy with mutation it is read as
//! min(1, p(child) / max(p(parent 1), p(parent 2))).
//!
//! One step:
//! 1. Crossover (Eq. 17): slots are paired at random; a pair mates with probability p_c (Eq. 19). With kappa ~ U[0, 1) and tau ~ N(0, Sigma),
//!    both shared by the two children as printed, c1 = kappa p1 + (1 - kappa) p2 + tau and c2 likewise from p2.
//!    Blends run in the tangent of the parent, so headings stay on the circle. Child 1 may replace parent 1, child 2
//!    parent 2, each judged in the slot it would take.
//! 2. Mutation (Eq. 18): each slot, with probability p_m (Eq. 19), proposes c = p + N(0, Sigma), accepted by the Metropolis rule.
//!
//! Rates are frozen within each of the two phases, which keeps the phases independent of the order of slots.
//!
//! When not to use: wherever the population stands for a distribution. Blending draws the population together
//! and the rule with the greater parent climbs; the spread that remains says nothing about the posterior. Use
//! [`crate::resample_move`] there. This mode exists to reproduce published figures.
//!
//! Degenerate cases: one genome never mates; with an odd number one slot a step stays single.

use rand::{Rng, RngExt};

use crate::error::check_probability;
use crate::slots::{Child, evaluate, evolve_copy, map_ordered, metropolis, settle};
use crate::step::standard_normal;
use crate::{
    AdaptiveRates, EvolutionReport, EvolveError, LogFitness, Space, StepFactors, StopReason,
};

/// Settings of [`evolve_paper`]; the defaults are the paper's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperParams {
    /// Steps of crossover and mutation. Default 8.
    pub steps: usize,
    /// Probability of crossover for parents below average, 0..=1. Default 0.85.
    pub p_c1: f64,
    /// Probability of crossover for the best parent, 0..=1. Default 0.65.
    pub p_c2: f64,
    /// Probability of mutation below average, and for the best, 0..=1. Default 0.1.
    pub p_m1: f64,
    /// Probability of mutation at average, 0..=1. Default 0.001.
    pub p_m2: f64,
    /// Most calls of the fitness. Default `usize::MAX`.
    pub max_evaluations: usize,
}

impl Default for PaperParams {
    fn default() -> Self {
        Self {
            steps: 8,
            p_c1: 0.85,
            p_c2: 0.65,
            p_m1: 0.1,
            p_m2: 0.001,
            max_evaluations: usize::MAX,
        }
    }
}

impl PaperParams {
    fn check(&self) -> Result<(), EvolveError> {
        check_probability("p_c1", self.p_c1)?;
        check_probability("p_c2", self.p_c2)?;
        check_probability("p_m1", self.p_m1)?;
        check_probability("p_m2", self.p_m2)
    }
}

/// Evolves the population in place by the paper's operators.
///
/// `factors` hold the factor of Sigma. `streams(phase, slot)` gives the generator of a slot in a phase: step k has crossover as phase
/// 2k and mutation as phase 2k + 1; a pair draws from the stream of its first slot, and the pairing from slot number
/// `population.len()`. No (phase, slot) is asked for twice, so the result does not depend on the number of
/// threads. At most N + 2 N `steps` evaluations.
///
/// # Errors
/// [`EvolveError::EmptyPopulation`], a parameter or factor out of range, a budget below N, or [`EvolveError::LogFitness`];
/// the population is then what it was.
pub fn evolve_paper<const D: usize, S: Space<D>, R: Rng>(
    space: &S,
    population: &mut [S::Genome],
    fitness: &impl LogFitness<S::Genome>,
    factors: StepFactors<'_, D>,
    params: &PaperParams,
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
            for step in 0..params.steps {
                let pairs = random_pairs(size, &mut streams(2 * step, size));
                if !report.affords(2 * pairs.len(), params.max_evaluations) {
                    return Ok(());
                }
                let rates = AdaptiveRates::new(params, &report.log_fitness);
                let values = &report.log_fitness;
                let parents = &*population;
                let litters = map_ordered(&pairs, |&(first, second)| {
                    let mut rng = streams(2 * step, first);
                    if rng.random::<f64>() >= rates.crossover(values[first], values[second]) {
                        return Ok(None);
                    }
                    let kappa: f64 = rng.random();
                    let normal = standard_normal(&mut rng);
                    let best_parent = values[first].max(values[second]);
                    let mut child = |slot: usize, mate: usize| {
                        let toward_mate = space.local(&parents[slot], &parents[mate]);
                        let tau = factors.apply(slot, 1.0, &normal);
                        let blend =
                            std::array::from_fn(|i| (1.0 - kappa) * toward_mate[i] + tau[i]);
                        let genome = space.retract(&parents[slot], &blend);
                        let log_fitness = evaluate(fitness, slot, &genome)?;
                        Ok(Child {
                            slot,
                            genome,
                            log_fitness,
                            accepted: metropolis(log_fitness, best_parent, rng.random()),
                            from_crossover: true,
                        })
                    };
                    Ok(Some([child(first, second)?, child(second, first)?]))
                });
                let litters = litters
                    .into_iter()
                    .collect::<Result<Vec<_>, EvolveError>>()?;
                settle(litters.into_iter().flatten().flatten(), population, report);

                if !report.affords(size, params.max_evaluations) {
                    return Ok(());
                }
                let rates = AdaptiveRates::new(params, &report.log_fitness);
                let values = &report.log_fitness;
                let parents = &*population;
                let slots: Vec<usize> = (0..size).collect();
                let children = map_ordered(&slots, |&slot| {
                    let mut rng = streams(2 * step + 1, slot);
                    if rng.random::<f64>() >= rates.mutation(values[slot]) {
                        return Ok(None);
                    }
                    let sigma = factors.apply(slot, 1.0, &standard_normal(&mut rng));
                    let genome = space.retract(&parents[slot], &sigma);
                    let log_fitness = evaluate(fitness, slot, &genome)?;
                    Ok(Some(Child {
                        slot,
                        genome,
                        log_fitness,
                        accepted: metropolis(log_fitness, values[slot], rng.random()),
                        from_crossover: false,
                    }))
                });
                let children = children
                    .into_iter()
                    .collect::<Result<Vec<_>, EvolveError>>()?;
                settle(children.into_iter().flatten(), population, report);
                report.stop = StopReason::Steps { steps: step + 1 };
            }
            Ok(())
        },
    )
}

/// Disjoint pairs of slots, every pairing equally likely (Fisher-Yates).
fn random_pairs(size: usize, rng: &mut impl Rng) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..size).collect();
    for last in (1..size).rev() {
        order.swap(last, rng.random_range(0..=last));
    }
    order
        .chunks_exact(2)
        .map(|pair| (pair[0], pair[1]))
        .collect()
}
