//! The unscented transform of a landmark into a pixel, with its structure used.
//!
//! The direction from a camera is affine in the three parameters, q = o + B m ([`LandmarkView`]). With P = L L^T the sigma
//! points m +- s l_k have the directions q_0 +- s B l_k, so the seven images cost three products and seven divisions. Of the
//! cross covariance P_xz = L G^T, G = (w s (z_k+ - z_k-)), only G is formed: the slope P_xz^T P^-1 is G L^-1, one
//! substitution. Mean, covariance and slope are those of `ukf::unscented_transform` for a set of points along the axes.

use mono_geometry::Pinhole;
use mono_geometry::inverse_depth::{HORIZON, LandmarkView};
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};
use ukf::SigmaPoints;

/// Sigma points, and one lane that repeats the centre.
const LANES: usize = 8;

/// A set of sigma points along the axes, unfolded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AxisPoints {
    distance: f64,
    covariance_weight_of_centre: f64,
    weight: f64,
}

impl AxisPoints {
    /// The numbers of `points`, which lie along the axes.
    #[must_use]
    pub(crate) fn new(points: &SigmaPoints<3>) -> Self {
        Self {
            distance: points.offset(1).x,
            covariance_weight_of_centre: points.covariance_weight(0),
            weight: points.covariance_weight(1),
        }
    }
}

/// The lower Cholesky factor of a 3 x 3 covariance, with the inverse of its diagonal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lower3 {
    diagonal: [f64; 3],
    inverse: [f64; 3],
    l10: f64,
    l20: f64,
    l21: f64,
}

impl Lower3 {
    /// The factor of `p`; `None` if it is not positive definite.
    #[must_use]
    #[inline]
    pub(crate) fn of(p: &Matrix3<f64>) -> Option<Self> {
        // Comparisons that a NaN fails.
        let root = |v: f64| (v > 0.0).then(|| v.sqrt());
        let d0 = root(p[(0, 0)])?;
        let i0 = 1.0 / d0;
        let (l10, l20) = (p[(1, 0)] * i0, p[(2, 0)] * i0);
        let d1 = root(p[(1, 1)] - l10 * l10)?;
        let i1 = 1.0 / d1;
        let l21 = (p[(2, 1)] - l20 * l10) * i1;
        let d2 = root(p[(2, 2)] - l20 * l20 - l21 * l21)?;
        Some(Self {
            diagonal: [d0, d1, d2],
            inverse: [i0, i1, 1.0 / d2],
            l10,
            l20,
            l21,
        })
    }

    /// X with X L = `rows`, row by row.
    #[inline]
    fn divide_right(&self, rows: &Matrix2x3<f64>) -> Matrix2x3<f64> {
        let [i0, i1, i2] = self.inverse;
        let mut x = Matrix2x3::zeros();
        for r in 0..2 {
            let x2 = rows[(r, 2)] * i2;
            let x1 = (rows[(r, 1)] - x2 * self.l21) * i1;
            x[(r, 2)] = x2;
            x[(r, 1)] = x1;
            x[(r, 0)] = (rows[(r, 0)] - x1 * self.l10 - x2 * self.l20) * i0;
        }
        x
    }

    /// `matrix` L, by columns.
    #[inline]
    fn columns_of(&self, matrix: &Matrix3<f64>) -> [Vector3<f64>; 3] {
        let column = |i| matrix.column(i);
        let [d0, d1, d2] = self.diagonal;
        [
            column(0) * d0 + column(1) * self.l10 + column(2) * self.l20,
            column(1) * d1 + column(2) * self.l21,
            column(2) * d2,
        ]
    }
}

/// Statistical linearisation of the pixel: z = mean + slope (m - m_0) + N(0, rest).
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelMoments {
    /// Mean of the pixel.
    pub(crate) mean: Vector2<f64>,
    /// P_xz^T P^-1.
    pub(crate) slope: Matrix2x3<f64>,
    /// P_zz - P_xz^T P^-1 P_xz: what curvature adds.
    pub(crate) rest: Matrix2<f64>,
}

/// The moments of the pixel of N(`mean`, L L^T); `None` when a sigma point is not visible.
#[must_use]
#[inline]
pub(crate) fn pixel_moments(
    points: &AxisPoints,
    pinhole: &Pinhole,
    view: &LandmarkView,
    mean: &Vector3<f64>,
    lower: &Lower3,
) -> Option<PixelMoments> {
    let centre = view.direction(mean);
    let columns = lower.columns_of(&view.by_parameters);
    let (mut x, mut y, mut z) = ([centre.x; LANES], [centre.y; LANES], [centre.z; LANES]);
    for (k, column) in columns.iter().enumerate() {
        let step = column * points.distance;
        for (lane, step) in [(2 * k, step), (2 * k + 1, -step)] {
            x[lane] += step.x;
            y[lane] += step.y;
            z[lane] += step.z;
        }
    }
    let mut visible = true;
    for lane in 0..LANES {
        let largest = x[lane].abs().max(y[lane].abs()).max(z[lane].abs());
        visible &= z[lane] > HORIZON * largest;
    }
    if !visible {
        return None;
    }
    for lane in 0..LANES {
        let inverse = 1.0 / z[lane];
        x[lane] *= pinhole.fx * inverse;
        y[lane] *= pinhole.fy * inverse;
    }
    // From the centre, whose image is that of the last lane.
    let (u, v) = (x[LANES - 1], y[LANES - 1]);
    let mut off = Vector2::zeros();
    for lane in 0..6 {
        x[lane] -= u;
        y[lane] -= v;
        off += Vector2::new(x[lane], y[lane]);
    }
    off *= points.weight;
    let mut image = Matrix2x3::zeros();
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for k in 0..3 {
        let plus = (x[2 * k], y[2 * k]);
        let minus = (x[2 * k + 1], y[2 * k + 1]);
        let scale = points.weight * points.distance;
        image[(0, k)] = scale * (plus.0 - minus.0);
        image[(1, k)] = scale * (plus.1 - minus.1);
        for (du, dv) in [plus, minus] {
            let (du, dv) = (du - off.x, dv - off.y);
            xx += du * du;
            xy += du * dv;
            yy += dv * dv;
        }
    }
    let (w, c) = (points.weight, points.covariance_weight_of_centre);
    let covariance = Matrix2::new(
        w * xx + c * off.x * off.x,
        w * xy + c * off.x * off.y,
        w * xy + c * off.x * off.y,
        w * yy + c * off.y * off.y,
    );
    Some(PixelMoments {
        mean: Vector2::new(u + pinhole.cx, v + pinhole.cy) + off,
        slope: lower.divide_right(&image),
        rest: covariance - image * image.transpose(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::tests::common::{PINHOLE, near, place, pose, random_pose, rng, uniform};
    use mono_geometry::inverse_depth::LandmarkGeometry;
    use ukf::unscented_transform;

    /// The generic transform through the ray and the projection, for both sets of points that the methods use.
    #[test]
    fn the_moments_are_those_of_the_unscented_transform() {
        let mut rng = rng(71);
        let mut compared = 0;
        for case in 0..400 {
            let set = if case % 2 == 0 {
                SigmaPoints::default()
            } else {
                SigmaPoints::paper()
            };
            let from = random_pose(&mut rng);
            let (anchor, camera) = (place(&from), place(&near(&mut rng, &from)));
            let geometry = LandmarkGeometry::InverseDepth { anchor };
            let mean = Vector3::new(
                uniform(&mut rng, -0.3, 0.3),
                uniform(&mut rng, -0.3, 0.3),
                uniform(&mut rng, 0.3, 1.0),
            );
            let root = Matrix3::from_fn(|i, j| {
                let size = if i == 2 { 0.05 } else { 0.02 };
                if i >= j {
                    uniform(&mut rng, 0.1, 1.0) * size
                } else {
                    0.0
                }
            });
            let covariance = root * root.transpose();
            let Ok(expected) = unscented_transform(&mean, &covariance, &set, |m| {
                geometry
                    .ray(m)
                    .project(&PINHOLE, &camera)
                    .unwrap_or(Vector2::from_element(f64::NAN))
            }) else {
                continue;
            };
            let lower = Lower3::of(&covariance).unwrap();
            let moments = pixel_moments(
                &AxisPoints::new(&set),
                &PINHOLE,
                &geometry.view(&camera),
                &mean,
                &lower,
            )
            .unwrap();
            let slope = covariance
                .cholesky()
                .unwrap()
                .solve(&expected.cross_covariance)
                .transpose();
            let rest = expected.covariance - slope * expected.cross_covariance;
            assert!((moments.mean - expected.mean).norm() < 1e-9 * expected.mean.norm());
            assert!((moments.slope - slope).norm() < 1e-8 * slope.norm());
            assert!((moments.rest - rest).norm() < 1e-9 * expected.covariance.norm());
            compared += 1;
        }
        assert!(compared > 350, "{compared}");
    }

    #[test]
    fn what_is_not_definite_has_no_factor() {
        let definite = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, 0.2, 0.5, 0.2, 2.0);
        let lower = Lower3::of(&definite).unwrap();
        let [a, b, c] = lower.columns_of(&Matrix3::identity());
        let l = Matrix3::from_columns(&[a, b, c]);
        assert!((l * l.transpose() - definite).norm() < 1e-14);
        let mut wrong = definite;
        wrong[(2, 1)] = 9.0;
        assert!(Lower3::of(&wrong).is_none());
        wrong[(2, 1)] = f64::NAN;
        assert!(Lower3::of(&wrong).is_none());
    }

    #[test]
    fn a_sigma_point_behind_the_camera_has_no_moments() {
        let (anchor, camera) = (place(&pose(0.0, 0.0, 0.0)), place(&pose(0.0, 0.3, 0.0)));
        let view = LandmarkGeometry::InverseDepth { anchor }.view(&camera);
        let moments = |sigma: f64| {
            let p = Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, sigma * sigma));
            let mean = Vector3::new(0.0, 0.0, 1.0);
            let points = AxisPoints::new(&SigmaPoints::default());
            pixel_moments(&points, &PINHOLE, &view, &mean, &Lower3::of(&p).unwrap())
        };
        assert!(moments(0.1).is_some() && moments(3.0).is_none());
    }
}
