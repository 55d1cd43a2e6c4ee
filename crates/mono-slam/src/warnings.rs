//! The words of a run on its inputs: whatever was seen in them that a user should know before believing the result.

use mono_geometry::Se2;
use mono_geometry::motion::{OdometrySample, held_between};
use motion_consistency::{Finding, check_path};
use slam_io::{FrameRecord, Sequence, Warning};

/// A reference pose this near to a frame is that frame's, seconds (as `trajectory-eval` pairs them).
const SAME_TIME_S: f64 = 0.01;
/// Keypoints below which a frame shows next to nothing.
const FEW_KEYPOINTS: usize = 20;
/// Matches below which a frame says next to nothing about the pose.
const FEW_MATCHES: usize = 5;
/// Share of the frames that may lack either without a word.
const LACKING_SHARE: f64 = 0.25;
/// Matches that a frame needs for its pose to be held against odometry.
const PATH_MATCHES: usize = 10;

/// The reference against the frames, to be told before the run.
#[must_use]
pub fn of_reference(sequence: &Sequence) -> Option<Warning> {
    let reference = sequence.reference.as_ref()?;
    let frames = &sequence.times_s;
    let (first_s, last_s) = (reference.first()?.0, reference.last()?.0);
    let covered = frames
        .iter()
        .filter(|&&frame_s| {
            let after = reference.partition_point(|&(t_s, _)| t_s < frame_s);
            [after.checked_sub(1), Some(after)]
                .into_iter()
                .flatten()
                .filter_map(|i| reference.get(i))
                .any(|&(t_s, _)| (t_s - frame_s).abs() <= SAME_TIME_S)
        })
        .count();
    let spans = format!(
        "the images last from {} to {} s, the reference from {first_s} to {last_s} s",
        frames.first()?,
        frames.last()?
    );
    if covered == 0 {
        Some(Warning::new(
            "reference-elsewhere",
            format!(
                "No pose of the reference lies within {:.0} ms of a frame, so no error is computed: {spans}{}.",
                SAME_TIME_S * 1e3,
                unit_hint(frames, reference)
            ),
        ))
    } else if covered < frames.len() {
        Some(Warning::new(
            "reference-in-part",
            format!(
                "The error is that of {covered} of {} frames: {spans}.",
                frames.len()
            ),
        ))
    } else {
        None
    }
}

/// Whether one of two clocks that do not meet seems to count in another unit.
fn unit_hint(frames: &[f64], reference: &[(f64, Se2)]) -> &'static str {
    let span = |first: f64, last: f64| (last - first).max(f64::MIN_POSITIVE);
    let (Some(a), Some(b)) = (
        frames.first().zip(frames.last()),
        reference.first().zip(reference.last()),
    ) else {
        return "";
    };
    let ratio = span(b.0.0, b.1.0) / span(*a.0, *a.1);
    if ratio > 100.0 {
        " (the reference seems to count in milliseconds or nanoseconds)"
    } else if ratio < 0.01 {
        " (the images seem to be counted in milliseconds or nanoseconds)"
    } else {
        ""
    }
}

/// The word of the images of a finished run against its odometry and its mount, and whether they showed anything.
///
/// `findings` are those of pairs of images ([`motion_consistency::check_motion`]), `path` is the smoothed body path, one pose a
/// frame.
pub(crate) fn of_run(
    odometry: &[OdometrySample],
    mut findings: Vec<Finding>,
    frames: &[FrameRecord],
    path: &[Se2],
) -> Vec<Warning> {
    let mut warnings = nothing_seen(frames);
    let seen: Vec<(f64, Se2)> = frames
        .iter()
        .zip(path)
        .filter(|(frame, _)| frame.report.matches >= PATH_MATCHES)
        .map(|(frame, pose)| (frame.time_s, *pose))
        .collect();
    let corrected = check_path(&seen, odometry);
    // Turns that come too early or too late look like turns of another size, and distances like a slip.
    let late = corrected
        .iter()
        .any(|finding| matches!(finding, Finding::ClockOffset { .. }));
    if late {
        findings.retain(|finding| {
            !matches!(
                finding,
                Finding::TurnRatio { .. }
                    | Finding::TurnUnrelated { .. }
                    | Finding::WheelSlip { .. }
            )
        });
    }
    if findings.is_empty() {
        findings = corrected;
    }
    // Whatever makes the odometry wrong throughout makes the filter doubt it, too.
    let slips_at_most = findings
        .iter()
        .all(|finding| matches!(finding, Finding::WheelSlip { .. }));
    if let Some(slip) = slip(odometry, frames).filter(|_| slips_at_most) {
        findings.clear();
        warnings.push(slip);
    }
    warnings.extend(findings.iter().map(told));
    warnings
}

/// The span in which the filter doubted its odometry for the most metres.
fn slip(odometry: &[OdometrySample], frames: &[FrameRecord]) -> Option<Warning> {
    let doubted: Vec<usize> = (1..frames.len())
        .filter(|&i| frames[i].report.odometry_doubted)
        .collect();
    let mut spans: Vec<(usize, usize)> = Vec::new();
    for &index in &doubted {
        match spans.last_mut() {
            Some((_, last)) if index <= *last + 2 => *last = index,
            _ => spans.push((index - 1, index)),
        }
    }
    let driven = |&(first, last): &(usize, usize)| {
        let wheels_m: f64 = held_between(odometry, frames[first].time_s, frames[last].time_s)
            .iter()
            .map(|(row, duration_s)| (row.v_mps * duration_s).abs())
            .sum();
        let path_m: f64 = frames[first..=last]
            .windows(2)
            .map(|two| {
                let step = two[0]
                    .report
                    .estimate
                    .pose
                    .between(&two[1].report.estimate.pose);
                step.x.hypot(step.y)
            })
            .sum();
        (wheels_m, path_m)
    };
    let (span, (wheels_m, path_m)) = spans
        .iter()
        .map(|span| (span, driven(span)))
        .max_by(|(_, a), (_, b)| (a.0 - a.1).abs().total_cmp(&(b.0 - b.1).abs()))?;
    Some(Warning::new(
        "wheel-slip",
        format!(
            "From {:.2} to {:.2} s the odometry drives {wheels_m:.2} m, the robot {path_m:.2} m by what it sees: the wheels slip \
             there, or speed or turn rate are wrong (the odometry was doubted in {} of {} frames).",
            frames[span.0].time_s,
            frames[span.1].time_s,
            doubted.len(),
            frames.len()
        ),
    ))
}

fn told(finding: &Finding) -> Warning {
    let hint = match finding {
        Finding::ClockOffset { offset_s, .. } => format!(" Try --odometry-offset {offset_s:.2}."),
        _ => String::new(),
    };
    Warning::new(finding.name(), format!("{finding}{hint}"))
}

/// Frames that show nothing, or nothing known.
fn nothing_seen(frames: &[FrameRecord]) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let count = frames.len();
    let share = |lacking: usize, of: usize| lacking as f64 > LACKING_SHARE * of as f64;
    let blank = frames
        .iter()
        .filter(|f| f.keypoints < FEW_KEYPOINTS)
        .count();
    if share(blank, count) {
        let found = median(frames.iter().map(|f| f.keypoints).collect());
        warnings.push(Warning::new(
            "few-keypoints",
            format!(
                "{blank} of {count} frames have fewer than {FEW_KEYPOINTS} keypoints (median of all frames: {found}): the images \
                 are blank, too dark, out of focus, or use few of their grey levels. The path there is that of the odometry."
            ),
        ));
        return warnings;
    }
    // The first frame has nothing to be matched with.
    let later = frames.get(1..).unwrap_or_default();
    let lost = later
        .iter()
        .filter(|f| f.report.matches < FEW_MATCHES)
        .count();
    if share(lost, later.len()) {
        let found = median(later.iter().map(|f| f.report.matches).collect());
        warnings.push(Warning::new(
            "few-matches",
            format!(
                "{lost} of {} frames have fewer than {FEW_MATCHES} matches with the map (median of all frames: {found}): what is \
                 seen does not lie where odometry, mount and calibration say. The path there is that of the odometry.",
                later.len()
            ),
        ));
    }
    warnings
}

fn median(mut counts: Vec<usize>) -> usize {
    counts.sort_unstable();
    counts.get(counts.len() / 2).copied().unwrap_or(0)
}
