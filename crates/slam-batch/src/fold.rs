//! Rows of odometry folded into one body motion under given constants of the carrier, with its derivatives.
//!
//! A row (v, omega) held for dt moves the point that does not slip along the direction of travel; the body origin, at
//! the distance kappa behind it, follows with
//!
//! > v_x = (1 + w) v cos(beta),  v_y = (1 + w) v sin(beta) - kappa omega',  omega' = omega + b,
//!
//! and the row's motion is the exact arc exp((v_x, v_y, omega') dt) = (V(theta) (v_x, v_y) dt, theta) with
//! theta = omega' dt and V(theta) = sinc(theta / 2) R(theta / 2). Motions are chained row by row, because the bias turns
//! the later rows more than the earlier ones: folding the bias into the whole increment would be off by its square.

use estimation_base::series::sinc;
use nalgebra::{Matrix2, SMatrix, Vector2};
use slam_pipeline::OdometryInterval;

use crate::constants::{Constant, Constants};

/// The constants that act on a row, in the order of the derivatives.
pub(crate) const ROW_CONSTANTS: [Constant; 4] = [
    Constant::WheelScale,
    Constant::TurningCentre,
    Constant::SlipAngle,
    Constant::TurnRateBias,
];

/// A body motion in the axes of its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Folded {
    /// Displacement, metres.
    pub(crate) displacement: Vector2<f64>,
    /// Turn, not wrapped.
    pub(crate) turn: f64,
    /// Derivatives of (dx, dy, dphi) by [`ROW_CONSTANTS`].
    pub(crate) by_constants: SMatrix<f64, 3, 4>,
}

/// The motion of all rows. O(rows).
pub(crate) fn fold(rows: &[OdometryInterval], constants: &Constants) -> Folded {
    let wheel = 1.0 + constants[Constant::WheelScale];
    let kappa = constants[Constant::TurningCentre];
    let (sin_slip, cos_slip) = constants[Constant::SlipAngle].sin_cos();
    let mut folded = Folded {
        displacement: Vector2::zeros(),
        turn: 0.0,
        by_constants: SMatrix::zeros(),
    };
    for row in rows {
        let dt = row.duration_s;
        let omega = row.omega_radps + constants[Constant::TurnRateBias];
        let along = row.v_mps * dt;
        let theta = omega * dt;
        let sides = Vector2::new(
            wheel * along * cos_slip,
            wheel * along * sin_slip - kappa * theta,
        );
        let (v, v_by_theta) = arc(theta);
        let start = rotation(folded.turn);
        let step = start * v * sides;
        let left = Vector2::new(-step.y, step.x);
        let turned_so_far = folded.by_constants.row(2).into_owned();
        let mut by = start
            * v
            * SMatrix::<f64, 2, 4>::new(
                along * cos_slip,
                0.0,
                -wheel * along * sin_slip,
                0.0,
                along * sin_slip,
                -theta,
                wheel * along * cos_slip,
                -kappa * dt,
            );
        by.set_column(3, &(by.column(3) + start * v_by_theta * sides * dt));
        by += left * turned_so_far;
        for column in 0..4 {
            folded.by_constants[(0, column)] += by[(0, column)];
            folded.by_constants[(1, column)] += by[(1, column)];
        }
        folded.by_constants[(2, 3)] += dt;
        folded.displacement += step;
        folded.turn += theta;
    }
    folded
}

/// V(theta) and its derivative.
fn arc(theta: f64) -> (Matrix2<f64>, Matrix2<f64>) {
    let half = 0.5 * theta;
    let size = sinc(half);
    // (cos x - sinc x) / x, by its series where the difference loses its digits.
    let size_rate = if half.abs() < 1e-3 {
        -half / 3.0
    } else {
        (half.cos() - size) / half
    };
    let turn = rotation(half);
    let (s, c) = half.sin_cos();
    let turn_rate = Matrix2::new(-s, -c, c, -s);
    (turn * size, (turn * size_rate + turn_rate * size) * 0.5)
}

/// Rotation by `angle`.
pub(crate) fn rotation(angle: f64) -> Matrix2<f64> {
    let (s, c) = angle.sin_cos();
    Matrix2::new(c, -s, s, c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::Se2;
    use mono_geometry::motion::exact_arc;

    fn rows() -> Vec<OdometryInterval> {
        [
            (0.1, 0.5, 0.3),
            (0.2, 0.6, -1.1),
            (0.15, 0.0, 0.0),
            (0.3, 0.4, 2.0),
        ]
        .map(|(duration_s, v_mps, omega_radps)| OdometryInterval {
            duration_s,
            v_mps,
            omega_radps,
        })
        .to_vec()
    }

    fn some() -> Constants {
        Constants::ZERO
            .with(Constant::WheelScale, 0.02)
            .with(Constant::TurningCentre, 0.3)
            .with(Constant::SlipAngle, 0.05)
            .with(Constant::TurnRateBias, 0.1)
    }

    #[test]
    fn nominal_rows_are_chained_exact_arcs() {
        let mut at = Se2::identity();
        for row in rows() {
            at = at.compose(&exact_arc(row.v_mps, row.omega_radps, row.duration_s));
        }
        let folded = fold(&rows(), &Constants::ZERO);
        assert!((folded.displacement - Vector2::new(at.x, at.y)).norm() < 1e-15);
        assert!((folded.turn - at.phi).abs() < 1e-15);
    }

    #[test]
    fn the_turning_centre_is_a_point_ahead_that_does_not_slip() {
        // The point ahead moves by the plain arc; the body origin stays kappa behind it.
        let constants = Constants::ZERO.with(Constant::TurningCentre, 0.4);
        let folded = fold(&rows(), &constants);
        let plain = fold(&rows(), &Constants::ZERO);
        let ahead = Vector2::new(0.4, 0.0);
        let expected = ahead + plain.displacement - rotation(plain.turn) * ahead;
        assert!((folded.displacement - expected).norm() < 1e-12);
        // With the other sign it would lie behind.
        let other = fold(
            &rows(),
            &Constants::ZERO.with(Constant::TurningCentre, -0.4),
        );
        assert!((other.displacement - expected).norm() > 0.1);
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let folded = fold(&rows(), &some());
        for (column, constant) in ROW_CONSTANTS.into_iter().enumerate() {
            let h = 1e-6;
            let shifted = |h: f64| fold(&rows(), &some().with(constant, some()[constant] + h));
            let (plus, minus) = (shifted(h), shifted(-h));
            let by = (plus.displacement - minus.displacement) / (2.0 * h);
            let turn = (plus.turn - minus.turn) / (2.0 * h);
            let found = folded.by_constants.column(column);
            assert!((found[0] - by.x).abs() < 1e-8, "{constant:?}");
            assert!((found[1] - by.y).abs() < 1e-8, "{constant:?}");
            assert!((found[2] - turn).abs() < 1e-8, "{constant:?}");
        }
    }

    #[test]
    fn the_bias_turns_later_rows_more() {
        // Folding the bias into the whole increment (half of it before, half after) is another motion.
        let constants = Constants::ZERO.with(Constant::TurnRateBias, 0.1);
        let plain = fold(&rows(), &Constants::ZERO);
        let time: f64 = rows().iter().map(|r| r.duration_s).sum();
        let whole = rotation(0.05 * time) * plain.displacement;
        let folded = fold(&rows(), &constants);
        assert!((folded.displacement - whole).norm() > 1e-3);
        assert!((folded.turn - plain.turn - 0.1 * time).abs() < 1e-15);
    }
}
