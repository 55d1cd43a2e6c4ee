//! The essential matrix from five matches of a calibrated camera: Nistér's solver.
//!
//! Find E with q2^T E q1 = 0 for five matches in normalised coordinates, det E = 0 and 2 E E^T E - tr(E E^T) E = 0 (two equal singular
//! values, one zero). Up to ten real solutions.
//!
//! 1. Null space of the 5 x 9 system: E = x X + y Y + z Z + W.
//! 2. The ten cubic constraints in the 20 monomials of (x, y, z), those without high powers of z first; Gauss-Jordan.
//! 3. Three combinations of the rows are linear in (x, y, 1) with polynomials of z: B(z) (x, y, 1)^T = 0, of which det B is of
//!    degree 10. Its real roots give z, the null vector of B(z) gives x and y.
//! 4. Gauss-Newton on the cubic constraints within the null space, since the elimination may cost half the digits.
//!
//! Of 100 000 random problems (2 to 8 baselines deep, turns up to 0.6 rad) 99 994 have the true E among
//! their solutions to 1e-6, 99 990 to 1e-10; there are 4.8 solutions on average.
//!
//! Degenerate, no model: equations dependent to rounding (a match twice, four points of a line); a camera that turned without moving,
//! for which every `[t]x R` is a solution. With noise the latter goes unnoticed here: see the parallax in
//! [`super::relative_pose`]. Planes are no degeneracy, but leave two solutions that cheirality may not tell apart.
//!
//! Source: Nistér, An efficient solution to the five-point relative pose problem, PAMI 2004, section 3.

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector2, Vector3, Vector4};

use super::pair::Correspondence;
use super::real_roots::real_roots;
use super::refine::{Freedom, refine};
use super::relative_pose::{RelativePose, candidates};
use crate::linalg::{cholesky, null_space};
use crate::ransac::Solver;

/// Rows of unit length carry a few eps of rounding.
const RANK_TOLERANCE: f64 = 256.0 * f64::EPSILON;
/// Constraint violation of an E of Frobenius norm sqrt 2 that Gauss-Newton has not brought to a solution: half the digits.
const SOLUTION_TOLERANCE: f64 = 1.5e-8;

/// Appends every essential matrix (Frobenius norm sqrt 2, sign arbitrary) of five matches in normalised coordinates. O(1).
///
/// Appends nothing for a degenerate sample or coordinates that are not finite.
pub fn essential_from_five(sample: &[Correspondence; 5], solutions: &mut Vec<Matrix3<f64>>) {
    if !sample.iter().all(Correspondence::is_finite) {
        return;
    }
    let rays = sample.map(|m| {
        (
            m.first.push(1.0).normalize(),
            m.second.push(1.0).normalize(),
        )
    });
    if turned_only(&rays) {
        return;
    }
    let system = SMatrix::<f64, 5, 9>::from_fn(|i, j| rays[i].1[j / 3] * rays[i].0[j % 3]);
    let Some(null) = null_space::<5, 9, 4>(&system, RANK_TOLERANCE) else {
        return;
    };
    let basis: [Matrix3<f64>; 4] =
        std::array::from_fn(|k| Matrix3::from_row_slice(null.column(k).as_slice()));
    let Some(eliminated) = eliminate(constraints(&basis)) else {
        return;
    };
    let rows = b_rows(&eliminated);
    let mut roots = Vec::with_capacity(10);
    real_roots(&determinant(&rows), &mut roots);
    for root in roots {
        let b = rows.map(|row| row.map(|p| homogeneous(&p, root.numerator, root.denominator)));
        let Some(v) = null_direction(&b) else {
            continue;
        };
        // (x : y : z : 1), multiplied by the root's denominator: B was evaluated with it.
        let start = Vector4::new(
            v.x * root.denominator,
            v.y * root.denominator,
            v.z * root.numerator,
            v.z * root.denominator,
        );
        solutions.extend(polish(&basis, start));
    }
}

/// The five-point solver for RANSAC: data in normalised coordinates; refits are maximum likelihood (Sampson).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FivePoint {
    /// Variance of a coordinate along x and y; only the ratio counts, (1, 1) for square pixels.
    pub variance: Vector2<f64>,
    /// Largest number of Levenberg-Marquardt steps of a refit.
    pub refit_iterations: usize,
}

impl Default for FivePoint {
    /// Square pixels, five iterations a refit; the driver repeats it with the new inliers.
    fn default() -> Self {
        Self {
            variance: Vector2::repeat(1.0),
            refit_iterations: 5,
        }
    }
}

impl Solver for FivePoint {
    type Datum = Correspondence;
    type Model = Matrix3<f64>;

    fn sample_size(&self) -> usize {
        5
    }

    fn fit(&self, data: &[Correspondence], sample: &[usize], models: &mut Vec<Matrix3<f64>>) {
        if let [a, b, c, d, e] = *sample {
            essential_from_five(&[data[a], data[b], data[c], data[d], data[e]], models);
        }
    }

    fn refit(
        &self,
        data: &[Correspondence],
        inliers: &[usize],
        model: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        // All four poses have the same essential matrix.
        let start = RelativePose::new(&candidates(model)?[0])?;
        let refined = refine(&start, data, inliers, &self.variance, self.refit_iterations).ok()?;
        Some(refined.model.essential())
    }
}

/// Whether the angles between all rays are the same in both views, to rounding.
fn turned_only(rays: &[(Vector3<f64>, Vector3<f64>); 5]) -> bool {
    (0..5).all(|i| {
        (0..i).all(|j| {
            let before = (rays[i].0 - rays[j].0).norm_squared();
            let after = (rays[i].1 - rays[j].1).norm_squared();
            // Squared chords of unit rays are accurate to 8 eps of the chord itself.
            (before - after).abs() <= 32.0 * f64::EPSILON * before.max(after).sqrt()
        })
    })
}

/// Position of a product of two of (x, y, z, 1) among the ten quadratic monomials.
const QUADRATIC: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];
/// Position of a quadratic monomial times one of (x, y, z, 1) among the twenty of
/// x3 y3 x2y xy2 x2z x2 y2z y2 xyz xy | xz2 xz x yz2 yz y z3 z2 z 1.
const CUBIC: [[usize; 4]; 10] = [
    [0, 2, 4, 5],     // xx
    [2, 3, 8, 9],     // xy
    [4, 8, 10, 11],   // xz
    [5, 9, 11, 12],   // x
    [3, 1, 6, 7],     // yy
    [8, 6, 13, 14],   // yz
    [9, 7, 14, 15],   // y
    [10, 13, 16, 17], // zz
    [11, 14, 17, 18], // z
    [12, 15, 18, 19], // 1
];

type Linear = [f64; 4];
type Quadratic = [f64; 10];
type Cubic = [f64; 20];

fn add_product(sum: &mut Quadratic, factor: f64, a: &Linear, b: &Linear) {
    for i in 0..4 {
        for j in 0..4 {
            sum[QUADRATIC[i][j]] += factor * a[i] * b[j];
        }
    }
}

fn add_cubic(sum: &mut Cubic, a: &Quadratic, b: &Linear) {
    for i in 0..10 {
        for j in 0..4 {
            sum[CUBIC[i][j]] += a[i] * b[j];
        }
    }
}

/// The nine trace constraints and the determinant.
fn constraints(basis: &[Matrix3<f64>; 4]) -> [Cubic; 10] {
    let e: [[Linear; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| basis.map(|b| b[(i, j)])));
    let mut gram = [[[0.0; 10]; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            for k in 0..3 {
                add_product(&mut gram[i][j], 1.0, &e[i][k], &e[j][k]);
            }
            gram[j][i] = gram[i][j];
        }
    }
    let half_trace: Quadratic =
        std::array::from_fn(|k| 0.5 * (gram[0][0][k] + gram[1][1][k] + gram[2][2][k]));
    for i in 0..3 {
        for k in 0..10 {
            gram[i][i][k] -= half_trace[k];
        }
    }
    let mut rows = [[0.0; 20]; 10];
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                add_cubic(&mut rows[3 * i + j], &gram[i][k], &e[k][j]);
            }
        }
    }
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let mut minor = [0.0; 10];
        add_product(&mut minor, 1.0, &e[1][j], &e[2][k]);
        add_product(&mut minor, -1.0, &e[1][k], &e[2][j]);
        add_cubic(&mut rows[9], &minor, &e[0][i]);
    }
    rows
}

/// Gauss-Jordan on the first ten columns with row pivoting; the last ten columns of rows 4 to 9. `None` if singular.
fn eliminate(mut rows: [Cubic; 10]) -> Option<[[f64; 10]; 6]> {
    for k in 0..10 {
        let mut pivot = k;
        for i in k + 1..10 {
            if rows[i][k].abs() > rows[pivot][k].abs() {
                pivot = i;
            }
        }
        rows.swap(k, pivot);
        let value = rows[k][k];
        // The basis is orthonormal, so coefficients are of size one and smaller pivots rounding.
        if value.abs() <= f64::EPSILON {
            return None;
        }
        for j in k..20 {
            rows[k][j] /= value;
        }
        let row = rows[k];
        // The first four rows are needed no more once their columns are gone from the others.
        let next = if k < 4 { k + 1 } else { 4 };
        for i in next..10 {
            if i != k {
                let factor = rows[i][k];
                for j in k..20 {
                    rows[i][j] -= factor * row[j];
                }
            }
        }
    }
    Some(std::array::from_fn(|i| {
        std::array::from_fn(|j| rows[i + 4][j + 10])
    }))
}

/// B(z): the coefficients of x, y and 1 as polynomials of degree 4 in z (those of x and y of degree 3).
fn b_rows(eliminated: &[[f64; 10]; 6]) -> [[[f64; 5]; 3]; 3] {
    std::array::from_fn(|k| {
        // (row of x2z, y2z, xyz) - z (row of x2, y2, xy).
        let (a, b) = (&eliminated[2 * k], &eliminated[2 * k + 1]);
        let cubic = |o: usize| [a[o + 2], a[o + 1] - b[o + 2], a[o] - b[o + 1], -b[o], 0.0];
        [
            cubic(0),
            cubic(3),
            [a[9], a[8] - b[9], a[7] - b[8], a[6] - b[7], -b[6]],
        ]
    })
}

/// det B(z), coefficients ascending.
fn determinant(b: &[[[f64; 5]; 3]; 3]) -> [f64; 11] {
    let mut sum = [0.0; 11];
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        // Cofactor of the constant column: degree 6.
        let mut minor = [0.0; 7];
        for p in 0..4 {
            for q in 0..4 {
                minor[p + q] += b[j][0][p] * b[k][1][q] - b[j][1][p] * b[k][0][q];
            }
        }
        for p in 0..7 {
            for q in 0..5 {
                sum[p + q] += minor[p] * b[i][2][q];
            }
        }
    }
    sum
}

/// sum_k p_k n^k d^(4 - k).
fn homogeneous(p: &[f64; 5], n: f64, d: f64) -> f64 {
    let (d2, n2) = (d * d, n * n);
    p[0] * d2 * d2 + p[1] * n * d2 * d + p[2] * n2 * d2 + p[3] * n2 * n * d + p[4] * n2 * n2
}

/// Null vector of a singular 3x3 matrix: the longest cross product of two rows.
fn null_direction(b: &[[f64; 3]; 3]) -> Option<Vector3<f64>> {
    let rows = b.map(|row| {
        let row = Vector3::from(row);
        row / row.norm().max(f64::MIN_POSITIVE)
    });
    let crosses = [
        rows[0].cross(&rows[1]),
        rows[1].cross(&rows[2]),
        rows[2].cross(&rows[0]),
    ];
    let longest = crosses
        .into_iter()
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    let norm = longest.norm();
    (norm > 0.0 && norm.is_finite()).then(|| longest / norm)
}

/// Gauss-Newton on 2 E E^T E - tr(E E^T) E = 0 over unit coefficient vectors; `None` where that is not solved.
fn polish(basis: &[Matrix3<f64>; 4], start: Vector4<f64>) -> Option<Matrix3<f64>> {
    let sqrt2 = std::f64::consts::SQRT_2;
    let combine = |c: &Vector4<f64>| -> Matrix3<f64> {
        basis[0] * c[0] + basis[1] * c[1] + basis[2] * c[2] + basis[3] * c[3]
    };
    let violation = |e: &Matrix3<f64>| -> Matrix3<f64> {
        let gram = e * e.transpose();
        gram * e * 2.0 - e * gram.trace()
    };
    let mut c = start.try_normalize(0.0)? * sqrt2;
    let mut e = combine(&c);
    let mut left = violation(&e);
    let mut size = left.norm();
    for _ in 0..10 {
        if size <= 4.0 * f64::EPSILON {
            break;
        }
        let gram = e * e.transpose();
        let (trace, inner) = (gram.trace(), e.transpose() * e);
        let mut jacobian = SMatrix::<f64, 9, 4>::zeros();
        for k in 0..4 {
            let b = &basis[k];
            let column = (b * inner + e * (b.transpose() * e) + gram * b) * 2.0
                - e * (2.0 * e.dot(b))
                - b * trace;
            jacobian.set_column(k, &SVector::<f64, 9>::from_column_slice(column.as_slice()));
        }
        let residual = SVector::<f64, 9>::from_column_slice(left.as_slice());
        // The length is not determined by the constraints: steps are taken across it.
        let normal: Matrix4<f64> = jacobian.transpose() * jacobian + c * c.transpose();
        let Ok(factor) = cholesky(&normal) else {
            break;
        };
        let step = factor.solve(&(jacobian.transpose() * residual));
        let Some(direction) = (c - step).try_normalize(0.0) else {
            break;
        };
        let next = direction * sqrt2;
        let next_e = combine(&next);
        let next_left = violation(&next_e);
        let next_size = next_left.norm();
        // Written so that NaN ends it too.
        let better = next_size < size;
        if !better {
            break;
        }
        (c, e, left, size) = (next, next_e, next_left, next_size);
    }
    (size <= SOLUTION_TOLERANCE).then_some(e)
}
