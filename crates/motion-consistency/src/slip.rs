//! Wheels that slip: the depth of a point that three frames in a row have seen must come out the same from both pairs.
//!
//! Each of two consecutive pairs gives a depth in the frame that they share, in units of its own baseline, and the odometry
//! says how long that is. Where the second pair's depths are `k` times those of the first, the odometry has driven `k`
//! times as far in the second pair, compared with the first, as the camera has.
//!
//! A camera that looks sideways at a wall hardly tells a step from a turn, so the turns are not taken as claimed: `ln k` is
//! averaged over a grid of both turns, each cell weighted by how well the points agree on one `k` there and by the prior of
//! the turns. The spread of that average says how sure `k` is.

use std::f64::consts::FRAC_PI_2;

use mono_geometry::motion::OdometrySample;
use mono_geometry::{Mount, Pinhole};
use nalgebra::Vector2;

use crate::agreement::CameraMotion;
use crate::finding::Finding;
use crate::pair::{Claim, FramePair, median};

/// Points that three frames must share.
const MIN_SHARED: usize = 20;
/// Points that are looked at.
const MAX_SHARED: usize = 60;
/// Parallax that a point must show in both pairs for its ratio to count, radians.
const MIN_PARALLAX_RAD: f64 = 0.010;
/// Standard deviation of a matched keypoint, radians at the focal length, and pixels.
const MATCH_SIGMA_RAD: f64 = 0.002;
const MATCH_SIGMA_PX: f64 = 1.0;
/// Standard deviation of a claimed turn: radians per root second, and share of the turn.
const TURN_SIGMA_PER_SQRT_S: f64 = 0.02;
const TURN_SIGMA_SHARE: f64 = 0.05;
/// Cells of the grid to either side, and standard deviations from one to the next.
const CELLS: i32 = 4;
const CELL_SIGMAS: f64 = 0.6;
/// Squared deviations count up to this.
const CLIP: f64 = 4.0;
/// Standard deviation that is left of `ln k` however many points agree: robots pitch and roll.
const MIN_LOG_SIGMA: f64 = 0.1;
/// A jump of the scale that is told, and the standard deviations by which it must differ from none.
const MIN_JUMP: f64 = 2.0;
const JUMP_SIGMAS: f64 = 5.0;

/// The surest jump of the scale between two consecutive pairs; `None` where there is none to speak of.
pub(crate) fn slip(
    pairs: &[&FramePair],
    rows: &[OdometrySample],
    camera: &Pinhole,
    mount: &Mount,
) -> Option<Finding> {
    pairs
        .windows(2)
        .filter(|two| {
            two[0].to_s == two[1].from_s && rows.first().is_some_and(|row| row.t_s <= two[0].from_s)
        })
        .filter_map(|two| {
            let (log_jump, sigma) = log_scale_jump(two[0], two[1], rows, camera, mount)?;
            Some((two[1].from_s, log_jump, sigma))
        })
        .filter(|(_, log_jump, sigma)| {
            log_jump.abs() > MIN_JUMP.ln() && log_jump.abs() > JUMP_SIGMAS * sigma
        })
        .max_by(|a, b| (a.1.abs() / a.2).total_cmp(&(b.1.abs() / b.2)))
        .map(|(at_s, log_jump, _)| Finding::WheelSlip {
            at_s,
            jump: log_jump.exp(),
        })
}

/// Mean and standard deviation of `ln k`; `None` where too few points show a parallax.
fn log_scale_jump(
    first: &FramePair,
    second: &FramePair,
    rows: &[OdometrySample],
    camera: &Pinhole,
    mount: &Mount,
) -> Option<(f64, f64)> {
    let points: Vec<[Vector2<f64>; 3]> = first
        .matches
        .iter()
        .filter_map(|[x, shared]| {
            // The same keypoint has the same bits in both pairs.
            let [_, y] = second.matches.iter().find(|[from, _]| from == shared)?;
            Some([x, shared, y].map(|pixel| camera.normalize(pixel)))
        })
        .collect();
    if points.len() < MIN_SHARED {
        return None;
    }
    let every = points.len().div_ceil(MAX_SHARED);
    let points: Vec<_> = points.into_iter().step_by(every).collect();
    let match_sigma = MATCH_SIGMA_RAD.max(MATCH_SIGMA_PX / camera.fx.max(camera.fy));
    let motions = |pair: &FramePair| -> Vec<(f64, CameraMotion)> {
        let claim = Claim::of(rows, pair.from_s, pair.to_s);
        let sigma = TURN_SIGMA_PER_SQRT_S * (pair.to_s - pair.from_s).sqrt()
            + TURN_SIGMA_SHARE * claim.turn_rad.abs();
        (-CELLS..=CELLS)
            .map(|cell| {
                let sigmas = f64::from(cell) * CELL_SIGMAS;
                let turn_rad = claim.turn_rad + sigmas * sigma;
                (
                    sigmas,
                    CameraMotion::of(claim.distance_m, turn_rad, 0.0, mount),
                )
            })
            .collect()
    };
    let (before, after) = (motions(first), motions(second));
    // The points that show a parallax where the turns are as claimed: they are asked in every cell.
    let middle = CELLS as usize;
    let near: Vec<[Vector2<f64>; 3]> = points
        .into_iter()
        .filter(|point| {
            log_ratio(point, &before[middle].1, &after[middle].1, match_sigma).is_some()
        })
        .collect();
    if near.len() < MIN_SHARED {
        return None;
    }
    let mut cells: Vec<Cell> = Vec::new();
    for (sigmas_before, earlier) in &before {
        for (sigmas_after, later) in &after {
            let prior = sigmas_before * sigmas_before + sigmas_after * sigmas_after;
            cells.extend(cell(&near, earlier, later, match_sigma, prior));
        }
    }
    let least = cells.iter().map(|c| c.cost).fold(f64::INFINITY, f64::min);
    let weight = |cell: &Cell| (0.5 * (least - cell.cost)).exp();
    let total: f64 = cells.iter().map(weight).sum();
    let mean = cells.iter().map(|c| weight(c) * c.log_k).sum::<f64>() / total;
    let variance = cells
        .iter()
        .map(|c| weight(c) * ((c.log_k - mean).powi(2) + c.variance))
        .sum::<f64>()
        / total;
    let sigma = variance.sqrt().hypot(MIN_LOG_SIGMA);
    (mean.is_finite() && sigma.is_finite()).then_some((mean, sigma))
}

/// One pair of turns.
struct Cell {
    log_k: f64,
    /// Variance of `log_k` for these turns.
    variance: f64,
    /// Squared deviations of points and turns.
    cost: f64,
}

/// The `ln k` on which most points agree, and how badly they do; points that lost their parallax count as far off.
fn cell(
    points: &[[Vector2<f64>; 3]],
    earlier: &CameraMotion,
    later: &CameraMotion,
    match_sigma: f64,
    prior: f64,
) -> Option<Cell> {
    let ratios: Vec<(f64, f64)> = points
        .iter()
        .filter_map(|point| log_ratio(point, earlier, later, match_sigma))
        .collect();
    let log_k = median(ratios.iter().map(|r| r.0).collect())?;
    let deviations = ratios
        .iter()
        .map(|(l, sigma)| ((l - log_k) / sigma).powi(2));
    let lost = CLIP * (points.len() - ratios.len()) as f64;
    let spread = median(ratios.iter().map(|r| (r.0 - log_k).abs()).collect())?;
    Some(Cell {
        log_k,
        // A median of n points with the middle deviation of 0.67 standard deviations.
        variance: FRAC_PI_2 * (spread / 0.67).powi(2) / ratios.len() as f64,
        cost: deviations.map(|square| square.min(CLIP)).sum::<f64>() + lost + prior,
    })
}

/// `ln k` of one point and its standard deviation; `None` without parallax in both pairs.
fn log_ratio(
    [x, shared, y]: &[Vector2<f64>; 3],
    earlier: &CameraMotion,
    later: &CameraMotion,
    match_sigma: f64,
) -> Option<(f64, f64)> {
    let first = earlier.parallax_rad(x, shared);
    let found = later.parallax_rad(shared, y);
    let predicted = later.parallax_at(shared, earlier.later_inverse_depth(x, first));
    let telling = first > MIN_PARALLAX_RAD && found > MIN_PARALLAX_RAD && predicted > 0.0;
    telling.then(|| {
        let sigma = match_sigma * first.recip().hypot(found.recip());
        ((predicted / found).ln(), sigma)
    })
}
