//! The update of one landmark by one measurement: the unscented update of Eq. 14-16 in the right form, with R inside
//! S, iterated at the posterior while the depth is open.
//!
//! Iterated posterior linearisation (Garcia-Fernandez, Svensson, Morelande,
//! Särkkä 2015): the moments of h under the linearisation Gaussian (m_i, P_i)
//! give H = P_xz^T P_i^-1 and Omega = P_zz - H P_i H^T; the prior (m, P) is then
//! updated with z = z_i + H (x - m_i) + N(0, Omega + R), and the result is the
//! next place to linearise. One iteration from (m, P) is the plain UKF.
//! The printed gain of Eq. 16 multiplies a 3x3 by a 2x2 and is not used.

use mono_geometry::Pinhole;
use mono_geometry::inverse_depth::LandmarkView;
use nalgebra::{Matrix3, Matrix3x2, Vector2, Vector3};

use super::landmark::Landmark;
use super::landmark_moments::{AxisPoints, Lower3, pixel_moments};
use super::pixel_noise::PixelNoise;

/// Gate on the normalised innovation squared, which one in 10 000 good measurements exceeds (2 degrees of freedom).
const GATE: f64 = 18.4;
/// Number of linearisations while the depth is open.
const OPEN_ITERATIONS: usize = 4;
/// Ratio sigma_rho / rho above which the depth counts as open in the update.
const OPEN_DEPTH: f64 = 0.15;
/// Share of the inverse depth, and of its prior, that the first linearisation
/// of an open depth spans.
const START_SPREAD: f64 = 0.1;
const START_FLOOR: f64 = 0.01;
/// The depth prior is this much wider in the first update than in the search
/// for the second sighting: a search must be bounded, an estimate must not be
/// pulled. With the search's own width the world shrinks by one to three per cent.
const PRIOR_WIDENING: f64 = 8.0;

/// The Kalman filter of a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LandmarkUpdate<'a> {
    /// Ideal pinhole.
    pub(crate) pinhole: &'a Pinhole,
    /// Sigma points over the three parameters.
    pub(crate) points: AxisPoints,
}

impl LandmarkUpdate<'_> {
    /// The landmark after the first measurement that can tell its depth.
    #[must_use]
    pub(crate) fn first(
        &self,
        view: &LandmarkView,
        prototype: &Landmark,
        pixel: &Vector2<f64>,
        noise: &PixelNoise,
    ) -> Option<Landmark> {
        let mut wide = *prototype;
        wide.covariance[(2, 2)] *= PRIOR_WIDENING * PRIOR_WIDENING;
        self.update(view, &wide, pixel, noise)
    }

    /// The landmark after one measurement in the camera of `view`; `None` when a sigma point is not
    /// visible, the gate rejects it or its covariance lost positive definiteness.
    #[must_use]
    pub(crate) fn update(
        &self,
        view: &LandmarkView,
        landmark: &Landmark,
        pixel: &Vector2<f64>,
        noise: &PixelNoise,
    ) -> Option<Landmark> {
        let (mean, covariance) = (landmark.mean, landmark.covariance);
        let noise = noise.covariance();
        let (mut about, mut lower, iterations);
        if landmark.depth_openness() > OPEN_DEPTH {
            let (start, diagonal) = self.start(view, landmark, pixel);
            about = start;
            lower = Lower3::of(&Matrix3::from_diagonal(&diagonal))?;
            iterations = OPEN_ITERATIONS;
        } else {
            about = mean;
            lower = Lower3::of(&covariance)?;
            iterations = 1;
        }
        let mut updated = covariance;
        let mut nis = 0.0;
        for _ in 0..iterations {
            let moments = pixel_moments(&self.points, self.pinhole, view, &about, &lower)?;
            let cross: Matrix3x2<f64> = covariance * moments.slope.transpose();
            let of_prior = moments.slope * cross;
            let (a, b, c) = (
                of_prior[(0, 0)] + moments.rest[(0, 0)] + noise[(0, 0)],
                of_prior[(1, 0)] + moments.rest[(1, 0)] + noise[(1, 0)],
                of_prior[(1, 1)] + moments.rest[(1, 1)] + noise[(1, 1)],
            );
            let determinant = a * c - b * b;
            let definite = a > 0.0 && determinant > 0.0;
            if !definite {
                return None;
            }
            let inverse = 1.0 / determinant;
            let gain = Matrix3x2::from_columns(&[
                (cross.column(0) * c - cross.column(1) * b) * inverse,
                (cross.column(1) * a - cross.column(0) * b) * inverse,
            ]);
            let innovation = pixel - moments.mean - moments.slope * (mean - about);
            // P - K S K^T, with K S = P_xz.
            for j in 0..3 {
                for i in j..3 {
                    let taken = gain[(i, 0)] * cross[(j, 0)] + gain[(i, 1)] * cross[(j, 1)];
                    updated[(i, j)] = covariance[(i, j)] - taken;
                    updated[(j, i)] = updated[(i, j)];
                }
            }
            lower = Lower3::of(&updated)?;
            about = mean + gain * innovation;
            let (e, f) = (innovation.x, innovation.y);
            nis = (c * e * e - 2.0 * b * e * f + a * f * f) * inverse;
        }
        (nis <= GATE).then_some(Landmark {
            mean: about,
            covariance: updated,
            ..*landmark
        })
    }

    /// The Gaussian at which an open depth is linearised first, mean and variances: at the depth that the pixel shows, and
    /// so narrow that no sigma point lies behind the camera.
    fn start(
        &self,
        view: &LandmarkView,
        landmark: &Landmark,
        pixel: &Vector2<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let highest = landmark.mean.z + 4.0 * landmark.covariance[(2, 2)].sqrt();
        let mean = view.refocus(self.pinhole, &landmark.mean, pixel, highest);
        let spread = (START_SPREAD * mean.z).max(START_FLOOR * highest);
        let mut diagonal = landmark.covariance.diagonal();
        diagonal.z = diagonal.z.min(spread * spread);
        (mean, diagonal)
    }
}
