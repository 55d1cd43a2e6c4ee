//! Sub-pixel corners: a picture of the corner fitted to the pixels.
//!
//! Problem: the place of a corner to a few hundredths of a pixel, with its own standard deviation.
//!
//! Two straight edges through c with directions a_1, a_2, blurred by Gaussians s_1, s_2, on a slanted ground:
//!
//!   I(p) = o + g^T (p - c) + h erf(d_1 / (sqrt 2 s_1)) erf(d_2 / (sqrt 2 s_2)),
//!   d_k = (-sin a_k, cos a_k) . (p - c) - b_k / 2 ((cos a_k, sin a_k) . (p - c))^2
//!
//! The bends b_k of the edges are given by the module `measure`. The ten parameters are fitted by least squares
//! (Levenberg-Marquardt) to all pixels within a window shaped like the squares ([`Window`]). All pixels along both edges
//! take part, each with the weight that noise gives it, so the estimate is close to the best that the pixels allow;
//! its covariance is s^2 (J^T J)^-1 with s^2 from the residuals. `cornerSubPix` (Förstner's orthogonality of gradients)
//! uses the same pixels with weights that grow with noise. For edges at a right angle under one blur the product is
//! exact; for others it is not, but model and image both map to themselves by a half turn about c, so nothing
//! pulls c aside. Two widths let motion blur spread one edge more than the other.
//!
//! Steps: start from the saddle and its edges; fit; give up when the fit leaves the window, flips its contrast or
//! has no positive definite normal matrix.
//!
//! Degenerate: a window that contains a neighbouring corner (it ends at 0.4 squares); a corner without edges on
//! one side of the image border.

use nalgebra::{SMatrix, SVector};

use super::plane::Plane;

/// Number of parameters: c (2), directions (2), log widths (2), contrast, ground level, slope (2).
const N: usize = 10;
/// Iterations after which the fit is taken as failed.
const MOST_ITERATIONS: usize = 40;
/// A step of c below this ends the fit, pixels: a hundredth of the best standard deviation to be had.
const SMALLEST_STEP_PX: f64 = 1e-4;
/// Range of blur that is believed, pixels: the square of a pixel alone has 0.29.
const WIDTH_RANGE: (f64, f64) = (0.2, 8.0);
/// Share of a square around a corner in which no other corner shows.
const OWN_SHARE: f64 = 0.4;
/// Least share of the window that lies on the image.
const LEAST_INSIDE: f64 = 0.6;

/// The pixels a corner is fitted to: an ellipse in the axes of its squares, cut by a disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Window {
    /// Pixels to squares, row by row.
    squares: [f64; 4],
    /// Radius of the disc, pixels.
    reach: f64,
}

impl Window {
    /// From the sides of a square at the corner, pixels; `None` when they are parallel.
    ///
    /// Within [`OWN_SHARE`] of a square no other corner shows, however the board is tilted; beyond a fifth of one the
    /// bending of the lens would.
    pub(super) fn new(side: [f64; 2], other: [f64; 2]) -> Option<Window> {
        let determinant = side[0] * other[1] - side[1] * other[0];
        let longer = side[0].hypot(side[1]).max(other[0].hypot(other[1]));
        (determinant.abs() > f64::EPSILON * longer * longer).then(|| Window {
            squares: [other[1], -other[0], -side[1], side[0]].map(|entry| entry / determinant),
            reach: (0.2 * longer).clamp(6.0, 24.0),
        })
    }

    /// Half the narrow way across, pixels.
    pub(super) fn narrowest(&self) -> f64 {
        let [a, b, c, d] = self.squares;
        // The largest singular value is below the Frobenius norm and above 0.7 of it.
        (OWN_SHARE / (a * a + b * b + c * c + d * d).sqrt()).min(self.reach)
    }

    fn holds(&self, x: f64, y: f64) -> bool {
        let [a, b, c, d] = self.squares;
        (a * x + b * y).hypot(c * x + d * y) <= OWN_SHARE && x.hypot(y) <= self.reach
    }
}

/// A fitted corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Pixels of the plane.
    pub(super) position: [f64; 2],
    /// Directions of the two edges, radians.
    pub(super) directions: [f64; 2],
    /// Number of pixels in the window.
    pub(super) pixels: usize,
    /// Bright minus dark, grey levels.
    pub(super) contrast: f64,
    /// Standard deviations of the edges' blur, pixels.
    pub(super) widths: [f64; 2],
    /// Standard deviation of the position by the fit, root mean square of x and y, pixels.
    pub(super) sigma_px: f64,
}

/// The parameters that a fit may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Freedom {
    /// All ten parameters.
    Full,
    /// The blur keeps its given value and the ground stays level. For windows of few pixels, where both would follow the noise.
    Stiff,
}

impl Freedom {
    fn holds(self, parameter: usize) -> bool {
        self == Freedom::Stiff && matches!(parameter, 4 | 5 | 8 | 9)
    }
}

/// Where a fit starts, pixels of the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    /// The corner.
    pub(super) position: [f64; 2],
    /// Directions of its two edges, radians.
    pub(super) directions: [f64; 2],
    /// Curvatures of the edges towards (-sin, cos) of their directions, held.
    pub(super) bends: [f64; 2],
    /// Standard deviation of the blur.
    pub(super) width: f64,
}

/// Fits a corner from its start over the pixels of `window`.
pub(super) fn fit(plane: &Plane, shape: &Shape, window: &Window, freedom: Freedom) -> Option<Fit> {
    let &Shape {
        position,
        directions,
        bends,
        width,
    } = shape;
    let pixels = inside(plane, position, window)?;
    let furthest = window.narrowest();
    let mut state = start(&pixels, position, directions, bends, width)?;
    let (mut normal, mut gradient, mut cost) = linearised(&pixels, &state, bends, freedom);
    let mut damping = 1e-3;
    let mut settled = false;
    for _ in 0..MOST_ITERATIONS {
        let mut damped = normal;
        for k in 0..N {
            damped[(k, k)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&gradient);
        let mut next = state - step;
        for k in 4..6 {
            next[k] = next[k].clamp(WIDTH_RANGE.0.ln(), WIDTH_RANGE.1.ln());
        }
        if (next[0] - position[0]).hypot(next[1] - position[1]) > furthest {
            return None;
        }
        let (next_normal, next_gradient, next_cost) = linearised(&pixels, &next, bends, freedom);
        if next_cost.is_finite() && next_cost <= cost {
            let moved = step[0].hypot(step[1]);
            (state, normal, gradient, cost) = (next, next_normal, next_gradient, next_cost);
            damping = (0.2 * damping).max(1e-9);
            if moved < SMALLEST_STEP_PX {
                settled = true;
                break;
            }
        } else {
            damping *= 8.0;
            if damping > 1e9 {
                // No direction lowers the cost any more: rounding.
                settled = true;
                break;
            }
        }
    }
    let factor = normal.cholesky()?;
    let estimated = (0..N).filter(|&k| !freedom.holds(k)).count();
    let variance = cost / (pixels.len() - estimated) as f64;
    let spread = |axis: usize| {
        let mut unit = SVector::<f64, N>::zeros();
        unit[axis] = 1.0;
        factor.solve(&unit)[axis] * variance
    };
    let sigma_px = (0.5 * (spread(0) + spread(1))).max(0.0).sqrt();
    let upright = (state[2] - directions[0]).abs() < 0.8 && (state[3] - directions[1]).abs() < 0.8;
    (settled && upright && sigma_px.is_finite()).then(|| Fit {
        position: [state[0], state[1]],
        directions: [state[2], state[3]],
        contrast: 2.0 * state[6].abs(),
        pixels: pixels.len(),
        widths: [state[4].exp(), state[5].exp()],
        sigma_px,
    })
}

/// (x, y, grey level) of the pixels of a window.
fn inside(plane: &Plane, centre: [f64; 2], window: &Window) -> Option<Vec<[f64; 3]>> {
    let reach = window.reach.ceil() as i64;
    let (middle_x, middle_y) = (centre[0].round() as i64, centre[1].round() as i64);
    let (mut pixels, mut all) = (Vec::new(), 0_usize);
    for y in middle_y - reach..=middle_y + reach {
        for x in middle_x - reach..=middle_x + reach {
            if !window.holds(x as f64 - centre[0], y as f64 - centre[1]) {
                continue;
            }
            all += 1;
            if let (Ok(column), Ok(row)) = (usize::try_from(x), usize::try_from(y))
                && column < plane.width
                && row < plane.height
            {
                pixels.push([x as f64, y as f64, f64::from(plane.at(column, row))]);
            }
        }
    }
    (pixels.len() > 2 * N && pixels.len() as f64 >= LEAST_INSIDE * all as f64).then_some(pixels)
}

/// The level and contrast that fit best with the geometry given.
fn start(
    pixels: &[[f64; 3]],
    position: [f64; 2],
    directions: [f64; 2],
    bends: [f64; 2],
    width: f64,
) -> Option<SVector<f64, N>> {
    let mut state = SVector::<f64, N>::zeros();
    (state[0], state[1]) = (position[0], position[1]);
    (state[2], state[3]) = (directions[0], directions[1]);
    (state[4], state[5]) = (width.ln(), width.ln());
    state[6] = 1.0;
    let count = pixels.len() as f64;
    let edges = Edge::both(&state, bends);
    let (mut m, mut v, mut mm, mut mv) = (0.0, 0.0, 0.0, 0.0);
    for pixel in pixels {
        let shape = model(&state, &edges, pixel).0;
        m += shape;
        v += pixel[2];
        mm += shape * shape;
        mv += shape * pixel[2];
    }
    let spread = mm - m * m / count;
    if spread <= f64::EPSILON * mm {
        return None;
    }
    state[6] = (mv - m * v / count) / spread;
    state[7] = (v - state[6] * m) / count;
    Some(state)
}

/// J^T J, J^T r and r^T r of the residuals model minus pixel.
fn linearised(
    pixels: &[[f64; 3]],
    state: &SVector<f64, N>,
    bends: [f64; 2],
    freedom: Freedom,
) -> (SMatrix<f64, N, N>, SVector<f64, N>, f64) {
    let mut normal = SMatrix::<f64, N, N>::zeros();
    let mut gradient = SVector::<f64, N>::zeros();
    let mut cost = 0.0;
    let edges = Edge::both(state, bends);
    for pixel in pixels {
        let (value, row) = model(state, &edges, pixel);
        let residual = value - pixel[2];
        for i in 0..N {
            gradient[i] += row[i] * residual;
            for j in 0..=i {
                normal[(i, j)] += row[i] * row[j];
            }
        }
        cost += residual * residual;
    }
    for i in 0..N {
        for j in 0..i {
            normal[(j, i)] = normal[(i, j)];
        }
    }
    for k in (0..N).filter(|&k| freedom.holds(k)) {
        normal.row_mut(k).fill(0.0);
        normal.column_mut(k).fill(0.0);
        normal[(k, k)] = 1.0;
        gradient[k] = 0.0;
    }
    (normal, gradient, cost)
}

/// The quantities of an edge that the model uses at every pixel.
#[derive(Debug, Clone, Copy)]
struct Edge {
    sin: f64,
    cos: f64,
    bend: f64,
    /// 1 / (sqrt 2 width).
    scale: f64,
}

impl Edge {
    fn both(state: &SVector<f64, N>, bends: [f64; 2]) -> [Edge; 2] {
        [0, 1].map(|k| {
            let (sin, cos) = state[2 + k].sin_cos();
            Edge {
                sin,
                cos,
                bend: bends[k],
                scale: (-state[4 + k]).exp() * std::f64::consts::FRAC_1_SQRT_2,
            }
        })
    }

    /// The edge's profile at a place relative to the corner, and its derivatives by c_x, c_y, direction and log width.
    fn profile(&self, x: f64, y: f64) -> (f64, [f64; 4]) {
        let Edge {
            sin,
            cos,
            bend,
            scale,
        } = *self;
        let (along, across) = (cos * x + sin * y, cos * y - sin * x);
        let off = across - 0.5 * bend * along * along;
        let (value, slope) = erf(off * scale);
        let by = slope * scale;
        let derivatives = [
            by * (sin + bend * along * cos),
            by * (bend * along * sin - cos),
            -by * along * (1.0 + bend * across),
            -by * off,
        ];
        (value, derivatives)
    }
}

/// The model at a pixel and its derivatives by the parameters.
fn model(state: &SVector<f64, N>, edges: &[Edge; 2], pixel: &[f64; 3]) -> (f64, [f64; N]) {
    let (x, y) = (pixel[0] - state[0], pixel[1] - state[1]);
    let (first, d_first) = edges[0].profile(x, y);
    let (second, d_second) = edges[1].profile(x, y);
    let contrast = state[6];
    let row = [
        contrast * (d_first[0] * second + first * d_second[0]) - state[8],
        contrast * (d_first[1] * second + first * d_second[1]) - state[9],
        contrast * d_first[2] * second,
        contrast * first * d_second[2],
        contrast * d_first[3] * second,
        contrast * first * d_second[3],
        first * second,
        1.0,
        x,
        y,
    ];
    let value = contrast * first * second + state[7] + state[8] * x + state[9] * y;
    (value, row)
}

/// The error function and its derivative.
fn erf(t: f64) -> (f64, f64) {
    (
        libm::erf(t),
        std::f64::consts::FRAC_2_SQRT_PI * (-t * t).exp(),
    )
}

#[cfg(test)]
mod tests;
