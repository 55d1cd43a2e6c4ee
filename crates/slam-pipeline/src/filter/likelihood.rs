//! The observation likelihood: how well a pose explains a frame, given the map before it (Eq. 26-30).
//!
//! In the exact form each match contributes log((1 - eps) N(d; 0, J G J^T + R) + eps / A). The pixel noise and the
//! log-determinant are included, and a wrong match costs at most a constant. A match of open depth contributes the same
//! across its epipolar line only, which is the paper's Eq. 30 with a noise and without using information twice.
//!
//! The printed form is Eq. 29 with S = J G J^T, without pixel noise or determinant, and d^2 clipped at T_l = 3; and
//! Eq. 30, the linear pixel distances to both epipolar lines without a standard deviation.

use core::f64::consts::PI;

use mono_geometry::{Pinhole, PlacedCamera};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::landmark::projected_covariance;
use super::linearised::across_epipolar;
use super::observation::{Prepared, Scoring};
use super::pose::CameraPose;
use crate::method::LikelihoodForm;
use crate::rig::Rig;

/// T_l of Eq. 29.
const PAPER_INNOVATION_CLIP: f64 = 3.0;
/// Floor of the covariance that Eq. 29 divides by, which otherwise shrinks without bound: the square of the rounding of
/// a pixel.
const PAPER_VARIANCE_FLOOR_PX2: f64 = 1e-6;

/// The observation likelihood of one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Likelihood {
    /// Share of wrong matches.
    pub(crate) outlier_share: f64,
    /// The exact or the printed formulas.
    pub(crate) form: LikelihoodForm,
}

/// The likelihood with the camera it is asked for.
struct View<'a> {
    placed: PlacedCamera,
    pinhole: &'a Pinhole,
    outlier_share: f64,
    image_area_px2: f64,
    matches: &'a [Option<Prepared>],
}

impl Likelihood {
    /// The natural logarithm of p(z | pose, map), a density in pixels^-n.
    ///
    /// The `matches` are those prepared for the particle. A landmark that the particle lacks or cannot see counts as a
    /// wrong match, so that weights compare.
    #[must_use]
    pub(crate) fn log(&self, rig: &Rig, pose: &CameraPose, matches: &[Option<Prepared>]) -> f64 {
        let size = rig.image_size_px();
        let view = View {
            placed: pose.place(rig),
            pinhole: rig.pinhole(),
            outlier_share: self.outlier_share,
            image_area_px2: size.x * size.y,
            matches,
        };
        match self.form {
            LikelihoodForm::Exact => {
                view.sum((self.outlier_share / view.image_area_px2).ln(), View::exact)
            }
            LikelihoodForm::Printed => view.sum(-0.5 * PAPER_INNOVATION_CLIP, View::printed),
        }
    }
}

impl View<'_> {
    /// Sum over the matches, `unseen` for those that the particle lacks.
    fn sum(&self, unseen: f64, of_match: fn(&Self, &Prepared) -> f64) -> f64 {
        self.matches
            .iter()
            .map(|m| m.as_ref().map_or(unseen, |m| of_match(self, m)))
            .sum()
    }

    fn exact(&self, m: &Prepared) -> f64 {
        let across_only = m.scoring == Scoring::AcrossEpipolar;
        let wrong = if across_only {
            self.outlier_share / self.image_area_px2.sqrt()
        } else {
            self.outlier_share / self.image_area_px2
        };
        let view = m.geometry.view(&self.placed);
        let focus = m.focus(self.pinhole, &view);
        let (Some(predicted), Some(jacobian)) = (
            view.project(self.pinhole, &focus),
            view.jacobian(self.pinhole, &focus),
        ) else {
            return wrong.ln();
        };
        let innovation = m.pixel - predicted;
        let s = projected_covariance(&jacobian, &m.covariance) + m.noise.covariance();
        let density = if across_only {
            let normal = across_epipolar(&jacobian);
            let variance = (normal.transpose() * s * normal)[(0, 0)];
            let d = normal.dot(&innovation);
            (-0.5 * d * d / variance).exp() / (2.0 * PI * variance).sqrt()
        } else {
            gaussian_2d(&innovation, &s)
        };
        ((1.0 - self.outlier_share) * density + wrong).ln()
    }

    fn printed(&self, m: &Prepared) -> f64 {
        let camera = &self.placed;
        if m.scoring == Scoring::AcrossEpipolar {
            return -0.5 * self.epipolar_distances(m);
        }
        let ray = m.geometry.ray(&m.mean);
        let (Some(predicted), Some(jacobian)) = (
            ray.project(self.pinhole, camera),
            m.geometry.parameter_jacobian(self.pinhole, camera, &m.mean),
        ) else {
            return -0.5 * PAPER_INNOVATION_CLIP;
        };
        let innovation = m.pixel - predicted;
        let s = projected_covariance(&jacobian, &m.covariance)
            + Matrix2::identity() * PAPER_VARIANCE_FLOOR_PX2;
        let squared = mahalanobis_2d(&innovation, &s);
        -0.5 * squared.min(PAPER_INNOVATION_CLIP)
    }

    /// dist(I_j, H_fj) + dist(I_fj, H_j) of Eq. 30, pixels; zero without baseline,
    /// where no epipolar line exists.
    fn epipolar_distances(&self, m: &Prepared) -> f64 {
        let camera = &self.placed;
        let ray = m.geometry.ray(&m.mean);
        let homogeneous = |n: Vector3<f64>| {
            Vector3::new(
                self.pinhole.fx * n.x + self.pinhole.cx * n.z,
                self.pinhole.fy * n.y + self.pinhole.cy * n.z,
                n.z,
            )
        };
        let distance = |line: Vector3<f64>, p: &Vector2<f64>| {
            let norm = line.x.hypot(line.y);
            if norm < 1e-12 {
                0.0
            } else {
                (line.x * p.x + line.y * p.y + line.z).abs() / norm
            }
        };
        let baseline = ray.origin - camera.centre;
        let here = homogeneous(camera.camera_from_world * ray.base)
            .cross(&homogeneous(camera.camera_from_world * baseline));
        let n = self.pinhole.normalize(&m.pixel);
        let seen = camera
            .camera_from_world
            .tr_mul(&Vector3::new(n.x, n.y, 1.0));
        let to_anchor = m
            .geometry
            .anchor()
            .map_or_else(Matrix3::identity, |anchor| anchor.camera_from_world);
        let there = homogeneous(to_anchor * seen).cross(&homogeneous(to_anchor * -baseline));
        let first = Vector2::new(
            self.pinhole.fx * m.mean.x + self.pinhole.cx,
            self.pinhole.fy * m.mean.y + self.pinhole.cy,
        );
        distance(here, &m.pixel) + distance(there, &first)
    }
}

/// Density of N(0, s) at `d`; zero for a covariance that is not positive.
#[must_use]
pub(crate) fn gaussian_2d(d: &Vector2<f64>, s: &Matrix2<f64>) -> f64 {
    let det = s.determinant();
    if det <= 0.0 {
        return 0.0;
    }
    (-0.5 * mahalanobis_2d(d, s)).exp() / (2.0 * PI * det.sqrt())
}

/// d^T s^-1 d, in closed form.
#[must_use]
pub(crate) fn mahalanobis_2d(d: &Vector2<f64>, s: &Matrix2<f64>) -> f64 {
    let det = s.determinant();
    (s[(1, 1)] * d.x * d.x - 2.0 * s[(0, 1)] * d.x * d.y + s[(0, 0)] * d.y * d.y) / det
}
