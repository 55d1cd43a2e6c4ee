//! Poses at which a camera sees a whole board, spread over image, distance and tilt.
//!
//! Drawn and rejected until all corners lie inside the image by a margin and no two neighbours are nearer than a few
//! pixels. Tilts reach 45 degrees about any axis, turns 25 degrees in the image, so that focal length, centre and lens
//! are all constrained.

use mono_geometry::{Camera, Se3, so3};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

use super::shape::Board;

/// Distance of every corner from the image border, pixels.
const MARGIN_PX: f64 = 8.0;
/// Smallest distance of neighbouring corners, pixels.
const SPACING_PX: f64 = 9.0;
/// Draws a pose before the next one is asked for; a camera that never sees the board must end.
const MOST_DRAWS: usize = 20_000;

/// `count` poses (camera from board), fewer when the camera cannot see the whole board.
pub fn board_poses(board: &Board, camera: &Camera, count: usize, seed: u64) -> Vec<Se3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(u64::from(u32::MAX));
    let mut found = Vec::with_capacity(count);
    for _ in 0..count {
        match (0..MOST_DRAWS)
            .map(|_| draw(board, camera, &mut rng))
            .find(|pose| visible(board, camera, pose))
        {
            Some(pose) => found.push(pose),
            None => break,
        }
    }
    found
}

fn draw(board: &Board, camera: &Camera, rng: &mut ChaCha8Rng) -> Se3 {
    let pinhole = camera.pinhole();
    let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let (axis, tilt) = (uniform(0.0, TAU), uniform(5.0, 45.0).to_radians());
    let turn = uniform(-25.0, 25.0).to_radians();
    let rotation = so3::exp(&(Vector3::new(axis.cos(), axis.sin(), 0.0) * tilt))
        * so3::exp(&Vector3::new(0.0, 0.0, turn));
    // The board's width as a share of the image's.
    let share = uniform(0.3, 0.85);
    let width_m = board.square_m * (board.columns + 1) as f64;
    let depth = pinhole.fx * width_m / (share * pinhole.width as f64);
    let pixel = Vector2::new(
        uniform(0.15, 0.85) * pinhole.width as f64,
        uniform(0.15, 0.85) * pinhole.height as f64,
    );
    let centre = pinhole.normalize(&pixel).push(1.0) * depth;
    let middle = Vector3::new(
        0.5 * board.square_m * (board.columns - 1) as f64,
        0.5 * board.square_m * (board.rows - 1) as f64,
        0.0,
    );
    Se3::new(rotation, centre - rotation * middle)
}

fn visible(board: &Board, camera: &Camera, pose: &Se3) -> bool {
    let (columns, rows) = (board.columns, board.rows);
    let mut pixels = Vec::with_capacity(columns * rows);
    for point in board.corners_m() {
        match camera.project(&pose.transform_point(&point)) {
            Some(pixel) if camera.contains(&pixel, MARGIN_PX) => pixels.push(pixel),
            _ => return false,
        }
    }
    (0..columns * rows).all(|k| {
        let apart = |other: usize| (pixels[k] - pixels[other]).norm() >= SPACING_PX;
        (k % columns + 1 == columns || apart(k + 1))
            && (k / columns + 1 == rows || apart(k + columns))
    })
}
