//! Keypoints drawn into a colour picture: a circle of the keypoint's scale with a line along its orientation.

use std::f32::consts::TAU;

use image::{Rgb, RgbImage};

use crate::features::Keypoint;

/// Radius of the circle over the keypoint's sigma: that of OpenCV's `DRAW_RICH_KEYPOINTS`.
const RADIUS: f32 = 1.0;
/// Smallest radius that is seen, pixels.
const LEAST_RADIUS: f32 = 2.0;

/// Draws each keypoint as a circle of radius sigma (at least 2 pixels) and a line from its centre along its orientation.
///
/// Parts outside the picture are left out. O(circumference) a keypoint.
pub fn draw_keypoints(picture: &mut RgbImage, keypoints: &[Keypoint], colour: [u8; 3]) {
    let (width, height) = picture.dimensions();
    let mut dot = |x: f32, y: f32| {
        let (x, y) = (x.round(), y.round());
        if x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32 {
            picture.put_pixel(x as u32, y as u32, Rgb(colour));
        }
    };
    // No circle is longer than the border of the picture needs it to be.
    let longest = 2.0 * (width + height) as f32;
    for keypoint in keypoints {
        let radius = (RADIUS * keypoint.sigma).max(LEAST_RADIUS);
        if !(radius.is_finite() && keypoint.angle.is_finite()) {
            continue;
        }
        let steps = (1.5 * TAU * radius).min(longest).ceil();
        for step in 0..steps as u32 {
            let (sine, cosine) = (TAU * step as f32 / steps).sin_cos();
            dot(keypoint.x + radius * cosine, keypoint.y + radius * sine);
        }
        let (sine, cosine) = keypoint.angle.sin_cos();
        let steps = (1.5 * radius).min(longest).ceil();
        for step in 0..=steps as u32 {
            let along = radius * step as f32 / steps;
            dot(keypoint.x + along * cosine, keypoint.y + along * sine);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_keypoint_is_a_circle_with_a_line_and_may_reach_over_the_edge() {
        let mut picture = RgbImage::new(40, 30);
        let keypoint = Keypoint {
            x: 20.0,
            y: 15.0,
            sigma: 6.0,
            angle: 0.0,
            response: 0.1,
        };
        let over = Keypoint {
            x: 0.0,
            sigma: 1e6,
            ..keypoint
        };
        let lost = Keypoint {
            x: f32::NAN,
            sigma: f32::NAN,
            ..keypoint
        };
        draw_keypoints(&mut picture, &[keypoint, lost], [255, 0, 0]);
        let red = |x, y| picture.get_pixel(x, y).0 == [255, 0, 0];
        assert!(red(26, 15) && red(20, 9) && red(14, 15) && red(20, 21));
        assert!((20..=26).all(|x| red(x, 15)));
        assert!(!red(18, 15) && !red(0, 0));
        draw_keypoints(&mut picture, &[over], [0, 255, 0]);
    }
}
