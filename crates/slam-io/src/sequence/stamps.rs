//! Units of time stamps.
//!
//! Seconds are expected. A stamp that counts from 1970 tells its unit by its size alone: of the years 2001 to 2100 the
//! seconds lie around 1e9, the milliseconds around 1e12, the microseconds around 1e15, the nanoseconds around 1e18. Such
//! stamps are converted, and the user is told. Stamps that start at zero tell nothing for certain: where their steps
//! cannot be seconds the file is refused with the unit that would fit.

use crate::error::SequenceError;
use std::path::Path;

/// Seconds from 1970 of the years 2001 and 2100, rounded outwards.
const EPOCH_S: std::ops::Range<f64> = 9.7e8..4.2e9;
/// No camera and no odometer of a robot waits longer between two readings, seconds.
const LONGEST_STEP_S: f64 = 100.0;
/// The step that a wrong unit is judged by, seconds: that of a camera of 10 Hz.
const USUAL_STEP_S: f64 = 0.1;

/// A unit of time stamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimeUnit {
    Seconds,
    Milliseconds,
    Microseconds,
    Nanoseconds,
}

impl TimeUnit {
    const ALL: [TimeUnit; 4] = [
        TimeUnit::Seconds,
        TimeUnit::Milliseconds,
        TimeUnit::Microseconds,
        TimeUnit::Nanoseconds,
    ];

    /// The unit of stamps that count from 1970; `None` when the stamps count from anything else.
    ///
    /// `step` is the usual difference of two stamps in the same unit, as a second witness.
    pub(crate) fn since_1970(stamp: f64, step: Option<f64>) -> Option<TimeUnit> {
        Self::ALL.into_iter().find(|unit| {
            EPOCH_S.contains(&(stamp / unit.per_second()))
                && step.is_none_or(|step| step / unit.per_second() <= LONGEST_STEP_S)
        })
    }

    /// How many of the unit are a second.
    pub(crate) fn per_second(self) -> f64 {
        match self {
            TimeUnit::Seconds => 1.0,
            TimeUnit::Milliseconds => 1e3,
            TimeUnit::Microseconds => 1e6,
            TimeUnit::Nanoseconds => 1e9,
        }
    }

    /// The word for messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            TimeUnit::Seconds => "seconds",
            TimeUnit::Milliseconds => "milliseconds",
            TimeUnit::Microseconds => "microseconds",
            TimeUnit::Nanoseconds => "nanoseconds",
        }
    }

    /// Seconds of a finite stamp; `text` is how it was written, whose digits may be more than a float holds.
    pub(crate) fn seconds(self, text: &str, value: f64) -> f64 {
        if self == TimeUnit::Seconds {
            return value;
        }
        match text.parse::<u64>() {
            Ok(count) => {
                let per_second = self.per_second() as u64;
                (count / per_second) as f64 + (count % per_second) as f64 / self.per_second()
            }
            Err(_) => value / self.per_second(),
        }
    }
}

/// The median of the differences of neighbours; `None` for fewer than two values.
pub(crate) fn median_step(values: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

/// Refuses stamps whose usual step is no number of seconds; `what` names the readings in the plural.
pub(crate) fn refuse_other_units(
    path: &Path,
    what: &str,
    values: &[f64],
) -> Result<(), SequenceError> {
    let Some(step) = median_step(values).filter(|&step| step > LONGEST_STEP_S) else {
        return Ok(());
    };
    // The unit in which the step is nearest to the usual one, as a ratio.
    let far = |unit: TimeUnit| (step / unit.per_second() / USUAL_STEP_S).ln().abs();
    let unit = TimeUnit::ALL
        .into_iter()
        .min_by(|&a, &b| far(a).total_cmp(&far(b)))
        .unwrap_or(TimeUnit::Nanoseconds);
    Err(SequenceError::File {
        path: path.to_path_buf(),
        expected: "times in seconds".into(),
        found: format!(
            "{what} that are {step} apart: these look like {}, divide them by {:e}",
            unit.name(),
            unit.per_second()
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_since_1970_tell_their_unit() {
        let unit = TimeUnit::since_1970;
        assert_eq!(unit(1.4e9, Some(0.05)), Some(TimeUnit::Seconds));
        assert_eq!(unit(1.4e12, Some(33.0)), Some(TimeUnit::Milliseconds));
        assert_eq!(unit(1.4e15, None), Some(TimeUnit::Microseconds));
        assert_eq!(unit(1.4e18, Some(5e7)), Some(TimeUnit::Nanoseconds));
        assert_eq!(unit(0.0, Some(0.1)), None);
        // Nanoseconds since the computer started, half an hour ago: no milliseconds since 1970.
        assert_eq!(unit(1.8e12, Some(3.3e7)), None);
    }

    #[test]
    fn long_stamps_lose_nothing_but_the_last_digits_of_a_float() {
        let text = "1403715273262142976";
        let seconds = TimeUnit::Nanoseconds.seconds(text, text.parse().unwrap());
        assert_eq!(seconds, 1_403_715_273.262_143);
        assert_eq!(TimeUnit::Milliseconds.seconds("1.5e3", 1.5e3), 1.5);
    }

    #[test]
    fn regress_steps_that_are_no_seconds_are_refused_with_their_unit() {
        let path = Path::new("times.txt");
        let refused = |step: f64| {
            let values: Vec<f64> = (0..5).map(|k| f64::from(k) * step).collect();
            refuse_other_units(path, "frames", &values)
                .err()
                .map(|fault| fault.to_string())
        };
        assert_eq!(refused(0.5), None);
        assert_eq!(refused(60.0), None);
        assert_eq!(
            refused(5e8).unwrap(),
            "times.txt: expected times in seconds, found frames that are 500000000 apart: these look like \
             nanoseconds, divide them by 1e9"
        );
        assert!(refused(33_333.0).unwrap().contains("microseconds"));
        assert!(refused(500.0).unwrap().contains("milliseconds"));
    }
}
