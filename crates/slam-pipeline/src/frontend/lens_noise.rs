//! The noise of a pixel where a landmark is predicted.
//!
//! A keypoint is found in the real image with the same noise in both directions; in the ideal image, where predictions are compared,
//! the noise is stretched with the picture, most along the radius. With J the derivative of the lens at the ideal pixel the
//! covariance is sigma^2 (J^T J)^-1.
//!
//! Degenerate: beyond the fold of the lens nothing is seen; the noise is left round there.

use mono_geometry::{Camera, Distortion};
use nalgebra::{Matrix2, Vector2};

/// Covariance of an ideal pixel for a noise of one pixel in the real image, pixels squared. O(1).
#[must_use]
pub(crate) fn noise_at(camera: &Camera, pixel_ideal: &Vector2<f64>) -> Matrix2<f64> {
    let pinhole = camera.pinhole();
    let normalized = pinhole.normalize(pixel_ideal);
    if camera.distortion() == &Distortion::None || normalized.norm() >= camera.field_radius() {
        return Matrix2::identity();
    }
    let (_, lens) = camera.distortion().distort_with_jacobian(&normalized);
    let aspect = pinhole.fx / pinhole.fy;
    let j = Matrix2::new(
        lens[(0, 0)],
        lens[(0, 1)] * aspect,
        lens[(1, 0)] / aspect,
        lens[(1, 1)],
    );
    (j.tr_mul(&j))
        .try_inverse()
        .unwrap_or_else(Matrix2::identity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::Pinhole;

    #[test]
    fn it_is_the_noise_of_a_keypoint_found_there() {
        let pinhole = Pinhole {
            width: 640,
            height: 480,
            fx: 300.0,
            fy: 320.0,
            cx: 319.5,
            cy: 239.5,
        };
        let lenses = [
            Distortion::Radtan {
                k1: -0.2,
                k2: 0.05,
                p1: 1e-3,
                p2: -1e-3,
                k3: 0.0,
            },
            Distortion::KannalaBrandt {
                k1: -0.01,
                k2: 0.0,
                k3: 0.0,
                k4: 0.0,
            },
        ];
        for lens in lenses {
            let camera = Camera::new(pinhole, lens).unwrap();
            let (ideal, expected) = camera
                .undistort_with_covariance(&Vector2::new(560.0, 100.0), &Matrix2::identity())
                .unwrap();
            let found = noise_at(&camera, &ideal);
            assert!((found - expected).amax() < 1e-9 * expected.amax());
            assert!(expected.amax() > 1.5, "{expected}");
        }
        let plain = Camera::new(pinhole, Distortion::None).unwrap();
        assert_eq!(
            noise_at(&plain, &Vector2::new(9.0, 9.0)),
            Matrix2::identity()
        );
    }
}
