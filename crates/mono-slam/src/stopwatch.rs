//! Wall time of the stages of a frame, from a clock that the caller owns.

use slam_io::StageTimes;
use slam_pipeline::{Stage, StageObserver};

/// A monotonic clock in seconds, given by the caller.
pub(crate) type Clock<'a> = dyn Fn() -> f64 + Sync + 'a;

/// Time since the last lap.
pub(crate) struct Lap<'a> {
    clock: &'a Clock<'a>,
    last_s: f64,
}

impl<'a> Lap<'a> {
    /// Starts timing.
    pub(crate) fn start(clock: &'a Clock<'a>) -> Self {
        Self {
            clock,
            last_s: clock(),
        }
    }

    /// Milliseconds since the last lap, and a new lap.
    pub(crate) fn lap_ms(&mut self) -> f64 {
        let now = (self.clock)();
        let ms = (now - self.last_s) * 1e3;
        self.last_s = now;
        ms
    }
}

/// An observer of the frame loop that times the stages.
pub(crate) struct StageClock<'a> {
    lap: Lap<'a>,
    current: Option<Stage>,
    laps: StageTimes,
}

impl<'a> StageClock<'a> {
    /// Starts before the first stage.
    pub(crate) fn start(clock: &'a Clock<'a>) -> Self {
        Self {
            lap: Lap::start(clock),
            current: None,
            laps: StageTimes::default(),
        }
    }

    /// Ends the last stage and gives the times of all.
    pub(crate) fn stop(mut self) -> StageTimes {
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
            // a stage of a later version has no column
            Some(_) => {}
        }
    }
}

impl StageObserver for StageClock<'_> {
    fn begin(&mut self, stage: Stage) {
        self.end_stage();
        self.current = Some(stage);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    /// The clock advances by one second whenever it is read.
    #[test]
    fn a_stage_lasts_until_the_next_one_begins() {
        let seconds = AtomicU32::new(0);
        let clock = || f64::from(seconds.fetch_add(1, Ordering::Relaxed));
        let mut stages = StageClock::start(&clock);
        stages.begin(Stage::Association);
        stages.begin(Stage::Mapping);
        stages.begin(Stage::Mapping);
        let times = stages.stop();
        let expected = StageTimes {
            association_ms: 1e3,
            mapping_ms: 2e3,
            ..StageTimes::default()
        };
        assert_eq!(times, expected);
    }
}
