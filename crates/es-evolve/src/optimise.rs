//! Optimisation by a (mu/mu_I, lambda) evolution strategy with self-adapted step sizes (Beyer and Schwefel 2002).
//!
//! Problem: find the genome of greatest log-fitness, without derivatives. To minimise f, give -f: only the order of values
//! and the target are looked at.
//!
//! One generation: lambda offspring mutate the centre, each with its own step size; the mu best of them, and of them alone
//! (comma selection: the old centre does not compete), are averaged into the next centre and the next step sizes. Step sizes
//! are never set from outside: offspring with a good size survive. See [`StepAdaptation`] for the three shapes.
//!
//! Steps are taken in the tangent at the centre: the next centre is retract(centre, mean of the mu best steps). This needs
//! [`Manifold::retract`] only, so poses optimise as vectors do.
//!
//! Degenerate cases: an impossible offspring (log-fitness minus infinity) never survives; when fewer than mu are possible those
//! few are averaged. Equal fitness is ranked by offspring number.
//!
//! When not to use: with derivatives at hand, or to sample a distribution ([`crate::resample_move`]). Rugged functions
//! want a large population, not a long run: see [`crate::optimise_restarting`].

use estimation_base::{CholeskyError, Manifold};
use nalgebra::SVector;
use rand::Rng;

use crate::adaptation::{StepAdaptation, Strategy};
use crate::error::{EvolveError, check_scale};
use crate::slots::{evaluate, map_ordered};

/// Settings of [`optimise`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OptimiseParams {
    /// Survivors of a generation, mu, at least 1.
    pub parents: usize,
    /// Offspring of a generation, lambda, more than `parents`.
    pub offspring: usize,
    /// Shape of the mutations.
    pub adaptation: StepAdaptation,
    /// Log-fitness at which to stop; plus infinity never.
    pub target: f64,
    /// Largest standard deviation of a step, relative to the initial step sizes, below which the run has collapsed.
    pub min_step_size: f64,
    /// Generations without a better genome than the best so far, after which the run stagnates.
    pub max_stagnation: usize,
    /// Most calls of the fitness.
    pub max_evaluations: usize,
}

impl OptimiseParams {
    /// lambda = max(8, 4 D) and mu = lambda / 4 (Beyer and Sendhoff 2008), covariance adaptation, no target, collapse at 1e-9,
    /// stagnation after 100 + 10 D generations, 10^4 D evaluations.
    #[must_use]
    pub fn for_dimension(dimension: usize) -> Self {
        let offspring = (4 * dimension).max(8);
        Self {
            parents: offspring / 4,
            offspring,
            adaptation: StepAdaptation::Covariance,
            target: f64::INFINITY,
            min_step_size: 1e-9,
            max_stagnation: 100 + 10 * dimension,
            max_evaluations: 10_000 * dimension,
        }
    }

    fn check(&self) -> Result<(), EvolveError> {
        let Self {
            parents,
            offspring,
            max_evaluations,
            ..
        } = *self;
        if parents == 0 || parents >= offspring {
            return Err(EvolveError::Parents { parents, offspring });
        }
        if max_evaluations < offspring {
            return Err(EvolveError::Budget {
                max_evaluations,
                required: offspring,
            });
        }
        if self.target.is_nan() {
            return Err(EvolveError::Target);
        }
        check_scale("min_step_size", self.min_step_size)
    }
}

/// The result of a run of [`optimise`].
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum<G, const D: usize> {
    /// The best genome evaluated.
    pub best: G,
    /// Its log-fitness.
    pub log_fitness: f64,
    /// The last centre. Not evaluated; under noise the better estimate.
    pub centre: G,
    /// Standard deviation of the next step along each coordinate.
    pub step_sizes: SVector<f64, D>,
    /// Generations done.
    pub generations: usize,
    /// Calls of the fitness.
    pub evaluations: usize,
    /// Why the run ended.
    pub stop: OptimiseStop,
}

/// Why a run of [`optimise`] ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OptimiseStop {
    /// The best log-fitness reached the target.
    Target {
        /// The log-fitness reached.
        log_fitness: f64,
        /// The target.
        target: f64,
    },
    /// Steps became too small to matter, at an optimum (or a premature one).
    StepSize {
        /// Largest standard deviation of a step, relative to the initial sizes.
        largest: f64,
        /// The bound.
        min_step_size: f64,
    },
    /// No better genome was found for too many generations.
    Stagnation {
        /// Generations since it was found.
        generations: usize,
    },
    /// The next generation would exceed the budget.
    Budget {
        /// Evaluations spent.
        evaluations: usize,
        /// The budget.
        max_evaluations: usize,
    },
    /// The covariance of the steps lost positive definiteness by rounding: its condition passed about 1e16.
    Covariance {
        /// The pivot at which its factorisation failed.
        reason: CholeskyError,
    },
}

/// Maximises a log-fitness from `start`.
///
/// `step_sizes` give the initial standard deviation along each coordinate, about a third of the distance to where the optimum
/// may lie; they also set the relative scale of coordinates. `streams(generation, offspring)` gives the generator of an
/// offspring; no pair is asked for twice, and the result does not depend on the number of threads. The fitness is called with the
/// offspring's number as slot. Cost: lambda evaluations a generation, and what [`StepAdaptation`] says.
///
/// # Errors
/// A parameter or step size out of range, [`EvolveError::LogFitness`] for NaN or plus infinity (the slot is the
/// offspring's number), [`EvolveError::Impossible`] when a whole generation is impossible.
pub fn optimise<const D: usize, G, R>(
    start: &G,
    step_sizes: &SVector<f64, D>,
    fitness: &(impl Fn(usize, &G) -> f64 + Sync),
    params: &OptimiseParams,
    streams: &(impl Fn(usize, usize) -> R + Sync),
) -> Result<Optimum<G, D>, EvolveError>
where
    G: Manifold<D> + Send + Sync,
    R: Rng,
{
    params.check()?;
    check_step_sizes(step_sizes.as_slice())?;
    let in_tangent = |step: &SVector<f64, D>| step_sizes.component_mul(step);
    let slots: Vec<usize> = (0..params.offspring).collect();
    let mut strategy = Strategy::new(params.adaptation);
    let mut centre = start.clone();
    let mut best = start.clone();
    let mut log_fitness = f64::NEG_INFINITY;
    let mut best_generation = 0;
    let mut generation = 0;
    let stop = loop {
        let offspring = map_ordered(&slots, |&slot| {
            let mutation = strategy.mutate(&mut streams(generation, slot));
            let genome = centre.retract(&in_tangent(&mutation.step));
            let value = evaluate(fitness, slot, &genome)?;
            Ok((value, genome, mutation))
        });
        let mut offspring = offspring
            .into_iter()
            .collect::<Result<Vec<_>, EvolveError>>()?;
        // Stable, so equal values stay in the order of offspring.
        offspring.sort_by(|a, b| b.0.total_cmp(&a.0));
        let possible = offspring.partition_point(|child| child.0 > f64::NEG_INFINITY);
        if possible == 0 {
            return Err(EvolveError::Impossible {
                generation,
                offspring: params.offspring,
            });
        }
        let survivors: Vec<_> = offspring[..possible.min(params.parents)]
            .iter()
            .map(|child| &child.2)
            .collect();
        let recombined = strategy.recombine(&survivors);
        if offspring[0].0 > log_fitness {
            best.clone_from(&offspring[0].1);
            log_fitness = offspring[0].0;
            best_generation = generation;
        }
        let stagnant = generation - best_generation;
        generation += 1;
        match recombined {
            Ok(step) => centre = centre.retract(&in_tangent(&step)),
            Err(reason) => break OptimiseStop::Covariance { reason },
        }
        let largest = strategy.deviations().iter().copied().fold(0.0, f64::max);
        let evaluations = generation * params.offspring;
        if log_fitness >= params.target {
            let target = params.target;
            break OptimiseStop::Target {
                log_fitness,
                target,
            };
        } else if largest < params.min_step_size {
            let min_step_size = params.min_step_size;
            break OptimiseStop::StepSize {
                largest,
                min_step_size,
            };
        } else if stagnant >= params.max_stagnation {
            break OptimiseStop::Stagnation {
                generations: stagnant,
            };
        } else if params.offspring > params.max_evaluations - evaluations {
            let max_evaluations = params.max_evaluations;
            break OptimiseStop::Budget {
                evaluations,
                max_evaluations,
            };
        }
    };
    let deviations = strategy.deviations();
    Ok(Optimum {
        best,
        log_fitness,
        centre,
        step_sizes: in_tangent(&deviations),
        generations: generation,
        evaluations: generation * params.offspring,
        stop,
    })
}

fn check_step_sizes(sizes: &[f64]) -> Result<(), EvolveError> {
    match sizes
        .iter()
        .position(|size| !(size.is_finite() && *size > 0.0))
    {
        Some(coordinate) => Err(EvolveError::StepSize {
            coordinate,
            given: sizes[coordinate],
        }),
        None => Ok(()),
    }
}
