//! The optimiser for vectors whose dimension is known at run time, with bounds.
//!
//! [`optimise_vector`] is [`crate::optimise`] with a slice for a genome. Coordinates with a least or greatest value are searched
//! through a fold ([`Bounds`]), so that an optimum at a bound or in a corner is found as any other; a constraint that is no
//! bound is still said by a log-fitness of minus infinity, or better by a penalty that says which way is in.

use nalgebra::DVector;
use rand::Rng;

use crate::bounds::{Bounds, check_dimension};
use crate::error::EvolveError;
use crate::optimise::{OptimiseParams, OptimiseStop, check_step_sizes, search};

/// The result of a run of [`optimise_vector`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct VectorOptimum {
    /// The best vector evaluated.
    pub best: Vec<f64>,
    /// Its log-fitness.
    pub log_fitness: f64,
    /// The last centre. Not evaluated; under noise the better estimate.
    pub centre: Vec<f64>,
    /// Standard deviation of the next step along each coordinate, away from bounds.
    pub step_sizes: Vec<f64>,
    /// Generations done.
    pub generations: usize,
    /// Calls of the fitness.
    pub evaluations: usize,
    /// Why the run ended.
    pub stop: OptimiseStop,
}

/// Maximises a log-fitness over vectors inside `bounds`, from `start`.
///
/// `step_sizes`, `streams`, `params` and the cost are those of [`crate::optimise`]. A start outside the bounds is brought to the
/// nearest point inside. The fitness never sees a vector outside.
///
/// # Errors
/// [`EvolveError::Dimension`] for lists of different lengths or none, otherwise as [`crate::optimise`].
pub fn optimise_vector<R: Rng>(
    start: &[f64],
    step_sizes: &[f64],
    bounds: &Bounds,
    fitness: &(impl Fn(usize, &[f64]) -> f64 + Sync),
    params: &OptimiseParams,
    streams: &(impl Fn(usize, usize) -> R + Sync),
) -> Result<VectorOptimum, EvolveError> {
    let dimension = start.len();
    check_dimension("coordinates of the start", dimension, dimension.max(1))?;
    check_dimension("step sizes", step_sizes.len(), dimension)?;
    check_dimension("bounds", bounds.dimension(), dimension)?;
    check_step_sizes(step_sizes)?;
    let inside = |u: &DVector<f64>| -> Vec<f64> {
        (0..dimension)
            .map(|i| bounds.folded(i, u[i], step_sizes[i]))
            .collect()
    };
    let unfolded = DVector::from_fn(dimension, |i, _| {
        bounds.unfolded(i, start[i], step_sizes[i])
    });
    let sizes = DVector::from_column_slice(step_sizes);
    let found = search(
        dimension,
        &unfolded,
        |centre, step| centre + sizes.component_mul(step),
        &|slot, u: &DVector<f64>| fitness(slot, &inside(u)),
        params,
        streams,
    )?;
    Ok(VectorOptimum {
        best: inside(&found.best),
        log_fitness: found.log_fitness,
        centre: inside(&found.centre),
        step_sizes: sizes.component_mul(&found.deviations).as_slice().to_vec(),
        generations: found.generations,
        evaluations: found.generations * params.offspring,
        stop: found.stop,
    })
}
