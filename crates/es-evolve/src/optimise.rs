//! Optimisation by a (mu/mu_I, lambda) evolution strategy that adapts its steps (Beyer and Schwefel 2002, Hansen 2016).
//!
//! Problem: find the genome of greatest log-fitness, without derivatives. To minimise f, give -f: only the order of values
//! and the target are looked at.
//!
//! One generation: lambda offspring mutate the centre; the mu best of them, and of them alone (comma selection: the old centre
//! does not compete), are averaged into the next centre and tell the next steps. Step sizes are never set from outside. See
//! [`StepAdaptation`] for the shapes.
//!
//! Steps are taken in the tangent at the centre: the next centre is retract(centre, mean of the mu best steps). This needs
//! [`Manifold::retract`] only, so poses optimise as vectors do.
//!
//! [`crate::optimise_vector`] is the same for vectors whose dimension is known at run time, with bounds for each coordinate.
//!
//! Degenerate cases: an impossible offspring (log-fitness minus infinity) never survives; when fewer than mu are possible those
//! few are averaged. Equal fitness is ranked by offspring number. Steps that shrink while offspring are impossible shrink against an
//! edge, along which they may have been too large to follow it to the optimum: [`OptimiseStop::Edge`] says so.
//!
//! When not to use: with derivatives at hand, or to sample a distribution ([`crate::resample_move`]). Rugged functions
//! want a large population, not a long run: see [`crate::optimise_restarting`].

use estimation_base::{CholeskyError, Manifold};
use nalgebra::{DVector, SVector};
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
    /// lambda = 4 + 3 ln D and mu = lambda / 2 (Hansen 2016), steps along evolution paths, no target, collapse at 1e-9,
    /// stagnation after 100 + 10 D generations, 10^4 D evaluations.
    #[must_use]
    pub fn for_dimension(dimension: usize) -> Self {
        let offspring = 4 + (3.0 * (dimension.max(1) as f64).ln()) as usize;
        Self {
            parents: offspring / 2,
            offspring,
            adaptation: StepAdaptation::Paths,
            ..Self::self_adaptive(dimension)
        }
    }

    /// lambda = max(8, 4 D) and mu = lambda / 4, self-adapted covariance (Beyer and Sendhoff 2008), the rest as
    /// [`Self::for_dimension`]: more evaluations, and step sizes that differ within a generation.
    #[must_use]
    pub fn self_adaptive(dimension: usize) -> Self {
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
#[non_exhaustive]
pub enum OptimiseStop {
    /// The best log-fitness reached the target.
    Target {
        /// The log-fitness reached.
        log_fitness: f64,
        /// The target.
        target: f64,
    },
    /// Steps became too small to matter, at an optimum (or a premature one), and hardly an offspring was impossible.
    StepSize {
        /// Largest standard deviation of a step, relative to the initial sizes.
        largest: f64,
        /// The bound.
        min_step_size: f64,
    },
    /// Steps became too small while offspring were impossible: they shrank against an edge of what is possible, and the best
    /// genome need not be an optimum along it. Or a whole generation after the first was impossible. Bounds of single coordinates belong into [`crate::optimise_vector`].
    Edge {
        /// Largest standard deviation of a step, relative to the initial sizes.
        largest: f64,
        /// The bound.
        min_step_size: f64,
        /// Share of impossible offspring in the last generations (those of about ten, the latest counting most).
        impossible: f64,
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
/// offspring's number), [`EvolveError::Impossible`] when the whole first generation is impossible.
///
/// ```
/// use es_evolve::{OptimiseParams, OptimiseStop, optimise};
/// use nalgebra::Vector2;
/// use rand::SeedableRng;
/// use rand_chacha::ChaCha8Rng;
///
/// # fn main() -> Result<(), es_evolve::EvolveError> {
/// let log_fitness = |_: usize, x: &Vector2<f64>| -(x - Vector2::new(1.0, -2.0)).norm_squared();
/// let streams = |generation: usize, offspring: usize| {
///     let mut rng = ChaCha8Rng::seed_from_u64(7);
///     rng.set_stream((generation as u64) << 32 | offspring as u64);
///     rng
/// };
/// let params = OptimiseParams { target: -1e-10, ..OptimiseParams::for_dimension(2) };
/// let (start, step_sizes) = (Vector2::zeros(), Vector2::repeat(0.5));
/// let found = optimise(&start, &step_sizes, &log_fitness, &params, &streams)?;
/// assert!(matches!(found.stop, OptimiseStop::Target { .. }));
/// assert!((found.best - Vector2::new(1.0, -2.0)).norm() < 1e-4);
/// # Ok(())
/// # }
/// ```
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
    check_step_sizes(step_sizes.as_slice())?;
    let in_tangent = |step: &DVector<f64>| SVector::from_fn(|i: usize, _| step_sizes[i] * step[i]);
    let found = search(
        D,
        start,
        |centre, step| centre.retract(&in_tangent(step)),
        fitness,
        params,
        streams,
    )?;
    Ok(Optimum {
        best: found.best,
        log_fitness: found.log_fitness,
        centre: found.centre,
        step_sizes: in_tangent(&found.deviations),
        generations: found.generations,
        evaluations: found.generations * params.offspring,
        stop: found.stop,
    })
}

/// The end of a search.
pub(crate) struct Found<G> {
    pub(crate) best: G,
    pub(crate) log_fitness: f64,
    pub(crate) centre: G,
    /// Standard deviation of the next step along each coordinate, relative to the initial sizes.
    pub(crate) deviations: DVector<f64>,
    pub(crate) generations: usize,
    pub(crate) stop: OptimiseStop,
}

/// Weight of one generation in the share of impossible offspring.
const RECENT: f64 = 0.1;
/// Share of impossible offspring that chance leaves far from every edge.
const AT_EDGE: f64 = 0.01;

/// The search of [`optimise`] in a space of which only `moved`(centre, step in units of the initial sizes) is known.
pub(crate) fn search<G: Clone + Send + Sync, R: Rng>(
    dimension: usize,
    start: &G,
    moved: impl Fn(&G, &DVector<f64>) -> G + Sync,
    fitness: &(impl Fn(usize, &G) -> f64 + Sync),
    params: &OptimiseParams,
    streams: &(impl Fn(usize, usize) -> R + Sync),
) -> Result<Found<G>, EvolveError> {
    params.check()?;
    let slots: Vec<usize> = (0..params.offspring).collect();
    let mut strategy = Strategy::new(
        params.adaptation,
        dimension,
        params.parents,
        params.offspring,
    );
    let mut centre = start.clone();
    let mut best = start.clone();
    let mut log_fitness = f64::NEG_INFINITY;
    let mut best_generation = 0;
    let mut generation = 0;
    let mut impossible = 0.0;
    let stop = loop {
        let offspring = map_ordered(&slots, |&slot| {
            let mutation = strategy.mutate(&mut streams(generation, slot));
            let genome = moved(&centre, &mutation.step);
            let value = evaluate(fitness, slot, &genome)?;
            Ok((value, genome, mutation))
        });
        let mut offspring = offspring
            .into_iter()
            .collect::<Result<Vec<_>, EvolveError>>()?;
        // Stable, so equal values stay in the order of offspring.
        offspring.sort_by(|a, b| b.0.total_cmp(&a.0));
        let possible = offspring.partition_point(|child| child.0 > f64::NEG_INFINITY);
        if possible == 0 && generation > 0 {
            // the steps have gone over an edge; what was found before stands
            generation += 1;
            break OptimiseStop::Edge {
                largest: strategy.deviations().iter().copied().fold(0.0, f64::max),
                min_step_size: params.min_step_size,
                impossible: 1.0,
            };
        }
        if possible == 0 {
            return Err(EvolveError::Impossible {
                generation,
                offspring: params.offspring,
            });
        }
        let lost = (params.offspring - possible) as f64 / params.offspring as f64;
        impossible += RECENT * (lost - impossible);
        let ranked: Vec<_> = offspring.iter().map(|child| &child.2).collect();
        let recombined = strategy.recombine(&ranked, possible);
        if offspring[0].0 > log_fitness {
            best.clone_from(&offspring[0].1);
            log_fitness = offspring[0].0;
            best_generation = generation;
        }
        let stagnant = generation - best_generation;
        generation += 1;
        match recombined {
            Ok(step) => centre = moved(&centre, &step),
            Err(reason) => break OptimiseStop::Covariance { reason },
        }
        let largest = strategy.deviations().iter().copied().fold(0.0, f64::max);
        let evaluations = generation * params.offspring;
        let min_step_size = params.min_step_size;
        if log_fitness >= params.target {
            let target = params.target;
            break OptimiseStop::Target {
                log_fitness,
                target,
            };
        } else if largest < min_step_size && impossible > AT_EDGE {
            break OptimiseStop::Edge {
                largest,
                min_step_size,
                impossible,
            };
        } else if largest < min_step_size {
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
    Ok(Found {
        best,
        log_fitness,
        centre,
        deviations: strategy.deviations(),
        generations: generation,
        stop,
    })
}

pub(crate) fn check_step_sizes(sizes: &[f64]) -> Result<(), EvolveError> {
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
