//! The position of an extremum between samples, the contrast test and the edge test (Lowe, section 4).
//!
//! Around a sample the difference of Gaussians is taken as a quadratic in `x = (x, y, level)`:
//! ```text
//! D(x) = D + g' x + x' H x / 2,     x^ = -H^-1 g  (solved, not inverted),     D(x^) = D + g' x^ / 2     (Lowe, eq. 2, 3)
//! ```
//! with `g` and `H` from central differences. When the offset `x^` is longer than [`OffsetLimits::settled`] along an axis,
//! the sample moves there and the fit is repeated. A fit that would have to move but cannot (all steps are used, or the
//! border or the last level is reached) is kept up to [`OffsetLimits::last`]: such points hop between two samples, and in a
//! second picture one of the two fits may well settle.
//!
//! Rejected are fits further off than that, a singular `H`, `|D(x^)|` below the contrast threshold, and edges: points whose
//! ratio of principal curvatures, from the 2x2 spatial Hessian, does not satisfy `tr^2 / det < (r + 1)^2 / r` (section 4.1;
//! `det <= 0` is a saddle and is rejected as well).

use crate::constants::{BORDER, MAX_REFINE_STEPS};
use crate::points::{OffsetLimits, Sample, ScalePoint};
use crate::scale_space::Differences;

/// The conditions under which a refined extremum becomes a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Acceptance {
    /// The least `|D(x^)|`.
    pub(crate) min_contrast: f32,
    /// The largest ratio of principal curvatures.
    pub(crate) edge_ratio: f32,
    /// The largest offsets.
    pub(crate) offsets: OffsetLimits,
}

/// Refines a candidate; `None` when it is rejected.
pub(crate) fn refine(
    differences: Differences<'_>,
    start: Sample,
    accept: &Acceptance,
) -> Option<ScalePoint> {
    let mut sample = start;
    for step in 1..=MAX_REFINE_STEPS {
        let fit = Quadratic::at(differences, sample);
        let offset = solve3(fit.hessian, fit.gradient.map(|g| -g))?;
        let within = |limit: f32| offset.iter().all(|o| o.abs() <= limit);
        let next = if within(accept.offsets.settled) || step == MAX_REFINE_STEPS {
            None
        } else {
            moved_by(offset, sample, differences)
        };
        let Some(next) = next else {
            return within(accept.offsets.last)
                .then(|| fit.point(sample, offset, accept))
                .flatten();
        };
        sample = next;
    }
    None
}

/// The sample nearest to `from + offset`, if a fit can be made there.
fn moved_by(offset: [f32; 3], from: Sample, differences: Differences<'_>) -> Option<Sample> {
    let (width, height) = (differences.width(), differences.height());
    Some(Sample {
        x: moved(from.x, offset[0], BORDER, width - BORDER)?,
        y: moved(from.y, offset[1], BORDER, height - BORDER)?,
        level: moved(from.level, offset[2], 1, differences.levels() - 1)?,
    })
}

/// `from + round(offset)` if it lies in `low..high`; `None` also for an offset that is not a number.
fn moved(from: usize, offset: f32, low: usize, high: usize) -> Option<usize> {
    let to = from as f32 + offset.round();
    (to >= low as f32 && to < high as f32).then_some(to as usize)
}

/// The value, gradient and Hessian of `D` in (x, y, level), by central differences.
struct Quadratic {
    value: f32,
    gradient: [f32; 3],
    hessian: [[f32; 3]; 3],
}

impl Quadratic {
    fn at(differences: Differences<'_>, Sample { level, y, x }: Sample) -> Self {
        let below = |x: usize, y: usize| differences.at(level - 1, x, y);
        let here = |x: usize, y: usize| differences.at(level, x, y);
        let above = |x: usize, y: usize| differences.at(level + 1, x, y);
        let value = here(x, y);
        let twice = 2.0 * value;
        let (left, right) = (here(x - 1, y), here(x + 1, y));
        let (up, down) = (here(x, y - 1), here(x, y + 1));
        let (under, over) = (below(x, y), above(x, y));
        let gradient = [
            0.5 * (right - left),
            0.5 * (down - up),
            0.5 * (over - under),
        ];
        let dxx = right + left - twice;
        let dyy = down + up - twice;
        let dss = over + under - twice;
        let dxy = 0.25
            * (here(x + 1, y + 1) - here(x - 1, y + 1) - here(x + 1, y - 1) + here(x - 1, y - 1));
        let dxs = 0.25 * (above(x + 1, y) - above(x - 1, y) - below(x + 1, y) + below(x - 1, y));
        let dys = 0.25 * (above(x, y + 1) - above(x, y - 1) - below(x, y + 1) + below(x, y - 1));
        Self {
            value,
            gradient,
            hessian: [[dxx, dxy, dxs], [dxy, dyy, dys], [dxs, dys, dss]],
        }
    }
}

impl Quadratic {
    /// The point at `offset` from `sample`, if contrast and edge ratio allow it.
    fn point(&self, sample: Sample, offset: [f32; 3], accept: &Acceptance) -> Option<ScalePoint> {
        let slope: f32 = (0..3).map(|i| self.gradient[i] * offset[i]).sum();
        let response = (self.value + 0.5 * slope).abs();
        let [[dxx, dxy, _], [_, dyy, _], _] = self.hessian;
        let (trace, det) = (dxx + dyy, dxx * dyy - dxy * dxy);
        let r = accept.edge_ratio;
        let edge = det <= 0.0 || trace * trace * r >= (r + 1.0).powi(2) * det;
        (response >= accept.min_contrast && !edge).then_some(ScalePoint {
            sample,
            x: sample.x as f32 + offset[0],
            y: sample.y as f32 + offset[1],
            level: sample.level as f32 + offset[2],
            response,
        })
    }
}

/// Solves `a x = b` by elimination with row pivoting; `None` when a pivot vanishes.
fn solve3(mut a: [[f32; 3]; 3], mut b: [f32; 3]) -> Option<[f32; 3]> {
    for k in 0..3 {
        let pivot = (k..3).fold(k, |p, i| if a[i][k].abs() > a[p][k].abs() { i } else { p });
        a.swap(k, pivot);
        b.swap(k, pivot);
        if a[k][k] == 0.0 {
            return None;
        }
        for i in k + 1..3 {
            let factor = a[i][k] / a[k][k];
            for j in k..3 {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    let mut x = [0.0; 3];
    for k in (0..3).rev() {
        let known: f32 = (k + 1..3).map(|j| a[k][j] * x[j]).sum();
        x[k] = (b[k] - known) / a[k][k];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Plane;

    /// Gaussian levels with `D = peak - a (x - cx)^2 - b (y - cy)^2 - c (level - cl)^2 - d (x - cx)(y - cy)`.
    fn paraboloid(peak: f32, [cx, cy, cl]: [f32; 3], [a, b, c, d]: [f32; 4]) -> Vec<Plane> {
        let mut gaussians = vec![Plane::default(); 6];
        gaussians[0].resize(30, 28);
        for level in 0..5_u8 {
            let mut plane = gaussians[usize::from(level)].clone();
            for y in 0..28 {
                for x in 0..30 {
                    let (u, v, w) = (x as f32 - cx, y as f32 - cy, f32::from(level) - cl);
                    plane.row_mut(y)[x] += peak - a * u * u - b * v * v - c * w * w - d * u * v;
                }
            }
            gaussians[usize::from(level) + 1] = plane;
        }
        gaussians
    }

    fn accept(min_contrast: f32) -> Acceptance {
        Acceptance {
            min_contrast,
            edge_ratio: 10.0,
            offsets: OffsetLimits {
                settled: 0.6,
                last: 1.0,
            },
        }
    }

    const ROUND: [f32; 4] = [0.01, 0.012, 0.008, 0.004];

    #[test]
    fn the_top_of_a_quadratic_is_exact() {
        let centre = [14.3, 12.8, 2.25];
        for sign in [1.0, -1.0] {
            let planes = paraboloid(sign * 0.2, centre, ROUND.map(|c| sign * c));
            // From the nearest sample and from samples two away, which have to move.
            for (x, y, level) in [(14, 13, 2), (16, 12, 2), (13, 15, 3), (15, 11, 1)] {
                let point =
                    refine(Differences(&planes), Sample { level, y, x }, &accept(0.01)).unwrap();
                let error = [
                    point.x - centre[0],
                    point.y - centre[1],
                    point.level - centre[2],
                ];
                assert!(error.iter().all(|e| e.abs() < 1e-3), "{error:?}");
                assert!((point.response - 0.2).abs() < 1e-5);
                assert_eq!(
                    point.sample,
                    Sample {
                        level: 2,
                        y: 13,
                        x: 14
                    }
                );
            }
        }
    }

    #[test]
    fn an_offset_up_to_six_tenths_stays() {
        let start = Sample {
            level: 2,
            y: 13,
            x: 14,
        };
        let settled = |cx: f32| {
            refine(
                Differences(&paraboloid(0.2, [cx, 13.0, 2.0], ROUND)),
                start,
                &accept(0.01),
            )
            .unwrap()
            .sample
            .x
        };
        assert_eq!(
            [settled(14.45), settled(14.58), settled(14.63)],
            [14, 14, 15]
        );
    }

    #[test]
    fn faint_edge_saddle_flat_and_runaway_are_rejected() {
        let start = Sample {
            level: 2,
            y: 13,
            x: 14,
        };
        let centre = [14.2, 13.1, 2.0];
        let with = |coefficients, contrast| {
            refine(
                Differences(&paraboloid(0.2, centre, coefficients)),
                start,
                &accept(contrast),
            )
        };
        assert!(with(ROUND, 0.19).is_some());
        assert!(with(ROUND, 0.21).is_none());
        // Curvatures in the ratio 9 pass, in the ratio 11 do not: the limit is r = 10 itself.
        assert!(with([0.045, 0.005, 0.008, 0.0], 0.01).is_some());
        assert!(with([0.055, 0.005, 0.008, 0.0], 0.01).is_none());
        assert!(with([0.01, -0.01, 0.008, 0.0], 0.01).is_none());
        assert!(with([0.0; 4], 0.01).is_none());
        assert!(
            refine(
                Differences(&paraboloid(0.9, [2.0, 13.0, 2.0], ROUND)),
                start,
                &accept(0.01)
            )
            .is_none()
        );
        assert!(
            refine(
                Differences(&paraboloid(0.9, [14.0, 13.0, 4.1], ROUND)),
                start,
                &accept(0.01)
            )
            .is_none()
        );
    }
    #[test]
    fn a_fit_that_cannot_move_is_kept_up_to_one_sample() {
        // Level 4 is the last difference: no fit can be made there, so level 3 keeps the point, up to an offset of 1.
        let start = Sample {
            level: 3,
            y: 13,
            x: 14,
        };
        let at = |level: f32, last: f32| {
            let mut accept = accept(0.01);
            accept.offsets.last = last;
            let planes = paraboloid(0.2, [14.1, 13.0, level], ROUND);
            refine(Differences(&planes), start, &accept)
        };
        for level in [3.62_f32, 3.7, 3.95] {
            let point = at(level, 1.0).unwrap();
            assert_eq!(point.sample, start);
            assert!((point.level - level).abs() < 1e-3, "{level}: {point:?}");
            assert_eq!(at(level, 0.6), None);
        }
        assert!(at(4.1, 1.0).is_none());
    }
}
