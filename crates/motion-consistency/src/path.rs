//! A path that was estimated with the help of images, held against the odometry that went into it.
//!
//! A filter that sees its landmarks corrects an odometry that is moderately wrong. What it corrected, again and again in
//! the same sense, is told here: turns too large or too small throughout, turns that come too early or too late.

use mono_geometry::Se2;
use mono_geometry::motion::OdometrySample;

use crate::finding::Finding;
use crate::pair::Claim;

/// Length of the pieces of the path, seconds: short ones see when a turn comes, long ones how large it is.
const CLOCK_INTERVAL_S: f64 = 0.3;
const RATIO_INTERVAL_S: f64 = 1.0;
/// Pieces needed for a statement on turns.
const MIN_INTERVALS: usize = 8;
/// Turn needed for a statement on the ratio of the turns, radians.
const MIN_TURNED_RAD: f64 = 1.0;
/// Ratios of the turns nearer to 1 are not told.
const MIN_RATIO_ERROR: f64 = 0.1;
/// A ratio is told from this many standard deviations.
const RATIO_SIGMAS: f64 = 5.0;
/// Offsets of the clock that are tried: steps to either side, seconds a step.
const OFFSET_STEPS: i32 = 100;
const OFFSET_STEP_S: f64 = 0.02;
/// Offsets below this are not told, seconds.
const MIN_OFFSET_S: f64 = 0.05;
/// The difference of the turns must fall to this share.
const MAX_OFFSET_SHARE: f64 = 0.6;
/// Differences of the turns below this are noise, radians.
const MIN_DIFFERENCE_RAD: f64 = 0.003;
/// Away from the best offset by this the difference must have grown by [`GROWN`], seconds.
const AWAY_S: f64 = 0.4;
const GROWN: f64 = 1.3;
/// The time between two poses of the path.
struct Interval {
    from_s: f64,
    to_s: f64,
    /// Turn of the path, radians in (-pi, pi].
    turn_rad: f64,
    /// The claim of the odometry.
    claim: Claim,
}

/// The contradiction between `path`, poses in order of time that images were used for, and `odometry`; empty where they fit.
///
/// Poses that were only carried on by odometry do not belong into `path`: they agree with it. O(path (log rows + rows of an
/// interval)), times 200 for the clocks.
#[must_use]
pub fn check_path(path: &[(f64, Se2)], odometry: &[OdometrySample]) -> Vec<Finding> {
    match clock_offset(&intervals(path, odometry, CLOCK_INTERVAL_S), odometry) {
        Some(offset) => vec![offset],
        None => turn_ratio(&intervals(path, odometry, RATIO_INTERVAL_S))
            .into_iter()
            .collect(),
    }
}

/// The path cut into pieces of at least `least_s` seconds.
fn intervals(path: &[(f64, Se2)], odometry: &[OdometrySample], least_s: f64) -> Vec<Interval> {
    let mut cut: Vec<(f64, Se2)> = Vec::new();
    for &(t_s, pose) in path {
        if cut
            .last()
            .is_none_or(|&(before_s, _)| t_s >= before_s + least_s)
        {
            cut.push((t_s, pose));
        }
    }
    cut.windows(2)
        .map(|ends| Interval {
            from_s: ends[0].0,
            to_s: ends[1].0,
            turn_rad: ends[0].1.between(&ends[1].1).phi,
            claim: Claim::of(odometry, ends[0].0, ends[1].0),
        })
        .collect()
}

/// The slope of the path's turns over the odometry's, where it is not 1.
fn turn_ratio(intervals: &[Interval]) -> Option<Finding> {
    let squares: f64 = intervals.iter().map(|i| i.claim.turn_rad.powi(2)).sum();
    let turned_rad: f64 = intervals.iter().map(|i| i.claim.turn_rad.abs()).sum();
    if intervals.len() < MIN_INTERVALS || turned_rad < MIN_TURNED_RAD {
        return None;
    }
    let products: f64 = intervals
        .iter()
        .map(|i| i.claim.turn_rad * i.turn_rad)
        .sum();
    let ratio = products / squares;
    // Noise of the odometry makes this slope too small, noise of the path makes that of the odometry over the path too
    // small: the truth lies between the two.
    let other = intervals.iter().map(|i| i.turn_rad.powi(2)).sum::<f64>() / products;
    let residual: f64 = intervals
        .iter()
        .map(|i| (i.turn_rad - ratio * i.claim.turn_rad).powi(2))
        .sum();
    let sigma = (residual / (intervals.len() - 1) as f64 / squares).sqrt();
    let error = (ratio - 1.0).abs();
    ((other - 1.0) * (ratio - 1.0) > 0.0
        && (other - 1.0).abs() > MIN_RATIO_ERROR
        && error > MIN_RATIO_ERROR
        && error > RATIO_SIGMAS * sigma)
        .then_some(Finding::PathTurnRatio {
            ratio,
            sigma,
            turned_rad,
        })
}

/// The offset of the odometry's clock that makes the turns fit; `None` where they fit as they are, or fit nowhere.
fn clock_offset(intervals: &[Interval], odometry: &[OdometrySample]) -> Option<Finding> {
    let (first_s, last_s) = (odometry.first()?.t_s, odometry.last()?.t_s);
    let reach_s = f64::from(OFFSET_STEPS) * OFFSET_STEP_S;
    // Mean over the intervals that the shifted odometry still covers.
    let difference = |offset_s: f64| {
        let mut sum = 0.0;
        let mut count = 0;
        for i in intervals {
            let (from_s, to_s) = (i.from_s - offset_s, i.to_s - offset_s);
            if from_s >= first_s && to_s <= last_s {
                let claim = Claim::of(odometry, from_s, to_s);
                sum += (claim.turn_rad - i.turn_rad).abs();
                count += 1;
            }
        }
        (count >= MIN_INTERVALS && 2 * count >= intervals.len())
            .then(|| (sum / f64::from(count as u32), count))
    };
    let (before_rad, _) = difference(0.0)?;
    let (offset_s, (after_rad, compared)) = (-OFFSET_STEPS..=OFFSET_STEPS)
        .map(|step| f64::from(step) * OFFSET_STEP_S)
        .filter_map(|offset_s| Some((offset_s, difference(offset_s)?)))
        .min_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let sharp = [-AWAY_S, AWAY_S]
        .iter()
        .all(|away| difference(offset_s + away).is_none_or(|(there, _)| there > GROWN * after_rad));
    (offset_s.abs() >= MIN_OFFSET_S
        && offset_s.abs() < reach_s - OFFSET_STEP_S
        && before_rad >= MIN_DIFFERENCE_RAD
        && after_rad <= MAX_OFFSET_SHARE * before_rad
        && sharp)
        .then_some(Finding::ClockOffset {
            offset_s,
            before_rad,
            after_rad,
            pairs: compared,
        })
}
