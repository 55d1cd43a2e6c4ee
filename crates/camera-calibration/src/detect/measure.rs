//! All corners of a board measured: levels, windows, and the bending of its edges by the lens.
//!
//! Problem: `refine` fits one corner with straight edges. This file chooses the pixels and the pyramid level, and accounts
//! for edges that the lens bends.
//!
//! Steps: fit at the level where the board was found, then at finer ones while the edges look sharper than [`SHARP_PX`];
//! corners of few pixels take their blur from the others; at the last level, fit once more with the edges bent.
//!
//! The bend of an edge comes from three corners in a row (at the rim from the next three): with the steps L_1, L_2 and
//! the middle corner off the chord by s, the curve through them has the curvature 2 s / (L_1 L_2). Perspective bends nothing,
//! so this is the lens alone. A bend of curvature k within a window of radius r pulls a straight fit by about k r^2 / 8.
//!
//! Degenerate: squares of a few pixels are measured at the finest level only; a corner that cannot be fitted there
//! makes the board unmeasurable.

use super::plane::{Plane, from_finest, to_finest};
use super::refine::{Fit, Freedom, Shape, Window, fit};
use super::star::{Star, turn};
use crate::board::{BoardSize, FoundBoard, NotFound};

/// Edge blur above which a finer level shows nothing more, pixels.
const SHARP_PX: f64 = 1.2;
/// Half the narrow way across the smallest window a corner is fitted in, pixels of its level.
const LEAST_WINDOW_PX: f64 = 2.0;
/// Share of the contrast seen around a corner that its fit must find.
const CONTRAST_SHARE: f64 = 0.4;
/// Pixels below which blur and ground are not fitted corner by corner: eight a parameter.
const FEW_PIXELS: usize = 80;
/// Blur of the edges before it is known, pixels of the level.
const USUAL_BLUR_PX: f64 = 0.8;

/// Corners as far as they are known, in pixels of the finest level.
struct Measured {
    positions: Vec<[f64; 2]>,
    directions: Vec<[f64; 2]>,
    sigmas_px: Vec<f64>,
    blur_px: f64,
}

/// Measures the corners found at the last of `levels`, given in board order.
pub(super) fn measured(
    levels: &[Plane],
    corners: &[Star],
    size: BoardSize,
) -> Result<FoundBoard, NotFound> {
    let found_at = levels.len() as u32 - 1;
    let mut state = Measured {
        positions: corners
            .iter()
            .map(|corner| to_finest(corner.position, found_at))
            .collect(),
        directions: corners.iter().map(lines).collect(),
        sigmas_px: Vec::new(),
        blur_px: USUAL_BLUR_PX * f64::from(1_u32 << found_at),
    };
    let straight = vec![[0.0; 2]; corners.len()];
    let mut last = None;
    for level in (0..=found_at).rev() {
        let factor = f64::from(1_u32 << level);
        let Some(windows) = windows(&state.positions, size, factor) else {
            break;
        };
        let narrow = |window: &Window| window.narrowest() < LEAST_WINDOW_PX;
        if level > 0 && windows.iter().any(narrow) {
            // Squares too small to be measured here; the next level has twice the pixels.
            continue;
        }
        match state.refined(&levels[level as usize], level, corners, &windows, &straight) {
            Ok(next) => state = next,
            // The coarser level stands, when there is one.
            Err(_) if last.is_some() => break,
            Err(failed) => return Err(NotFound::Unmeasurable { corners: failed }),
        }
        last = Some((level, windows));
        if state.blur_px > SHARP_PX * factor {
            break;
        }
    }
    let Some((level, windows)) = last else {
        return Err(NotFound::Unmeasurable {
            corners: corners.len(),
        });
    };
    let bends = bends(&state, size);
    if let Ok(bent) = state.refined(&levels[level as usize], level, corners, &windows, &bends) {
        state = bent;
    }
    Ok(FoundBoard {
        corners: state.positions,
        sigmas_px: state.sigmas_px,
        blur_px: state.blur_px,
        level: found_at,
    })
}

/// Directions of the two lines through a corner: edges 0 and 2 are one, 1 and 3 the other.
fn lines(corner: &Star) -> [f64; 2] {
    [0, 1].map(|line| {
        let ahead = corner.rays[line];
        let back = corner.rays[line + 2] - std::f64::consts::PI;
        ahead + 0.5 * turn(back - ahead)
    })
}

impl Measured {
    /// Fits every corner at a level; an error carries the number of corners that cannot be fitted. `bends` are in
    /// 1 / pixels of the finest level.
    fn refined(
        &self,
        plane: &Plane,
        level: u32,
        corners: &[Star],
        windows: &[Window],
        bends: &[[f64; 2]],
    ) -> Result<Measured, usize> {
        let factor = f64::from(1_u32 << level);
        let one = |k: usize, blur: f64, freedom: Freedom| {
            let shape = Shape {
                position: from_finest(self.positions[k], level),
                directions: self.directions[k],
                bends: bends[k].map(|bend| bend * factor),
                width: blur,
            };
            fit(plane, &shape, &windows[k], freedom)
                .filter(|fit| fit.contrast >= CONTRAST_SHARE * corners[k].contrast)
        };
        let before = self.blur_px / factor;
        let free: Vec<Option<Fit>> = (0..corners.len())
            .map(|k| one(k, before, Freedom::Full))
            .collect();
        let found = free.iter().flatten();
        let usual = median(found.flat_map(|fit| fit.widths).collect()).unwrap_or(before);
        let fits: Vec<Option<Fit>> = free
            .into_iter()
            .enumerate()
            .map(|(k, found)| match found {
                Some(found) if found.pixels >= FEW_PIXELS => Some(found),
                _ => one(k, usual, Freedom::Stiff),
            })
            .collect();
        let failed = fits.iter().filter(|fit| fit.is_none()).count();
        if failed > 0 {
            return Err(failed);
        }
        let fits: Vec<Fit> = fits.into_iter().flatten().collect();
        Ok(Measured {
            positions: fits
                .iter()
                .map(|fit| to_finest(fit.position, level))
                .collect(),
            directions: fits.iter().map(|fit| fit.directions).collect(),
            sigmas_px: fits.iter().map(|fit| factor * fit.sigma_px).collect(),
            blur_px: factor * usual,
        })
    }
}

/// Curvature of the two lines through every corner, towards the normal (-sin, cos) of their directions; 1 / pixels.
fn bends(state: &Measured, size: BoardSize) -> Vec<[f64; 2]> {
    let (columns, rows) = (size.columns, size.rows);
    (0..state.positions.len())
        .map(|k| {
            let (column, row) = (k % columns, k / columns);
            // The middle of the three corners, moved in from the rim.
            let along_row = row * columns + column.clamp(1, columns - 2);
            let along_column = row.clamp(1, rows - 2) * columns + column;
            let trios = [
                [along_row - 1, along_row, along_row + 1],
                [along_column - columns, along_column, along_column + columns],
            ]
            .map(|trio| trio.map(|corner| state.positions[corner]));
            state.directions[k].map(|direction| {
                let (sin, cos) = direction.sin_cos();
                let along = |trio: &[[f64; 2]; 3]| {
                    let (dx, dy) = (trio[2][0] - trio[0][0], trio[2][1] - trio[0][1]);
                    (cos * dx + sin * dy).abs() / dx.hypot(dy)
                };
                let trio = if along(&trios[0]) >= along(&trios[1]) {
                    &trios[0]
                } else {
                    &trios[1]
                };
                curvature(trio, [-sin, cos])
            })
        })
        .collect()
}

/// Curvature of the curve through three points towards `normal`.
fn curvature(trio: &[[f64; 2]; 3], normal: [f64; 2]) -> f64 {
    let length =
        |from: usize, to: usize| (trio[to][0] - trio[from][0]).hypot(trio[to][1] - trio[from][1]);
    let (first, second) = (length(0, 1), length(1, 2));
    let share = first / (first + second);
    let chord = [0, 1].map(|axis| trio[0][axis] + share * (trio[2][axis] - trio[0][axis]));
    let off = normal[0] * (chord[0] - trio[1][0]) + normal[1] * (chord[1] - trio[1][1]);
    let bend = 2.0 * off / (first * second);
    if bend.is_finite() { bend } else { 0.0 }
}

/// Window each corner is fitted in, at a level `factor` times smaller; `None` when its squares have no area.
fn windows(positions: &[[f64; 2]], size: BoardSize, factor: f64) -> Option<Vec<Window>> {
    let side = |k: usize, place: usize, count: usize, stride: usize| {
        let (before, after) = (place > 0, place + 1 < count);
        let (from, to) = (
            if before { k - stride } else { k },
            if after { k + stride } else { k },
        );
        let steps = if before && after { 2.0 } else { 1.0 };
        [0, 1].map(|axis| (positions[to][axis] - positions[from][axis]) / (steps * factor))
    };
    (0..positions.len())
        .map(|k| {
            let (column, row) = (k % size.columns, k / size.columns);
            Window::new(
                side(k, column, size.columns, 1),
                side(k, row, size.rows, size.columns),
            )
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_points_of_a_circle_give_its_curvature() {
        let radius: f64 = 400.0;
        let point = |angle: f64| [radius * angle.sin(), radius - radius * angle.cos()];
        let trio = [point(-0.05), point(0.0), point(0.06)];
        // The circle's centre is towards +y.
        assert!((curvature(&trio, [0.0, 1.0]) - 1.0 / radius).abs() < 1e-5);
        assert!((curvature(&trio, [0.0, -1.0]) + 1.0 / radius).abs() < 1e-5);
    }
}
