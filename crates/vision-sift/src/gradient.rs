//! Image gradients in polar form, as the orientation and the descriptor stage need them (Lowe, section 5).
//!
//! ```text
//! m(x, y)     = sqrt((L(x+1, y) - L(x-1, y))^2 + (L(x, y+1) - L(x, y-1))^2)
//! theta(x, y) = atan2(L(x, y+1) - L(x, y-1), L(x+1, y) - L(x-1, y))
//! ```
//! Angles are in radians from the x axis towards the y axis, clockwise on the screen because y points down.
//!
//! The arctangent is an odd polynomial of degree 11 on `[0, 1]`, a minimax fit; the largest error over the circle is
//! below [`ATAN2_MAX_ERROR`] (1.7e-6 from the polynomial, the rest rounding), a 70 000th of the narrowest histogram bin.
//! It has no branches, so runs of samples become vector code.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::image::Plane;

/// Samples handled together.
pub(crate) const RUN: usize = 16;

/// Bound of the error of [`atan2`], radians.
#[cfg(test)]
pub(crate) const ATAN2_MAX_ERROR: f32 = 2.5e-6;

/// Magnitude and angle of the gradients of one run of samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PolarRun {
    pub(crate) magnitude: [f32; RUN],
    /// In `[-pi, pi]`.
    pub(crate) angle: [f32; RUN],
}

/// Gradients at `(x + i, y)`, `i < RUN`, for samples with all four neighbours inside; samples `i >= count` are zero.
#[inline(always)]
pub(crate) fn polar_run(plane: &Plane, x: usize, y: usize, count: usize) -> PolarRun {
    let (above, row, below) = (
        &plane.row(y - 1)[x..],
        &plane.row(y)[x - 1..],
        &plane.row(y + 1)[x..],
    );
    let (mut dx, mut dy) = ([0.0; RUN], [0.0; RUN]);
    if let (RUN, Some(a), Some(l), Some(r), Some(b)) = (
        count,
        above.first_chunk::<RUN>(),
        row.first_chunk::<RUN>(),
        row[2..].first_chunk::<RUN>(),
        below.first_chunk::<RUN>(),
    ) {
        for i in 0..RUN {
            dx[i] = r[i] - l[i];
            dy[i] = b[i] - a[i];
        }
    } else {
        for i in 0..count.min(RUN) {
            dx[i] = row[i + 2] - row[i];
            dy[i] = below[i] - above[i];
        }
    }
    let (mut magnitude, mut angle) = ([0.0; RUN], [0.0; RUN]);
    for i in 0..RUN {
        magnitude[i] = (dx[i] * dx[i] + dy[i] * dy[i]).sqrt();
        angle[i] = atan2(dy[i], dx[i]);
    }
    PolarRun { magnitude, angle }
}

/// `atan2(y, x)` in `[-pi, pi]`, error below [`ATAN2_MAX_ERROR`]; `atan2(0, 0) = 0`. For finite arguments.
#[inline(always)]
pub(crate) fn atan2(y: f32, x: f32) -> f32 {
    const C: [f32; 6] = [
        0.999_977_23,
        -0.332_622_83,
        0.193_540_35,
        -0.116_426_39,
        0.052_647_255,
        -0.011_719_096,
    ];
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = if ax < ay { (ax, ay) } else { (ay, ax) };
    // The smallest normal number keeps 0 / 0 away and changes nothing else.
    let q = low / (high + f32::MIN_POSITIVE);
    let s = q * q;
    let p = q * (C[0] + s * (C[1] + s * (C[2] + s * (C[3] + s * (C[4] + s * C[5])))));
    let p = if ax < ay { FRAC_PI_2 - p } else { p };
    let p = if x < 0.0 { PI - p } else { p };
    if y < 0.0 { -p } else { p }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn atan2_keeps_its_bound_over_the_circle() {
        let n = 100_000;
        let mut worst = 0.0_f64;
        for i in 0..n {
            let t = (f64::from(i) + 0.5) / f64::from(n) * std::f64::consts::TAU;
            for radius in [1e-20_f32, 1e-4, 1.0] {
                let (x, y) = (radius * t.cos() as f32, radius * t.sin() as f32);
                let exact = f64::from(y).atan2(f64::from(x));
                worst = worst.max((f64::from(atan2(y, x)) - exact).abs());
            }
        }
        assert!(worst < f64::from(ATAN2_MAX_ERROR), "{worst}");
        assert_eq!(atan2(0.0, 0.0), 0.0);
        assert!((atan2(0.0, -1.0) - PI).abs() < ATAN2_MAX_ERROR);
        assert!((atan2(-2.0, 0.0) + FRAC_PI_2).abs() < ATAN2_MAX_ERROR);
    }

    #[test]
    fn runs_agree_with_single_samples() {
        let mut plane = Plane::default();
        plane.resize(40, 3);
        for (i, v) in plane.data_mut().iter_mut().enumerate() {
            *v = ((i * 7919) % 97) as f32 / 97.0;
        }
        let run = polar_run(&plane, 5, 1, RUN);
        for i in 0..RUN {
            let one = polar_run(&plane, 5 + i, 1, 1);
            assert_eq!(
                (run.magnitude[i], run.angle[i]),
                (one.magnitude[0], one.angle[0])
            );
        }
        // The last run of a row is short: the samples after it are zero.
        let short = polar_run(&plane, 36, 1, 3);
        assert_eq!(short.magnitude[3..], [0.0; RUN - 3]);
    }
}
