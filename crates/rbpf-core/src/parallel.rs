//! One piece of work for every particle, with the results in particle order.

/// Applies `work` to every particle and its slot, on several threads with the feature `parallel`.
///
/// The results are in slot order. Implementations of [`crate::Rejuvenation`] use it to run as
/// [`crate::ParticleFilter`] does.
pub fn map_particles<P: Send, R: Send>(
    particles: &mut [P],
    work: impl Fn(usize, &mut P) -> R + Sync,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        particles
            .par_iter_mut()
            .enumerate()
            .map(|(slot, particle)| work(slot, particle))
            .collect()
    }
    #[cfg(not(feature = "parallel"))]
    {
        particles
            .iter_mut()
            .enumerate()
            .map(|(slot, particle)| work(slot, particle))
            .collect()
    }
}

/// A failure, and the slot in which it happened.
type InSlot<E> = (usize, E);

/// All values, or the first failure in slot order.
pub(crate) fn first_error<T, E>(outcomes: Vec<Result<T, E>>) -> Result<Vec<T>, InSlot<E>> {
    outcomes
        .into_iter()
        .enumerate()
        .map(|(slot, outcome)| outcome.map_err(|error| (slot, error)))
        .collect()
}
