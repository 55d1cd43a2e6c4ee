//! How far a run is, for the person who waits.

use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use mono_slam::run::Progress;

use crate::failure::tell;

/// Seconds between two lines of progress where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(3);

/// A bar on a terminal, a line now and then elsewhere, nothing when quiet.
pub(crate) enum Reporter {
    Quiet,
    Bar(ProgressBar),
    Lines {
        started: Instant,
        last: Mutex<Instant>,
    },
}

impl Reporter {
    /// One for a run of as many frames.
    pub(crate) fn new(quiet: bool, frames: usize) -> Self {
        if quiet {
            return Self::Quiet;
        }
        if !std::io::stderr().is_terminal() {
            let now = Instant::now();
            return Self::Lines {
                started: now,
                last: Mutex::new(now),
            };
        }
        let bar = ProgressBar::new(frames as u64);
        // Within 60 columns: the bar takes what the figures leave.
        if let Ok(style) =
            ProgressStyle::with_template("{wide_bar} {pos}/{len} {rate} {eta} left, {msg}")
        {
            let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
                // A bar that cannot be drawn is not drawn.
                let _ = write!(out, "{:.1} Hz", state.per_sec());
            };
            bar.set_style(style.with_key("rate", rate));
        }
        Self::Bar(bar)
    }

    /// After a frame.
    pub(crate) fn report(&self, p: Progress) {
        match self {
            Self::Quiet => {}
            Self::Bar(bar) => {
                bar.set_message(format!("{} landmarks", p.landmarks));
                bar.set_position(p.frame as u64);
            }
            Self::Lines { started, last } => {
                let Ok(mut last) = last.lock() else { return };
                if last.elapsed() < LINE_EVERY {
                    return;
                }
                *last = Instant::now();
                let rate = p.frame as f64 / started.elapsed().as_secs_f64();
                tell(&format!(
                    "frame {}/{}, {rate:.1} Hz, {:.0} s left, {} landmarks",
                    p.frame,
                    p.frames,
                    (p.frames - p.frame) as f64 / rate,
                    p.landmarks
                ));
            }
        }
    }

    /// Leaves the terminal as it was.
    pub(crate) fn finish(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}
