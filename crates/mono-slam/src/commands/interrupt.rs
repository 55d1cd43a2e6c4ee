//! Ctrl-C: the first one ends a run after its frame, the second one ends the process at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::failure::{Failure, SIGNAL_CODE};

/// A listener to the signals that ask a process to end.
pub(crate) struct Interrupt {
    /// Number of the signal that came; zero before.
    signal: Arc<AtomicUsize>,
}

impl Interrupt {
    /// From now on the first signal is noted, and the second one ends the process.
    pub(crate) fn listen() -> Result<Self, Failure> {
        let came = Arc::new(AtomicBool::new(false));
        let number = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM] {
            // In this order: the end looks at the flag before this very signal raises it.
            flag::register_conditional_shutdown(signal, SIGNAL_CODE + signal, Arc::clone(&came))
                .and_then(|_| flag::register(signal, Arc::clone(&came)))
                .and_then(|_| {
                    flag::register_usize(
                        signal,
                        Arc::clone(&number),
                        signal.unsigned_abs() as usize,
                    )
                })
                .map_err(|error| Failure::Other(error.into()))?;
        }
        Ok(Self { signal: number })
    }

    /// The signal that came, if any.
    pub(crate) fn signal(&self) -> Option<i32> {
        match self.signal.load(Ordering::Relaxed) {
            0 => None,
            number => i32::try_from(number).ok(),
        }
    }
}
