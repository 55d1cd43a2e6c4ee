//! The pose update: all matches of a frame in information form, linearised
//! statistically by sigma points and iterated at the posterior (Eq. 7-12 made
//! right; iterated posterior linearisation, Garcia-Fernandez et al. 2015).
//!
//! With P = A A^T and x = x0 + A xi the prior of xi is N(0, I). Sigma points
//! x_i +- sqrt(L + lambda) a_j give each 2-D measurement as
//! z = z_mean + D xi' + e. Given pose and map the measurements are independent,
//! so Lambda = I + sum B^T D^T R^-1 D B is linear in their number; R holds the
//! pixel noise, the projected landmark covariance and the linearisation error.
//! A match far from its prediction is down-weighted (Huber) in the proposal
//! only; the importance weight makes up for it.

use estimation_base::Manifold;
use mono_geometry::inverse_depth::HORIZON;
use mono_geometry::{Pinhole, PlacedCamera};
use nalgebra::{Matrix2, SMatrix, Vector2, Vector3};

use super::landmark::projected_covariance;
use super::motion::MotionPrior;
use super::observation::{Prepared, Scoring};
use super::pose::{CameraPose, POSE_DIM, PoseMatrix, PoseStep};
use crate::rig::Rig;

/// Huber threshold in standard deviations: 95 % efficient for one coordinate
/// is 1.345; matches are gated before, so the bend sits further out.
const HUBER_SIGMAS: f64 = 2.5;

/// Gaussian posterior of the whitened pose xi.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PosePosterior {
    /// Mean in whitened coordinates of the prior.
    pub(crate) mean: PoseStep,
    /// Lower factor C of the covariance of xi: C C^T = Lambda^-1.
    pub(crate) factor: PoseMatrix,
    /// log of the product of the diagonal of `factor`.
    pub(crate) log_det_factor: f64,
}

impl PosePosterior {
    /// The prior itself.
    #[must_use]
    pub(crate) fn prior() -> Self {
        Self {
            mean: PoseStep::zeros(),
            factor: PoseMatrix::identity(),
            log_det_factor: 0.0,
        }
    }

    /// The pose of the mean.
    #[must_use]
    pub(crate) fn mean_pose(&self, prior: &MotionPrior) -> CameraPose {
        prior.mean.retract(&(prior.factor * self.mean))
    }

    /// Covariance of the pose tangent: A Lambda^-1 A^T.
    #[must_use]
    pub(crate) fn pose_covariance(&self, prior: &MotionPrior) -> PoseMatrix {
        let f = prior.factor * self.factor;
        f * f.transpose()
    }
}

/// Unscented spread for the pose: alpha 1, kappa 0, so the centre has no weight
/// and no weight is negative.
const SPREAD_SQUARED: f64 = POSE_DIM as f64;

/// Posterior of the pose given `matches`, after `iterations` linearisations.
///
/// Matches that a sigma point cannot see are left out. The cost is 13 projections and a rank-two update of a 6 x 6 matrix
/// for every match and iteration.
#[must_use]
pub(crate) fn pose_posterior(
    rig: &Rig,
    prior: &MotionPrior,
    matches: &[Option<Prepared>],
    iterations: usize,
) -> PosePosterior {
    let mut posterior = PosePosterior::prior();
    for iteration in 0..iterations {
        let linearisation = PoseLinearisation::new(rig, prior, &posterior);
        // xi' = C^-1 (xi - xi_i), so D xi' = D C^-1 xi - D C^-1 xi_i.
        let Some(inverse_factor) = posterior
            .factor
            .solve_lower_triangular(&PoseMatrix::identity())
        else {
            return posterior;
        };
        let offset = inverse_factor * posterior.mean;
        // Sums over the matches in the coordinates linearised about, turned into those of the prior once.
        let mut information = PoseMatrix::zeros();
        let mut vector = PoseStep::zeros();
        for prepared in matches.iter().flatten() {
            let Some(line) = linearisation.linearise(prepared) else {
                continue;
            };
            let at_mean = prepared.pixel - line.mean;
            let residual = at_mean + line.slope * offset;
            match prepared.scoring {
                Scoring::Full => {
                    let Some(inverse) = line.inverse_noise() else {
                        continue;
                    };
                    let weight = huber(iteration, at_mean.dot(&(inverse * at_mean)));
                    let weighted = inverse * line.slope * weight;
                    information += line.slope.transpose() * weighted;
                    vector += weighted.transpose() * residual;
                }
                Scoring::AcrossEpipolar => {
                    let normal = line.across;
                    let variance = (normal.transpose() * line.noise * normal)[(0, 0)];
                    let along = normal.dot(&at_mean);
                    let weight = huber(iteration, along * along / variance) / variance;
                    let row = line.slope.tr_mul(&normal);
                    information += row * row.transpose() * weight;
                    vector += row * (weight * normal.dot(&residual));
                }
                Scoring::MapOnly => {}
            }
        }
        let information =
            PoseMatrix::identity() + inverse_factor.tr_mul(&(information * inverse_factor));
        let vector = inverse_factor.tr_mul(&vector);
        let Some(chol) = information.cholesky() else {
            return posterior;
        };
        // Lambda = G G^T, so Lambda^-1 = G^-T G^-1; its lower factor comes from
        // one more Cholesky of a well-conditioned 6 x 6.
        let covariance = chol.inverse();
        let Some(factor) = covariance.cholesky().map(|c| c.l()) else {
            return posterior;
        };
        posterior = PosePosterior {
            mean: chol.solve(&vector),
            factor,
            log_det_factor: factor.diagonal().iter().map(|d| d.ln()).sum(),
        };
    }
    posterior
}

fn huber(iteration: usize, squared: f64) -> f64 {
    // The first linearisation sees the whole prior error: nothing is far yet.
    if iteration == 0 || squared <= HUBER_SIGMAS * HUBER_SIGMAS {
        1.0
    } else {
        HUBER_SIGMAS / squared.sqrt()
    }
}

/// Statistical linearisation of one match: z = mean + slope xi' + N(0, noise).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// Mean of the measurement over the pose distribution.
    pub(crate) mean: Vector2<f64>,
    /// Slope in whitened coordinates of the distribution linearised about.
    pub(crate) slope: SMatrix<f64, 2, POSE_DIM>,
    /// Pixel noise, landmark covariance and linearisation error.
    pub(crate) noise: Matrix2<f64>,
    /// Unit normal of the epipolar line.
    pub(crate) across: Vector2<f64>,
}

impl Line {
    /// The inverse of the noise; `None` if it is not positive definite.
    #[inline]
    fn inverse_noise(&self) -> Option<Matrix2<f64>> {
        let (a, b, c) = (self.noise[(0, 0)], self.noise[(1, 0)], self.noise[(1, 1)]);
        let determinant = a * c - b * b;
        (a > 0.0 && determinant > 0.0).then(|| Matrix2::new(c, -b, -b, a) / determinant)
    }

    /// Innovation covariance under the distribution linearised about.
    #[must_use]
    pub(crate) fn innovation(&self) -> Matrix2<f64> {
        self.slope * self.slope.transpose() + self.noise
    }
}

/// Cameras of the sigma points: plus and minus each axis.
const SIGMA: usize = 2 * POSE_DIM;

/// The cameras of the sigma points of a pose distribution.
#[derive(Debug, Clone)]
pub(crate) struct PoseLinearisation {
    pinhole: Pinhole,
    mean: PlacedCamera,
    /// Entries of camera_from_world by rows, one lane a camera.
    rotation: [[f64; SIGMA]; 9],
    /// From the mean camera's centre to each one's, in the axes of that one.
    shift: [[f64; SIGMA]; 3],
}

impl PoseLinearisation {
    /// Sigma points of `posterior` under `prior`.
    #[must_use]
    pub(crate) fn new(rig: &Rig, prior: &MotionPrior, posterior: &PosePosterior) -> Self {
        let centre = posterior.mean_pose(prior);
        let mean = centre.place(rig);
        let spread = prior.factor * posterior.factor * SPREAD_SQUARED.sqrt();
        let (mut rotation, mut shift) = ([[0.0; SIGMA]; 9], [[0.0; SIGMA]; 3]);
        for lane in 0..SIGMA {
            let column = spread.column(lane % POSE_DIM).into_owned();
            let step = if lane < POSE_DIM { column } else { -column };
            let camera = centre.retract(&step).place(rig);
            let from_mean = camera.camera_from_world * (camera.centre - mean.centre);
            for row in 0..3 {
                shift[row][lane] = from_mean[row];
                for column in 0..3 {
                    rotation[3 * row + column][lane] = camera.camera_from_world[(row, column)];
                }
            }
        }
        Self {
            pinhole: *rig.pinhole(),
            mean,
            rotation,
            shift,
        }
    }

    /// The camera of the mean pose.
    #[must_use]
    pub(crate) fn mean_camera(&self) -> &PlacedCamera {
        &self.mean
    }

    /// How far the cameras of the sigma points are from the mean camera: the largest Frobenius norm of a difference of their
    /// rotations, and the largest distance between their centres.
    #[must_use]
    pub(crate) fn spread(&self) -> (f64, f64) {
        let (mut turned, mut moved) = (0.0_f64, 0.0_f64);
        for lane in 0..SIGMA {
            let mut squared = 0.0;
            for row in 0..3 {
                for column in 0..3 {
                    let mean = self.mean.camera_from_world[(row, column)];
                    squared += (self.rotation[3 * row + column][lane] - mean).powi(2);
                }
            }
            turned = turned.max(squared.sqrt());
            let [x, y, z] = [0, 1, 2].map(|row| self.shift[row][lane]);
            moved = moved.max(x.hypot(y).hypot(z));
        }
        (turned, moved)
    }

    /// Pixels without principal point of a direction seen from the sigma points, of which `rate` times the way is taken
    /// off; `None` unless all see it.
    #[inline]
    fn images(&self, direction: &Vector3<f64>, rate: f64) -> Option<[[f64; SIGMA]; 2]> {
        let mut q = [[0.0; SIGMA]; 3];
        for (row, q) in q.iter_mut().enumerate() {
            let [a, b, c] = [
                &self.rotation[3 * row],
                &self.rotation[3 * row + 1],
                &self.rotation[3 * row + 2],
            ];
            let shift = &self.shift[row];
            for lane in 0..SIGMA {
                q[lane] = a[lane] * direction.x + b[lane] * direction.y + c[lane] * direction.z
                    - rate * shift[lane];
            }
        }
        let [mut u, mut v, z] = q;
        let mut visible = true;
        for lane in 0..SIGMA {
            let largest = u[lane].abs().max(v[lane].abs()).max(z[lane].abs());
            visible &= z[lane] > HORIZON * largest;
        }
        if !visible {
            return None;
        }
        for lane in 0..SIGMA {
            let inverse = 1.0 / z[lane];
            u[lane] *= self.pinhole.fx * inverse;
            v[lane] *= self.pinhole.fy * inverse;
        }
        Some([u, v])
    }

    /// Linearises one match; `None` when a sigma point cannot see the landmark.
    #[must_use]
    pub(crate) fn linearise(&self, prepared: &Prepared) -> Option<Line> {
        let pinhole = &self.pinhole;
        let view = prepared.geometry.view(&self.mean);
        let focus = prepared.focus(pinhole, &view);
        let jacobian = view.jacobian(pinhole, &focus)?;
        let q = view.direction(&focus);
        let base = Vector2::new(pinhole.fx * q.x / q.z, pinhole.fy * q.y / q.z);
        let ray = prepared.geometry.ray(&focus);
        let direction = ray.base + (ray.origin - self.mean.centre) * ray.rate;
        let [u, v] = self.images(&direction, ray.rate)?;
        let half = 0.5 / SPREAD_SQUARED.sqrt();
        let mut slope = SMatrix::<f64, 2, POSE_DIM>::zeros();
        let mut mean = Vector2::zeros();
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for j in 0..POSE_DIM {
            let (pu, pv) = (u[j] - base.x, v[j] - base.y);
            let (mu, mv) = (u[j + POSE_DIM] - base.x, v[j + POSE_DIM] - base.y);
            mean.x += pu + mu;
            mean.y += pv + mv;
            xx += pu * pu + mu * mu;
            xy += pu * pv + mu * mv;
            yy += pv * pv + mv * mv;
            slope[(0, j)] = (pu - mu) * half;
            slope[(1, j)] = (pv - mv) * half;
        }
        let weight = 0.5 / SPREAD_SQUARED;
        mean *= weight;
        // Covariance about the mean; beta = 2 gives the centre a covariance weight of 2.
        let spread_covariance = Matrix2::new(xx, xy, xy, yy) * weight + mean * mean.transpose();
        let mut error = spread_covariance - slope * slope.transpose();
        // What curvature leaves; rounding may make a zero slightly negative.
        if error[(0, 0)] < 0.0 || error[(1, 1)] < 0.0 || error.determinant() < 0.0 {
            error = Matrix2::zeros();
        }
        let noise = error
            + projected_covariance(&jacobian, &prepared.covariance)
            + prepared.noise.covariance();
        Some(Line {
            mean: base + Vector2::new(pinhole.cx, pinhole.cy) + mean,
            slope,
            noise,
            across: across_epipolar(&jacobian),
        })
    }
}

/// Unit normal of the direction in which the pixel moves with depth.
#[must_use]
pub(crate) fn across_epipolar(jacobian: &nalgebra::Matrix2x3<f64>) -> Vector2<f64> {
    let along = jacobian.column(2);
    let norm = along.norm();
    if norm < 1e-9 {
        // No baseline: every direction is across; take the rows.
        return Vector2::y();
    }
    Vector2::new(-along.y, along.x) / norm
}
