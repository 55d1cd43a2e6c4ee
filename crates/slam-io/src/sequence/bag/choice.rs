//! Which topic of a log is the camera and which the odometry.
//!
//! The only candidate is taken. Of several, images are those with the most messages, raw ones before compressed ones of
//! equal number, and depth or infrared ones only where there is nothing else; odometry is `nav_msgs/Odometry` before
//! velocities before wheel angles (where the wheels are known), and of the same type the topic with the most messages.

use std::path::Path;

use robot_logs::{MessageKind, RobotLog, Topic};

use crate::error::SequenceError;
use crate::warning::Warning;

/// Topics that a message names.
const NAMED: usize = 6;

/// A chosen topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Chosen {
    /// Index in the log.
    pub(super) topic: usize,
}

/// The kind of thing that is chosen.
struct Wanted {
    /// How it is called.
    what: &'static str,
    /// The types that can be it.
    types: &'static str,
    /// The option that names one.
    option: &'static str,
    /// Name of the warning.
    warning: &'static str,
}

const IMAGES: Wanted = Wanted {
    what: "image topic",
    types: "sensor_msgs/Image or sensor_msgs/CompressedImage",
    option: "--image-topic",
    warning: "image-topic-chosen",
};

const ODOMETRY: Wanted = Wanted {
    what: "odometry topic",
    types: "nav_msgs/Odometry, geometry_msgs/Twist(Stamped) or, with robot.toml beside the log, sensor_msgs/JointState",
    option: "--odometry-topic",
    warning: "odometry-topic-chosen",
};

/// The camera.
pub(super) fn choose_images(
    path: &Path,
    log: &RobotLog,
    named: Option<&str>,
    warnings: &mut Vec<Warning>,
) -> Result<Chosen, SequenceError> {
    choose(path, log, named, warnings, &IMAGES, |topic| {
        let raw = match topic.kind? {
            MessageKind::Image => 1,
            MessageKind::CompressedImage => 0,
            _ => return None,
        };
        let name = topic.name.to_lowercase();
        let other_sense = ["depth", "infra", "thermal", "disparity"]
            .iter()
            .any(|word| name.contains(word));
        Some((usize::from(!other_sense), topic.messages, raw))
    })
}

/// The odometry.
pub(super) fn choose_odometry(
    path: &Path,
    log: &RobotLog,
    named: Option<&str>,
    wheels_known: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Chosen, SequenceError> {
    let chosen = choose(path, log, named, warnings, &ODOMETRY, |topic| {
        let rank = match topic.kind? {
            MessageKind::Odometry => 2,
            MessageKind::Twist
            | MessageKind::TwistStamped
            | MessageKind::TwistWithCovarianceStamped => 1,
            MessageKind::JointState if wheels_known => 0,
            _ => return None,
        };
        Some((rank, topic.messages, 0))
    });
    chosen.map_err(|mut fault| {
        if let SequenceError::File { found, .. } = &mut fault {
            found.push_str("; without odometry, `--odometry none` finds the motion from the images, up to scale");
        }
        fault
    })
}

/// Takes the candidate of the largest rank; candidates of the first rank's number that are set aside are named.
fn choose(
    path: &Path,
    log: &RobotLog,
    named: Option<&str>,
    warnings: &mut Vec<Warning>,
    wanted: &Wanted,
    rank: impl Fn(&Topic) -> Option<(usize, usize, usize)>,
) -> Result<Chosen, SequenceError> {
    let mut candidates: Vec<(usize, (usize, usize, usize))> = log
        .topics()
        .iter()
        .enumerate()
        .filter(|(_, topic)| topic.messages > 0)
        .filter_map(|(index, topic)| Some((index, rank(topic)?)))
        .collect();
    candidates.sort_by_key(|&(index, rank)| (std::cmp::Reverse(rank), index));
    let name = |index: usize| log.topics()[index].name.as_str();
    if let Some(named) = named {
        let found = candidates.iter().find(|(index, _)| name(*index) == named);
        return found
            .map(|&(topic, _)| Chosen { topic })
            .ok_or_else(|| SequenceError::File {
                path: path.to_path_buf(),
                expected: format!(
                    "messages of {} on {named} ({})",
                    wanted.types, wanted.option
                ),
                found: match log.topics().iter().find(|topic| topic.name == named) {
                    Some(topic) if topic.messages == 0 => "none on this topic".into(),
                    Some(topic) => format!("a topic of type {}", topic.type_name),
                    None => listed("only", candidates.iter().map(|(index, _)| name(*index))),
                },
            });
    }
    let Some(&(topic, best)) = candidates.first() else {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: format!("an {} ({})", wanted.what, wanted.types),
            found: all_topics(log),
        });
    };
    let rivals: Vec<&str> = candidates[1..]
        .iter()
        .filter(|(_, rank)| rank.0 == best.0)
        .map(|(index, _)| name(*index))
        .collect();
    if !rivals.is_empty() {
        warnings.push(Warning::new(
            wanted.warning,
            format!(
                "Of {} {}s the log's {} with {} messages is taken, {}; {} takes another.",
                rivals.len() + 1,
                wanted.what,
                name(topic),
                log.topics()[topic].messages,
                listed("not", rivals.into_iter()),
                wanted.option
            ),
        ));
    }
    Ok(Chosen { topic })
}

/// The topics of a log that has none of the right kind.
fn all_topics(log: &RobotLog) -> String {
    if log.topics().iter().all(|topic| topic.messages == 0) {
        return "a log without messages".into();
    }
    let named = log
        .topics()
        .iter()
        .filter(|topic| topic.messages > 0)
        .map(|topic| topic.name.as_str());
    listed("only", named)
}

/// Some names and how many more there are.
fn listed<'a>(word: &str, names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    let more = names.len().saturating_sub(NAMED);
    let mut text = format!("{word} {}", names[..names.len() - more].join(", "));
    if more > 0 {
        text += &format!(" and {more} more");
    }
    if names.is_empty() {
        text += "none";
    }
    text
}
