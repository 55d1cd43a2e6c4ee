//! The frame of both movers: ordered maps over slots (on several threads with the `parallel` feature), checked fitness
//! values, the Metropolis rule, phases that are done whole or not at all, and a copy that is thrown away after an error.

use estimation_base::Manifold;
use nalgebra::SVector;
use rand::{Rng, RngExt};

use crate::error::EvolveError;
use crate::report::{EvolutionReport, StopReason};
use crate::step::StepFactors;

/// `f` of every item, in the order of the items.
#[cfg(feature = "parallel")]
pub(crate) fn map_ordered<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    use rayon::prelude::*;
    items.par_iter().map(&f).collect()
}

/// `f` of every item, in the order of the items.
#[cfg(not(feature = "parallel"))]
pub(crate) fn map_ordered<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    items.iter().map(f).collect()
}

/// The population of a mover on its way, with what happened so far.
#[derive(Debug)]
pub(crate) struct Run<'a, G, F> {
    population: &'a mut [G],
    fitness: &'a F,
    report: EvolutionReport,
    max_evaluations: usize,
}

/// Runs `phases` on a copy of the population, after the checks and the first look at every slot; the population takes the
/// outcome only when nothing failed.
pub(crate) fn evolve_copy<const D: usize, G: Clone + Sync, F: Fn(usize, &G) -> f64 + Sync>(
    population: &mut [G],
    fitness: &F,
    factors: StepFactors<'_, D>,
    max_evaluations: usize,
    phases: impl FnOnce(&mut Run<'_, G, F>) -> Result<(), EvolveError>,
) -> Result<EvolutionReport, EvolveError> {
    let size = population.len();
    factors.check(size)?;
    if size == 0 {
        return Err(EvolveError::EmptyPopulation);
    }
    if max_evaluations < size {
        return Err(EvolveError::Budget {
            max_evaluations,
            required: size,
        });
    }
    let report = EvolutionReport::new(evaluate_all(population, fitness)?);
    let mut evolved = population.to_vec();
    let mut run = Run {
        population: &mut evolved,
        fitness,
        report,
        max_evaluations,
    };
    phases(&mut run)?;
    let report = run.report;
    population.swap_with_slice(&mut evolved);
    Ok(report)
}

impl<G: Send + Sync, F: Fn(usize, &G) -> f64 + Sync> Run<'_, G, F> {
    /// Log-fitness of the present genome of each slot.
    pub(crate) fn log_fitness(&self) -> &[f64] {
        &self.report.log_fitness
    }

    /// Notes that so many steps are done.
    pub(crate) const fn finish_step(&mut self, steps: usize) {
        self.report.stop = StopReason::Steps { steps };
    }

    /// One phase: every item proposes children, at most `children` of them, from the population as it stands; then all
    /// accepted ones take their slots. False, with the reason noted, when the budget does not allow the phase.
    pub(crate) fn phase<T: Sync, C: IntoIterator<Item = Child<G>> + Send>(
        &mut self,
        items: &[T],
        children: usize,
        propose: impl Fn(&Parents<'_, G, F>, &T) -> Result<C, EvolveError> + Sync,
    ) -> Result<bool, EvolveError> {
        if !self
            .report
            .affords(children * items.len(), self.max_evaluations)
        {
            return Ok(false);
        }
        let parents = Parents {
            genomes: self.population,
            log_fitness: &self.report.log_fitness,
            fitness: self.fitness,
        };
        let proposed = map_ordered(items, |item| propose(&parents, item));
        let proposed = proposed
            .into_iter()
            .collect::<Result<Vec<C>, EvolveError>>()?;
        settle(
            proposed.into_iter().flatten(),
            self.population,
            &mut self.report,
        );
        Ok(true)
    }
}

/// The population that a phase proposes from.
#[derive(Debug)]
pub(crate) struct Parents<'a, G, F> {
    pub(crate) genomes: &'a [G],
    pub(crate) log_fitness: &'a [f64],
    fitness: &'a F,
}

impl<G, F: Fn(usize, &G) -> f64 + Sync> Parents<'_, G, F> {
    /// The genome `step` away from that of the slot, judged there against log-fitness `rival` by the Metropolis rule.
    pub(crate) fn child<const D: usize>(
        &self,
        slot: usize,
        step: &SVector<f64, D>,
        rival: f64,
        from_crossover: bool,
        rng: &mut impl Rng,
    ) -> Result<Child<G>, EvolveError>
    where
        G: Manifold<D>,
    {
        let genome = self.genomes[slot].retract(step);
        let log_fitness = evaluate(self.fitness, slot, &genome)?;
        Ok(Child {
            slot,
            genome,
            log_fitness,
            accepted: metropolis(log_fitness, rival, rng.random()),
            from_crossover,
        })
    }
}

/// Log-fitness of every slot; the error of the lowest slot when several are wrong.
fn evaluate_all<G: Sync>(
    population: &[G],
    fitness: &(impl Fn(usize, &G) -> f64 + Sync),
) -> Result<Vec<f64>, EvolveError> {
    let slots: Vec<usize> = (0..population.len()).collect();
    let values = map_ordered(&slots, |&slot| evaluate(fitness, slot, &population[slot]));
    values.into_iter().collect()
}

/// Log-fitness of one genome, refused when NaN or plus infinity.
pub(crate) fn evaluate<G>(
    fitness: &(impl Fn(usize, &G) -> f64 + Sync),
    slot: usize,
    genome: &G,
) -> Result<f64, EvolveError> {
    let value = fitness(slot, genome);
    if value < f64::INFINITY {
        Ok(value)
    } else {
        Err(EvolveError::LogFitness { slot, value })
    }
}

/// A proposed genome and what became of it.
#[derive(Debug)]
pub(crate) struct Child<G> {
    pub(crate) slot: usize,
    pub(crate) genome: G,
    pub(crate) log_fitness: f64,
    pub(crate) accepted: bool,
    pub(crate) from_crossover: bool,
}

/// Counts the children and puts the accepted ones into their slots.
fn settle<G>(
    children: impl IntoIterator<Item = Child<G>>,
    population: &mut [G],
    report: &mut EvolutionReport,
) {
    for child in children {
        report.evaluations += 1;
        let accepted = usize::from(child.accepted);
        if child.from_crossover {
            report.proposed_crossovers += 1;
            report.accepted_crossovers += accepted;
        } else {
            report.proposed_mutations += 1;
            report.accepted_mutations += accepted;
        }
        if child.accepted {
            population[child.slot] = child.genome;
            report.log_fitness[child.slot] = child.log_fitness;
        }
    }
}

/// Metropolis rule in log space: accepted with probability min(1, exp(child - parent)).
///
/// An impossible child is refused, also by an impossible parent (0/0 is read as no improvement). `uniform` lies in [0, 1).
fn metropolis(child: f64, parent: f64, uniform: f64) -> bool {
    child > parent || (child > f64::NEG_INFINITY && uniform < (child - parent).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metropolis_at_its_edges() {
        let impossible = f64::NEG_INFINITY;
        assert!(metropolis(0.0, impossible, 0.99));
        assert!(!metropolis(impossible, impossible, 0.0));
        assert!(!metropolis(impossible, 0.0, 0.0));
        assert!(metropolis(3.0, 3.0, 0.999_999));
        // Far below the range of exp as plain fitness values, half as fit.
        let parent = -1e6;
        let child = parent - 2.0_f64.ln();
        assert!(metropolis(child, parent, 0.499));
        assert!(!metropolis(child, parent, 0.501));
    }

    #[test]
    fn nan_and_plus_infinity_name_the_lowest_slot() {
        let population = [0.0, 1.0, 2.0, 3.0];
        for bad in [f64::NAN, f64::INFINITY] {
            let fitness = |slot: usize, _: &f64| if slot % 2 == 1 { bad } else { 0.0 };
            assert!(matches!(
                evaluate_all(&population, &fitness),
                Err(EvolveError::LogFitness { slot: 1, .. })
            ));
        }
        let fitness = |_: usize, _: &f64| f64::NEG_INFINITY;
        assert!(evaluate_all(&population, &fitness).is_ok());
    }
}
