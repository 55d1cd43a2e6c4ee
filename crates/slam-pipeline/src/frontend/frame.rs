//! The keypoints of one frame, undistorted.

use mono_geometry::{Camera, Distortion};
use nalgebra::{Matrix2, Vector2};
use vision_sift::Features;

use super::nearby::Nearby;

/// Features of one frame with their ideal pixels.
#[derive(Debug)]
pub(crate) struct FrameFeatures<'a> {
    /// Keypoints and descriptors as detected.
    pub(crate) features: &'a Features,
    /// Ideal pinhole pixel of each keypoint; `None` outside the lens model.
    pub(crate) ideal: Vec<Option<Vector2<f64>>>,
    /// Variance of an ideal pixel per variance of the measured one: the lens stretches the noise with the image.
    pub(crate) variance_stretch: Vec<f64>,
    /// The keypoints with an ideal pixel, by place.
    pub(crate) nearby: Nearby,
}

impl<'a> FrameFeatures<'a> {
    /// Undistorts the keypoints. O(n log n).
    #[must_use]
    pub(crate) fn new(features: &'a Features, camera: &Camera) -> Self {
        let ideal: Vec<_> = features
            .keypoints
            .iter()
            .map(|k| {
                camera
                    .undistort_pixel(&Vector2::new(f64::from(k.x), f64::from(k.y)))
                    .ok()
            })
            .collect();
        let variance_stretch = ideal
            .iter()
            .map(|p| p.map_or(1.0, |p| variance_stretch(camera, &p)))
            .collect();
        let nearby = Nearby::new(&ideal);
        Self {
            features,
            ideal,
            variance_stretch,
            nearby,
        }
    }
}

/// The area of ideal pixels that one measured pixel at the ideal pixel `p` becomes: one over the determinant of the lens, by
/// central differences over a pixel.
fn variance_stretch(camera: &Camera, p: &Vector2<f64>) -> f64 {
    if camera.distortion() == &Distortion::None {
        return 1.0;
    }
    let half = 0.5;
    let along =
        |step: Vector2<f64>| camera.distort_pixel(&(p + step)) - camera.distort_pixel(&(p - step));
    let area = Matrix2::from_columns(&[
        along(Vector2::new(half, 0.0)),
        along(Vector2::new(0.0, half)),
    ])
    .determinant()
    .abs();
    if area > 0.0 { 1.0 / area } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::Pinhole;

    /// Noise of one pixel in a barrel-shaped image spreads as its square of variance does when the image is straightened.
    #[test]
    fn noise_behind_a_lens_is_stretched_with_the_image() {
        let pinhole = Pinhole {
            width: 640,
            height: 480,
            fx: 400.0,
            fy: 400.0,
            cx: 319.5,
            cy: 239.5,
        };
        let barrel = Distortion::Radtan {
            k1: -0.28,
            k2: 0.07,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
        };
        let camera = Camera::new(pinhole, barrel).unwrap();
        let measured = Vector2::new(600.0, 440.0);
        let ideal = camera.undistort_pixel(&measured).unwrap();
        let shifted = |x: f64, y: f64| {
            camera
                .undistort_pixel(&(measured + Vector2::new(x, y)))
                .unwrap()
                - ideal
        };
        let h = 1e-3;
        let area = Matrix2::from_columns(&[shifted(h, 0.0) / h, shifted(0.0, h) / h])
            .determinant()
            .abs();
        let stretch = variance_stretch(&camera, &ideal);
        assert!((stretch / area - 1.0).abs() < 2e-3, "{stretch} {area}");
        assert!(stretch > 1.5, "the corner is stretched: {stretch}");
        let centre = variance_stretch(&camera, &Vector2::new(319.5, 239.5));
        assert!((centre - 1.0).abs() < 1e-4, "{centre}");
        let plain = Camera::new(pinhole, Distortion::None).unwrap();
        assert_eq!(variance_stretch(&plain, &ideal), 1.0);
    }
}
