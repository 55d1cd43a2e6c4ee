//! How far a study is, and how long it still takes.

use std::sync::Mutex;
use std::time::Instant;

/// Lines on finished trials, with the time left by the work done so far.
pub(crate) struct Progress<'a> {
    tell: &'a (dyn Fn(&str) + Sync),
    start: Instant,
    all: Work,
    done: Mutex<Work>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Work {
    trials: usize,
    cost: f64,
}

impl<'a> Progress<'a> {
    /// Nothing is done yet of trials with these costs.
    pub(crate) fn new(costs: impl Iterator<Item = f64>, tell: &'a (dyn Fn(&str) + Sync)) -> Self {
        let mut all = Work::default();
        for cost in costs {
            all.trials += 1;
            all.cost += cost;
        }
        Self {
            tell,
            start: Instant::now(),
            all,
            done: Mutex::default(),
        }
    }

    /// A trial is finished.
    pub(crate) fn finished(&self, cost: f64, what: &str) {
        let done = {
            let mut done = self
                .done
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner);
            done.trials += 1;
            done.cost += cost;
            *done
        };
        let left_s = self.start.elapsed().as_secs_f64() * (self.all.cost / done.cost - 1.0);
        (self.tell)(&format!(
            "[{}/{}, {} left] {what}",
            done.trials,
            self.all.trials,
            duration(left_s)
        ));
    }
}

/// Seconds in words.
fn duration(seconds: f64) -> String {
    let seconds = seconds.max(0.0).round() as u64;
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", seconds.div_ceil(60)),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_go_up_and_nothing_is_left_at_the_end() {
        let lines = Mutex::new(Vec::new());
        let tell = |line: &str| lines.lock().unwrap().push(line.to_owned());
        let progress = Progress::new([1.0, 3.0].into_iter(), &tell);
        progress.finished(3.0, "big");
        progress.finished(1.0, "small");
        let lines = lines.lock().unwrap();
        assert!(lines[0].starts_with("[1/2, ") && lines[0].ends_with("] big"));
        assert_eq!(lines[1], "[2/2, 0 s left] small");
    }

    #[test]
    fn durations_are_told_in_fitting_units() {
        let texts = [0.4, 119.0, 121.0, 7300.0].map(duration);
        assert_eq!(texts, ["0 s", "119 s", "3 min", "2 h 1 min"]);
    }
}
