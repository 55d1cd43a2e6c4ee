//! Divides the rows of a cell in two by a small deterministic 2-means (Lloyd 1982).
//!
//! Steps:
//! 1. At most [`SAMPLE`] rows, evenly spaced, are taken to find the centroids.
//! 2. Seeds: the row farthest from the mean, and the row farthest from that one.
//! 3. At most [`ROUNDS`] times: each row goes to the nearer centroid, ties to the first; each centroid becomes the
//!    mean of its rows, rounded to bytes.
//! 4. All rows go to the nearer centroid. Where that leaves less than an eighth on one side, the rows are cut
//!    instead near the middle of their order along the line through the centroids, between unequal neighbours.
//!    A lone outlier would otherwise be split off again and again at the price of the whole cell each time.
//!
//! No randomness, no dependence on anything but the rows and their order. Work: O(SAMPLE * ROUNDS + rows).
//!
//! Degenerate cases: equal rows cannot be divided (`None`). Rows of which more than seven eighths are equal are
//! divided unevenly, since equal rows always stay together.

use std::cmp::Reverse;

use simd_level::SimdLevel;

use crate::descriptor::{DESCRIPTOR_LENGTH, Descriptor};
use crate::row_block::PreparedQuery;
use crate::row_scan;
use crate::rows::Rows;

/// The number of rows from which the centroids are found at most.
const SAMPLE: usize = 256;
/// Rounds of Lloyd's iteration at most.
const ROUNDS: usize = 6;
/// The number of rows whose sum fits 16 bits: 256 * 255 is below 2^16.
const ROWS_OF_SHORTS: u32 = 256;
/// The smaller side gets at least one row in this many, unless too many rows are equal.
const LEAST_SHARE: usize = 8;

/// Two centroids, and the side of each row.
#[derive(Debug)]
pub(crate) struct Division {
    pub(crate) centroids: [Descriptor; 2],
    /// Whether each row belongs to the second centroid, by position.
    pub(crate) on_second: Vec<bool>,
}

/// Divides the rows, whose descriptors are given besides; `None` when all are equal.
pub(crate) fn divide(
    level: SimdLevel,
    rows: &Rows,
    descriptors: &[Descriptor],
) -> Option<Division> {
    let step = rows.len().div_ceil(SAMPLE);
    let mut centroids = seeds(level, rows, descriptors, step)?;
    let thinned = (step > 1).then(|| thin(rows, descriptors, step));
    let (sample, sampled) = match &thinned {
        Some((sample, sampled)) => (sample, sampled.as_slice()),
        None => (rows, descriptors),
    };
    let mut before = Vec::new();
    for _ in 0..ROUNDS {
        let sides = nearer(level, sample, &centroids);
        if sides == before {
            break;
        }
        let Some(means) = means_of_sides(sampled, &sides) else {
            break;
        };
        centroids = means;
        before = sides;
    }
    let mut on_second = nearer(level, rows, &centroids);
    let second = on_second.iter().filter(|&&side| side).count();
    let least = (rows.len() / LEAST_SHARE).max(1);
    if second.min(rows.len() - second) < least {
        on_second = cut_near_the_middle(level, rows, &centroids, least).unwrap_or(on_second);
    }
    Some(Division {
        centroids: means_of_sides(descriptors, &on_second)?,
        on_second,
    })
}

/// Two rows that are different and far apart; `None` when all are equal.
fn seeds(
    level: SimdLevel,
    rows: &Rows,
    descriptors: &[Descriptor],
    step: usize,
) -> Option<[Descriptor; 2]> {
    let mean = mean_of(descriptors.iter().step_by(step.max(1)))?;
    let farthest = |from: &Descriptor| {
        let distances = distances(level, rows, from);
        let position = (0..rows.len()).max_by_key(|&row| (distances[row], Reverse(row)))?;
        Some(descriptors[position])
    };
    let first = farthest(&mean)?;
    let second = farthest(&first)?;
    (first != second).then_some([first, second])
}

/// Every `step`-th row, stored as rows and as descriptors.
fn thin(rows: &Rows, descriptors: &[Descriptor], step: usize) -> (Rows, Vec<Descriptor>) {
    let sampled: Vec<Descriptor> = descriptors.iter().step_by(step).copied().collect();
    let mut sample = Rows::default();
    for (&id, descriptor) in rows.ids().iter().step_by(step).zip(&sampled) {
        sample.push(id, descriptor);
    }
    (sample, sampled)
}

/// The squared distances of all rows, by position.
fn distances(level: SimdLevel, rows: &Rows, from: &Descriptor) -> Vec<u32> {
    let mut distances = Vec::new();
    row_scan::distances(rows, level, &PreparedQuery::new(from), &mut distances);
    distances
}

/// Whether each row is nearer to the second centroid.
fn nearer(level: SimdLevel, rows: &Rows, [first, second]: &[Descriptor; 2]) -> Vec<bool> {
    let to_first = distances(level, rows, first);
    let to_second = distances(level, rows, second);
    to_first
        .iter()
        .zip(&to_second)
        .map(|(first, second)| second < first)
        .collect()
}

/// The cut nearest the middle of the order along the line through the centroids that leaves `least` rows on each
/// side and equal positions together; `None` when there is none.
fn cut_near_the_middle(
    level: SimdLevel,
    rows: &Rows,
    [first, second]: &[Descriptor; 2],
    least: usize,
) -> Option<Vec<bool>> {
    let to_first = distances(level, rows, first);
    let to_second = distances(level, rows, second);
    let position = |row: usize| i64::from(to_first[row]) - i64::from(to_second[row]);
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_unstable_by_key(|&row| (position(row), row));
    let cut = (least..=rows.len().saturating_sub(least))
        .filter(|&cut| position(order[cut - 1]) < position(order[cut]))
        .min_by_key(|cut| cut.abs_diff(rows.len() / 2))?;
    let mut on_second = vec![false; rows.len()];
    for &row in &order[cut..] {
        on_second[row] = true;
    }
    Some(on_second)
}

fn means_of_sides(descriptors: &[Descriptor], on_second: &[bool]) -> Option<[Descriptor; 2]> {
    let mean_of_side = |wanted: bool| {
        let of_side = descriptors.iter().zip(on_second);
        mean_of(of_side.filter_map(|(descriptor, &side)| (side == wanted).then_some(descriptor)))
    };
    Some([mean_of_side(false)?, mean_of_side(true)?])
}

/// The mean of each component, rounded to the nearest byte; `None` when there is no descriptor.
fn mean_of<'a>(descriptors: impl Iterator<Item = &'a Descriptor>) -> Option<Descriptor> {
    // At most 2^24 rows of 255 fit; a cell is far smaller.
    let mut sums = [0_u32; DESCRIPTOR_LENGTH];
    // The sums of at most ROWS_OF_SHORTS rows in 16 bits: a register holds twice as many of them.
    let mut shorts = [0_u16; DESCRIPTOR_LENGTH];
    let mut count = 0_u32;
    let flush = |sums: &mut [u32; DESCRIPTOR_LENGTH], shorts: &mut [u16; DESCRIPTOR_LENGTH]| {
        for (sum, short) in sums
            .iter_mut()
            .zip(std::mem::replace(shorts, [0; DESCRIPTOR_LENGTH]))
        {
            *sum = sum.wrapping_add(u32::from(short));
        }
    };
    for descriptor in descriptors {
        if count > 0 && count.is_multiple_of(ROWS_OF_SHORTS) {
            flush(&mut sums, &mut shorts);
        }
        count += 1;
        for (short, &byte) in shorts.iter_mut().zip(descriptor) {
            *short = short.wrapping_add(u16::from(byte));
        }
    }
    flush(&mut sums, &mut shorts);
    (count > 0).then(|| sums.map(|sum| ((sum + count / 2) / count) as u8))
}
