//! A landmark of which only bearings are measured: its start without depth, its updates, and the point it becomes.
//!
//! One bearing says nothing of the distance, so a Gaussian over the position cannot begin a landmark: it would have to reach from
//! the sensor to infinity. A Gaussian over the *inverse* distance can. The landmark is (beta, rho) at an anchor, the place from which it
//! was first seen (Montiel, Civera, Davison 2006, in the plane):
//!
//! ```text
//! m = a + (cos beta, sin beta) / rho
//! d = rho (a - p) + (cos beta, sin beta),   h = atan2(d_y, d_x) - phi       seen from (p, phi)
//! ```
//!
//! d has the direction of m - p and no division, so a landmark at infinity (rho = 0) is an ordinary one, and h is nearly linear in
//! (beta, rho) where it is far from linear in m. The first rho is 1 / (2 d_min) with half of that as standard deviation: two of them
//! reach from infinity to the nearest distance d_min.
//!
//! The anchor is exact, because a particle knows its path. When the parallax has fixed the distance, the landmark becomes a point
//! ([`BearingLandmark::point`]): when the standard deviation of the distance bends the next bearings by little (the linearity index
//! of Civera, Davison, Montiel 2008 below 0.1).
//!
//! For a camera in space with its lens, `mono_geometry::inverse_depth` does the same in three dimensions.

use std::f64::consts::TAU;

use estimation_base::{Se2, wrap};

use crate::error::RbpfError;

/// Largest linearity index of a landmark that becomes a point.
const LINEARITY: f64 = 0.1;

/// A landmark in the plane by bearing and inverse distance from where it was first seen.
///
/// ```
/// use estimation_base::Se2;
/// use rbpf_core::BearingLandmark;
///
/// // Something ahead to the left, at least 1 m away; the robot then drives 2 m and sees it abeam.
/// let mut landmark = BearingLandmark::first_seen(&Se2::new(0.0, 0.0, 0.0), 0.785, 0.01, 1.0)?;
/// assert!(landmark.point(&Se2::new(0.0, 0.0, 0.0)).is_none());
/// for k in 1..=20 {
///     let x = 0.1 * f64::from(k);
///     let bearing = 2.0_f64.atan2(2.0 - x);
///     landmark.update(&Se2::new(x, 0.0, 0.0), bearing, 0.01)?;
/// }
/// let point = landmark.point(&Se2::new(2.0, 0.0, 0.0)).ok_or("seen from all sides")?;
/// assert!((point.position[0] - 2.0).hypot(point.position[1] - 2.0) < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingLandmark {
    anchor: [f64; 2],
    /// World bearing (radians) and inverse distance (1/m) from the anchor.
    mean: [f64; 2],
    covariance: [[f64; 2]; 2],
}

/// A point in the plane with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarPoint {
    /// x and y, metres.
    pub position: [f64; 2],
    /// Covariance, metres squared, symmetric.
    pub covariance: [[f64; 2]; 2],
}

impl BearingLandmark {
    /// A landmark seen for the first time from `world_from_body` at `bearing` (from the heading, counterclockwise), no nearer than
    /// `nearest_m`.
    ///
    /// # Errors
    /// [`RbpfError::InvalidSetting`] for a standard deviation or a distance that is not above zero, [`RbpfError::NotFinite`] for a
    /// pose or bearing with NaN or infinity.
    pub fn first_seen(
        world_from_body: &Se2,
        bearing: f64,
        sigma_rad: f64,
        nearest_m: f64,
    ) -> Result<Self, RbpfError> {
        check_sigma(sigma_rad)?;
        if !(nearest_m > 0.0 && (1.0 / nearest_m).is_finite() && nearest_m.is_finite()) {
            return Err(RbpfError::InvalidSetting {
                what: "the nearest distance of a landmark must be finite and above 0 m",
                value: nearest_m,
            });
        }
        check_finite(world_from_body, bearing)?;
        let inverse = 0.5 / nearest_m;
        Ok(Self {
            anchor: [world_from_body.x, world_from_body.y],
            mean: [wrap(world_from_body.phi + bearing), inverse],
            covariance: [
                [sigma_rad * sigma_rad, 0.0],
                [0.0, 0.25 * inverse * inverse],
            ],
        })
    }

    /// The bearing at which the landmark is expected and its variance without noise; `None` at the landmark itself. O(1).
    #[must_use]
    pub fn expected(&self, world_from_body: &Se2) -> Option<(f64, f64)> {
        let (bearing, slope) = self.linearised(world_from_body)?;
        let spread = self.times_covariance(slope);
        Some((bearing, slope[0] * spread[0] + slope[1] * spread[1]))
    }

    /// Takes in a bearing and returns its log likelihood, the increment of a particle's log weight; `None`, with nothing changed,
    /// at the landmark itself. O(1).
    ///
    /// # Errors
    /// As [`Self::first_seen`]; the landmark is then unchanged.
    pub fn update(
        &mut self,
        world_from_body: &Se2,
        bearing: f64,
        sigma_rad: f64,
    ) -> Result<Option<f64>, RbpfError> {
        check_sigma(sigma_rad)?;
        check_finite(world_from_body, bearing)?;
        let Some((expected, slope)) = self.linearised(world_from_body) else {
            return Ok(None);
        };
        let noise = sigma_rad * sigma_rad;
        let spread = self.times_covariance(slope);
        let variance = slope[0] * spread[0] + slope[1] * spread[1] + noise;
        let residual = wrap(bearing - expected);
        let gain = [spread[0] / variance, spread[1] / variance];
        // (I - K H) P (I - K H)^T + K R K^T: positive definite whatever the rounding.
        let keep = [
            [1.0 - gain[0] * slope[0], -gain[0] * slope[1]],
            [-gain[1] * slope[0], 1.0 - gain[1] * slope[1]],
        ];
        let mut updated = product(&product(&keep, &self.covariance), &transposed(&keep));
        for row in 0..2 {
            for column in 0..2 {
                updated[row][column] += noise * gain[row] * gain[column];
            }
        }
        let off_diagonal = 0.5 * (updated[0][1] + updated[1][0]);
        (updated[0][1], updated[1][0]) = (off_diagonal, off_diagonal);
        self.mean = [
            wrap(self.mean[0] + gain[0] * residual),
            self.mean[1] + gain[1] * residual,
        ];
        self.covariance = updated;
        Ok(Some(
            -0.5 * (residual * residual / variance + (TAU * variance).ln()),
        ))
    }

    /// The landmark as a point with covariance, once that is an honest description from `world_from_body`; `None` before.
    ///
    /// The linearity index is 4 (sigma_d / d) |cos alpha|, sigma_d the standard deviation of the distance from the anchor, d the
    /// distance from here, alpha the parallax between the two. O(1).
    #[must_use]
    pub fn point(&self, world_from_body: &Se2) -> Option<PlanarPoint> {
        let [beta, rho] = self.mean;
        let sigma_rho = self.covariance[1][1].sqrt();
        if rho <= 0.0 {
            return None;
        }
        let (sine, cosine) = beta.sin_cos();
        let position = [self.anchor[0] + cosine / rho, self.anchor[1] + sine / rho];
        let from_here = [
            position[0] - world_from_body.x,
            position[1] - world_from_body.y,
        ];
        let distance = from_here[0].hypot(from_here[1]);
        let parallax = (from_here[0] * cosine + from_here[1] * sine) / distance;
        let index = 4.0 * sigma_rho / (rho * rho) / distance * parallax.abs();
        // NaN at the landmark itself.
        if index.is_nan() || index >= LINEARITY {
            return None;
        }
        let jacobian = [
            [-sine / rho, -cosine / (rho * rho)],
            [cosine / rho, -sine / (rho * rho)],
        ];
        Some(PlanarPoint {
            position,
            covariance: product(
                &product(&jacobian, &self.covariance),
                &transposed(&jacobian),
            ),
        })
    }

    /// World bearing from the anchor (radians) and inverse distance (1/m).
    #[must_use]
    pub const fn mean(&self) -> [f64; 2] {
        self.mean
    }

    /// Covariance of [`Self::mean`].
    #[must_use]
    pub const fn covariance(&self) -> [[f64; 2]; 2] {
        self.covariance
    }

    /// The expected bearing and its derivative by (beta, rho).
    fn linearised(&self, world_from_body: &Se2) -> Option<(f64, [f64; 2])> {
        let [beta, rho] = self.mean;
        let (sine, cosine) = beta.sin_cos();
        let back = [
            self.anchor[0] - world_from_body.x,
            self.anchor[1] - world_from_body.y,
        ];
        let d = [rho * back[0] + cosine, rho * back[1] + sine];
        let square = d[0] * d[0] + d[1] * d[1];
        if !(square > f64::EPSILON && square.is_finite()) {
            return None;
        }
        let by_d = [-d[1] / square, d[0] / square];
        let slope = [
            by_d[1] * cosine - by_d[0] * sine,
            by_d[0] * back[0] + by_d[1] * back[1],
        ];
        Some((wrap(d[1].atan2(d[0]) - world_from_body.phi), slope))
    }

    fn times_covariance(&self, vector: [f64; 2]) -> [f64; 2] {
        let row = |k: usize| self.covariance[k][0] * vector[0] + self.covariance[k][1] * vector[1];
        [row(0), row(1)]
    }
}

fn check_sigma(sigma_rad: f64) -> Result<(), RbpfError> {
    if sigma_rad > 0.0 && sigma_rad.is_finite() {
        Ok(())
    } else {
        Err(RbpfError::InvalidSetting {
            what: "the standard deviation of a bearing must be finite and above 0 rad",
            value: sigma_rad,
        })
    }
}

fn check_finite(pose: &Se2, bearing: f64) -> Result<(), RbpfError> {
    let all = [pose.x, pose.y, pose.phi, bearing];
    if all.iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(RbpfError::NotFinite {
            what: "pose or bearing",
        })
    }
}

fn product(a: &[[f64; 2]; 2], b: &[[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let entry = |row: usize, column: usize| a[row][0] * b[0][column] + a[row][1] * b[1][column];
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

fn transposed(a: &[[f64; 2]; 2]) -> [[f64; 2]; 2] {
    [[a[0][0], a[1][0]], [a[0][1], a[1][1]]]
}
