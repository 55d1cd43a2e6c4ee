//! Where genomes live and how good they are.
//!
//! Operators add and subtract genomes, which angles do not allow directly. A [`Space`] says how a genome is moved by a
//! tangent vector and which tangent vector leads from one genome to another, so that headings stay on the circle.

/// Moves and compares genomes by tangent vectors of dimension `D`.
///
/// `retract(from, local(from, to))` must give `to`. [`crate::resample_move`] needs two things more, because
/// its proposals must be as likely backward as forward:
/// - a step is undone by its negative: `retract(retract(g, v), -v) == g`;
/// - `retract(g, ..)` keeps volumes in the coordinates in which the fitness is a density.
///
/// Plain addition with wrapped angles satisfies both, and so does the group exponential of SE(2) with density in
/// (x, y, heading). Moving by a translation in body axes while turning by a separate angle does not: its backward step is read
/// in other axes than its forward step.
pub trait Space<const D: usize>: Sync {
    /// One candidate solution.
    type Genome: Clone + Send + Sync;

    /// The genome reached from `at` by a tangent step.
    fn retract(&self, at: &Self::Genome, step: &[f64; D]) -> Self::Genome;

    /// The tangent step that leads from `from` to `to`, angles wrapped.
    fn local(&self, from: &Self::Genome, to: &Self::Genome) -> [f64; D];
}

/// Vectors of `D` numbers under plain addition.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Euclidean;

impl<const D: usize> Space<D> for Euclidean {
    type Genome = [f64; D];

    fn retract(&self, at: &[f64; D], step: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|i| at[i] + step[i])
    }

    fn local(&self, from: &[f64; D], to: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|i| to[i] - from[i])
    }
}

/// Natural logarithm of a fitness that may depend on the slot.
///
/// Minus infinity means impossible. NaN and plus infinity are errors. Evaluations of one phase run in parallel
/// and in no promised order, so the value must depend on the arguments alone.
pub trait LogFitness<G>: Sync {
    /// Log-fitness of `genome`, were it in `slot`.
    fn log_fitness(&self, slot: usize, genome: &G) -> f64;
}

impl<G, F: Fn(usize, &G) -> f64 + Sync> LogFitness<G> for F {
    fn log_fitness(&self, slot: usize, genome: &G) -> f64 {
        self(slot, genome)
    }
}
