//! The image of a board: area sampling behind the lens, then optics, light and sensor.
//!
//! Problem: an image whose corners are known to a thousandth of a pixel, and which is as hard as a real one.
//!
//! Steps: every corner of every pixel is taken through the lens to the board's plane (inverse homography of the
//! pose); a pixel that an edge crosses is the mean of [`SIDE`] x [`SIDE`] jittered samples, board coordinates bilinear
//! within it (the error of that is the second derivative over 8: below 1e-4 px); Gaussian blur; light that falls off towards
//! the rim and to one side; Gaussian noise; rounding to 8 bits. Jitter rather than a grid of samples, because a grid moves
//! an edge that runs along it by up to half its spacing.
//!
//! The square before the first corner is dark; a white margin surrounds the squares; behind it lies clutter of
//! rectangles and stripes. Truth is the camera's own projection of the corners, so renderer and truth share the lens
//! model but no code path: the renderer only ever inverts it.

use mono_geometry::{Camera, Se3};
use nalgebra::{Matrix3, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

use super::shape::Board;
use crate::image::GreyImage;

/// Samples along each side of a pixel.
const SIDE: usize = 12;
/// Pieces of clutter.
const CLUTTER: usize = 70;

/// Light, optics, sensor and surroundings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Standard deviation of the lens blur, pixels.
    pub blur_px: f64,
    /// Standard deviation of the noise, grey levels.
    pub noise: f64,
    /// Grey levels of black and white at full light.
    pub tones: (f64, f64),
    /// Loss of light at the image corner, 0 to 1.
    pub vignetting: f64,
    /// Change of light from the middle to the side, 0 to 1.
    pub slope: f64,
    /// White margin around the squares, in squares.
    pub margin: f64,
    /// Whether something is behind the board.
    pub clutter: bool,
}

impl Default for Look {
    /// A fair camera in a fair room.
    fn default() -> Self {
        Look {
            blur_px: 0.7,
            noise: 1.0,
            tones: (35.0, 215.0),
            vignetting: 0.25,
            slope: 0.15,
            margin: 0.8,
            clutter: true,
        }
    }
}

/// An image and its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The image.
    pub image: GreyImage,
    /// True corners in board order, pixels.
    pub corners: Vec<[f64; 2]>,
}

/// Renders boards for one camera; the way through its lens is computed once.
#[derive(Debug, Clone)]
pub struct BoardRenderer {
    camera: Camera,
    /// Normalised undistorted place of every corner of every pixel; `None` outside the lens's field.
    lattice: Vec<Option<Vector2<f64>>>,
}

impl BoardRenderer {
    /// Takes every corner of every pixel through the lens: about a microsecond each.
    pub fn new(camera: Camera) -> Self {
        let (width, height) = (camera.pinhole().width, camera.pinhole().height);
        let lattice = (0..(width + 1) * (height + 1))
            .map(|k| {
                let (column, row) = (k % (width + 1), k / (width + 1));
                camera
                    .undistort(&Vector2::new(column as f64 - 0.5, row as f64 - 0.5))
                    .ok()
            })
            .collect();
        Self { camera, lattice }
    }

    /// The board at a pose (camera from board); `seed` and `index` choose clutter and noise.
    pub fn render(
        &self,
        board: &Board,
        camera_from_board: &Se3,
        look: &Look,
        seed: u64,
        index: u64,
    ) -> Picture {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(index);
        let (width, height) = (self.camera.pinhole().width, self.camera.pinhole().height);
        let behind = background(look, width, height, &mut rng);
        let on_board = self.on_board(board, camera_from_board);
        let scene = Scene { board, look };
        let mut values = Vec::with_capacity(width * height);
        for row in 0..height {
            for column in 0..width {
                let at = row * (width + 1) + column;
                let rim = [at, at + 1, at + width + 1, at + width + 2].map(|k| on_board[k]);
                let back = behind[row * width + column];
                values.push(match rim {
                    [Some(a), Some(b), Some(c), Some(d)] => {
                        scene.pixel([a, b, c, d], back, &mut rng)
                    }
                    _ => back,
                });
            }
        }
        let values = blur(&values, width, height, look.blur_px);
        let turn = TAU * rng.random::<f64>();
        let (half_x, half_y) = (0.5 * width as f64, 0.5 * height as f64);
        let pixels = values
            .iter()
            .enumerate()
            .map(|(k, value)| {
                let x = ((k % width) as f64 - half_x) / half_x;
                let y = ((k / width) as f64 - half_y) / half_y;
                let light = (1.0 - 0.5 * look.vignetting * (x * x + y * y))
                    * (1.0 + look.slope * (turn.cos() * x + turn.sin() * y));
                let noise: f64 = rng.sample(StandardNormal);
                (value * light + look.noise * noise)
                    .round()
                    .clamp(0.0, 255.0) as u8
            })
            .collect();
        let corners = board
            .corners_m()
            .map(|point| {
                self.camera
                    .project(&camera_from_board.transform_point(&point))
                    .map_or([f64::NAN; 2], |pixel| [pixel.x, pixel.y])
            })
            .collect();
        Picture {
            image: GreyImage {
                width,
                height,
                pixels,
            },
            corners,
        }
    }

    /// The lattice in the board's plane, in squares from the first corner.
    fn on_board(&self, board: &Board, pose: &Se3) -> Vec<Option<Vector2<f64>>> {
        let rotation = pose.rotation.matrix();
        let plane = Matrix3::from_columns(&[
            rotation.column(0) * board.square_m,
            rotation.column(1) * board.square_m,
            pose.translation.column(0).into(),
        ]);
        let Some(inverse) = plane.try_inverse() else {
            return vec![None; self.lattice.len()];
        };
        self.lattice
            .iter()
            .map(|normalized| {
                let q = inverse * (*normalized)?.push(1.0);
                // Positive depth: the third coordinate is the inverse of it.
                (q.z > 0.0).then(|| Vector2::new(q.x / q.z, q.y / q.z))
            })
            .collect()
    }
}

struct Scene<'a> {
    board: &'a Board,
    look: &'a Look,
}

impl Scene<'_> {
    /// Mean over a pixel whose corners lie at `rim` on the board.
    fn pixel(&self, rim: [Vector2<f64>; 4], back: f64, rng: &mut ChaCha8Rng) -> f64 {
        let here = self.patch(&rim[0]);
        if rim.iter().all(|place| self.patch(place) == here) {
            return self.tone(here, back);
        }
        let mut sum = 0.0;
        for j in 0..SIDE {
            for i in 0..SIDE {
                // One draw for both: 32 bits place a sample to a billionth of a pixel.
                let draw: u64 = rng.random();
                let jitter = |bits: u64| (bits & 0xffff_ffff) as f64 / 4_294_967_296.0;
                let u = (i as f64 + jitter(draw)) / SIDE as f64;
                let v = (j as f64 + jitter(draw >> 32)) / SIDE as f64;
                let upper = rim[0] * (1.0 - u) + rim[1] * u;
                let lower = rim[2] * (1.0 - u) + rim[3] * u;
                sum += self.tone(self.patch(&(upper * (1.0 - v) + lower * v)), back);
            }
        }
        sum / (SIDE * SIDE) as f64
    }

    /// Which square, margin or nothing: equal patches have equal tone.
    fn patch(&self, place: &Vector2<f64>) -> Option<(i32, i32)> {
        let (columns, rows) = (self.board.columns as f64, self.board.rows as f64);
        let outside = |value: f64, last: f64| (-1.0 - value).max(value - last);
        let beyond = outside(place.x, columns).max(outside(place.y, rows));
        if beyond <= 0.0 {
            Some((place.x.floor() as i32, place.y.floor() as i32))
        } else if beyond <= self.look.margin {
            Some((i32::MAX, 0))
        } else {
            None
        }
    }

    fn tone(&self, patch: Option<(i32, i32)>, back: f64) -> f64 {
        let (dark, bright) = self.look.tones;
        match patch {
            None => back,
            Some((i32::MAX, _)) => bright,
            Some((column, row)) if (column + row).rem_euclid(2) == 0 => dark,
            Some(_) => bright,
        }
    }
}

/// The surroundings of the board: a flat tone, or rectangles turned at random and filled with a tone or with stripes.
fn background(look: &Look, width: usize, height: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let (dark, bright) = look.tones;
    let mut values = vec![0.5 * (dark + bright); width * height];
    if !look.clutter {
        return values;
    }
    for _ in 0..CLUTTER {
        let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let (cx, cy) = (uniform(0.0, width as f64), uniform(0.0, height as f64));
        let (a, b) = (
            uniform(0.01, 0.12) * width as f64,
            uniform(0.01, 0.12) * width as f64,
        );
        let (sin, cos) = uniform(0.0, TAU).sin_cos();
        let (first, second) = (uniform(dark, bright), uniform(dark, bright));
        let period = uniform(3.0, 14.0);
        let reach = a.hypot(b);
        let span = |centre: f64, side: usize| {
            let low = (centre - reach).floor().max(0.0) as usize;
            low..((centre + reach).ceil().max(0.0) as usize).min(side)
        };
        for y in span(cy, height) {
            for x in span(cx, width) {
                let (dx, dy) = (x as f64 - cx, y as f64 - cy);
                let (u, v) = (cos * dx + sin * dy, cos * dy - sin * dx);
                if u.abs() <= a && v.abs() <= b {
                    // Stripes one period wide, their edges over one pixel: sharper ones alias into checkerboards.
                    let place = u.rem_euclid(2.0 * period) - period;
                    let inside = 0.5 * period - (place.abs() - 0.5 * period).abs();
                    let share = (0.5 + inside * place.signum()).clamp(0.0, 1.0);
                    values[y * width + x] = second + share * (first - second);
                }
            }
        }
    }
    values
}

/// Separable Gaussian to four standard deviations, rim repeated.
fn blur(values: &[f64], width: usize, height: usize, sigma_px: f64) -> Vec<f64> {
    if sigma_px <= 0.0 {
        return values.to_vec();
    }
    let reach = (4.0 * sigma_px).ceil() as usize;
    let raw: Vec<f64> = (0..=2 * reach)
        .map(|k| (-0.5 * ((k as f64 - reach as f64) / sigma_px).powi(2)).exp())
        .collect();
    let total: f64 = raw.iter().sum();
    let pass = |source: &[f64], across: bool| -> Vec<f64> {
        (0..width * height)
            .map(|k| {
                let (column, row) = (k % width, k / width);
                let sum: f64 = raw
                    .iter()
                    .enumerate()
                    .map(|(tap, weight)| {
                        let shift =
                            |at: usize, side: usize| (at + tap).saturating_sub(reach).min(side - 1);
                        let at = if across {
                            row * width + shift(column, width)
                        } else {
                            shift(row, height) * width + column
                        };
                        weight * source[at]
                    })
                    .sum();
                sum / total
            })
            .collect()
    };
    pass(&pass(values, true), false)
}
