//! From a saddle to a corner: the four edges that leave it, and which of the squares are bright.
//!
//! Problem: saddles occur in any texture. A corner of a checkerboard shows, on a circle around it, four arcs that are in
//! turn bright and dark, the opposite ones alike; the four changes are the directions of its edges. This is the ring of
//! the ChESS detector (Bennett and Lasenby, CVIU 118, 2014), read here for directions instead of summed.
//!
//! Steps: [`SAMPLES`] bilinear samples on a circle; middle level between the brightest and the darkest eighth; signs of
//! the samples that are clearly off the middle; exactly four changes; each change interpolated to an angle;
//! opposite edges within [`STRAIGHT_TOLERANCE`] of a straight line; opposite samples alike.
//!
//! Angles grow from x (right) towards y (down). Degenerate: corners of less than about 25 degrees (boards seen at more
//! than 75 degrees from their normal) merge two arcs on the small circle and are refused.

use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

use super::plane::Plane;

/// Samples on the circle.
const SAMPLES: usize = 32;
/// Circles tried in turn, pixels: the larger one for acute corners, the smaller one for small squares.
const RADII: [f64; 3] = [4.0, 6.0, 3.0];
/// Smallest difference of bright and dark, grey levels.
const CONTRAST_FLOOR: f64 = 8.0;
/// Samples within this share of the contrast around the middle take no side.
const UNDECIDED_SHARE: f64 = 0.12;
/// Opposite edges of a corner lie on one line but for perspective and lens within so small a circle.
const STRAIGHT_TOLERANCE: f64 = 40.0 * PI / 180.0;
/// Mean difference of opposite samples, as a share of the contrast.
const ASYMMETRY: f64 = 0.3;

/// Sine and cosine of every sample's direction.
static DIRECTIONS: LazyLock<[(f64, f64); SAMPLES]> =
    LazyLock::new(|| std::array::from_fn(|k| (TAU * k as f64 / SAMPLES as f64).sin_cos()));

/// A place with four edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Star {
    /// Pixels of the level it was found at.
    pub(super) position: [f64; 2],
    /// Directions of the edges, radians in [0, 2 pi), ascending.
    pub(super) rays: [f64; 4],
    /// Whether the square between the first and the second edge is bright.
    bright_first: bool,
    /// Bright minus dark, grey levels.
    pub(super) contrast: f64,
}

impl Star {
    /// Whether the square that follows edge `ray` in the sense of growing angles is bright.
    pub(super) fn bright_after(&self, ray: usize) -> bool {
        self.bright_first == ray.is_multiple_of(2)
    }

    /// The edge nearest to direction `angle`, and how far off it is.
    pub(super) fn nearest_ray(&self, angle: f64) -> (usize, f64) {
        let mut best = (0, f64::INFINITY);
        for (ray, &direction) in self.rays.iter().enumerate() {
            let off = turn(direction - angle).abs();
            if off < best.1 {
                best = (ray, off);
            }
        }
        best
    }

    /// Half the angle to the nearer neighbour of edge `ray`: beyond it another edge is meant.
    pub(super) fn half_gap(&self, ray: usize) -> f64 {
        let gap = |to: usize| turn(self.rays[to % 4] - self.rays[ray]).abs();
        0.5 * gap(ray + 1).min(gap(ray + 3))
    }
}

/// An angle in [-pi, pi].
pub(super) fn turn(angle: f64) -> f64 {
    // Sums of a few angles: a remainder would cost more than the rest of the ring.
    angle - TAU * (angle / TAU).round()
}

/// The star at a place of the blurred plane, if there is one.
pub(super) fn star(blurred: &Plane, position: [f64; 2]) -> Option<Star> {
    RADII
        .iter()
        .find_map(|&radius| star_at(blurred, position, radius))
}

fn star_at(blurred: &Plane, position: [f64; 2], radius: f64) -> Option<Star> {
    let mut ring = [0.0_f64; SAMPLES];
    for (value, &(sin, cos)) in ring.iter_mut().zip(DIRECTIONS.iter()) {
        *value = f64::from(blurred.sample(position[0] + radius * cos, position[1] + radius * sin)?);
    }
    let mut sorted = ring;
    sorted.sort_by(f64::total_cmp);
    let eighth = SAMPLES / 8;
    let dark = sorted[..eighth].iter().sum::<f64>() / eighth as f64;
    let bright = sorted[SAMPLES - eighth..].iter().sum::<f64>() / eighth as f64;
    let contrast = bright - dark;
    if contrast < CONTRAST_FLOOR {
        return None;
    }
    let half = SAMPLES / 2;
    let asymmetry: f64 = (0..half)
        .map(|k| (ring[k] - ring[k + half]).abs())
        .sum::<f64>()
        / half as f64;
    if asymmetry > ASYMMETRY * contrast {
        return None;
    }
    let middle = 0.5 * (dark + bright);
    let offsets = ring.map(|value| value - middle);
    let changes = changes(&offsets, UNDECIDED_SHARE * contrast)?;
    let rays = changes.map(|change| change.angle);
    let straight =
        |a: usize, b: usize| (turn(rays[b] - rays[a]).abs() - PI).abs() <= STRAIGHT_TOLERANCE;
    (straight(0, 2) && straight(1, 3)).then(|| Star {
        position,
        rays,
        bright_first: changes[0].to_bright,
        contrast,
    })
}

#[derive(Clone, Copy)]
struct Change {
    angle: f64,
    to_bright: bool,
}

/// The four changes of side around the ring in order of their angles; `None` when there are not exactly four.
fn changes(offsets: &[f64; SAMPLES], undecided: f64) -> Option<[Change; 4]> {
    let decided: Vec<usize> = (0..SAMPLES)
        .filter(|&k| offsets[k].abs() > undecided)
        .collect();
    let mut found = Vec::with_capacity(4);
    for (index, &from) in decided.iter().enumerate() {
        let to = decided[(index + 1) % decided.len()];
        if (offsets[from] > 0.0) == (offsets[to] > 0.0) {
            continue;
        }
        if found.len() == 4 {
            return None;
        }
        // Undecided samples between the two: a straight line from one to the other is close enough.
        let steps = (to + SAMPLES - from) % SAMPLES;
        let share = offsets[from] / (offsets[from] - offsets[to]);
        let place = from as f64 + share * steps as f64;
        found.push(Change {
            angle: (TAU * place / SAMPLES as f64).rem_euclid(TAU),
            to_bright: offsets[to] > 0.0,
        });
    }
    found.sort_by(|a, b| a.angle.total_cmp(&b.angle));
    found.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two edges through (15.5, 15.2) in the directions given, degrees.
    fn corner(first: f64, second: f64) -> Plane {
        let side = |angle: f64, x: f64, y: f64| {
            let (sin, cos) = angle.to_radians().sin_cos();
            (1.5 * (cos * y - sin * x)).tanh()
        };
        let values = (0..32 * 32)
            .map(|k| {
                let (x, y) = (f64::from(k % 32) - 15.5, f64::from(k / 32) - 15.2);
                (120.0 - 60.0 * side(first, x, y) * side(second, x, y)) as f32
            })
            .collect();
        Plane {
            width: 32,
            height: 32,
            values,
        }
    }

    #[test]
    fn directions_and_sides_are_read() {
        for (first, second) in [(10.0, 100.0), (20.0, 70.0), (30.0, 140.0)] {
            let plane = corner(first, second);
            let star = star(&plane, [15.5, 15.2]).unwrap();
            for (ray, expected) in [first, second, first + 180.0, second + 180.0]
                .iter()
                .enumerate()
            {
                let off = turn(star.rays[ray] - expected.to_radians()).abs();
                assert!(off < 0.12, "{first} {second}: ray {ray} is {off} rad off");
            }
            // Between the edges the product of the sides is negative, and the value above the middle.
            assert!(star.bright_after(0) && !star.bright_after(1) && star.bright_after(2));
            assert_eq!(star.nearest_ray(first.to_radians() + 0.1).0, 0);
            assert!(
                (star.half_gap(0).to_degrees()
                    - 0.5 * (second - first).min(180.0 - second + first))
                .abs()
                    < 6.0
            );
        }
    }

    #[test]
    fn an_edge_a_junction_and_a_flat_place_are_no_stars() {
        let flat = Plane {
            width: 32,
            height: 32,
            values: vec![90.0; 1024],
        };
        assert!(star(&flat, [15.0, 15.0]).is_none());
        let mut edge = corner(10.0, 100.0);
        for (k, value) in edge.values.iter_mut().enumerate() {
            *value = if k % 32 < 16 { 30.0 } else { 200.0 };
        }
        assert!(star(&edge, [15.5, 15.0]).is_none());
        let mut junction = edge.clone();
        for (k, value) in junction.values.iter_mut().enumerate() {
            if k % 32 >= 16 && k / 32 >= 16 {
                *value = 30.0;
            }
        }
        assert!(star(&junction, [15.5, 15.5]).is_none());
        assert!(star(&flat, [1.0, 1.0]).is_none());
    }
}
