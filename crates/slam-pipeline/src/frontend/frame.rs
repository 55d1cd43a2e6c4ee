//! The keypoints of one frame, undistorted.

use mono_geometry::{Camera, NoiseShape};
use nalgebra::Vector2;
use vision_sift::Features;

use super::nearby::Nearby;
use crate::features::keypoint_sigma_px;
use crate::filter::pixel_noise::PixelNoise;

/// Features of one frame with their ideal pixels.
#[derive(Debug)]
pub(crate) struct FrameFeatures<'a> {
    /// Keypoints and descriptors as detected.
    pub(crate) features: &'a Features,
    /// Ideal pinhole pixel of each keypoint; `None` outside the lens model.
    pub(crate) ideal: Vec<Option<Vector2<f64>>>,
    /// The noise of an ideal pixel, per standard deviation of the measured one: the lens stretches it with the image.
    pub(crate) shape: Vec<NoiseShape>,
    /// The keypoints with an ideal pixel, by place.
    pub(crate) nearby: Nearby,
}

impl<'a> FrameFeatures<'a> {
    /// Undistorts the keypoints. O(n log n).
    #[must_use]
    pub(crate) fn new(features: &'a Features, camera: &Camera) -> Self {
        let undistorted = features.keypoints.iter().map(|k| {
            camera
                .undistort_with_shape(&Vector2::new(f64::from(k.x), f64::from(k.y)))
                .ok()
        });
        let (ideal, shape): (Vec<_>, Vec<_>) = undistorted
            .map(|found| (found.map(|f| f.0), found.map_or(NoiseShape::ROUND, |f| f.1)))
            .unzip();
        let nearby = Nearby::new(&ideal);
        Self {
            features,
            ideal,
            shape,
            nearby,
        }
    }

    /// The noise of the ideal pixel of keypoint `k`, where the smallest keypoints have `sigma_px` in the real image.
    #[must_use]
    pub(crate) fn noise(&self, k: usize, sigma_px: f64) -> PixelNoise {
        let size_px = f64::from(self.features.keypoints[k].sigma);
        PixelNoise::shaped(&self.shape[k], keypoint_sigma_px(sigma_px, size_px))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::tests::common::rig;
    use mono_geometry::{Distortion, Pinhole};
    use nalgebra::Matrix2;
    use vision_sift::Keypoint;

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
        let features = |at: &Vector2<f64>| Features {
            keypoints: vec![Keypoint {
                x: at.x as f32,
                y: at.y as f32,
                sigma: 2.0,
                angle: 0.0,
                response: 0.1,
            }],
            descriptors: vec![[0; 128]],
        };
        let stretch = |camera: &Camera, at: &Vector2<f64>| {
            let shape = FrameFeatures::new(&features(at), camera).shape[0];
            shape.covariance(1.0).determinant().sqrt()
        };
        let corner = stretch(&camera, &measured);
        assert!((corner / area - 1.0).abs() < 1e-5, "{corner} {area}");
        assert!(corner > 1.5, "the corner is stretched: {corner}");
        let centre = stretch(&camera, &Vector2::new(319.5, 239.5));
        assert!((centre - 1.0).abs() < 1e-12, "{centre}");
        let plain = Camera::new(pinhole, Distortion::None).unwrap();
        assert_eq!(stretch(&plain, &measured), 1.0);
    }

    /// The noise of the smallest keypoints is the stated one; one of size 2 has twice the variance.
    #[test]
    fn large_keypoints_are_found_less_well() {
        let keypoint = |sigma: f32| Keypoint {
            x: 100.0,
            y: 100.0,
            sigma,
            angle: 0.0,
            response: 0.1,
        };
        let features = Features {
            keypoints: [0.01, 2.0, 6.0].map(keypoint).to_vec(),
            descriptors: vec![[0; 128]; 3],
        };
        let frame = FrameFeatures::new(&features, &rig().camera);
        let variance = |k: usize| frame.noise(k, 0.3).covariance()[(0, 0)];
        assert!((variance(0) - 0.09).abs() < 1e-5);
        assert!((variance(1) - 2.0 * 0.09).abs() < 1e-12);
        assert!((variance(2) - 10.0 * 0.09).abs() < 1e-12);
    }
}
