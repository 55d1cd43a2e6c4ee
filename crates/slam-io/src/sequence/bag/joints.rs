//! Wheel angles of `sensor_msgs/JointState` as odometry of a differential drive.
//!
//! Drivers name their joints as they like: the left wheel is the only joint whose name says `left` and, where several do,
//! `wheel`; so is the right one. Radius and base are those of `robot.toml` beside the log or in its folder.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use mono_geometry::motion::differential_drive;
use robot_logs::JointState;

use crate::error::SequenceError;
use crate::sequence::robot::{ROBOT, Robot};
use crate::sequence::rows::OdometryRow;

/// Angles beyond this are not those of a joint that wraps at pi, radians.
const WRAPPING_RAD: f64 = PI + 1e-3;

/// The wheels that joints turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct JointWheels {
    /// Radii of the left and the right wheel, metres.
    radii_m: [f64; 2],
    base_m: f64,
}

impl JointWheels {
    /// The wheels of the `robot.toml` beside the log `path`, or in it where it is a folder; `None` where there is none, or
    /// none with a radius and a base.
    ///
    /// # Errors
    /// [`SequenceError`] when there is one that cannot be read.
    pub(super) fn beside(path: &Path) -> Result<Option<Self>, SequenceError> {
        let folder = if path.is_dir() {
            path
        } else {
            path.parent().unwrap_or(Path::new("."))
        };
        let file = folder.join(ROBOT);
        if !file.exists() {
            return Ok(None);
        }
        let wheels = Robot::read(&file)?.wheels;
        Ok(wheels.and_then(|wheels| {
            Some(Self {
                radii_m: wheels.radii_m?,
                base_m: wheels.base_m?,
            })
        }))
    }

    /// The rows of wheel angles (left, right, radians) in the order of their times: each holds the mean speed and turn rate up to
    /// the next, the last one repeats those before it. Angles that stay between -pi and pi are taken for wrapped ones.
    pub(super) fn rows(&self, angles: &[(f64, [f64; 2])]) -> Vec<OdometryRow> {
        let wraps = [0, 1].map(|wheel| {
            angles
                .iter()
                .all(|(_, angle)| angle[wheel].abs() <= WRAPPING_RAD)
        });
        let rolled = |wheel: usize, from: f64, to: f64| {
            let turn = if wraps[wheel] {
                (to - from + PI).rem_euclid(TAU) - PI
            } else {
                to - from
            };
            self.radii_m[wheel] * turn
        };
        let mut rows: Vec<OdometryRow> = angles
            .windows(2)
            .map(|pair| {
                let [(from_s, from), (to_s, to)] = [pair[0], pair[1]];
                let way = [0, 1].map(|wheel| rolled(wheel, from[wheel], to[wheel]));
                let travel = differential_drive(way[0], way[1], self.base_m);
                OdometryRow {
                    t_s: from_s,
                    v_mps: travel.distance_m / (to_s - from_s),
                    omega_radps: travel.turn_rad / (to_s - from_s),
                }
            })
            .collect();
        if let (Some(&last), Some(&(t_s, _))) = (rows.last(), angles.last()) {
            rows.push(OdometryRow { t_s, ..last });
        }
        rows
    }
}

/// Angles of the left and the right wheel; `None` where the joints do not tell them.
pub(super) fn wheel_angles(joints: &JointState) -> Option<[f64; 2]> {
    let angle_of = |side: &str| {
        let named: Vec<usize> = (0..joints.name.len())
            .filter(|&i| joints.name[i].to_lowercase().contains(side))
            .collect();
        let wheel = |&i: &usize| joints.name[i].to_lowercase().contains("wheel");
        let index = match named[..] {
            [only] => only,
            _ => *named.iter().find(|i| wheel(i))?,
        };
        joints
            .position
            .get(index)
            .copied()
            .filter(|angle| angle.is_finite())
    };
    Some([angle_of("left")?, angle_of("right")?])
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEELS: JointWheels = JointWheels {
        radii_m: [0.05, 0.05],
        base_m: 0.4,
    };

    /// Wheels at constant speeds of 4 and 6 rad/s, wrapped or not.
    fn angles(wrap: bool) -> Vec<(f64, [f64; 2])> {
        (0..40)
            .map(|k| {
                let t_s = 0.1 * f64::from(k);
                let angle = |speed: f64| {
                    let angle = speed * t_s;
                    if wrap {
                        (angle + PI).rem_euclid(TAU) - PI
                    } else {
                        angle
                    }
                };
                (t_s, [angle(4.0), angle(6.0)])
            })
            .collect()
    }

    #[test]
    fn wheels_at_constant_speeds_drive_a_circle() {
        for wrap in [false, true] {
            let rows = WHEELS.rows(&angles(wrap));
            assert_eq!(rows.len(), 40);
            for row in &rows {
                // 0.05 m (4 + 6) / 2 rad/s, and 0.05 m (6 - 4) rad/s over 0.4 m.
                assert!((row.v_mps - 0.25).abs() < 1e-9, "{row:?}");
                assert!((row.omega_radps - 0.25).abs() < 1e-9, "{row:?}");
            }
        }
        assert!(WHEELS.rows(&[]).is_empty());
    }

    #[test]
    fn wheels_are_found_among_other_joints() {
        let joints = |names: &[&str]| JointState {
            header: robot_logs::Header::default(),
            name: names.iter().map(|&name| name.to_owned()).collect(),
            position: (0..names.len()).map(|i| i as f64).collect(),
            velocity: Vec::new(),
        };
        let angles = |names: &[&str]| wheel_angles(&joints(names));
        assert_eq!(
            angles(&["wheel_right_joint", "pan", "wheel_left_joint"]),
            Some([2.0, 0.0])
        );
        assert_eq!(
            angles(&["left_arm", "left_wheel", "Right_Wheel"]),
            Some([1.0, 2.0])
        );
        assert_eq!(angles(&["a", "b"]), None);
        let mut short = joints(&["left", "right"]);
        short.position.truncate(1);
        assert_eq!(wheel_angles(&short), None);
    }
}
