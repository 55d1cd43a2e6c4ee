//! Image gradients, weighted by a Gaussian window, and their angle (Lowe, section 5).
//!
//! ```text
//! m(x, y)     = sqrt((L(x+1, y) - L(x-1, y))^2 + (L(x, y+1) - L(x, y-1))^2)
//! theta(x, y) = atan2(L(x, y+1) - L(x, y-1), L(x+1, y) - L(x-1, y))
//! ```
//! Angles are in radians from the x axis towards the y axis, clockwise on the screen because y points down.
//!
//! The orientation stage and the descriptor stage both weigh the gradients of a window with `exp(-(dx^2 + dy^2) / 2 s^2)`. The
//! Gaussian separates, so [`WindowTable`] holds one factor for each column, and each row has one more. The weight multiplies
//! both components of the gradient: its length then is the weighted one, its direction the same.
//!
//! The arctangent is an odd polynomial of degree 11 on `[0, 1]`, a minimax fit; the largest error over the circle is
//! below 2.5e-6 radians (1.7e-6 from the polynomial, the rest rounding), a 70 000th of the narrowest histogram bin.
//! OpenCV's polynomial of degree 7 errs by up to 1.7e-4, which is seen where a bin takes or loses a gradient by it.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::constants::{Arctangent, MAX_WINDOW_COLUMNS};
use crate::image::Plane;
use crate::simd::{LANES, Lanes, Run, load, prefetch, store};

/// The number of each lane.
const STEPS: Run = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
];

/// Bound of the error of [`atan2`], radians.
#[cfg(test)]
pub(crate) const ATAN2_MAX_ERROR: f32 = 2.5e-6;

/// Bound of the relative error of [`falloff`].
#[cfg(test)]
pub(crate) const FALLOFF_MAX_ERROR: f32 = 1.5e-5;

/// The offset from the centre and the factor of the window, for each column.
pub(crate) struct WindowTable {
    first: usize,
    offset: [f32; MAX_WINDOW_COLUMNS + LANES],
    factor: [f32; MAX_WINDOW_COLUMNS + LANES],
}

impl WindowTable {
    /// An empty table, to be set before use.
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            first: 0,
            offset: [0.0; MAX_WINDOW_COLUMNS + LANES],
            factor: [0.0; MAX_WINDOW_COLUMNS + LANES],
        }
    }

    /// Sets the table for columns `first..=last` around `centre`; `scale` is `-1 / 2 s^2`.
    #[inline(always)]
    pub(crate) fn set<L: Lanes>(&mut self, centre: f32, first: usize, last: usize, scale: f32) {
        self.first = first;
        let steps = L::load(&STEPS);
        let columns = (last + 1 - first).min(MAX_WINDOW_COLUMNS);
        for at in (0..columns).step_by(LANES) {
            let offset = L::splat((first + at) as f32 - centre).add(steps);
            let factor = falloff(offset.mul(offset).mul(L::splat(scale)));
            store(offset, &mut self.offset, at);
            store(factor, &mut self.factor, at);
        }
    }

    /// The offsets from the centre of the columns that begin with `x`.
    #[inline(always)]
    pub(crate) fn offsets<L: Lanes>(&self, x: usize) -> L {
        load(&self.offset, x - self.first)
    }

    /// The gradients at `(x + i, y)`, weighted with the factors of the columns and `row_factor`. All four neighbours of
    /// the samples wanted must be inside the plane; lanes beyond the row are finite and carry no meaning.
    #[inline(always)]
    pub(crate) fn gradients<L: Lanes>(
        &self,
        plane: &Plane,
        x: usize,
        y: usize,
        row_factor: L,
    ) -> (L, L) {
        let row = plane.from(x - 1, y);
        let dx = load::<L>(row, 2).sub(load(row, 0));
        let dy = load::<L>(plane.from(x, y + 1), 0).sub(load(plane.from(x, y - 1), 0));
        let weight = load::<L>(&self.factor, x - self.first).mul(row_factor);
        (dx.mul(weight), dy.mul(weight))
    }
}

/// Asks for the samples within `reach` of `(x, y)` to be brought into the caches. Windows are short pieces of many rows,
/// which the processor does not foresee, and the wait for them would be as long as the work on them.
pub(crate) fn prefetch_window(plane: &Plane, x: f32, y: f32, reach: f32) {
    let ends = |centre: f32, length: usize| {
        let first = (centre - reach).max(0.0) as usize;
        let last = (centre + reach + 1.0).max(0.0) as usize;
        (first.min(length - 1), last.min(length - 1))
    };
    let (left, right) = ends(x, plane.width());
    let (top, bottom) = ends(y, plane.height());
    for y in top..=bottom {
        let row = plane.row(y);
        for x in (left..=right).step_by(LANES) {
            prefetch(&row[x..]);
        }
        prefetch(&row[right..]);
    }
}

/// `exp(t)` for `t` in `[-4.5, 0]` (three standard deviations), relative error below 1.5e-5.
///
/// It is `exp(t / 16)^16` by the Taylor polynomial of degree 5, whose next term is `16 (4.5 / 16)^6 / 720 = 1.1e-5` at the
/// end; the rounding of the four squarings adds 3e-6.
#[inline(always)]
pub(crate) fn falloff<L: Lanes>(t: L) -> L {
    let t = t.mul(L::splat(1.0 / 16.0));
    let mut e = L::splat(1.0 / 120.0);
    for c in [1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        e = e.mul(t).add(L::splat(c));
    }
    for _ in 0..4 {
        e = e.mul(e);
    }
    e
}

/// `sqrt(x^2 + y^2)`; gradients of grey values neither overflow nor need more than the squares' range.
#[inline(always)]
pub(crate) fn length<L: Lanes>(x: L, y: L) -> L {
    x.mul(x).add(y.mul(y)).sqrt()
}

/// `atan2(y, x)` in `[-pi, pi]`, for finite arguments; `atan2(0, 0) = 0`. With the polynomial of this crate the
/// error is below 2.5e-6.
#[inline(always)]
pub(crate) fn atan2<L: Lanes>(y: L, x: L, c: &Arctangent) -> L {
    let zero = L::splat(0.0);
    let (ax, ay) = (x.abs(), y.abs());
    // The smallest normal number keeps 0 / 0 away and changes nothing else.
    let q = ax.min(ay).div(ax.max(ay).add(L::splat(f32::MIN_POSITIVE)));
    let s = q.mul(q);
    let mut p = L::splat(c[5]);
    for c in c[..5].iter().rev() {
        p = p.mul(s).add(L::splat(*c));
    }
    let p = p.mul(q);
    let p = L::select(ay.greater(ax), L::splat(FRAC_PI_2).sub(p), p);
    let p = L::select(zero.greater(x), L::splat(PI).sub(p), p);
    L::select(zero.greater(y), zero.sub(p), p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::{ARCTANGENT, OPENCV_ARCTANGENT};
    use crate::simd::Portable;

    fn each(values: Run, f: impl Fn(Portable) -> Portable) -> Run {
        let mut out = [0.0; LANES];
        f(Portable::load(&values)).store(&mut out);
        out
    }

    #[test]
    fn atan2_keeps_its_bound_over_the_circle() {
        let one =
            |y: f32, x: f32| each([y; LANES], |y| atan2(y, Portable::splat(x), &ARCTANGENT))[0];
        let n = 100_000;
        let mut worst = 0.0_f64;
        for i in 0..n {
            let t = (f64::from(i) + 0.5) / f64::from(n) * std::f64::consts::TAU;
            for radius in [1e-20_f32, 1e-4, 1.0] {
                let (x, y) = (radius * t.cos() as f32, radius * t.sin() as f32);
                let exact = f64::from(y).atan2(f64::from(x));
                worst = worst.max((f64::from(one(y, x)) - exact).abs());
            }
        }
        assert!(worst < f64::from(ATAN2_MAX_ERROR), "{worst}");
        assert_eq!(one(0.0, 0.0), 0.0);
        assert!((one(0.0, -1.0) - PI).abs() < ATAN2_MAX_ERROR);
        assert!((one(-2.0, 0.0) + FRAC_PI_2).abs() < ATAN2_MAX_ERROR);
    }

    #[test]
    fn opencv_arctangent_errs_by_its_known_bound() {
        let errors = (0..=1000).map(|i| {
            let t = f64::from(i) / 1000.0 * std::f64::consts::FRAC_PI_4;
            let x = Portable::splat(t.cos() as f32);
            let got = each([t.sin() as f32; LANES], |y| atan2(y, x, &OPENCV_ARCTANGENT))[0];
            (f64::from(got) - t).abs()
        });
        let worst = errors.fold(0.0, f64::max);
        assert!((1.5e-4..1.8e-4).contains(&worst), "{worst}");
    }

    #[test]
    fn falloff_keeps_its_bound() {
        for i in 0..=1000 {
            let t = -4.5 * f64::from(i) / 1000.0;
            let got = each([t as f32; LANES], falloff)[0];
            let error = f64::from(got) / f64::from(t as f32).exp() - 1.0;
            assert!(error.abs() < f64::from(FALLOFF_MAX_ERROR), "{t}: {error}");
        }
    }

    #[test]
    fn gradients_are_weighted_central_differences() {
        let mut plane = Plane::default();
        plane.resize(40, 5);
        for y in 0..5 {
            for (x, v) in plane.row_mut(y).iter_mut().enumerate() {
                *v = ((x * 7919 + y * 104_729) % 97) as f32 / 97.0;
            }
        }
        let (centre, scale) = (17.3_f32, -0.02_f32);
        let mut table = WindowTable::new();
        table.set::<Portable>(centre, 1, 38, scale);
        for y in 1..4 {
            let (mut dx, mut dy) = ([0.0; LANES], [0.0; LANES]);
            for x in [1, 9, 23, 38] {
                let (gx, gy) = table.gradients(&plane, x, y, Portable::splat(0.5));
                gx.store(&mut dx);
                gy.store(&mut dy);
                for i in 0..LANES.min(39 - x) {
                    let c = x + i;
                    let w = 0.5 * f64::from(scale * (c as f32 - centre).powi(2)).exp();
                    let exact = w * f64::from(plane.at(c + 1, y) - plane.at(c - 1, y));
                    assert!((f64::from(dx[i]) - exact).abs() < 1e-5);
                    let exact = w * f64::from(plane.at(c, y + 1) - plane.at(c, y - 1));
                    assert!((f64::from(dy[i]) - exact).abs() < 1e-5);
                }
            }
        }
    }
}
