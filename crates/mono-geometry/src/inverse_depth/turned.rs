//! How the direction to a landmark turns with its cameras.
//!
//! The direction d = b + rho (c_a - c) of a landmark with anchor a, as the camera at c sees it, is R d. A camera that turns
//! with the angular velocity w changes what it sees as if d had turned the other way, d x w; an anchor that turns takes the
//! ray with it, w x b. A shift dc of the camera changes d by -rho dc, one of the anchor by rho dc_a.
//!
//! The functions give one column for each axis of rotation, in the axes in which direction and axes are given:
//! [`tilted_body_axes`](crate::tilted_body_axes) are those of heading, roll and pitch.

use nalgebra::{Matrix3, Vector3};

/// Derivative of the direction as the camera sees it by rotations of that camera about `axes`. O(1).
#[must_use]
#[inline]
pub fn turned_camera(direction: &Vector3<f64>, axes: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&[0, 1, 2].map(|i| direction.cross(&axes.column(i))))
}

/// Derivative of the direction by rotations of its anchor about `axes`; `base` is the part b that turns with it. O(1).
#[must_use]
#[inline]
pub fn turned_anchor(base: &Vector3<f64>, axes: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&[0, 1, 2].map(|i| axes.column(i).cross(base)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Se2, tilted_body_axes, world_from_tilted_body};

    /// Central differences of R^T d and R b over heading, roll and pitch.
    #[test]
    fn rotations_are_those_of_finite_differences() {
        let at = [0.7, 0.2, -0.3];
        let rotation = |angles: [f64; 3]| {
            let [phi, roll, pitch] = angles;
            let pose = world_from_tilted_body(&Se2::new(0.0, 0.0, phi), roll, pitch, 0.0);
            *pose.rotation.matrix()
        };
        let v = Vector3::new(0.4, -1.1, 2.0);
        let world_from_body = rotation(at);
        let axes = tilted_body_axes(at[0], at[2]);
        let (camera, anchor) = (turned_camera(&v, &axes), turned_anchor(&v, &axes));
        let h = 1e-6;
        for i in 0..3 {
            let moved = |h: f64| {
                let mut angles = at;
                angles[i] += h;
                rotation(angles)
            };
            let (more, less) = (moved(h), moved(-h));
            let seen = (more.tr_mul(&v) - less.tr_mul(&v)) / (2.0 * h);
            assert!((world_from_body.tr_mul(&camera.column(i)) - seen).norm() < 1e-9);
            let fixed = world_from_body.tr_mul(&v);
            let carried = (more * fixed - less * fixed) / (2.0 * h);
            assert!((anchor.column(i) - carried).norm() < 1e-9);
        }
    }
}
