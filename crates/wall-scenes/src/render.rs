//! Images of a scene: rays, optics, sensor.
//!
//! Steps per frame: 4x4 rays a pixel averaged (the pixel's square aperture), a Gaussian
//! blur for the lens (an open shutter sees the mean over its poses, 2x2 rays each), vignetting 1 - a r^2, the frame's exposure, noise with variance
//! `noise_px`^2 (1/3 + 2/3 I / 128) (read plus shot noise; I in grey levels), rounding to 8 bits.
//! Rows of a frame and frames are independent; the noise of frame k is stream k.

use crate::camera::{CX, CY, HEIGHT, Lens, WIDTH, ray};
use crate::facet::{Facet, nearest};
use crate::image::GreyImage;
use crate::mishaps::FrameSpan;
use crate::scene::Scene;
use crate::screen::ScreenIndex;
use crate::skin::paint::Skins;
use crate::stream::{Purpose, stream};
use nalgebra::{Isometry3, Point3, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Rays along each edge of a pixel of a still camera, and of each pose of a moving one.
const RAYS: [usize; 2] = [4, 2];
/// Mean brightness of what covers the lens.
const COVER: f32 = 55.0;
/// Standard deviation of the lens blur, pixels.
const BLUR_SIGMA_PX: f64 = 0.75;
/// Loss of light at the image corner.
const VIGNETTING: f64 = 0.28;
/// Gain from painted tone to grey level at exposure 1.
const WHITE_LEVEL: f32 = 1.1;
/// Read noise's share of the variance at mid grey.
const READ_SHARE: f32 = 1.0 / 3.0;

impl Scene {
    /// The image of a frame, row by row. About 40 ms of one core, a quarter of that a pose where the shutter is open for long.
    ///
    /// # Panics
    /// When `frame` is not below the number of frames, or the skins are another scene's.
    pub fn render(&self, skins: &Skins, frame: usize) -> GreyImage {
        let frames = self.spec.frame_rate.frames_at(frame);
        let hidden = |span: Option<FrameSpan>| span.is_some_and(|span| span.holds(frames));
        let clean = if hidden(self.spec.mishaps.dark) {
            vec![0.0; WIDTH * HEIGHT]
        } else if hidden(self.spec.mishaps.blocked) {
            vec![COVER; WIDTH * HEIGHT]
        } else {
            blur(&self.radiance(skins, frame))
        };
        let exposure = self.exposure(frame);
        let mut rng = stream(self.spec.seed, Purpose::Sensor, frame as u64);
        let corner2 = CX.max(WIDTH as f64 - CX).powi(2) + CY.max(HEIGHT as f64 - CY).powi(2);
        let mut pixels = Vec::with_capacity(WIDTH * HEIGHT);
        for (index, value) in clean.iter().enumerate() {
            let (u, v) = ((index % WIDTH) as f64, (index / WIDTH) as f64);
            let r2 = ((u - CX).powi(2) + (v - CY).powi(2)) / corner2;
            let level = value * WHITE_LEVEL * (exposure * (1.0 - VIGNETTING * r2)) as f32;
            let variance = READ_SHARE + (1.0 - READ_SHARE) * level / 128.0;
            let sigma = self.spec.noise_px as f32 * variance.sqrt();
            let noise: f32 = rng.sample(StandardNormal);
            pixels.push((level + sigma * noise).round().clamp(0.0, 255.0) as u8);
        }
        GreyImage {
            width: WIDTH,
            height: HEIGHT,
            pixels,
        }
    }

    /// Slow drift of the exposure about 1, a few percent, with its own phase a seed.
    fn exposure(&self, frame: usize) -> f64 {
        let mut rng = stream(self.spec.seed, Purpose::Exposure, 0);
        let mut draw = || rng.random::<f64>();
        let (slow, fast) = (30.0 + 30.0 * draw(), 9.0 + 6.0 * draw());
        let (phase_slow, phase_fast) = (TAU * draw(), TAU * draw());
        let t = TAU * self.spec.frame_rate.frames_at(frame);
        1.0 + 0.06 * (t / slow + phase_slow).sin() + 0.025 * (t / fast + phase_fast).sin()
    }

    /// Mean brightness (0..255) under each pixel's aperture.
    fn radiance(&self, skins: &Skins, frame: usize) -> Vec<f32> {
        let facets = self.facets_at(frame);
        let poses = self.exposure_poses(frame);
        let mut sum = vec![0.0_f32; WIDTH * HEIGHT];
        for pose in &poses {
            let rays = RAYS[usize::from(poses.len() > 1)];
            let seen = self.radiance_from(skins, &facets, pose, rays);
            for (sum, seen) in sum.iter_mut().zip(seen) {
                *sum += seen;
            }
        }
        let share = 1.0 / poses.len() as f32;
        sum.iter_mut().for_each(|value| *value *= share);
        sum
    }

    /// Mean brightness under each pixel's aperture from one pose, `rays` along each edge of a pixel.
    fn radiance_from(
        &self,
        skins: &Skins,
        facets: &[Facet],
        pose: &Isometry3<f64>,
        rays: usize,
    ) -> Vec<f32> {
        let lens = self.spec.lens();
        let index = ScreenIndex::new(facets, pose, lens);
        let origin = Point3::from(pose.translation.vector);
        let across: Vector3<f64> = pose * (ray(1.0, 0.0) - ray(0.0, 0.0));
        let offset = |k: usize| (k as f64 + 0.5) / rays as f64 - 0.5;
        let mut pixels = vec![0.0_f32; WIDTH * HEIGHT];
        pixels
            .par_chunks_mut(WIDTH)
            .enumerate()
            .for_each(|(row, line)| {
                for (column, pixel) in line.iter_mut().enumerate() {
                    let candidates = index.at(column, row);
                    let mut sum = 0.0;
                    for j in 0..rays {
                        let v = row as f64 + offset(j);
                        let start = pose * ray(column as f64, v);
                        for i in 0..rays {
                            let direction = match lens {
                                Lens::Pinhole => start + across * offset(i),
                                Lens::Equidistant(_) => {
                                    pose * lens.ray(column as f64 + offset(i), v)
                                }
                            };
                            let listed = candidates.iter().map(|&k| k as usize);
                            if let Some(hit) = nearest(facets, listed, &origin, &direction) {
                                let point = origin + direction * hit.distance;
                                sum += skins.brightness(facets, hit.facet, &point);
                            }
                        }
                    }
                    *pixel = sum / (rays * rays) as f32;
                }
            });
        pixels
    }
}

/// Separable Gaussian of five taps, rim repeated.
fn blur(pixels: &[f32]) -> Vec<f32> {
    let raw: [f32; 5] =
        std::array::from_fn(|k| (-0.5 * ((k as f64 - 2.0) / BLUR_SIGMA_PX).powi(2)).exp() as f32);
    let total: f32 = raw.iter().sum();
    let pass = |source: &[f32], horizontal: bool| -> Vec<f32> {
        let mut out = Vec::with_capacity(source.len());
        for row in 0..HEIGHT {
            for column in 0..WIDTH {
                let mut sum = 0.0;
                for (k, weight) in raw.iter().enumerate() {
                    let shift = |at: usize, last: usize| (at + k).saturating_sub(2).min(last);
                    let at = if horizontal {
                        row * WIDTH + shift(column, WIDTH - 1)
                    } else {
                        shift(row, HEIGHT - 1) * WIDTH + column
                    };
                    sum += weight * source[at];
                }
                out.push(sum / total);
            }
        }
        out
    };
    pass(&pass(pixels, true), false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_keeps_a_flat_image_and_spreads_a_point_by_its_sigma() {
        assert!(
            blur(&vec![7.0; WIDTH * HEIGHT])
                .iter()
                .all(|v| (v - 7.0).abs() < 1e-4)
        );
        let mut point = vec![0.0; WIDTH * HEIGHT];
        point[100 * WIDTH + 150] = 1.0;
        let spread = blur(&point);
        let variance: f32 = (0..WIDTH)
            .map(|c| spread[100 * WIDTH + c] * (c as f32 - 150.0).powi(2))
            .sum::<f32>()
            / (0..WIDTH).map(|c| spread[100 * WIDTH + c]).sum::<f32>();
        assert!(
            (f64::from(variance).sqrt() - BLUR_SIGMA_PX).abs() < 0.02,
            "{variance}"
        );
    }
}
