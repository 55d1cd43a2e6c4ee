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

use estimation_base::Manifold;
use rand::{Rng, RngExt};

use crate::error::EvolveError;
use crate::params::PaperParams;
use crate::rates::AdaptiveRates;
use crate::report::EvolutionReport;
use crate::slots::evolve_copy;
use crate::step::{StepFactors, standard_normal};

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
///
/// ```
/// use es_evolve::{PaperParams, StepFactors, evolve_paper};
/// use nalgebra::Matrix1;
/// use rand::SeedableRng;
/// use rand_chacha::ChaCha8Rng;
///
/// let mut population: Vec<f64> = (0..40).map(|i| 0.1 * f64::from(i)).collect();
/// let log_fitness = |_slot: usize, x: &f64| -0.5 * (x - 3.0).powi(2);
/// let streams = |phase: usize, slot: usize| {
///     let mut rng = ChaCha8Rng::seed_from_u64(42);
///     rng.set_stream((phase as u64) << 32 | slot as u64);
///     rng
/// };
/// let before: f64 = population.iter().map(|x| log_fitness(0, x)).sum();
/// let factor = Matrix1::new(0.3);
/// let report =
///     evolve_paper(&mut population, &log_fitness, StepFactors::Common(&factor), &PaperParams::default(), &streams)?;
/// let after: f64 = population.iter().map(|x| log_fitness(0, x)).sum();
/// assert!(after > before && report.evaluations > 40);
/// # Ok::<(), es_evolve::EvolveError>(())
/// ```
pub fn evolve_paper<const D: usize, G, R>(
    population: &mut [G],
    fitness: &(impl Fn(usize, &G) -> f64 + Sync),
    factors: StepFactors<'_, D>,
    params: &PaperParams,
    streams: &(impl Fn(usize, usize) -> R + Sync),
) -> Result<EvolutionReport, EvolveError>
where
    G: Manifold<D> + Send + Sync,
    R: Rng,
{
    params.check()?;
    let size = population.len();
    let slots: Vec<usize> = (0..size).collect();
    let budget = params.max_evaluations;
    evolve_copy(population, fitness, factors, budget, |run| {
        for step in 0..params.steps {
            let pairs = random_pairs(size, &mut streams(2 * step, size));
            let rates = AdaptiveRates::new(params, run.log_fitness());
            let crossed = run.phase(&pairs, 2, |parents, &(first, second)| {
                let (one, other) = (parents.log_fitness[first], parents.log_fitness[second]);
                let mut rng = streams(2 * step, first);
                if rng.random::<f64>() >= rates.crossover(one, other) {
                    return Ok(Vec::new());
                }
                let kappa: f64 = rng.random();
                let normal = standard_normal(&mut rng);
                let mut child = |slot: usize, mate: usize| {
                    let toward_mate = parents.genomes[slot].local(&parents.genomes[mate]);
                    let tau = factors.apply(slot, 1.0, &normal);
                    let blend = toward_mate * (1.0 - kappa) + tau;
                    parents.child(slot, &blend, one.max(other), true, &mut rng)
                };
                Ok(vec![child(first, second)?, child(second, first)?])
            })?;
            if !crossed {
                return Ok(());
            }
            let rates = AdaptiveRates::new(params, run.log_fitness());
            let mutated = run.phase(&slots, 1, |parents, &slot| {
                let present = parents.log_fitness[slot];
                let mut rng = streams(2 * step + 1, slot);
                if rng.random::<f64>() >= rates.mutation(present) {
                    return Ok(None);
                }
                let change = factors.apply(slot, 1.0, &standard_normal(&mut rng));
                parents
                    .child(slot, &change, present, false, &mut rng)
                    .map(Some)
            })?;
            if !mutated {
                return Ok(());
            }
            run.finish_step(step + 1);
        }
        Ok(())
    })
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
