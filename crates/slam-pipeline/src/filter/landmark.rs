//! A landmark as one particle knows it: a Gaussian over three numbers.
//!
//! - Anchored inverse depth (Civera, Davison, Montiel 2008): (alpha, beta, rho)
//!   in the camera that first saw it. The anchor is a pose of the particle's
//!   own path, which an RBPF knows exactly, so three numbers are enough.
//! - Point (the paper's form): (X, Y, Z) in the particle's world.
//!
//! Both give the direction from a camera centre c to the landmark up to a
//! positive factor, linear in the last parameter:
//! `R_a (alpha, beta, 1) + rho (c_a - c)` and `X - c`.
//! A point at infinity (rho = 0) is ordinary in the first form.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

use super::pose::PlacedCamera;

/// How the three numbers of a landmark are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Parametrisation {
    /// (alpha, beta, rho) in the camera of this keyframe of the particle's path.
    InverseDepth {
        /// Keyframe index of the anchor.
        anchor: u32,
    },
    /// (X, Y, Z) in the particle's world.
    Point,
}

/// Gaussian estimate of one landmark in one particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Landmark {
    /// How `mean` is read.
    pub(crate) parametrisation: Parametrisation,
    /// Mean of the three numbers.
    pub(crate) mean: Vector3<f64>,
    /// Covariance of the three numbers.
    pub(crate) covariance: Matrix3<f64>,
}

/// A point in the world with its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PointEstimate {
    /// Position.
    pub(crate) position: Vector3<f64>,
    /// Covariance of the position.
    pub(crate) covariance: Matrix3<f64>,
}

/// Gaussian prior of the inverse depth of a landmark that was seen once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InverseDepthPrior {
    /// Mean, one over the particle's unit.
    pub(crate) mean: f64,
    /// Standard deviation.
    pub(crate) sigma: f64,
}

impl InverseDepthPrior {
    /// The prior whose two-sigma interval is (0, 1 / `min_depth`).
    #[must_use]
    pub(crate) fn beyond(min_depth: f64) -> Self {
        let mean = 0.5 / min_depth;
        Self {
            mean,
            sigma: 0.5 * mean,
        }
    }
}

/// The linear form behind a landmark: direction from a centre `c` is
/// `base + rate (origin - c)` with `base = basis * (a, b, w)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LandmarkGeometry {
    anchor_from_world: Matrix3<f64>,
    anchor_centre: Vector3<f64>,
    inverse_depth: bool,
}

impl LandmarkGeometry {
    /// Geometry of a landmark anchored in `anchor`, or of a point when `None`.
    #[must_use]
    pub(crate) fn new(anchor: Option<&PlacedCamera>) -> Self {
        match anchor {
            Some(a) => Self {
                anchor_from_world: a.camera_from_world,
                anchor_centre: a.centre,
                inverse_depth: true,
            },
            None => Self {
                anchor_from_world: Matrix3::identity(),
                anchor_centre: Vector3::zeros(),
                inverse_depth: false,
            },
        }
    }

    /// Whether the third parameter is an inverse depth.
    #[must_use]
    pub(crate) fn is_inverse_depth(&self) -> bool {
        self.inverse_depth
    }

    /// Rotation from world to anchor axes; the identity for a point.
    #[must_use]
    pub(crate) fn anchor_rotation(&self) -> &Matrix3<f64> {
        &self.anchor_from_world
    }

    /// The ray `(base, rate, origin)` of parameters `m`.
    #[must_use]
    pub(crate) fn ray(&self, m: &Vector3<f64>) -> Ray {
        if self.inverse_depth {
            Ray {
                base: self.anchor_from_world.tr_mul(&Vector3::new(m.x, m.y, 1.0)),
                rate: m.z,
                origin: self.anchor_centre,
            }
        } else {
            Ray {
                base: Vector3::zeros(),
                rate: 1.0,
                origin: *m,
            }
        }
    }
}

/// Direction to a landmark from any centre `c`: `base + rate (origin - c)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    /// Constant part, world axes.
    pub(crate) base: Vector3<f64>,
    /// Factor of the baseline.
    pub(crate) rate: f64,
    /// Centre the baseline is counted from.
    pub(crate) origin: Vector3<f64>,
}

/// Ideal pinhole in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lens {
    /// Focal lengths in pixels.
    pub(crate) focal: Vector2<f64>,
    /// Principal point in pixels.
    pub(crate) centre: Vector2<f64>,
}

impl Lens {
    /// Projects a ray into `camera`; `None` behind it or at its horizon.
    #[must_use]
    #[inline]
    pub(crate) fn project(&self, camera: &PlacedCamera, ray: &Ray) -> Option<Vector2<f64>> {
        let direction = ray.base + (ray.origin - camera.centre) * ray.rate;
        let q = camera.camera_from_world * direction;
        // A direction nearly in the image plane projects thousands of pixels away.
        if q.z <= 1e-3 * direction.amax() {
            return None;
        }
        Some(Vector2::new(
            self.focal.x * q.x / q.z + self.centre.x,
            self.focal.y * q.y / q.z + self.centre.y,
        ))
    }

    /// Jacobian of the pixel with respect to the three parameters.
    ///
    /// `None` behind the camera. Source: quotient rule on the ray form above.
    #[must_use]
    pub(crate) fn parameter_jacobian(
        &self,
        camera: &PlacedCamera,
        geometry: &LandmarkGeometry,
        mean: &Vector3<f64>,
    ) -> Option<Matrix2x3<f64>> {
        let ray = geometry.ray(mean);
        let direction = ray.base + (ray.origin - camera.centre) * ray.rate;
        let q = camera.camera_from_world * direction;
        if q.z <= 1e-3 * direction.amax() {
            return None;
        }
        let iz = 1.0 / q.z;
        let pixel_from_q = Matrix2x3::new(
            self.focal.x * iz,
            0.0,
            -self.focal.x * q.x * iz * iz,
            0.0,
            self.focal.y * iz,
            -self.focal.y * q.y * iz * iz,
        );
        let q_from_parameters = if geometry.inverse_depth {
            let camera_from_anchor =
                camera.camera_from_world * geometry.anchor_from_world.transpose();
            let baseline = camera.camera_from_world * (geometry.anchor_centre - camera.centre);
            Matrix3::from_columns(&[
                camera_from_anchor.column(0).into_owned(),
                camera_from_anchor.column(1).into_owned(),
                baseline,
            ])
        } else {
            camera.camera_from_world
        };
        Some(pixel_from_q * q_from_parameters)
    }

    /// `mean` with the inverse depth at which the landmark projects nearest to
    /// `pixel` along its epipolar line, kept within [0, `highest`].
    ///
    /// A slope taken at the prior depth is wrong by the distance along the line
    /// times its rotation; an open depth is linearised where it was seen.
    /// With q(rho) = b + rho t, e along the line and s = e^T (z - c):
    /// rho = (s b_z - e^T f b) / (e^T f t - s t_z). A point is returned as it is.
    #[must_use]
    pub(crate) fn refocus(
        &self,
        camera: &PlacedCamera,
        geometry: &LandmarkGeometry,
        mean: &Vector3<f64>,
        pixel: &Vector2<f64>,
        highest: f64,
    ) -> Vector3<f64> {
        if !geometry.inverse_depth {
            return *mean;
        }
        let Some(jacobian) = self.parameter_jacobian(camera, geometry, mean) else {
            return *mean;
        };
        let along = jacobian.column(2).into_owned();
        if along.norm_squared() < 1e-18 {
            return *mean;
        }
        let ray = geometry.ray(mean);
        let b = camera.camera_from_world * ray.base;
        let t = camera.camera_from_world * (ray.origin - camera.centre);
        let weighted = along.component_mul(&self.focal);
        let s = along.dot(&(pixel - self.centre));
        let denominator = weighted.dot(&t.xy()) - s * t.z;
        let rho = (s * b.z - weighted.dot(&b.xy())) / denominator;
        if !rho.is_finite() {
            return *mean;
        }
        let highest = highest.max(0.0);
        let at = |rho: f64| Vector3::new(mean.x, mean.y, rho);
        let seen = |m: &Vector3<f64>| self.project(camera, &geometry.ray(m));
        if (0.0..=highest).contains(&rho) && seen(&at(rho)).is_some() {
            return at(rho);
        }
        // Beyond an end of the line the nearest is an end, but not always that of the
        // nearer rho: past the epipole rho comes round from the other side of infinity.
        [at(0.0), at(highest)]
            .into_iter()
            .filter_map(|m| Some(((seen(&m)? - pixel).norm_squared(), m)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            // Never behind the camera.
            .map_or(*mean, |(_, m)| m)
    }

    /// Normalised image coordinates of a pixel.
    #[must_use]
    pub(crate) fn normalise(&self, pixel: &Vector2<f64>) -> Vector2<f64> {
        (pixel - self.centre).component_div(&self.focal)
    }
}

impl Landmark {
    /// A landmark of unknown depth, seen at `pixel` in keyframe `anchor` with pixel noise `sigma_px`.
    #[must_use]
    pub(crate) fn from_first_sighting(
        lens: &Lens,
        anchor: u32,
        pixel: &Vector2<f64>,
        sigma_px: f64,
        depth: InverseDepthPrior,
    ) -> Self {
        let n = lens.normalise(pixel);
        let (sx, sy) = (sigma_px / lens.focal.x, sigma_px / lens.focal.y);
        Self {
            parametrisation: Parametrisation::InverseDepth { anchor },
            mean: Vector3::new(n.x, n.y, depth.mean),
            covariance: Matrix3::from_diagonal(&Vector3::new(
                sx * sx,
                sy * sy,
                depth.sigma * depth.sigma,
            )),
        }
    }

    /// The same landmark with its unknown depth beyond what the camera has
    /// driven towards it since the anchor: seen again, it was not passed.
    ///
    /// Only for a landmark whose depth was never measured. The prior of inverse
    /// depth keeps its shape (mean two sigmas above zero).
    #[must_use]
    pub(crate) fn in_front_of(&self, geometry: &LandmarkGeometry, centre: &Vector3<f64>) -> Self {
        /// Share of the prior mean depth the camera may have driven.
        const REACH: f64 = 0.3;
        let forward = (geometry.anchor_from_world * (centre - geometry.anchor_centre)).z;
        let mut landmark = *self;
        if forward > 0.0 && landmark.mean.z * forward > REACH {
            let shrink = REACH / (forward * landmark.mean.z);
            landmark.mean.z *= shrink;
            landmark.covariance[(2, 2)] *= shrink * shrink;
        }
        landmark
    }

    /// Keyframe of the anchor; `None` for a point.
    #[must_use]
    pub(crate) fn anchor(&self) -> Option<u32> {
        match self.parametrisation {
            Parametrisation::InverseDepth { anchor } => Some(anchor),
            Parametrisation::Point => None,
        }
    }

    /// sigma_rho / rho for an inverse-depth landmark, zero for a point:
    /// how open its depth still is.
    #[must_use]
    pub(crate) fn depth_openness(&self) -> f64 {
        match self.parametrisation {
            Parametrisation::InverseDepth { .. } => {
                self.covariance[(2, 2)].sqrt() / self.mean.z.abs().max(1e-12)
            }
            Parametrisation::Point => 0.0,
        }
    }

    /// World point and its covariance by first-order propagation, in the
    /// particle's length unit; `None` when the depth is not positive.
    #[must_use]
    pub(crate) fn to_point(&self, anchor: Option<&PlacedCamera>) -> Option<PointEstimate> {
        match (self.parametrisation, anchor) {
            (Parametrisation::Point, _) => Some(PointEstimate {
                position: self.mean,
                covariance: self.covariance,
            }),
            (Parametrisation::InverseDepth { .. }, Some(a)) => {
                let rho = self.mean.z;
                if rho <= 0.0 {
                    return None;
                }
                let world_from_anchor = a.camera_from_world.transpose();
                let m = Vector3::new(self.mean.x, self.mean.y, 1.0);
                let jacobian = world_from_anchor
                    * Matrix3::from_columns(&[
                        Vector3::x() / rho,
                        Vector3::y() / rho,
                        -m / (rho * rho),
                    ]);
                Some(PointEstimate {
                    position: a.centre + world_from_anchor * m / rho,
                    covariance: jacobian * self.covariance * jacobian.transpose(),
                })
            }
            (Parametrisation::InverseDepth { .. }, None) => None,
        }
    }
}

/// Pixel covariance that the landmark's own uncertainty causes: J Sigma J^T.
#[must_use]
pub(crate) fn projected_covariance(
    jacobian: &Matrix2x3<f64>,
    covariance: &Matrix3<f64>,
) -> Matrix2<f64> {
    jacobian * covariance * jacobian.transpose()
}
