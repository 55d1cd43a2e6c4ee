//! Settings of the two movers.

use crate::error::{EvolveError, check_probability, check_scale};

/// Settings of [`crate::resample_move`].
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
    pub(crate) fn check(&self) -> Result<(), EvolveError> {
        check_probability("crossover_share", self.crossover_share)?;
        check_scale("mutation_scale", self.mutation_scale)?;
        check_scale("differential_scale", self.differential_scale)?;
        check_scale("jitter_scale", self.jitter_scale)
    }
}

/// Settings of [`crate::evolve_paper`]; the defaults are the paper's.
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
    pub(crate) fn check(&self) -> Result<(), EvolveError> {
        check_probability("p_c1", self.p_c1)?;
        check_probability("p_c2", self.p_c2)?;
        check_probability("p_m1", self.p_m1)?;
        check_probability("p_m2", self.p_m2)
    }
}
