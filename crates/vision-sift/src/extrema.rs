//! Local extrema of the difference of Gaussians (Lowe, section 3.1).
//!
//! A sample of `D` is a candidate when it is larger than its 26 neighbours in position and scale, or smaller than all of
//! them, and its size passes a first contrast threshold.
//!
//! Ties: neighbours that come before in the order (level, row, column) must be strictly less, those that come after
//! may be equal. A plateau of equal samples therefore gives exactly one candidate, and a blob centred exactly between two
//! samples is found.
//!
//! The differences of three rows of all levels are kept at a time, and sixteen samples are compared side by side. Most
//! vectors fail the threshold or the eight neighbours in their plane; few are compared with the levels beside.

use simd_level::SimdLevel;

use crate::constants::BORDER;
use crate::points::Sample;
use crate::scale_space::Differences;
use crate::simd::{self, Body, LANES, Lanes, load, prefetch, store};

/// Appends to `found` each candidate of rows `rows` (octave pixels) with `|D| > threshold`, row by row. Rows and columns
/// within [`BORDER`] of the edge are skipped. `scratch` is grown as needed.
pub(crate) fn scan(
    level: SimdLevel,
    differences: Differences<'_>,
    rows: std::ops::Range<usize>,
    threshold: f32,
    scratch: &mut Vec<f32>,
    found: &mut Vec<Sample>,
) {
    let rows = rows.start.max(BORDER)..rows.end.min(differences.height() - BORDER);
    if rows.is_empty() {
        return;
    }
    let needed = differences.levels() * RING * row_length(differences.width());
    if scratch.len() < needed {
        scratch.resize(needed, 0.0);
    }
    simd::run(
        level,
        Scan {
            differences,
            rows,
            threshold,
            scratch: &mut scratch[..needed],
            found,
        },
    );
}

/// The number of rows of differences that are kept of each level.
const RING: usize = 3;

/// The length of a kept row, with one vector before it and one after it so that its neighbours can be read everywhere.
fn row_length(width: usize) -> usize {
    width.next_multiple_of(LANES) + 2 * LANES
}

struct Scan<'a> {
    differences: Differences<'a>,
    rows: std::ops::Range<usize>,
    threshold: f32,
    scratch: &'a mut [f32],
    found: &'a mut Vec<Sample>,
}

impl Body for Scan<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            differences,
            rows,
            threshold,
            scratch,
            found,
        } = self;
        let (width, levels) = (differences.width(), differences.levels());
        let length = row_length(width);
        subtract_row::<L>(differences, rows.start - 1, scratch, length);
        subtract_row::<L>(differences, rows.start, scratch, length);
        for y in rows {
            subtract_row::<L>(differences, y + 1, scratch, length);
            let row =
                |level: usize, y: usize| &scratch[(level * RING + y % RING) * length..][..length];
            for level in 1..levels - 1 {
                let plane = |level: usize| [row(level, y - 1), row(level, y), row(level, y + 1)];
                let (below, here, above) = (plane(level - 1), plane(level), plane(level + 1));
                for x in (0..width).step_by(LANES) {
                    let mut bits = extrema_at::<L>(below, here, above, LANES + x, threshold);
                    while bits != 0 {
                        let column = x + bits.trailing_zeros() as usize;
                        if (BORDER..width - BORDER).contains(&column) {
                            found.push(Sample {
                                level,
                                y,
                                x: column,
                            });
                        }
                        bits &= bits - 1;
                    }
                }
            }
        }
    }
}

/// Writes row `y` of the differences of all levels to its place in the ring.
#[inline(always)]
fn subtract_row<L: Lanes>(
    differences: Differences<'_>,
    y: usize,
    scratch: &mut [f32],
    length: usize,
) {
    let gaussians = differences.0;
    for level in 0..differences.levels() {
        let out = &mut scratch[(level * RING + y % RING) * length + LANES..];
        let (fine, coarse) = (
            gaussians[level].padded_row(y),
            gaussians[level + 1].padded_row(y),
        );
        // The levels lie too far apart for the processor to foresee which rows come next.
        let next = gaussians[level].padded_row((y + 1).min(differences.height() - 1));
        for x in (0..fine.len()).step_by(LANES) {
            prefetch(&next[x..]);
            store(load::<L>(coarse, x).sub(load(fine, x)), out, x);
        }
    }
}

/// Which of the samples at `x..x + LANES` in the middle row of the middle level are extrema, as bits; ties are resolved as
/// the module says.
#[inline(always)]
fn extrema_at<L: Lanes>(
    below: [&[f32]; 3],
    here: [&[f32]; 3],
    above: [&[f32]; 3],
    x: usize,
    threshold: f32,
) -> u16 {
    let value = load::<L>(here[1], x);
    let high = value.greater(L::splat(threshold));
    let low = L::splat(-threshold).greater(value);
    if L::bits(L::or(high, low)) == 0 {
        return 0;
    }
    let (up, down) = (three::<L>(here[0], x), three::<L>(here[2], x));
    let (left, right) = (load::<L>(here[1], x - 1), load::<L>(here[1], x + 1));
    let high = L::and(
        high,
        L::and(
            value.greater(largest(up).max(left)),
            value.greater_or_equal(largest(down).max(right)),
        ),
    );
    let low = L::and(
        low,
        L::and(
            smallest(up).min(left).greater(value),
            smallest(down).min(right).greater_or_equal(value),
        ),
    );
    if L::bits(L::or(high, low)) == 0 {
        return 0;
    }
    let below = nine::<L>(below, x);
    let above = nine::<L>(above, x);
    let high = L::and(
        high,
        L::and(value.greater(below.0), value.greater_or_equal(above.0)),
    );
    let low = L::and(
        low,
        L::and(below.1.greater(value), above.1.greater_or_equal(value)),
    );
    L::bits(L::or(high, low))
}

/// The sample at `x` and its two neighbours in the row.
#[inline(always)]
fn three<L: Lanes>(row: &[f32], x: usize) -> [L; 3] {
    [load(row, x - 1), load(row, x), load(row, x + 1)]
}

#[inline(always)]
fn largest<L: Lanes>([a, b, c]: [L; 3]) -> L {
    a.max(b).max(c)
}

#[inline(always)]
fn smallest<L: Lanes>([a, b, c]: [L; 3]) -> L {
    a.min(b).min(c)
}

/// The largest and the smallest of the nine samples around and at `x`.
#[inline(always)]
fn nine<L: Lanes>([up, middle, down]: [&[f32]; 3], x: usize) -> (L, L) {
    let (up, middle, down) = (
        three::<L>(up, x),
        three::<L>(middle, x),
        three::<L>(down, x),
    );
    (
        largest([largest(up), largest(middle), largest(down)]),
        smallest([smallest(up), smallest(middle), smallest(down)]),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Plane;

    /// Gaussian levels whose differences are five flat planes of 40 x 30 with some samples set.
    fn planes(samples: &[(Sample, f32)]) -> Vec<Plane> {
        let mut planes = vec![Plane::default(); 6];
        for plane in &mut planes {
            plane.resize(40, 30);
        }
        for (s, value) in samples {
            for plane in &mut planes[s.level + 1..] {
                plane.row_mut(s.y)[s.x] += *value;
            }
        }
        planes
    }

    /// The extrema found, in order, after a check that every level finds the same.
    fn found(samples: &[(Sample, f32)]) -> Vec<Sample> {
        let planes = planes(samples);
        let run = |level| {
            let mut found = Vec::new();
            for rows in [0..16, 16..30] {
                scan(
                    level,
                    Differences(&planes),
                    rows,
                    0.1,
                    &mut Vec::new(),
                    &mut found,
                );
            }
            found
        };
        let found = run(SimdLevel::Portable);
        for level in SimdLevel::available() {
            assert_eq!(run(level), found, "{level}");
        }
        found
    }

    fn at(level: usize, y: usize, x: usize) -> Sample {
        Sample { level, y, x }
    }

    #[test]
    fn peaks_and_pits_are_found_wherever_they_are() {
        // In the vector part and in the rest of a row, at both ends of the part searched.
        for x in BORDER..40 - BORDER {
            for (y, level) in [(5, 1), (15, 2), (16, 3), (24, 1)] {
                for value in [0.5, -0.5] {
                    assert_eq!(found(&[(at(level, y, x), value)]), [at(level, y, x)]);
                }
            }
        }
    }

    #[test]
    fn each_of_the_26_neighbours_can_forbid() {
        let centre = at(2, 12, 17);
        for level in 1..4 {
            for y in 11..14 {
                for x in 16..19 {
                    if at(level, y, x) != centre {
                        let hits = found(&[(centre, 0.5), (at(level, y, x), 0.6)]);
                        assert_eq!(hits, [at(level, y, x)]);
                        let hits = found(&[(centre, -0.5), (at(level, y, x), -0.6)]);
                        assert_eq!(hits, [at(level, y, x)]);
                    }
                }
            }
        }
    }

    #[test]
    fn a_plateau_gives_its_first_sample_only() {
        let plateau: Vec<_> = [(2, 12, 17), (2, 12, 18), (2, 13, 17), (3, 12, 17)]
            .map(|(l, y, x)| (at(l, y, x), 0.5))
            .to_vec();
        assert_eq!(found(&plateau), [at(2, 12, 17)]);
    }

    #[test]
    fn border_threshold_and_outer_levels_are_left_out() {
        let none = [
            at(2, 4, 17),
            at(2, 25, 17),
            at(2, 12, 4),
            at(2, 12, 35),
            at(0, 12, 17),
            at(4, 12, 17),
        ];
        for sample in none {
            assert!(found(&[(sample, 0.5)]).is_empty(), "{sample:?}");
        }
        assert!(found(&[(at(2, 12, 17), 0.1)]).is_empty());
    }
}
