//! Grey planes in `f32`: blur, halving, sampling between pixels.
//!
//! Pixel (0, 0) is the centre of the top-left pixel. A pixel x of a halved plane covers pixels 2x and 2x + 1 of the one
//! before, so a place x at level l is 2^l x + (2^l - 1) / 2 at level 0 ([`to_finest`]).

use crate::image::GreyView;

/// Taps on each side of the smoothing kernel: three standard deviations.
const BLUR_REACH: usize = 3;

/// One level of the pyramid, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

impl Plane {
    /// Grey levels 0 to 255; `None` when the pixels do not fill the size.
    pub(super) fn of(image: GreyView<'_>) -> Option<Plane> {
        (image.width.checked_mul(image.height)? == image.pixels.len()).then(|| Plane {
            width: image.width,
            height: image.height,
            values: image.pixels.iter().map(|&value| f32::from(value)).collect(),
        })
    }

    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// Means of 2 x 2 pixels; an odd last row or column is dropped.
    pub(super) fn halved(&self) -> Plane {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            let above = &self.values[2 * y * self.width..][..2 * width];
            let below = &self.values[(2 * y + 1) * self.width..][..2 * width];
            let pairs = above.chunks_exact(2).zip(below.chunks_exact(2));
            values.extend(pairs.map(|(a, b)| 0.25 * (a[0] + a[1] + b[0] + b[1])));
        }
        Plane {
            width,
            height,
            values,
        }
    }

    /// Gaussian of one pixel's standard deviation, rim repeated.
    pub(super) fn blurred(&self) -> Plane {
        let raw: [f32; 2 * BLUR_REACH + 1] =
            std::array::from_fn(|k| (-0.5 * (k as f32 - BLUR_REACH as f32).powi(2)).exp());
        let total: f32 = raw.iter().sum();
        let taps = raw.map(|tap| tap / total);
        let mut rows = vec![0.0; self.values.len()];
        for (source, target) in self
            .values
            .chunks_exact(self.width)
            .zip(rows.chunks_exact_mut(self.width))
        {
            let mut padded = vec![source[0]; BLUR_REACH];
            padded.extend_from_slice(source);
            padded.extend([source[self.width - 1]; BLUR_REACH]);
            for (x, value) in target.iter_mut().enumerate() {
                *value = taps.iter().zip(&padded[x..]).map(|(t, v)| t * v).sum();
            }
        }
        let mut values = vec![0.0; self.values.len()];
        for (y, target) in values.chunks_exact_mut(self.width).enumerate() {
            for (k, tap) in taps.iter().enumerate() {
                let row = (y + k).saturating_sub(BLUR_REACH).min(self.height - 1);
                for (sum, value) in target.iter_mut().zip(&rows[row * self.width..]) {
                    *sum += tap * value;
                }
            }
        }
        Plane {
            values,
            ..Plane {
                width: self.width,
                height: self.height,
                values: Vec::new(),
            }
        }
    }

    /// Bilinear value; `None` outside the pixel centres.
    pub(super) fn sample(&self, x: f64, y: f64) -> Option<f32> {
        let (last_x, last_y) = ((self.width - 1) as f64, (self.height - 1) as f64);
        if !(x >= 0.0 && y >= 0.0 && x <= last_x && y <= last_y) {
            return None;
        }
        let (left, top) = (
            (x as usize).min(self.width.saturating_sub(2)),
            (y as usize).min(self.height.saturating_sub(2)),
        );
        let (fx, fy) = ((x - left as f64) as f32, (y - top as f64) as f32);
        let (right, bottom) = (
            (left + 1).min(self.width - 1),
            (top + 1).min(self.height - 1),
        );
        let upper = self.at(left, top) * (1.0 - fx) + self.at(right, top) * fx;
        let lower = self.at(left, bottom) * (1.0 - fx) + self.at(right, bottom) * fx;
        Some(upper * (1.0 - fy) + lower * fy)
    }
}

/// A place of level `level` in pixels of level 0.
pub(super) fn to_finest(position: [f64; 2], level: u32) -> [f64; 2] {
    let factor = f64::from(1_u32 << level);
    position.map(|value| factor * value + 0.5 * (factor - 1.0))
}

/// The inverse of [`to_finest`].
pub(super) fn from_finest(position: [f64; 2], level: u32) -> [f64; 2] {
    let factor = f64::from(1_u32 << level);
    position.map(|value| (value - 0.5 * (factor - 1.0)) / factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_survives_halving_and_blur_in_its_own_coordinates() {
        let pixels: Vec<u8> = (0..41 * 30)
            .map(|k| (2 * (k % 41) + 3 * (k / 41)) as u8)
            .collect();
        let plane = Plane::of(GreyView {
            width: 41,
            height: 30,
            pixels: &pixels,
        })
        .unwrap();
        let half = plane.halved();
        assert_eq!((half.width, half.height), (20, 15));
        let [x, y] = to_finest([7.0, 5.0], 1);
        assert_eq!((x, y), (14.5, 10.5));
        assert_eq!(from_finest([x, y], 1), [7.0, 5.0]);
        let expected = (2.0 * x + 3.0 * y) as f32;
        assert!((half.at(7, 5) - expected).abs() < 1e-4);
        assert!((plane.sample(x, y).unwrap() - expected).abs() < 1e-4);
        assert!((plane.blurred().at(20, 15) - plane.at(20, 15)).abs() < 1e-3);
        assert_eq!(plane.sample(40.0, 29.0), Some(plane.at(40, 29)));
        assert!(plane.sample(40.1, 3.0).is_none() && plane.sample(f64::NAN, 3.0).is_none());
    }
}
