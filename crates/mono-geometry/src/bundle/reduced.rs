//! The system of the poses alone, and its Cholesky factor: dense where most entries count, by envelope in a long chain.
//!
//! In a chain a pose shares landmarks with its neighbours only, and few poses with those of an old place. The lower triangle is then
//! kept row by row, each row from its first entry that can be non-zero to the diagonal. The factor stays inside this envelope
//! (Jennings 1966; George and Liu 1981, ch. 4), so a chain of n poses with neighbourhoods of b costs n b^2 instead of n^3 / 3, and
//! a loop that closes adds the long rows of the poses that close it: each n b. The order of the poses is not changed: a path that
//! runs through all places again and again has long rows throughout, and is no faster than dense.
//!
//! Small systems, and those whose envelope is most of the triangle, are dense (faer's blocked factorisation).

use nalgebra::DMatrix;

use super::layout::{Layout, Run};
use crate::error::GeometryError;
use crate::linalg::DenseCholesky;

/// Rows from which an envelope is thought of: below, the dense factorisation takes milliseconds.
const LEAST_ROWS: usize = 600;
/// The envelope must be this many times smaller than the triangle: its inner loops are shorter.
const LEAST_SAVING: usize = 3;

/// The lower triangle of a symmetric matrix of D rows a free pose.
#[derive(Debug)]
pub(super) struct Reduced {
    size: usize,
    storage: Storage,
}

#[derive(Debug)]
enum Storage {
    Dense(DMatrix<f64>),
    Envelope(Envelope),
}

/// Its factor.
#[derive(Debug)]
pub(super) enum Factor {
    Dense(DenseCholesky),
    Envelope(Envelope),
}

/// Rows from their first column to the diagonal, one after the other.
#[derive(Debug)]
pub(super) struct Envelope {
    /// First column of each row.
    first: Vec<usize>,
    /// Where the values of each row begin.
    start: Vec<usize>,
    values: Vec<f64>,
}

impl Reduced {
    /// Zeros, stored as the layout suggests.
    pub(super) fn new(layout: &Layout, d: usize) -> Self {
        let size = d * layout.free_poses.len();
        let entries: usize = layout
            .first
            .iter()
            .enumerate()
            .map(|(pose, first)| (pose - first + 1) * d * d)
            .sum();
        let sparse = size >= LEAST_ROWS && entries.saturating_mul(LEAST_SAVING) <= size * size / 2;
        Self::stored(layout, d, sparse)
    }

    /// Zeros, by envelope or dense.
    pub(super) fn stored(layout: &Layout, d: usize, by_envelope: bool) -> Self {
        let size = d * layout.free_poses.len();
        let storage = if by_envelope {
            Storage::Envelope(Envelope::new(
                (0..size).map(|row| layout.first[row / d] * d).collect(),
            ))
        } else {
            Storage::Dense(DMatrix::zeros(size, size))
        };
        Self { size, storage }
    }

    /// Number of rows.
    pub(super) fn size(&self) -> usize {
        self.size
    }

    /// An entry of the lower triangle, `row` >= `column`.
    pub(super) fn get(&self, row: usize, column: usize) -> f64 {
        match &self.storage {
            Storage::Dense(matrix) => matrix[(row, column)],
            Storage::Envelope(envelope) => envelope
                .at(row, column)
                .map_or(0.0, |at| envelope.values[at]),
        }
    }

    /// Adds to an entry of the lower triangle that the layout knows.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        match &mut self.storage {
            Storage::Dense(matrix) => matrix[(row, column)] += value,
            Storage::Envelope(envelope) => {
                if let Some(at) = envelope.at(row, column) {
                    envelope.values[at] += value;
                }
            }
        }
    }

    pub(super) fn clear(&mut self) {
        match &mut self.storage {
            Storage::Dense(matrix) => matrix.fill(0.0),
            Storage::Envelope(envelope) => envelope.values.fill(0.0),
        }
    }

    /// Takes the values of a matrix of the same layout.
    pub(super) fn copy_from(&mut self, other: &Self) {
        match (&mut self.storage, &other.storage) {
            (Storage::Dense(to), Storage::Dense(from)) => to.copy_from(from),
            (Storage::Envelope(to), Storage::Envelope(from)) => {
                to.values.copy_from_slice(&from.values);
            }
            // Not made by the same rule: entry by entry.
            _ => {
                self.clear();
                for row in 0..self.size {
                    for column in 0..=row {
                        self.add(row, column, other.get(row, column));
                    }
                }
            }
        }
    }

    /// Subtracts Z Z^T of one landmark, Z by its columns, the rows of Z those of its runs.
    pub(super) fn subtract(&mut self, runs: &[Run], z: &[Vec<f64>; 3], d: usize) {
        let [z0, z1, z2] = z;
        match &mut self.storage {
            Storage::Dense(matrix) => {
                let size = self.size;
                let entries = matrix.as_mut_slice();
                for (r, run) in runs.iter().enumerate() {
                    for a in 0..run.length * d {
                        let row = run.local * d + a;
                        let column = &mut entries[(run.free_pose * d + a) * size..][..size];
                        let factors = [z0[row], z1[row], z2[row]];
                        // On and below the diagonal of the first run, all rows of the later ones.
                        subtract(
                            &mut column[run.free_pose * d + a..(run.free_pose + run.length) * d],
                            [&z0[row..], &z1[row..], &z2[row..]],
                            factors,
                        );
                        for below in &runs[r + 1..] {
                            let first = below.local * d;
                            subtract(
                                &mut column
                                    [below.free_pose * d..(below.free_pose + below.length) * d],
                                [&z0[first..], &z1[first..], &z2[first..]],
                                factors,
                            );
                        }
                    }
                }
            }
            Storage::Envelope(envelope) => {
                for (r, run) in runs.iter().enumerate() {
                    for a in 0..run.length * d {
                        let row = run.local * d + a;
                        let factors = [z0[row], z1[row], z2[row]];
                        let values = envelope.row_mut(run.free_pose * d + a);
                        // The same entries by rows: all columns of the runs before, up to the diagonal of this one.
                        let (first, values) = values;
                        for before in &runs[..r] {
                            let at = before.free_pose * d - first;
                            let local = before.local * d;
                            subtract(
                                &mut values[at..at + before.length * d],
                                [&z0[local..], &z1[local..], &z2[local..]],
                                factors,
                            );
                        }
                        let at = run.free_pose * d - first;
                        let local = run.local * d;
                        subtract(
                            &mut values[at..=at + a],
                            [&z0[local..], &z1[local..], &z2[local..]],
                            factors,
                        );
                    }
                }
            }
        }
    }

    /// Factorises; the buffer goes into the factor and comes back by [`Factor::into_reduced`].
    ///
    /// # Errors
    /// [`GeometryError::NotPositiveDefinite`] with the first pivot that is not above its floor, or not finite; the matrix is then
    /// to be filled anew.
    pub(super) fn factorise(&mut self, pivot_floor: &[f64]) -> Result<Factor, GeometryError> {
        let empty = Storage::Dense(DMatrix::zeros(0, 0));
        match std::mem::replace(&mut self.storage, empty) {
            Storage::Dense(matrix) => match DenseCholesky::new(matrix, pivot_floor) {
                Ok(factor) => Ok(Factor::Dense(factor)),
                Err(error) => {
                    self.storage = Storage::Dense(DMatrix::zeros(self.size, self.size));
                    Err(error)
                }
            },
            Storage::Envelope(mut envelope) => match envelope.factorise(pivot_floor) {
                Ok(()) => Ok(Factor::Envelope(envelope)),
                Err(error) => {
                    self.storage = Storage::Envelope(envelope);
                    Err(error)
                }
            },
        }
    }

    /// Takes the buffer of a factor back.
    pub(super) fn reuse(&mut self, factor: Factor) {
        self.storage = match factor {
            Factor::Dense(factor) => Storage::Dense(factor.into_buffer()),
            Factor::Envelope(envelope) => Storage::Envelope(envelope),
        };
    }
}

impl Factor {
    /// Overwrites each column of `right` by the solution. O(entries of the factor) a column.
    ///
    /// # Errors
    /// [`GeometryError::Shape`] if the length is not a multiple of the number of rows.
    pub(super) fn solve_in_place(&self, right: &mut [f64]) -> Result<(), GeometryError> {
        match self {
            Self::Dense(factor) => factor.solve_in_place(right),
            Self::Envelope(envelope) => envelope.solve_in_place(right),
        }
    }
}

impl Envelope {
    fn new(first: Vec<usize>) -> Self {
        let mut start = Vec::with_capacity(first.len());
        let mut length = 0;
        for (row, first) in first.iter().enumerate() {
            start.push(length);
            length += row - first + 1;
        }
        Self {
            first,
            start,
            values: vec![0.0; length],
        }
    }

    fn at(&self, row: usize, column: usize) -> Option<usize> {
        let from_first = column.checked_sub(self.first[row])?;
        Some(self.start[row] + from_first)
    }

    /// The first column of a row, and its values.
    fn row_mut(&mut self, row: usize) -> (usize, &mut [f64]) {
        let first = self.first[row];
        let values = &mut self.values[self.start[row]..][..row - first + 1];
        (first, values)
    }

    /// L in the place of the matrix, row by row.
    fn factorise(&mut self, pivot_floor: &[f64]) -> Result<(), GeometryError> {
        for row in 0..self.first.len() {
            let first = self.first[row];
            let (done, rest) = self.values.split_at_mut(self.start[row]);
            let values = &mut rest[..row - first + 1];
            for column in first..row {
                let (other_first, other_start) = (self.first[column], self.start[column]);
                let from = first.max(other_first);
                let other = &done[other_start..][..column - other_first + 1];
                let dot = dot(
                    &values[from - first..column - first],
                    &other[from - other_first..column - other_first],
                );
                values[column - first] =
                    (values[column - first] - dot) / other[column - other_first];
            }
            let before = &values[..row - first];
            let pivot = values[row - first] - dot(before, before);
            if !(pivot > 0.0 && pivot > pivot_floor[row] && pivot.is_finite()) {
                return Err(GeometryError::NotPositiveDefinite {
                    pivot: row,
                    value: pivot,
                    required: pivot_floor[row],
                });
            }
            values[row - first] = pivot.sqrt();
        }
        Ok(())
    }

    fn solve_in_place(&self, right: &mut [f64]) -> Result<(), GeometryError> {
        let rows = self.first.len();
        if rows == 0 || !right.len().is_multiple_of(rows) {
            return Err(GeometryError::Shape {
                rows,
                columns: right.len(),
                required: "right-hand sides of as many entries as the matrix has rows",
            });
        }
        let row_of = |row: usize| &self.values[self.start[row]..][..row - self.first[row] + 1];
        for x in right.chunks_exact_mut(rows) {
            for row in 0..rows {
                let first = self.first[row];
                let values = row_of(row);
                let sum = dot(&values[..row - first], &x[first..row]);
                x[row] = (x[row] - sum) / values[row - first];
            }
            for row in (0..rows).rev() {
                let first = self.first[row];
                let values = row_of(row);
                x[row] /= values[row - first];
                let solved = x[row];
                for (x, value) in x[first..row].iter_mut().zip(values) {
                    *x -= value * solved;
                }
            }
        }
        Ok(())
    }
}

/// target -= z0 f0 + z1 f1 + z2 f2.
#[inline]
fn subtract(target: &mut [f64], z: [&[f64]; 3], factors: [f64; 3]) {
    let length = target.len();
    let (z0, z1, z2) = (&z[0][..length], &z[1][..length], &z[2][..length]);
    for i in 0..length {
        target[i] -= z0[i] * factors[0] + z1[i] * factors[1] + z2[i] * factors[2];
    }
}

/// The scalar product, in eight sums that the compiler keeps in vectors.
#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A positive definite matrix of a band with a few long rows: products of the rows of an envelope.
    fn matrix(first: &[usize]) -> (Envelope, DMatrix<f64>) {
        let size = first.len();
        let mut lower = DMatrix::zeros(size, size);
        for row in 0..size {
            for column in first[row]..row {
                lower[(row, column)] = ((row * 7 + column * 3) as f64 * 0.9).sin();
            }
            lower[(row, row)] = 2.0 + (row as f64).cos();
        }
        let dense = &lower * lower.transpose();
        let mut envelope = Envelope::new(first.to_vec());
        for row in 0..size {
            for column in first[row]..=row {
                let at = envelope.at(row, column).expect("inside");
                envelope.values[at] = dense[(row, column)];
            }
        }
        (envelope, dense)
    }

    #[test]
    fn the_envelope_solves_what_the_dense_factor_solves() {
        for size in [1, 2, 9, 40, 130] {
            let first: Vec<usize> = (0..size)
                .map(|row| {
                    if row % 31 == 30 {
                        row / 9
                    } else {
                        row - row.min(row % 11)
                    }
                })
                .collect();
            let (mut envelope, dense) = matrix(&first);
            envelope.factorise(&vec![0.0; size]).expect("definite");
            let truth = DMatrix::from_fn(size, 2, |i, j| (i as f64 - 3.0 * j as f64).cos());
            let mut right = &dense * &truth;
            envelope.solve_in_place(right.as_mut_slice()).expect("fits");
            assert!((right - truth).amax() < 1e-9, "{size}");
        }
    }

    #[test]
    fn the_first_pivot_that_is_lost_is_named_in_both() {
        let first = [0, 0, 1, 2];
        let (mut envelope, mut dense) = matrix(&first);
        let at = envelope.at(2, 2).expect("the diagonal");
        envelope.values[at] = -1.0;
        dense[(2, 2)] = -1.0;
        let pivot_of = |error: GeometryError| match error {
            GeometryError::NotPositiveDefinite { pivot, .. } => pivot,
            other => panic!("{other}"),
        };
        let by_envelope = envelope.factorise(&[0.0; 4]).expect_err("indefinite");
        let by_dense = DenseCholesky::new(dense, &[0.0; 4]).expect_err("indefinite");
        assert_eq!((pivot_of(by_envelope), pivot_of(by_dense)), (2, 2));
    }
}
