//! One clock for images and odometry of a log.
//!
//! A message has two times: the stamp that its sender put into the header, and the time at which the recorder received it.
//! The stamps are better, since they know nothing of the delay on the way. They are used where they are set, where they
//! rise from message to message, and where those of images and odometry are of one clock: simulators count from zero, and
//! the clocks of two computers may be days apart. Otherwise the recorder's times are used for both, with a warning.

use crate::warning::Warning;

/// Two clocks whose differences to the recorder's time are further apart than this are different clocks, in seconds.
const SAME_CLOCK_S: f64 = 1.0;
/// Share of steps that may go back or stand still in stamps that are used; messages overtake one another on the way.
const DISORDER: f64 = 0.02;

/// A message with both of its times.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stamped<T> {
    /// Time of the recorder.
    pub(super) log_ns: i64,
    /// Stamp of the header, where the type has one.
    pub(super) header_ns: Option<i64>,
    pub(super) value: T,
}

/// Values and their times in seconds.
pub(super) type Timed<T> = Vec<(f64, T)>;

/// Images and odometry on one clock, times strictly increasing.
pub(super) fn common_clock<A, B>(
    images: Vec<Stamped<A>>,
    odometry: Vec<Stamped<B>>,
    warnings: &mut Vec<Warning>,
) -> (Timed<A>, Timed<B>) {
    let (of_images, of_odometry) = (delay_s(&images), delay_s(&odometry));
    let mut reason = None;
    let headers = match (of_images, of_odometry) {
        (Some(a), Some(b)) if (a - b).abs() > SAME_CLOCK_S => {
            reason = Some(format!(
                "the stamps of the images are {a:.3} s behind the recorder's clock and those of the odometry {b:.3} s, \
                 which are two clocks"
            ));
            (false, false)
        }
        (Some(_), Some(_)) => (true, true),
        // Velocities without a header: they are as late as the recorder says.
        (Some(a), None) if !odometry.is_empty() => {
            let same = a.abs() <= SAME_CLOCK_S;
            let without = odometry.iter().all(|message| message.header_ns.is_none());
            reason = Some(if without {
                format!(
                    "the odometry has no stamps{}",
                    if same {
                        ""
                    } else {
                        ", and those of the images are of another clock than the recorder's"
                    }
                )
            } else {
                "the stamps of the odometry are not set or do not rise".into()
            });
            (same, false)
        }
        (None, _) if !images.is_empty() => {
            reason = Some("the stamps of the images are not set or do not rise".into());
            (
                false,
                of_odometry.is_some_and(|delay| delay.abs() <= SAME_CLOCK_S),
            )
        }
        (a, b) => (a.is_some(), b.is_some()),
    };
    if let Some(reason) = reason {
        let whose = match headers {
            (true, _) => "for it",
            (_, true) => "for them",
            _ => "for both",
        };
        warnings.push(Warning::new(
            "times-of-the-recorder",
            format!(
                "In this log {reason}: the times at which the recorder received the messages are taken {whose}, so that \
                 delays on the way stay in."
            ),
        ));
    }
    let images = timed(images, headers.0, "images", warnings);
    (
        images,
        timed(odometry, headers.1, "odometry messages", warnings),
    )
}

/// Median of recorder's time minus stamp in seconds; `None` where the stamps cannot be used.
fn delay_s<T>(messages: &[Stamped<T>]) -> Option<f64> {
    let mut delays = Vec::with_capacity(messages.len());
    let (mut disorder, mut zeros) = (0_usize, 0_usize);
    let mut last = None;
    for message in messages {
        let stamp = message.header_ns?;
        zeros += usize::from(stamp == 0);
        disorder += usize::from(last.is_some_and(|last| stamp <= last));
        last = Some(stamp);
        delays.push((message.log_ns as f64 - stamp as f64) * 1e-9);
    }
    let unset = messages.len() > 1 && zeros > 1 || messages.len() == 1 && zeros == 1;
    if delays.is_empty() || unset || disorder as f64 > DISORDER * messages.len() as f64 {
        return None;
    }
    delays.sort_by(f64::total_cmp);
    Some(delays[delays.len() / 2])
}

/// Messages by one of their times, in order; those whose time is that of another are left out.
fn timed<T>(
    messages: Vec<Stamped<T>>,
    header: bool,
    what: &str,
    warnings: &mut Vec<Warning>,
) -> Timed<T> {
    let mut timed: Vec<(i64, T)> = messages
        .into_iter()
        .map(|message| {
            let ns = message.header_ns.filter(|_| header);
            (ns.unwrap_or(message.log_ns), message.value)
        })
        .collect();
    timed.sort_by_key(|(ns, _)| *ns);
    let before = timed.len();
    timed.dedup_by_key(|(ns, _)| *ns);
    if timed.len() < before {
        warnings.push(Warning::new(
            "repeated-times",
            format!(
                "{} of {before} {what} have the time of the one before them and are left out.",
                before - timed.len()
            ),
        ));
    }
    timed
        .into_iter()
        .map(|(ns, value)| (ns as f64 / 1e9, value))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// Messages every 100 ms with stamps that are `delay_ms` before the recorder's times.
    fn stream(delay_ms: Option<i64>, count: i64) -> Vec<Stamped<i64>> {
        (0..count)
            .map(|k| {
                let log_ns = 1_700_000_000_000 * MS + 100 * MS * k;
                Stamped {
                    log_ns,
                    header_ns: delay_ms.map(|delay| log_ns - delay * MS),
                    value: k,
                }
            })
            .collect()
    }

    fn clocks(images: Option<i64>, odometry: Option<i64>) -> (f64, f64, Vec<Warning>) {
        let mut warnings = Vec::new();
        let (a, b) = common_clock(stream(images, 30), stream(odometry, 30), &mut warnings);
        let delay = |first: f64| ((1_700_000_000.0 - first) * 1e3).round();
        (delay(a[0].0), delay(b[0].0), warnings)
    }

    #[test]
    fn stamps_are_used_where_both_are_of_one_clock() {
        let (a, b, warnings) = clocks(Some(40), Some(5));
        assert_eq!((a, b), (40.0, 5.0));
        assert!(warnings.is_empty());
        // A simulator's clock, the same for both.
        let (a, b, warnings) = clocks(Some(1_699_999_000_040), Some(1_699_999_000_005));
        assert_eq!(a - b, 35.0);
        assert!(warnings.is_empty());
    }

    #[test]
    fn two_clocks_or_missing_stamps_fall_back_to_the_recorder() {
        for (images, odometry, used) in [
            (Some(40), Some(3_600_000), (0.0, 0.0)),
            (Some(40), None, (40.0, 0.0)),
            (Some(3_600_000), None, (0.0, 0.0)),
            (None, Some(5), (0.0, 5.0)),
        ] {
            let (a, b, warnings) = clocks(images, odometry);
            assert_eq!((a, b), used, "{images:?}, {odometry:?}");
            assert_eq!(warnings.len(), 1);
            assert_eq!(warnings[0].name, "times-of-the-recorder");
        }
    }

    #[test]
    fn stamps_that_stand_still_are_not_used_and_single_repetitions_are_left_out() {
        let mut zeros = stream(Some(0), 30);
        for message in &mut zeros {
            message.header_ns = Some(0);
        }
        assert_eq!(delay_s(&zeros), None);
        let mut one_repeated = stream(Some(5), 100);
        one_repeated[50].header_ns = one_repeated[49].header_ns;
        let mut warnings = Vec::new();
        let (images, _) = common_clock(one_repeated, stream(Some(5), 3), &mut warnings);
        assert_eq!(images.len(), 99);
        assert!(images.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!(warnings[0].name, "repeated-times");
        assert!(warnings[0].message.starts_with("1 of 100 images"));
    }
}
