//! Camera pose from three points: up to four solutions.
//!
//! Problem: points X_i seen along unit rays f_i; find the depths l_i along the rays, then the pose (Grunert 1841).
//!
//! Equation: |l_i f_i - l_j f_j|^2 = a_ij = |X_i - X_j|^2 for the three pairs, written without cancellation as
//!
//! > (l_i - l_j)^2 + d_ij l_i l_j = a_ij, d_ij = |f_i - f_j|^2.
//!
//! In the unknowns (w, u, v) = (theta l_1, l_2 - l_1, l_3 - l_1) with theta^2 the largest d_ij the three quadratic forms
//! have coefficients of order one however narrow the field of view: the usual form in the l_i, with cosines, is left with
//! the rounding of 1 - cos there.
//!
//! Steps:
//! 1. name the points so that a_23 is the longest edge, and divide by it;
//! 2. two conics without right-hand side, A = M_12 - a_12 M_23, B = M_13 - a_13 M_23, in (w : u : v);
//! 3. a real root of the cubic det(A + g B) = 0 at which the degenerate conic is a pair of real lines (Persson and
//!    Nordberg 2018, "Lambda Twist", and Ding et al. 2023, "Revisiting the P3P problem", go this way in other unknowns);
//! 4. each line meets B (or A) in up to two points; scale by the longest edge; keep positive depths;
//! 5. Newton on the three equations;
//! 6. the rotation between the two congruent triangles, from frames built alike on both, so it is exactly orthonormal.
//!
//! Degenerate: collinear points (the turn about their line is free) and coincident rays give no pose. On the danger
//! cylinder (through the points, perpendicular to their plane) two solutions fall together and are known to the square
//! root of the rounding only.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::cubic::real_roots;
use crate::linalg::cholesky;
use crate::se3::Se3;

/// Up to four poses, without allocation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct P3pSolutions {
    poses: [Se3; 4],
    count: usize,
}

impl P3pSolutions {
    /// The poses found, `world_from_camera`.
    #[must_use]
    pub fn as_slice(&self) -> &[Se3] {
        &self.poses[..self.count]
    }

    fn push(&mut self, pose: Se3) {
        if self.count < self.poses.len() {
            self.poses[self.count] = pose;
            self.count += 1;
        }
    }
}

/// Below this sine half of the digits of what a triangle or a pair of rays determines are lost: the square root of the
/// machine epsilon.
const MIN_SINE: f64 = 1.5e-8;
/// Relative error left in a squared edge that counts as a solution; a simple root reaches a few eps, a double one too, as
/// its residual is quadratic in its error.
const RESIDUAL_TOLERANCE: f64 = 1e-12;
const NEWTON_STEPS: usize = 12;

/// Poses `world_from_camera` that see the world points along the bearings (camera axes, any length above zero); none for
/// a degenerate sample or one that no pose explains. O(1).
#[must_use]
pub fn p3p(bearings: &[Vector3<f64>; 3], points_in_world: &[Vector3<f64>; 3]) -> P3pSolutions {
    let mut solutions = P3pSolutions::default();
    let Some(problem) = Problem::new(bearings, points_in_world) else {
        return solutions;
    };
    // The root whose conic is most clearly a real pair first; the others only if it gave nothing.
    let mut pencil = problem.pencil();
    pencil.sort_by(|a, b| a.realness.total_cmp(&b.realness));
    for conic in pencil.iter().take_while(|c| c.realness < f64::INFINITY) {
        problem.solve(conic, &mut solutions);
        if solutions.count > 0 {
            break;
        }
    }
    solutions
}

struct Problem {
    rays: [Vector3<f64>; 3],
    points: [Vector3<f64>; 3],
    /// Length of the longest edge, metres: the unit of everything below.
    unit: f64,
    theta: f64,
    /// M_12, M_13, M_23.
    forms: [Matrix3<f64>; 3],
    /// a_12, a_13, a_23 = 1.
    squared_edges: [f64; 3],
}

/// A degenerate conic of the pencil, and the conic to intersect it with.
#[derive(Clone, Copy)]
struct Degenerate {
    conic: Matrix3<f64>,
    other: Matrix3<f64>,
    /// Sum of the principal minors over the squared size: negative for two real lines; infinite for none.
    realness: f64,
}

impl Problem {
    fn new(bearings: &[Vector3<f64>; 3], points: &[Vector3<f64>; 3]) -> Option<Self> {
        let edge = |i: usize, j: usize| points[i] - points[j];
        let squares = [
            edge(1, 2).norm_squared(),
            edge(2, 0).norm_squared(),
            edge(0, 1).norm_squared(),
        ];
        let first = (0..3).fold(
            0,
            |best, k| if squares[k] > squares[best] { k } else { best },
        );
        let order = [first, (first + 1) % 3, (first + 2) % 3];
        let points = order.map(|k| points[k]);
        let rays = order.map(|k| bearings[k] / bearings[k].norm());
        let finite = rays
            .iter()
            .chain(&points)
            .all(|v| v.iter().all(|x| x.is_finite()));
        let unit = squares[first].sqrt();
        if !(finite && unit > 0.0 && unit.is_finite()) {
            return None;
        }
        let short = (
            (points[1] - points[0]) / unit,
            (points[2] - points[0]) / unit,
        );
        // The longest edge is the base: the height over it, against the shorter of the other edges.
        let height = short.0.cross(&short.1).norm();
        let shortest = short.0.norm().min(short.1.norm());
        let squared_chords = [
            (rays[0] - rays[1]).norm_squared(),
            (rays[0] - rays[2]).norm_squared(),
            (rays[1] - rays[2]).norm_squared(),
        ];
        let smallest = squared_chords.iter().fold(f64::INFINITY, |a, b| a.min(*b));
        if !(height > MIN_SINE * shortest && smallest > MIN_SINE * MIN_SINE) {
            return None;
        }
        let theta = squared_chords.iter().fold(0.0_f64, |a, b| a.max(*b)).sqrt();
        let [d12, d13, d23] = squared_chords.map(|d| d / (theta * theta));
        let half = 0.5 * theta;
        let forms = [
            Matrix3::new(d12, d12 * half, 0.0, d12 * half, 1.0, 0.0, 0.0, 0.0, 0.0),
            Matrix3::new(d13, 0.0, d13 * half, 0.0, 0.0, 0.0, d13 * half, 0.0, 1.0),
            Matrix3::new(
                d23,
                d23 * half,
                d23 * half,
                d23 * half,
                1.0,
                2.0 * d23 * half * half - 1.0,
                d23 * half,
                2.0 * d23 * half * half - 1.0,
                1.0,
            ),
        ];
        Some(Self {
            rays,
            points,
            unit,
            theta,
            forms,
            squared_edges: [short.0.norm_squared(), short.1.norm_squared(), 1.0],
        })
    }

    /// Steps 2 and 3.
    fn pencil(&self) -> [Degenerate; 3] {
        let [a12, a13, _] = self.squared_edges;
        let mut a = self.forms[0] - self.forms[2] * a12;
        let mut b = self.forms[1] - self.forms[2] * a13;
        let mut cubic = determinants(&a, &b);
        // The root must not be lost at infinity: B has to be clearly regular. In a symmetric triangle neither A nor B is,
        // but then their sum or their difference.
        let [c0, c1, c2, c3] = cubic;
        if c0.abs().max(c3.abs()) < 0.1 * c1.abs().max(c2.abs()) {
            let (sum, difference) = (a + b, a - b);
            let of_sum = c0 + c1 + c2 + c3;
            let of_difference = c0 - c1 + c2 - c3;
            (a, b) = if of_sum.abs() > of_difference.abs() {
                (difference, sum)
            } else {
                (sum, difference)
            };
            cubic = determinants(&a, &b);
        } else if c3.abs() < c0.abs() {
            (a, b) = (b, a);
            cubic.reverse();
        }
        let [c0, c1, c2, c3] = cubic;
        real_roots(c3, c2, c1, c0).map(|root| {
            let g = root.unwrap_or(0.0);
            let conic = a + b * g;
            let size = conic.amax();
            let realness = adjugate(&conic).trace() / (size * size);
            Degenerate {
                conic: conic / size,
                // On the lines of the conic A and B are proportional: take the one that is not small there.
                other: if g.abs() < 1.0 { b } else { a },
                realness: if root.is_some() && realness.is_finite() {
                    realness
                } else {
                    f64::INFINITY
                },
            }
        })
    }

    /// Steps 4 to 6.
    fn solve(&self, degenerate: &Degenerate, solutions: &mut P3pSolutions) {
        let mut known: [Vector3<f64>; 4] = [Vector3::zeros(); 4];
        for line in lines(&degenerate.conic) {
            for direction in intersect(&line, &degenerate.other).into_iter().flatten() {
                let Some(unknowns) = self.polish(&direction) else {
                    continue;
                };
                let again = known[..solutions.count]
                    .iter()
                    .any(|k| (k - unknowns).amax() <= MIN_SINE * k.amax());
                if !again && solutions.count < 4 {
                    let pose = self.pose(&unknowns);
                    // Overflow is no pose.
                    if finite(&pose) {
                        known[solutions.count] = unknowns;
                        solutions.push(pose);
                    }
                }
            }
        }
    }

    /// (w, u, v) to rounding, from their ratios; `None` unless all depths are positive and the edges right.
    fn polish(&self, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
        let squared = direction.dot(&(self.forms[2] * direction));
        let mut q = direction * squared.sqrt().recip().copysign(direction.x);
        let mut state = self.residual(&q);
        for _ in 0..NEWTON_STEPS {
            if state.error <= 2.0 * f64::EPSILON {
                break;
            }
            // Where two solutions meet the Jacobian is singular: the damped step leaves that direction alone.
            let better = [Residual::newton, Residual::damped]
                .into_iter()
                .find_map(|step| {
                    let candidate = q - step(&state);
                    let next = self.residual(&candidate);
                    (next.error < state.error).then_some((candidate, next))
                });
            let Some(next) = better else {
                break;
            };
            (q, state) = next;
        }
        let error = state.error;
        let base = q.x / self.theta;
        let in_front = base > 0.0 && base + q.y > 0.0 && base + q.z > 0.0;
        (in_front && error <= RESIDUAL_TOLERANCE).then_some(q)
    }

    fn residual(&self, q: &Vector3<f64>) -> Residual {
        let rows = self.forms.map(|form| form * q);
        let value = Vector3::from_fn(|k, _| rows[k].dot(q) - self.squared_edges[k]);
        let error = (0..3).fold(0.0_f64, |worst, k| {
            worst.max(value[k].abs() / self.squared_edges[k])
        });
        Residual {
            rows,
            value,
            error: if value.iter().all(|v| v.is_finite()) {
                error
            } else {
                f64::INFINITY
            },
        }
    }

    fn pose(&self, unknowns: &Vector3<f64>) -> Se3 {
        let [f1, f2, f3] = self.rays;
        let base = unknowns.x / self.theta;
        let (u, v) = (unknowns.y, unknowns.z);
        // Differences of the points in the camera, from the differences of the depths.
        let to_second = f2 * u + (f2 - f1) * base;
        let to_third = f3 * v + (f3 - f1) * base;
        let [x1, x2, x3] = self.points;
        let in_camera = frame(&to_second, &to_third);
        let in_world = frame(&(x2 - x1), &(x3 - x1));
        let rotation = Rotation3::from_matrix_unchecked(in_world * in_camera.transpose());
        let centroid_in_camera = (f1 * base + (to_second + to_third) / 3.0) * self.unit;
        let centroid = x1 + ((x2 - x1) + (x3 - x1)) / 3.0;
        Se3::new(rotation, centroid - rotation * centroid_in_camera)
    }
}

fn finite(pose: &Se3) -> bool {
    pose.translation.iter().all(|v| v.is_finite())
        && pose.rotation.matrix().iter().all(|v| v.is_finite())
}

/// The three equations at (w, u, v).
struct Residual {
    /// Half the rows of the Jacobian.
    rows: [Vector3<f64>; 3],
    value: Vector3<f64>,
    /// Largest relative error of a squared edge.
    error: f64,
}

impl Residual {
    fn newton(&self) -> Vector3<f64> {
        let [a, b, c] = &self.rows;
        let across = b.cross(c);
        (across * self.value.x + c.cross(a) * self.value.y + a.cross(b) * self.value.z)
            * (0.5 / a.dot(&across))
    }

    fn damped(&self) -> Vector3<f64> {
        let jacobian = Matrix3::from_columns(&self.rows) * 2.0;
        let mut normal = jacobian * jacobian.transpose();
        let damping = 1e-9 * normal.trace();
        for k in 0..3 {
            normal[(k, k)] += damping;
        }
        cholesky(&normal).map_or_else(
            |_not_finite| Vector3::zeros(),
            |factor| factor.solve(&(jacobian * self.value)),
        )
    }
}

/// Orthonormal axes of a triangle from two of its edges: along the third, normal to the plane, and across.
fn frame(to_second: &Vector3<f64>, to_third: &Vector3<f64>) -> Matrix3<f64> {
    let along = (to_third - to_second).normalize();
    let normal = to_second.cross(to_third).normalize();
    Matrix3::from_columns(&[along, normal, along.cross(&normal)])
}

/// Coefficients of det(A + g B) by rising powers of g.
fn determinants(a: &Matrix3<f64>, b: &Matrix3<f64>) -> [f64; 4] {
    let (adjugate_a, adjugate_b) = (adjugate(a), adjugate(b));
    [
        adjugate_a.column(0).dot(&a.column(0)),
        adjugate_a.dot(b),
        adjugate_b.dot(a),
        adjugate_b.column(0).dot(&b.column(0)),
    ]
}

/// Adjugate of a symmetric matrix, whose columns are the cross products of its rows.
fn adjugate(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let (a, b, c) = (matrix.column(0), matrix.column(1), matrix.column(2));
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)])
}

/// The two lines of a degenerate conic: with p their intersection, scaled, conic + [p]x has rank one, and its row and
/// column are the lines (Richter-Gebert 2011, 11.1).
fn lines(conic: &Matrix3<f64>) -> [Vector3<f64>; 2] {
    let minors = -adjugate(conic);
    let best = (0..3).fold(0, |k, i| {
        if minors[(i, i)] > minors[(k, k)] {
            i
        } else {
            k
        }
    });
    let squared = minors[(best, best)];
    let meet = if squared > 0.0 {
        minors.column(best) / squared.sqrt()
    } else {
        // The lines coincide.
        Vector3::zeros()
    };
    let product = conic + crate::so3::hat(&meet);
    let (row, column) = product.iamax_full();
    [
        product.row(row).transpose(),
        product.column(column).into_owned(),
    ]
}

/// Directions on the line that the conic contains.
fn intersect(line: &Vector3<f64>, conic: &Matrix3<f64>) -> [Option<Vector3<f64>>; 2] {
    let length = line.norm();
    if !(length > 0.0 && length.is_finite()) {
        return [None; 2];
    }
    let normal = line / length;
    let axis = Vector3::from_fn(|i, _| if i == normal.iamin() { 1.0 } else { 0.0 });
    let e = normal.cross(&axis).normalize();
    let f = normal.cross(&e);
    let (conic_e, conic_f) = (conic * e, conic * f);
    let (p, q, r) = (e.dot(&conic_e), e.dot(&conic_f), f.dot(&conic_f));
    // p s^2 + 2 q s t + r t^2 = 0 for s e + t f.
    let discriminant = q * q - p * r;
    // Two solutions about to fall together may have lost the sign to rounding: the polish decides.
    let real = discriminant >= -1e-10 * (p * p + q * q + r * r);
    if !real {
        return [None; 2];
    }
    let root = discriminant.max(0.0).sqrt();
    let sum = -(q + root.copysign(q));
    // (s : t) = (sum : p) and (r : sum).
    [Some(e * sum + f * p), Some(e * r + f * sum)]
}
