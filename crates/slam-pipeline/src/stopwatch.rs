//! Wall time from a clock the caller owns: this crate reads none.

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

    /// Time of the last lap, clock seconds.
    #[must_use]
    pub fn last_s(&self) -> f64 {
        self.last_s
    }
}
