//! Wall time from a clock the caller owns: this crate reads none.

use crate::slam::{Stage, StageObserver};

/// A monotonic clock in seconds, given by the caller.
pub type Clock<'a> = dyn Fn() -> f64 + Sync + 'a;

/// Time since the last lap.
#[derive(Clone, Copy)]
pub struct Lap<'a> {
    clock: &'a Clock<'a>,
    last_s: f64,
}

impl core::fmt::Debug for Lap<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Lap").field("last_s", &self.last_s).finish()
    }
}

impl<'a> Lap<'a> {
    /// Starts timing.
    #[must_use]
    pub fn start(clock: &'a Clock<'a>) -> Self {
        Self {
            clock,
            last_s: clock(),
        }
    }

    /// Milliseconds since the last lap, and a new lap.
    pub fn lap_ms(&mut self) -> f64 {
        let now = (self.clock)();
        let ms = (now - self.last_s) * 1e3;
        self.last_s = now;
        ms
    }
}

/// Milliseconds that the stages of one frame took.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StageLaps {
    /// Association.
    pub association_ms: f64,
    /// Proposal.
    pub proposal_ms: f64,
    /// Evolution.
    pub evolution_ms: f64,
    /// Mapping.
    pub mapping_ms: f64,
}

/// An observer of the frame loop that times the stages.
#[derive(Debug)]
pub struct StageClock<'a> {
    lap: Lap<'a>,
    current: Option<Stage>,
    laps: StageLaps,
}

impl<'a> StageClock<'a> {
    /// Starts before the first stage.
    #[must_use]
    pub fn start(clock: &'a Clock<'a>) -> Self {
        Self {
            lap: Lap::start(clock),
            current: None,
            laps: StageLaps::default(),
        }
    }

    /// Ends the last stage.
    #[must_use]
    pub fn stop(mut self) -> StageLaps {
        self.end_stage();
        self.laps
    }

    fn end_stage(&mut self) {
        let ms = self.lap.lap_ms();
        match self.current {
            None => {}
            Some(Stage::Association) => self.laps.association_ms += ms,
            Some(Stage::Proposal) => self.laps.proposal_ms += ms,
            Some(Stage::Evolution) => self.laps.evolution_ms += ms,
            Some(Stage::Mapping) => self.laps.mapping_ms += ms,
        }
    }
}

impl StageObserver for StageClock<'_> {
    fn begin(&mut self, stage: Stage) {
        self.end_stage();
        self.current = Some(stage);
    }
}
