//! Odometry of a log as rows of speed and turn rate.
//!
//! `nav_msgs/Odometry` has poses and velocities, and drivers fill both, or only one. The velocities are taken where they
//! are filled. Where they are zero while the poses move they are the arcs from one pose to the next
//! (`sequence/poses.rs`).

use std::f64::consts::{PI, TAU};
use std::path::Path;

use mono_geometry::Se2;
use robot_logs::{Message, Pose};

use super::joints::{JointWheels, wheel_angles};

use crate::error::SequenceError;
use crate::sequence::poses::rows_of_poses;
use crate::sequence::rows::OdometryRow;
use crate::warning::Warning;

/// Motion that cannot be the noise of a standing robot, in metres and radians.
const MOVED_M: f64 = 0.05;
const TURNED_RAD: f64 = 0.05;
/// Largest believable forward speed of a wheeled robot, m/s, and turn rate, rad/s.
const MAX_SPEED_MPS: f64 = 100.0;
const MAX_TURN_RADPS: f64 = 50.0;

/// One message of odometry.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reading {
    /// Forward speed in m/s and turn rate in rad/s.
    twist: Option<[f64; 2]>,
    /// x, y in metres, heading in rad.
    pose: Option<[f64; 3]>,
    /// Angles of the left and the right wheel in rad.
    wheels: Option<[f64; 2]>,
}

/// The frame of a stream of odometry, beside its readings.
#[derive(Debug)]
pub(super) struct Motion {
    body_frame: Option<String>,
    wheels: Option<JointWheels>,
}

impl Motion {
    /// A stream of a robot with these wheels.
    pub(super) fn new(wheels: Option<JointWheels>) -> Self {
        Self {
            body_frame: None,
            wheels,
        }
    }

    /// The stamp and the reading of a message; `None` where it is no odometry.
    pub(super) fn take(&mut self, message: Message) -> Option<(Option<i64>, Reading)> {
        match message {
            Message::Odometry(odometry) => {
                let frame =
                    || Some(odometry.child_frame_id.clone()).filter(|name| !name.is_empty());
                if self.body_frame.is_none() {
                    self.body_frame = frame();
                }
                let reading = Reading {
                    twist: Some([odometry.twist.linear[0], odometry.twist.angular[2]]),
                    pose: Some(planar(&odometry.pose)),
                    wheels: None,
                };
                Some((Some(odometry.header.stamp_ns), reading))
            }
            Message::Twist(twist) => {
                let stamped = twist.header != robot_logs::Header::default();
                let reading = Reading {
                    twist: Some([twist.twist.linear[0], twist.twist.angular[2]]),
                    pose: None,
                    wheels: None,
                };
                Some((stamped.then_some(twist.header.stamp_ns), reading))
            }
            Message::JointState(joints) => {
                let reading = Reading {
                    twist: None,
                    pose: None,
                    wheels: Some(wheel_angles(&joints)?),
                };
                Some((Some(joints.header.stamp_ns), reading))
            }
            _ => None,
        }
    }

    /// The frame in which the velocities are, as the messages name it.
    pub(super) fn body_frame(&self) -> Option<&str> {
        self.body_frame.as_deref()
    }

    /// The rows of readings in the order of their times.
    pub(super) fn rows(
        &self,
        path: &Path,
        topic: &str,
        readings: &[(f64, Reading)],
        warnings: &mut Vec<Warning>,
    ) -> Result<Vec<OdometryRow>, SequenceError> {
        let fault = |expected: String, found: String| SequenceError::File {
            path: path.to_path_buf(),
            expected,
            found,
        };
        let twists: Vec<OdometryRow> = readings
            .iter()
            .filter_map(|(t_s, reading)| {
                let [v_mps, omega_radps] = reading.twist?;
                Some(OdometryRow {
                    t_s: *t_s,
                    v_mps,
                    omega_radps,
                })
            })
            .collect();
        let poses: Vec<(f64, [f64; 3])> = readings
            .iter()
            .filter_map(|(t_s, reading)| Some((*t_s, reading.pose?)))
            .collect();
        let angles: Vec<(f64, [f64; 2])> = readings
            .iter()
            .filter_map(|(t_s, reading)| Some((*t_s, reading.wheels?)))
            .collect();
        let rows = match unfilled(&twists, &poses) {
            None => match &self.wheels {
                Some(wheels) if !angles.is_empty() => wheels.rows(&angles),
                _ => twists,
            },
            Some((which, moved)) => {
                warnings.push(Warning::new(
                    "odometry-from-poses",
                    format!(
                        "The {which} of {topic} are all zero while its poses {moved}: the odometry is the differences of \
                         the poses."
                    ),
                ));
                let poses: Vec<(f64, Se2)> = poses
                    .iter()
                    .map(|&(t_s, [x, y, heading])| (t_s, Se2::new(x, y, heading)))
                    .collect();
                rows_of_poses(&poses)
            }
        };
        if rows.len() < 2 {
            return Err(fault(
                format!("at least two odometry messages on {topic}"),
                format!("{}", rows.len()),
            ));
        }
        for row in &rows {
            if !(row.v_mps.abs() <= MAX_SPEED_MPS && row.omega_radps.abs() <= MAX_TURN_RADPS) {
                return Err(fault(
                    format!(
                        "speeds of at most {MAX_SPEED_MPS} m/s and {MAX_TURN_RADPS} rad/s on {topic}"
                    ),
                    format!(
                        "{} m/s and {} rad/s at {:.3} s",
                        row.v_mps, row.omega_radps, row.t_s
                    ),
                ));
            }
        }
        Ok(rows)
    }
}

/// Which velocities are not filled, and how the poses move meanwhile.
fn unfilled(twists: &[OdometryRow], poses: &[(f64, [f64; 3])]) -> Option<(&'static str, String)> {
    let (mut way_m, mut turn_rad) = (0.0, 0.0);
    for pair in poses.windows(2) {
        let ([x, y, heading], [next_x, next_y, next_heading]) = (pair[0].1, pair[1].1);
        way_m += (next_x - x).hypot(next_y - y);
        turn_rad += wrapped(next_heading - heading).abs();
    }
    let still = twists.iter().all(|row| row.v_mps == 0.0);
    let straight = twists.iter().all(|row| row.omega_radps == 0.0);
    let moved = format!("move {way_m:.2} m and turn {turn_rad:.2} rad");
    match (still && way_m > MOVED_M, straight && turn_rad > TURNED_RAD) {
        (true, true) => Some(("velocities", moved)),
        (true, false) if straight => Some(("velocities", moved)),
        (false, true) if still => Some(("velocities", moved)),
        (true, false) => Some(("forward speeds", moved)),
        (false, true) => Some(("turn rates", moved)),
        (false, false) => None,
    }
}

/// Position in the plane and heading of a pose.
fn planar(pose: &Pose) -> [f64; 3] {
    let [x, y, z, w] = pose.orientation;
    let heading = (2.0 * (w * z + x * y)).atan2(w * w + x * x - y * y - z * z);
    [pose.position[0], pose.position[1], heading]
}

/// An angle from -pi to pi.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poses on a circle of 2 m, one every 0.1 s, over the cut of the heading.
    fn circle() -> Vec<(f64, [f64; 3])> {
        (0..80_i32)
            .map(|k| {
                let heading = 0.1 * f64::from(k);
                (
                    0.1 * f64::from(k),
                    [
                        2.0 * heading.sin(),
                        2.0 - 2.0 * heading.cos(),
                        wrapped(heading),
                    ],
                )
            })
            .collect()
    }

    #[test]
    fn velocities_that_are_not_filled_are_seen_by_the_poses() {
        let rows = |v_mps, omega_radps| -> Vec<OdometryRow> {
            let row = |&(t_s, _): &(f64, [f64; 3])| OdometryRow {
                t_s,
                v_mps,
                omega_radps,
            };
            circle().iter().map(row).collect()
        };
        let which = |v, omega| unfilled(&rows(v, omega), &circle()).map(|(which, _)| which);
        assert_eq!(which(2.0, 1.0), None);
        assert_eq!(which(0.0, 0.0), Some("velocities"));
        assert_eq!(which(2.0, 0.0), Some("turn rates"));
        assert_eq!(which(0.0, 1.0), Some("forward speeds"));
        let standing = vec![(0.0, [1.0, 2.0, 3.0]); 5];
        assert_eq!(unfilled(&rows(0.0, 0.0), &standing), None);
    }

    #[test]
    fn the_heading_of_a_tilted_pose_is_about_the_vertical() {
        let pose = Pose {
            position: [1.0, 2.0, 3.0],
            orientation: [0.0, 0.0, (0.6_f64).sin(), (0.6_f64).cos()],
        };
        let [x, y, heading] = planar(&pose);
        assert_eq!((x, y), (1.0, 2.0));
        assert!((heading - 1.2).abs() < 1e-12);
    }
}
