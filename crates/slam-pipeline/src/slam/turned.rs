//! How far an error of the focal length has swung the path.

use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// The effect of a relative error of all angles on the pose: the angle turned so far, and its swing of the path.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Turned {
    angle: f64,
    swing: Vector2<f64>,
}

impl Turned {
    /// Adds a step of the path, world axes, that ends with a turn.
    pub(super) fn add(&mut self, step: &Vector2<f64>, turn: f64) {
        let middle = self.angle + 0.5 * turn;
        self.swing += Vector2::new(-step.y, step.x) * middle;
        self.angle += turn;
    }

    /// d (x, y, phi) / d (relative error).
    pub(super) fn gain(&self) -> Vector3<f64> {
        Vector3::new(self.swing.x, self.swing.y, self.angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use estimation_base::wrap;
    use mono_geometry::Se2;

    /// A path whose turns are all too large by the share e ends where the gain times e says.
    #[test]
    fn the_gain_of_turning_is_the_derivative_of_the_path() {
        let path = |stretch: f64| {
            let mut pose = Se2::identity();
            let mut turned = Turned::default();
            for k in 0..200 {
                let turn = 0.02 * (1.0 + (f64::from(k) * 0.05).sin());
                // The chord of an arc.
                let half = Se2::new(0.0, 0.0, 0.5 * turn * stretch);
                let next = pose
                    .compose(&half)
                    .compose(&Se2::new(0.05, 0.0, 0.0))
                    .compose(&half);
                turned.add(&Vector2::new(next.x - pose.x, next.y - pose.y), turn);
                pose = next;
            }
            (pose, turned)
        };
        let e = 1e-6;
        let (straight, turned) = path(1.0);
        let (more, less) = (path(1.0 + e).0, path(1.0 - e).0);
        let gain = turned.gain();
        let difference =
            Vector3::new(more.x - less.x, more.y - less.y, wrap(more.phi - less.phi)) / (2.0 * e);
        assert!((difference - gain).norm() < 1e-6, "{difference} {gain}");
        assert!(gain.z > 3.0 && straight.phi.abs() <= core::f64::consts::PI);
    }
}
