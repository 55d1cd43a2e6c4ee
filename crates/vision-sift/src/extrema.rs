//! Local extrema of the difference of Gaussians (Lowe, section 3.1).
//!
//! A sample of `D` is a candidate when it is larger than its 26 neighbours in position and scale, or smaller than all of
//! them, and its size passes a first contrast threshold.
//!
//! Ties: neighbours that come before in the order (level, row, column) must be strictly less, those that come after
//! may be equal. A plateau of equal samples so gives one candidate, not none and not many; a blob centred exactly
//! between two samples is found.
//!
//! Cost: 4 comparisons a sample for almost all samples, 26 for the few that are extreme within their row and column.

use crate::image::Plane;
use crate::params::BORDER;

/// Samples compared side by side.
const LANES: usize = 16;

/// A sample of the current octave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Sample {
    pub(crate) level: usize,
    pub(crate) y: usize,
    pub(crate) x: usize,
}

/// Calls `found` for each candidate of rows `rows` (octave pixels) with `|D| > threshold`, in the order level, row,
/// column. Rows within [`BORDER`] of the edge are skipped.
pub(crate) fn scan(
    differences: &[Plane],
    rows: std::ops::Range<usize>,
    threshold: f32,
    mut found: impl FnMut(Sample),
) {
    let (width, height) = (differences[0].width(), differences[0].height());
    let rows = rows.start.max(BORDER)..rows.end.min(height - BORDER);
    for level in 1..differences.len() - 1 {
        for y in rows.clone() {
            scan_row(&differences[level], y, width, threshold, |x| {
                let sample = Sample { level, y, x };
                if is_extremum(differences, sample) {
                    found(sample);
                }
            });
        }
    }
}

/// Columns of one row where the sample passes the threshold and is extreme among its four neighbours in the plane.
fn scan_row(plane: &Plane, y: usize, width: usize, threshold: f32, mut found: impl FnMut(usize)) {
    let (above, row, below) = (plane.row(y - 1), plane.row(y), plane.row(y + 1));
    let end = width - BORDER;
    let mut x = BORDER;
    while x + LANES <= end {
        let chunk = |values: &'_ [f32], from: usize| -> [f32; LANES] {
            *values[from..]
                .first_chunk()
                .expect("the run ends inside the row")
        };
        let (c, l, r) = (chunk(row, x), chunk(row, x - 1), chunk(row, x + 1));
        let (u, d) = (chunk(above, x), chunk(below, x));
        let mut hits = [0_u32; LANES];
        for i in 0..LANES {
            hits[i] = u32::from(extreme_of_five(c[i], l[i], r[i], u[i], d[i], threshold));
        }
        if hits.iter().fold(0, |a, h| a | h) != 0 {
            for (i, hit) in hits.iter().enumerate() {
                if *hit != 0 {
                    found(x + i);
                }
            }
        }
        x += LANES;
    }
    for x in x..end {
        if extreme_of_five(
            row[x],
            row[x - 1],
            row[x + 1],
            above[x],
            below[x],
            threshold,
        ) {
            found(x);
        }
    }
}

/// Branch-free, so that runs of it become vector code.
#[inline(always)]
fn extreme_of_five(c: f32, l: f32, r: f32, u: f32, d: f32, threshold: f32) -> bool {
    let high = (c > threshold) & (c >= l) & (c >= r) & (c >= u) & (c >= d);
    let low = (c < -threshold) & (c <= l) & (c <= r) & (c <= u) & (c <= d);
    high | low
}

/// The full test against 26 neighbours with the tie rule of the module.
fn is_extremum(differences: &[Plane], sample: Sample) -> bool {
    let value = differences[sample.level].at(sample.x, sample.y);
    // A minimum of D is a maximum of -D.
    let sign = if value > 0.0 { 1.0 } else { -1.0 };
    let value = sign * value;
    let mut before = true;
    for level in sample.level - 1..=sample.level + 1 {
        for y in sample.y - 1..=sample.y + 1 {
            let row = differences[level].row(y);
            for x in sample.x - 1..=sample.x + 1 {
                let neighbour = row[x];
                if (Sample { level, y, x }) == sample {
                    before = false;
                    continue;
                }
                let neighbour = sign * neighbour;
                if neighbour > value || (before && neighbour == value) {
                    return false;
                }
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five flat planes of 40 x 30 with some samples set.
    fn planes(samples: &[(Sample, f32)]) -> Vec<Plane> {
        let mut planes = vec![Plane::default(); 5];
        for plane in &mut planes {
            plane.resize(40, 30);
        }
        for (s, value) in samples {
            planes[s.level].row_mut(s.y)[s.x] = *value;
        }
        planes
    }

    fn found(samples: &[(Sample, f32)]) -> Vec<Sample> {
        let planes = planes(samples);
        let mut found = Vec::new();
        for rows in [0..16, 16..30] {
            scan(&planes, rows, 0.1, |s| found.push(s));
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
