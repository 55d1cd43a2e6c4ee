//! A sensor on a planar robot (x, y in metres, heading in radians) that measures range and bearing of
//! points.

use crate::models::{FieldOfView, InverseObservation, ObservationJacobians, ObservationModel};
use estimation_base::wrap;
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use std::f64::consts::PI;

/// A sensor that measures the range in metres and the bearing in radians of a point. Bearings count
/// from the heading, positive to the left. A point at the sensor itself has no measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeBearing {
    /// Standard deviation of the range, metres.
    pub range_deviation: f64,
    /// Standard deviation of the bearing, radians.
    pub bearing_deviation: f64,
    /// Farthest range measured, metres.
    pub farthest: f64,
    /// Largest bearing measured to either side, radians; with PI the sensor sees all around.
    pub half_angle: f64,
}

impl RangeBearing {
    /// A sensor that sees everything around it.
    #[must_use]
    pub const fn new(range_deviation: f64, bearing_deviation: f64) -> Self {
        Self {
            range_deviation,
            bearing_deviation,
            farthest: f64::INFINITY,
            half_angle: PI,
        }
    }
}

impl ObservationModel<3, 2, 2> for RangeBearing {
    fn predict(&self, pose: &Vector3<f64>, landmark: &Vector2<f64>) -> Option<Vector2<f64>> {
        let offset = landmark - pose.xy();
        let range = offset.norm();
        let bearing = wrap(offset.y.atan2(offset.x) - pose.z);
        (range > 0.0).then(|| Vector2::new(range, bearing))
    }

    fn noise(&self) -> Matrix2<f64> {
        let deviations = Vector2::new(self.range_deviation, self.bearing_deviation);
        Matrix2::from_diagonal(&deviations.component_mul(&deviations))
    }

    fn innovation(&self, measured: &Vector2<f64>, predicted: &Vector2<f64>) -> Vector2<f64> {
        let difference = measured - predicted;
        Vector2::new(difference.x, wrap(difference.y))
    }
}

impl ObservationJacobians<3, 2, 2> for RangeBearing {
    fn jacobians(
        &self,
        pose: &Vector3<f64>,
        landmark: &Vector2<f64>,
    ) -> Option<(Matrix2x3<f64>, Matrix2<f64>)> {
        let d = landmark - pose.xy();
        let squared = d.norm_squared();
        let range = squared.sqrt();
        let g = Matrix2::new(d.x / range, d.y / range, -d.y / squared, d.x / squared);
        let h = Matrix2x3::from_columns(&[-g.column(0), -g.column(1), Vector2::new(0.0, -1.0)]);
        (squared > 0.0).then_some((h, g))
    }
}

impl InverseObservation<3, 2, 2> for RangeBearing {
    fn locate(&self, pose: &Vector3<f64>, measurement: &Vector2<f64>) -> Option<Vector2<f64>> {
        let (sin, cos) = (pose.z + measurement.y).sin_cos();
        Some(pose.xy() + Vector2::new(cos, sin) * measurement.x)
    }

    fn locate_jacobian(
        &self,
        pose: &Vector3<f64>,
        measurement: &Vector2<f64>,
    ) -> Option<Matrix2<f64>> {
        let (sin, cos) = (pose.z + measurement.y).sin_cos();
        let range = measurement.x;
        Some(Matrix2::new(cos, -range * sin, sin, range * cos))
    }
}

/// A landmark is in reach within 1.5 times the range at any bearing, and expected within 0.8 of range
/// and bearing.
impl FieldOfView<3, 2> for RangeBearing {
    fn reaches(&self, pose: &Vector3<f64>, landmark: &Vector2<f64>) -> bool {
        (landmark - pose.xy()).norm() <= 1.5 * self.farthest
    }

    fn expects(&self, pose: &Vector3<f64>, landmark: &Vector2<f64>) -> bool {
        self.predict(pose, landmark).is_some_and(|z| {
            let all_around = self.half_angle >= PI;
            z.x < 0.8 * self.farthest && (all_around || z.y.abs() < 0.8 * self.half_angle)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Central differences of step e are off by e^2 and eps / e: 1e-9 at e = 1e-5, values of order ten.
    #[test]
    fn jacobians_are_the_differences() {
        let e = 1e-5;
        let sensor = RangeBearing::new(0.1, 0.02);
        let (pose, landmark) = (Vector3::new(1.0, -2.0, 3.0), Vector2::new(-1.0, -1.5));
        let (h, g) = sensor.jacobians(&pose, &landmark).unwrap();
        let difference = |pose: [Vector3<f64>; 2], landmark: [Vector2<f64>; 2]| {
            let [a, b] = [0, 1].map(|k| sensor.predict(&pose[k], &landmark[k]).unwrap());
            sensor.innovation(&b, &a) / (2.0 * e)
        };
        for k in 0..3 {
            let step = Vector3::ith(k, e);
            let column = difference([pose - step, pose + step], [landmark; 2]);
            assert!((h.column(k) - column).amax() < 1e-9);
        }
        let seen = sensor.predict(&pose, &landmark).unwrap();
        assert!((sensor.locate(&pose, &seen).unwrap() - landmark).amax() < 1e-14);
        for k in 0..2 {
            let step = Vector2::ith(k, e);
            let column = difference([pose; 2], [landmark - step, landmark + step]);
            assert!((g.column(k) - column).amax() < 1e-9);
        }
        // one undoes the other
        let inverse = sensor.locate_jacobian(&pose, &seen).unwrap() * g;
        assert!((inverse - Matrix2::identity()).amax() < 1e-13);
        assert!(sensor.predict(&pose, &pose.xy()).is_none());
        assert!(sensor.jacobians(&pose, &pose.xy()).is_none());
    }
}
