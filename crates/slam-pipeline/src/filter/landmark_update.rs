//! The update of one landmark by one measurement: the unscented update of Eq. 14-16 in the right form, with R inside
//! S, iterated at the posterior while the depth is open.
//!
//! Iterated posterior linearisation (Garcia-Fernandez, Svensson, Morelande,
//! Särkkä 2015): the moments of h under the linearisation Gaussian (m_i, P_i)
//! give H = P_xz^T P_i^-1 and Omega = P_zz - H P_i H^T; the prior (m, P) is then
//! updated with z = z_i + H (x - m_i) + N(0, Omega + R), and the result is the
//! next place to linearise. One iteration from (m, P) is the plain UKF.
//! The printed gain of Eq. 16 multiplies a 3x3 by a 2x2 and is not used.

use mono_geometry::inverse_depth::LandmarkGeometry;
use mono_geometry::{Pinhole, PlacedCamera};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use ukf::{SigmaPoints, unscented_transform};

use super::landmark::Landmark;

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
    pub(crate) points: SigmaPoints<3>,
}

impl LandmarkUpdate<'_> {
    /// The landmark after the first measurement that can tell its depth.
    #[must_use]
    pub(crate) fn first(
        &self,
        camera: &PlacedCamera,
        geometry: &LandmarkGeometry,
        prototype: &Landmark,
        pixel: &Vector2<f64>,
        variance_px2: f64,
    ) -> Option<Landmark> {
        let mut wide = *prototype;
        wide.covariance[(2, 2)] *= PRIOR_WIDENING * PRIOR_WIDENING;
        self.update(camera, geometry, &wide, pixel, variance_px2)
    }

    /// The landmark after one measurement; `None` when a sigma point is not
    /// visible, the gate rejects it or its covariance lost positive definiteness.
    #[must_use]
    pub(crate) fn update(
        &self,
        camera: &PlacedCamera,
        geometry: &LandmarkGeometry,
        landmark: &Landmark,
        pixel: &Vector2<f64>,
        variance_px2: f64,
    ) -> Option<Landmark> {
        let (mean, covariance) = (landmark.mean, landmark.covariance);
        let mut about = (mean, covariance);
        let mut iterations = 1;
        if landmark.depth_openness() > OPEN_DEPTH {
            iterations = OPEN_ITERATIONS;
            about = self.start(camera, geometry, landmark, pixel);
        }
        let noise = Matrix2::identity() * variance_px2;
        let mut nis = 0.0;
        for _ in 0..iterations {
            let moments = unscented_transform(&about.0, &about.1, &self.points, |m| {
                geometry
                    .ray(m)
                    .project(self.pinhole, camera)
                    .unwrap_or(Vector2::from_element(f64::NAN))
            })
            .ok()?;
            let slope_transposed = about.1.cholesky()?.solve(&moments.cross_covariance);
            let linear = slope_transposed.tr_mul(&moments.cross_covariance);
            let cross = covariance * slope_transposed;
            let innovation_covariance =
                slope_transposed.tr_mul(&cross) + (moments.covariance - linear) + noise;
            let factor = innovation_covariance.cholesky()?;
            let innovation = pixel - moments.mean - slope_transposed.tr_mul(&(mean - about.0));
            let gain = factor.solve(&cross.transpose()).transpose();
            let updated = covariance - gain * innovation_covariance * gain.transpose();
            let updated = (updated + updated.transpose()) * 0.5;
            updated.cholesky()?;
            about = (mean + gain * innovation, updated);
            nis = innovation.dot(&factor.solve(&innovation));
        }
        (nis <= GATE).then_some(Landmark {
            mean: about.0,
            covariance: about.1,
            ..*landmark
        })
    }

    /// The Gaussian at which an open depth is linearised first: at the depth that the pixel shows, and so narrow that no
    /// sigma point lies behind the camera.
    fn start(
        &self,
        camera: &PlacedCamera,
        geometry: &LandmarkGeometry,
        landmark: &Landmark,
        pixel: &Vector2<f64>,
    ) -> (Vector3<f64>, Matrix3<f64>) {
        let highest = landmark.mean.z + 4.0 * landmark.covariance[(2, 2)].sqrt();
        let mean = geometry.refocus(self.pinhole, camera, &landmark.mean, pixel, highest);
        let spread = (START_SPREAD * mean.z).max(START_FLOOR * highest);
        let mut diagonal = landmark.covariance.diagonal();
        diagonal.z = diagonal.z.min(spread * spread);
        (mean, Matrix3::from_diagonal(&diagonal))
    }
}
