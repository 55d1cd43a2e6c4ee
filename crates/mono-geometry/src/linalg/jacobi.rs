//! Singular value decomposition of small matrices by one-sided Jacobi rotations.
//!
//! Problem: A = U diag(s) V^T for a matrix of n columns, n up to a few hundred, with small singular values that can be
//! trusted and a result that depends on neither the machine nor the number of threads.
//!
//! Steps:
//! 1. Householder QR with column pivoting, A P = Q R: the rows of R fall in size, and R^T is close to orthogonal columns;
//! 2. plane rotations from the right make the columns of X = R^T orthogonal, X W = Y diag(s); a pair is done when its
//!    cosine is rounding, sqrt(n) eps, *relative to the lengths of the two columns*, so a tiny column is as orthogonal to
//!    a long one as two long ones are to each other. Each sweep takes the longest column that is left first (de Rijk);
//! 3. s are the lengths of the columns, V = P Y, U = Q W.
//!
//! Accuracy: for X = B D with a diagonal D, the relative error of every singular value is that of rounding times the
//! condition of B, not of X (Demmel and Veselić 1992); the pivoting of step 1 makes B well conditioned. The error of
//! A - U S V^T is a few eps of the largest singular value.
//!
//! Degenerate: a column shorter than 1e-140 of the largest entry is an exact zero; its singular vector is completed to an
//! orthonormal basis. Not for large matrices: O(n^3) a sweep, usually 3 to 6 sweeps.
//!
//! Sources: Demmel and Veselić, Jacobi's method is more accurate than QR (1992); de Rijk, A one-sided Jacobi algorithm
//! for computing the singular value decomposition on a vector computer (1989); Drmač and Veselić, New fast and accurate
//! Jacobi SVD algorithm (2008), for the preconditioning by R^T.

use nalgebra::{DMatrix, DVector};

/// A column this short has a square that is no longer a normal number times its neighbours'.
const ZERO_COLUMN: f64 = 1e-140;

/// Convergence is quadratic in the end: more sweeps than this are never needed for finite numbers.
const MAX_SWEEPS: usize = 40;

/// (U, s, V) of a matrix with at least as many rows as columns, entries of about unit size, s descending.
///
/// `None` if the rotations do not settle, which only numbers that are not finite can cause. O(m n^2 + n^3 a sweep).
pub(super) fn thin_svd(tall: DMatrix<f64>) -> Option<(DMatrix<f64>, DVector<f64>, DMatrix<f64>)> {
    let size = tall.ncols();
    let (q, r, permutation) = tall.col_piv_qr().unpack();
    let mut columns = r.transpose();
    let mut rotations = DMatrix::identity(size, size);
    orthogonalise(&mut columns, &mut rotations)?;

    let lengths: Vec<f64> = (0..size).map(|k| columns.column(k).norm()).collect();
    let mut order: Vec<usize> = (0..size).collect();
    order.sort_by(|a, b| lengths[*b].total_cmp(&lengths[*a]));
    let singular_values = DVector::from_fn(size, |k, _| lengths[order[k]]);
    let mut v = DMatrix::zeros(size, size);
    let mut u = DMatrix::zeros(q.nrows(), size);
    let mut kept = size;
    for (k, &from) in order.iter().enumerate() {
        if lengths[from] > ZERO_COLUMN {
            v.set_column(k, &(columns.column(from) / lengths[from]));
        } else {
            kept = kept.min(k);
        }
        // Column by column: a blocked product would sum in an order that depends on the machine.
        let mut product = u.column_mut(k);
        for j in 0..size {
            product.axpy(rotations[(j, from)], &q.column(j), 1.0);
        }
    }
    complete(&mut v, kept);
    permutation.inv_permute_rows(&mut v);
    Some((u, singular_values, v))
}

/// Rotates the columns of a square matrix until they are orthogonal, and `rotations` with them.
fn orthogonalise(columns: &mut DMatrix<f64>, rotations: &mut DMatrix<f64>) -> Option<()> {
    let size = columns.ncols();
    let tolerance = (size as f64).sqrt() * f64::EPSILON;
    let x = columns.as_mut_slice();
    let w = rotations.as_mut_slice();
    let mut squares = vec![0.0; size];
    for _ in 0..MAX_SWEEPS {
        for (square, column) in squares.iter_mut().zip(x.chunks_exact(size)) {
            *square = dot(column, column);
        }
        let mut settled = true;
        for i in 0..size {
            let longest = (i + 1..size).fold(
                i,
                |best, j| {
                    if squares[j] > squares[best] { j } else { best }
                },
            );
            if longest != i {
                squares.swap(i, longest);
                for matrix in [&mut *x, &mut *w] {
                    let (a, b) = two_columns(matrix, size, i, longest);
                    a.swap_with_slice(b);
                }
            }
            for j in i + 1..size {
                let smaller = squares[i].min(squares[j]);
                if smaller <= ZERO_COLUMN * ZERO_COLUMN {
                    continue;
                }
                let (a, b) = two_columns(x, size, i, j);
                let cosine = dot(a, b);
                if cosine.abs() <= tolerance * (squares[i].sqrt() * squares[j].sqrt()) {
                    continue;
                }
                settled = false;
                let zeta = (squares[j] - squares[i]) / (2.0 * cosine);
                let tangent = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let c = 1.0 / (1.0 + tangent * tangent).sqrt();
                let s = c * tangent;
                rotate(a, b, c, s);
                squares[i] = dot(a, a);
                squares[j] = dot(b, b);
                let (a, b) = two_columns(w, size, i, j);
                rotate(a, b, c, s);
            }
        }
        if settled {
            return Some(());
        }
    }
    None
}

/// Columns i < j of a column-major matrix.
fn two_columns(matrix: &mut [f64], rows: usize, i: usize, j: usize) -> (&mut [f64], &mut [f64]) {
    let (head, tail) = matrix.split_at_mut(j * rows);
    (&mut head[i * rows..][..rows], &mut tail[..rows])
}

fn rotate(a: &mut [f64], b: &mut [f64], c: f64, s: f64) {
    for (x, y) in a.iter_mut().zip(b) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

/// Scalar product in four running sums, an order that does not depend on the machine.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (x, y) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Fills the columns of a square matrix from `kept` on so that all are orthonormal, if the first ones are.
fn complete(basis: &mut DMatrix<f64>, kept: usize) {
    let size = basis.nrows();
    for k in kept..size {
        // The axis that the columns so far cover least leaves the longest remainder, at least sqrt(1 - k / n).
        let covered = |i: usize| basis.row(i).columns(0, k).norm_squared();
        let axis = (0..size)
            .min_by(|a, b| covered(*a).total_cmp(&covered(*b)))
            .unwrap_or(0);
        let mut column = DVector::zeros(size);
        column[axis] = 1.0;
        // Twice: the second time removes what rounding left of the first.
        for _ in 0..2 {
            for j in 0..k {
                let along = basis.column(j).dot(&column);
                column.axpy(-along, &basis.column(j), 1.0);
            }
        }
        basis.set_column(k, &column.normalize());
    }
}
