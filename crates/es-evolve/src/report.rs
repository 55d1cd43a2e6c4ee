//! The account of a run: proposals, acceptances, evaluations, and why it stopped.

/// Counts of one run and the fitness it ended with.
#[derive(Debug, Clone, PartialEq)]
pub struct EvolutionReport {
    /// Children proposed by crossover.
    pub proposed_crossovers: usize,
    /// Children of crossover that replaced their slot's genome.
    pub accepted_crossovers: usize,
    /// Children proposed by mutation.
    pub proposed_mutations: usize,
    /// Children of mutation that replaced their slot's genome.
    pub accepted_mutations: usize,
    /// Calls of the fitness, the first look at every slot included.
    pub evaluations: usize,
    /// Log-fitness of each slot's final genome.
    pub log_fitness: Vec<f64>,
    /// Why the run ended.
    pub stop: StopReason,
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// All steps asked for were done.
    Steps {
        /// Number of steps done.
        steps: usize,
    },
    /// The next phase could have exceeded the budget. Phases are done whole or not at all, so the answer does not
    /// depend on which slot would have come first.
    Budget {
        /// Evaluations spent.
        evaluations: usize,
        /// The most evaluations the next phase could have cost.
        next_phase: usize,
        /// The budget.
        max_evaluations: usize,
    },
}

impl EvolutionReport {
    /// After the first look at every slot.
    pub(crate) const fn new(log_fitness: Vec<f64>) -> Self {
        Self {
            proposed_crossovers: 0,
            accepted_crossovers: 0,
            proposed_mutations: 0,
            accepted_mutations: 0,
            evaluations: log_fitness.len(),
            log_fitness,
            stop: StopReason::Steps { steps: 0 },
        }
    }

    /// Share of all proposals that were accepted; `None` when there was none.
    #[must_use]
    pub fn acceptance(&self) -> Option<f64> {
        let proposed = self.proposed_crossovers + self.proposed_mutations;
        let accepted = self.accepted_crossovers + self.accepted_mutations;
        (proposed > 0).then(|| accepted as f64 / proposed as f64)
    }

    /// True if a phase of at most `next_phase` evaluations fits; records the stop if it does not.
    pub(crate) fn affords(&mut self, next_phase: usize, max_evaluations: usize) -> bool {
        let fits = next_phase <= max_evaluations.saturating_sub(self.evaluations);
        if !fits {
            self.stop = StopReason::Budget {
                evaluations: self.evaluations,
                next_phase,
                max_evaluations,
            };
        }
        fits
    }
}
