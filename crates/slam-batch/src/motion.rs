//! The factor of a motion: what the odometry says of two keyframes and the constants.
//!
//! With c the camera centres in the unit of the map, s the metres per unit, R the headings, l the lever arm turned by the
//! mount's yaw delta (l' = R(-delta) l: the state's heading is that of the nominal mount), and d, dphi the folded rows,
//!
//! > e = ( (R_1^T (s (c_2 - c_1) - (R_2 - R_1) l') - R(-delta) d) / (1 + w),  phi_2 - phi_1 - dphi ).
//!
//! The noise is that of the wheels' metres, hence the division by their scale. Without it a smaller world has smaller
//! errors: with n motions w would be estimated about n times its prior variance too small.
//!
//! Its covariance is that of the odometer, as the filter uses it, with the same floors.

use estimation_base::wrap;
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};
use slam_pipeline::OdometryInterval;

use crate::constants::{Constant, Constants};
use crate::fold::{ROW_CONSTANTS, fold, rotation};
use crate::state::CameraState;

/// Derivatives of the error of a motion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MotionError {
    /// (forward, left, turn) in the body axes of the first keyframe; metres, radians.
    pub(crate) error: Vector3<f64>,
    /// By (x, y, heading) of the first pose.
    pub(crate) by_from: Matrix3<f64>,
    /// By (x, y, heading) of the second pose.
    pub(crate) by_to: Matrix3<f64>,
    /// By the metres per unit.
    pub(crate) by_scale: Vector3<f64>,
    /// By the constants of the motion, in their order.
    pub(crate) by_constants: SMatrix<f64, 3, { Constant::OF_MOTION }>,
}

/// d R(phi) / d phi = R(phi) LEFT.
const LEFT: Matrix2<f64> = Matrix2::new(0.0, -1.0, 1.0, 0.0);

/// The error of a motion with all its derivatives; `lever_m` includes its constants. O(rows).
pub(crate) fn motion_error(
    from: &CameraState,
    to: &CameraState,
    scale: f64,
    rows: &[OdometryInterval],
    lever_m: &Vector2<f64>,
    constants: &Constants,
) -> MotionError {
    let folded = fold(rows, constants);
    let yaw = rotation(-constants[Constant::MountYaw]);
    let lever = yaw * lever_m;
    let turned = rotation(to.phi - from.phi);
    let body_from_world = rotation(-from.phi);
    let step = body_from_world * (to.centre - from.centre).xy();
    let swing = turned * lever - lever;
    let wheels = yaw * folded.displacement;
    let wheel_scale = 1.0 + constants[Constant::WheelScale];
    let along = (step * scale - swing - wheels) / wheel_scale;

    let mut by_from = Matrix3::zeros();
    let mut by_to = Matrix3::zeros();
    set(&mut by_from, &(-body_from_world * (scale / wheel_scale)));
    set(&mut by_to, &(body_from_world * (scale / wheel_scale)));
    // R_1^T turns against the heading; the swing depends on the difference of the headings alone.
    let swing_rate = turned * LEFT * lever / wheel_scale;
    let by_heading = -LEFT * step * (scale / wheel_scale) + swing_rate;
    by_from[(0, 2)] = by_heading.x;
    by_from[(1, 2)] = by_heading.y;
    by_from[(2, 2)] = -1.0;
    by_to[(0, 2)] = -swing_rate.x;
    by_to[(1, 2)] = -swing_rate.y;
    by_to[(2, 2)] = 1.0;

    let mut by_constants = SMatrix::zeros();
    for (column, constant) in ROW_CONSTANTS.into_iter().enumerate() {
        let by = folded.by_constants.column(column);
        let moved = yaw * Vector2::new(by[0], by[1]);
        put(&mut by_constants, constant, -moved / wheel_scale, -by[2]);
    }
    let by_wheels = by_constants.column(Constant::WheelScale as usize).xy() - along / wheel_scale;
    put(&mut by_constants, Constant::WheelScale, by_wheels, 0.0);
    let by_yaw = ((turned - Matrix2::identity()) * LEFT * lever + LEFT * wheels) / wheel_scale;
    put(&mut by_constants, Constant::MountYaw, by_yaw, 0.0);
    let by_lever = -(turned - Matrix2::identity()) * yaw / wheel_scale;
    put(
        &mut by_constants,
        Constant::LeverX,
        by_lever.column(0).into(),
        0.0,
    );
    put(
        &mut by_constants,
        Constant::LeverY,
        by_lever.column(1).into(),
        0.0,
    );

    MotionError {
        error: Vector3::new(along.x, along.y, wrap(to.phi - from.phi - folded.turn)),
        by_from,
        by_to,
        by_scale: Vector3::new(step.x, step.y, 0.0) / wheel_scale,
        by_constants,
    }
}

fn set(target: &mut Matrix3<f64>, block: &Matrix2<f64>) {
    target.fixed_view_mut::<2, 2>(0, 0).copy_from(block);
}

fn put(
    target: &mut SMatrix<f64, 3, { Constant::OF_MOTION }>,
    constant: Constant,
    along: Vector2<f64>,
    turn: f64,
) {
    target.set_column(constant as usize, &Vector3::new(along.x, along.y, turn));
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Case {
        from: CameraState,
        to: CameraState,
        scale: f64,
        lever: Vector2<f64>,
        constants: Constants,
    }

    fn case() -> Case {
        let mut constants = Constants::ZERO;
        for (i, constant) in Constant::ALL
            .into_iter()
            .enumerate()
            .take(Constant::OF_MOTION)
        {
            constants[constant] = 0.03 * (i as f64 + 1.0);
        }
        Case {
            from: CameraState {
                centre: Vector3::new(1.0, 2.0, 0.1),
                phi: 0.7,
                roll: 0.01,
                pitch: 0.02,
            },
            to: CameraState {
                centre: Vector3::new(1.3, 2.4, 0.1),
                phi: 1.2,
                roll: 0.0,
                pitch: 0.0,
            },
            scale: 1.1,
            lever: Vector2::new(0.3, -0.2),
            constants,
        }
    }

    fn rows() -> [OdometryInterval; 2] {
        [(0.3, 0.5, 0.9), (0.4, 0.7, 0.4)].map(|(duration_s, v_mps, omega_radps)| {
            OdometryInterval {
                duration_s,
                v_mps,
                omega_radps,
            }
        })
    }

    fn error(c: &Case) -> MotionError {
        let lever =
            c.lever + Vector2::new(c.constants[Constant::LeverX], c.constants[Constant::LeverY]);
        motion_error(&c.from, &c.to, c.scale, &rows(), &lever, &c.constants)
    }

    fn slope(change: impl Fn(&mut Case, f64)) -> Vector3<f64> {
        let h = 1e-6;
        let at = |h: f64| {
            let mut c = case();
            change(&mut c, h);
            error(&c).error
        };
        (at(h) - at(-h)) / (2.0 * h)
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let found = error(&case());
        let near = |a: Vector3<f64>, b: Vector3<f64>, name: &str| {
            assert!((a - b).norm() < 1e-8, "{name}: {a} against {b}");
        };
        near(
            found.by_from.column(0).into(),
            slope(|c, h| c.from.centre.x += h),
            "x1",
        );
        near(
            found.by_from.column(1).into(),
            slope(|c, h| c.from.centre.y += h),
            "y1",
        );
        near(
            found.by_from.column(2).into(),
            slope(|c, h| c.from.phi += h),
            "phi1",
        );
        near(
            found.by_to.column(0).into(),
            slope(|c, h| c.to.centre.x += h),
            "x2",
        );
        near(
            found.by_to.column(1).into(),
            slope(|c, h| c.to.centre.y += h),
            "y2",
        );
        near(
            found.by_to.column(2).into(),
            slope(|c, h| c.to.phi += h),
            "phi2",
        );
        near(found.by_scale, slope(|c, h| c.scale += h), "scale");
        for constant in Constant::ALL.into_iter().take(Constant::OF_MOTION) {
            near(
                found.by_constants.column(constant as usize).into(),
                slope(|c, h| c.constants[constant] += h),
                constant.name(),
            );
        }
    }

    #[test]
    fn a_true_motion_has_no_error() {
        // A body that drives one row, seen by a camera on a yawed mount, in a map of its own unit.
        let constants = Constants::ZERO
            .with(Constant::MountYaw, 0.1)
            .with(Constant::TurningCentre, 0.2);
        let (lever, scale) = (Vector2::new(0.3, 0.1), 1.25);
        let folded = fold(&rows(), &constants);
        // The world of the nominal mount is the true one turned back by the yaw.
        let world = rotation(-0.1);
        let camera = |position: Vector2<f64>, phi: f64| {
            let centre = world * (position + rotation(phi) * lever) / scale;
            CameraState {
                centre: Vector3::new(centre.x, centre.y, 0.0),
                phi,
                roll: 0.0,
                pitch: 0.0,
            }
        };
        let start = Vector2::new(2.0, -1.0);
        let from = camera(start, 0.4);
        let to = camera(
            start + rotation(0.4) * folded.displacement,
            0.4 + folded.turn,
        );
        let found = motion_error(&from, &to, scale, &rows(), &lever, &constants);
        assert!(found.error.norm() < 1e-14, "{}", found.error);
        // The other sign of the yaw leaves twice its angle times the way.
        let wrong = constants.with(Constant::MountYaw, -0.1);
        let found = motion_error(&from, &to, scale, &rows(), &lever, &wrong);
        assert!(found.error.norm() > 0.05, "{}", found.error);
    }
}
