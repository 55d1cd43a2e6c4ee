//! Odometry that comes as poses: speeds from their differences.
//!
//! Two neighbouring poses are joined by the arc of constant speed and turn rate; what a pose moved sideways is lost, since
//! wheels do not roll that way. For a point on the body's x axis, ahead of the turning centre or behind it, the forward
//! speed is that of the turning centre, and the sideways way is its swing. Much sideways motion that no turn explains means
//! other axes.

use mono_geometry::Se2;

use super::rows::OdometryRow;
use crate::warning::Warning;

/// Share of the way that poses may move sideways before it is remarked.
const SIDEWAYS_SHARE: f64 = 0.2;

/// Rows from poses at ascending times: each holds the motion to the next one, the last repeats the one before it.
pub(super) fn rows_of_poses(poses: &[(f64, Se2)]) -> Vec<OdometryRow> {
    let mut rows: Vec<OdometryRow> = poses
        .windows(2)
        .map(|pair| {
            let dt_s = pair[1].0 - pair[0].0;
            let step = pair[0].1.between(&pair[1].1).log();
            OdometryRow {
                t_s: pair[0].0,
                v_mps: step.x / dt_s,
                omega_radps: step.z / dt_s,
            }
        })
        .collect();
    if let (Some(last), Some(&(t_s, _))) = (rows.last().copied(), poses.last()) {
        rows.push(OdometryRow { t_s, ..last });
    }
    rows
}

/// The remark that `name` holds poses, and one on motion to the side.
pub(super) fn remarks(name: &str, poses: &[(f64, Se2)]) -> Vec<Warning> {
    let mut remarks = vec![Warning::new(
        "odometry-from-poses",
        format!(
            "{name} holds poses: the speeds are their differences, {} in all",
            poses.len().saturating_sub(1)
        ),
    )];
    let (mut along, mut aside) = (0.0, 0.0);
    for pair in poses.windows(2) {
        let step = pair[0].1.between(&pair[1].1).log();
        along += step.x.abs();
        aside += step.y.abs();
    }
    if aside > SIDEWAYS_SHARE * along {
        remarks.push(Warning::new(
            "odometry-sideways",
            format!(
                "The poses of {name} move {aside:.2} m sideways and {along:.2} m along their x axis: is x forward and the \
                 heading in radians?"
            ),
        ));
    }
    remarks
}

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::motion::exact_arc;

    /// Composing the rows gives back poses on arcs exactly, and the forward way of every other motion.
    #[test]
    fn differences_of_poses_on_arcs_give_the_poses_back() {
        let mut pose = Se2::new(3.0, -1.0, 2.9);
        let mut poses = vec![(10.0, pose)];
        for (index, (v, omega)) in [(0.5, 0.4), (0.0, 1.0), (-0.3, 0.2), (0.7, 0.0)]
            .into_iter()
            .enumerate()
        {
            pose = pose.compose(&exact_arc(v, omega, 0.25));
            poses.push((10.0 + 0.25 * (index + 1) as f64, pose));
        }
        let rows = rows_of_poses(&poses);
        assert_eq!(rows.len(), poses.len());
        let mut again = poses[0].1;
        for (row, next) in rows.iter().zip(&poses[1..]) {
            again = again.compose(&exact_arc(row.v_mps, row.omega_radps, next.0 - row.t_s));
            assert!(again.between(&next.1).log().norm() < 1e-14);
        }
        assert_eq!(remarks("odometry.csv", &poses).len(), 1);
        // Poses whose x axis looks to the side.
        let crab: Vec<(f64, Se2)> = (0..4)
            .map(|i| (f64::from(i), Se2::new(0.0, f64::from(i), 0.0)))
            .collect();
        assert_eq!(remarks("odometry.csv", &crab)[1].name, "odometry-sideways");
    }
}
