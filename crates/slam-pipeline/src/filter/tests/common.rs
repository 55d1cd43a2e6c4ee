//! Shared by the tests of the filter: the paper's camera, random poses, oracles.

use crate::filter::landmark::{InverseDepthPrior, Landmark, Parametrisation};
use crate::filter::metric::MetricState;
use crate::filter::motion::{CarrierModel, NoiseFactors};
use crate::filter::observation::{Prepared, Scoring};
use crate::filter::particle::Particle;
use crate::filter::pixel_noise::PixelNoise;
use crate::filter::pose::{CameraPose, PoseStep};
use crate::odometry::Control;
use crate::rig::Rig;
use estimation_base::{Manifold, symmetric};
use mono_geometry::inverse_depth::LandmarkGeometry;
use mono_geometry::{Camera, Distortion, Mount, Pinhole, PlacedCamera, Se2};
use nalgebra::{Matrix2, Matrix2x6, Matrix3, Rotation2, SMatrix, SVector, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// The paper's camera (Table I).
pub(crate) static PINHOLE: Pinhole = Pinhole {
    width: 320,
    height: 240,
    fx: 368.826_20,
    fy: 369.902_39,
    cx: 159.670_29,
    cy: 121.541_36,
};
pub(crate) fn pinhole() -> Pinhole {
    PINHOLE
}

pub(crate) fn camera() -> Camera {
    Camera::new(pinhole(), Distortion::None).unwrap()
}

/// The prior of inverse depth of a landmark seen once: from 0.4 m to infinity.
pub(crate) const OPEN_DEPTH: InverseDepthPrior = InverseDepthPrior {
    mean: 1.25,
    sigma: 0.625,
};

/// The camera at the body's origin, looking to its left.
pub(crate) fn rig() -> Rig {
    rig_at(Vector2::zeros())
}

/// The camera at `lever_m` in the body, looking to its left.
pub(crate) fn rig_at(lever_m: Vector2<f64>) -> Rig {
    Rig {
        camera: camera(),
        mount: Mount::new(&sideways(), &lever_m.push(0.0)).unwrap(),
    }
}

/// A camera that looks to the left of the body: columns right, down, forward.
pub(crate) fn sideways() -> Matrix3<f64> {
    Matrix3::new(
        1.0, 0.0, 0.0, //
        0.0, 0.0, 1.0, //
        0.0, -1.0, 0.0,
    )
}

pub(crate) fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

pub(crate) fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

pub(crate) fn pose(x: f64, y: f64, phi: f64) -> CameraPose {
    CameraPose {
        centre: Vector3::new(x, y, 0.0),
        phi,
        roll: 0.0,
        pitch: 0.0,
    }
}

/// A pose anywhere, its heading near the seam of the circle as often as not.
pub(crate) fn random_pose(rng: &mut ChaCha8Rng) -> CameraPose {
    let phi = if rng.random::<bool>() {
        estimation_base::wrap(core::f64::consts::PI + uniform(rng, -0.02, 0.02))
    } else {
        uniform(rng, -3.0, 3.0)
    };
    CameraPose {
        centre: Vector3::from_fn(|_, _| uniform(rng, -2.0, 2.0)),
        phi,
        roll: uniform(rng, -0.05, 0.05),
        pitch: uniform(rng, -0.05, 0.05),
    }
}

/// A pose a few decimetres and hundredths of a radian from `from`.
pub(crate) fn near(rng: &mut ChaCha8Rng, from: &CameraPose) -> CameraPose {
    let spread = PoseStep::from([0.2, 0.2, 0.05, 0.1, 0.02, 0.02]);
    from.retract(&PoseStep::from_fn(|i, _| {
        spread[i] * uniform(rng, -1.0, 1.0)
    }))
}

pub(crate) fn place(pose: &CameraPose) -> PlacedCamera {
    pose.place(&rig())
}

pub(crate) fn inverse_depth(mean: Vector3<f64>, covariance: Matrix3<f64>) -> Landmark {
    Landmark {
        parametrisation: Parametrisation::InverseDepth { anchor: 0 },
        mean,
        covariance,
    }
}

pub(crate) fn point(mean: Vector3<f64>, covariance: Matrix3<f64>) -> Landmark {
    Landmark {
        parametrisation: Parametrisation::Point,
        mean,
        covariance,
    }
}

/// World point at normalised image position (a, b) and `depth` in front of `camera`.
pub(crate) fn ahead(camera: &PlacedCamera, a: f64, b: f64, depth: f64) -> Vector3<f64> {
    camera.centre + camera.camera_from_world.transpose() * Vector3::new(a, b, 1.0) * depth
}

/// Pixel of a world point by the textbook formula, independent of the crate.
pub(crate) fn pixel_of(camera: &PlacedCamera, p: &Vector3<f64>) -> Vector2<f64> {
    let q = camera.camera_from_world * (p - camera.centre);
    let k = pinhole();
    Vector2::new(k.fx * q.x / q.z + k.cx, k.fy * q.y / q.z + k.cy)
}

/// Pixel of parameters `m` in `camera`; the test fails when it is not in front.
pub(crate) fn project(
    camera: &PlacedCamera,
    geometry: &LandmarkGeometry,
    m: &Vector3<f64>,
) -> Vector2<f64> {
    geometry.ray(m).project(&pinhole(), camera).unwrap()
}

/// d pixel / d pose tangent by central differences.
pub(crate) fn pose_jacobian(
    pose: &CameraPose,
    geometry: &LandmarkGeometry,
    m: &Vector3<f64>,
) -> Matrix2x6<f64> {
    const H: f64 = 1e-6;
    let mut jacobian = Matrix2x6::zeros();
    for j in 0..6 {
        let mut step = PoseStep::zeros();
        step[j] = H;
        let difference = project(&place(&pose.retract(&step)), geometry, m)
            - project(&place(&pose.retract(&-step)), geometry, m);
        jacobian.set_column(j, &(difference / (2.0 * H)));
    }
    jacobian
}

/// The square root of an ellipse of noise, turned and stretched up to threefold by an amount of its own for every `id`; every
/// third is round.
pub(crate) fn noise_root(sigma_px: f64, id: u32) -> Matrix2<f64> {
    let turn = Rotation2::new(0.7 * f64::from(id)).into_inner();
    turn * Matrix2::from_diagonal(&Vector2::new(1.0 + f64::from(id % 3), 1.0)) * sigma_px
}

/// The noise with this square root.
pub(crate) fn noise_of(root: &Matrix2<f64>) -> PixelNoise {
    PixelNoise::of(symmetric(&(root * root.transpose())))
}

pub(crate) fn prepared(
    geometry: LandmarkGeometry,
    landmark: &Landmark,
    pixel: Vector2<f64>,
    variance_px2: f64,
    scoring: Scoring,
) -> Prepared {
    Prepared {
        geometry,
        mean: landmark.mean,
        covariance: landmark.covariance,
        pixel,
        noise: PixelNoise::of(Matrix2::from_diagonal_element(variance_px2)),
        scoring,
    }
}

/// A strictly planar carrier with no open scale.
pub(crate) fn planar_carrier() -> CarrierModel {
    CarrierModel {
        tilt_sigma: 0.0,
        tilt_time_s: 1.0,
        slope_sigma: 0.0,
        scale_drift: 0.0,
        scale_sigma: 0.0,
        turn_bias_sigma: 0.0,
        turning_centre_sigma_m: 0.0,
        noise: NoiseFactors::NOMINAL,
    }
}

pub(crate) fn control(increment: [f64; 3], sigmas: [f64; 3]) -> Control {
    let [x, y, phi] = increment;
    Control {
        increment: Se2 { x, y, phi },
        covariance: Matrix3::from_diagonal(&Vector3::from(sigmas.map(|s| s * s))),
        turn_bias_gain: Vector3::new(0.0, 0.0, 0.1),
        dt_s: 0.1,
        distance_m: x.hypot(y),
    }
}

pub(crate) fn particle(pose: CameraPose) -> Particle {
    Particle::new(pose, MetricState::new(&planar_carrier()))
}

/// Fails unless every entry of the sample covariance of `n` Gaussian draws lies
/// within five standard errors, sqrt((C_ii C_jj + C_ij^2) / n), and a share
/// `curvature` of sqrt(C_ii C_jj) for what the linearisation leaves out.
pub(crate) fn assert_sample_covariance<const D: usize>(
    draws: &[SVector<f64, D>],
    covariance: &SMatrix<f64, D, D>,
    curvature: f64,
) {
    let n = draws.len() as f64;
    let mean = draws.iter().sum::<SVector<f64, D>>() / n;
    let mut sample = SMatrix::<f64, D, D>::zeros();
    for d in draws {
        sample += (d - mean) * (d - mean).transpose() / n;
    }
    for i in 0..D {
        for j in 0..D {
            let product = covariance[(i, i)] * covariance[(j, j)];
            let error = ((product + covariance[(i, j)].powi(2)) / n).sqrt();
            let bound = 5.0 * error + curvature * product.sqrt();
            let difference = (sample[(i, j)] - covariance[(i, j)]).abs();
            assert!(
                difference <= bound,
                "({i}, {j}): sample {}, stated {}, bound {bound}",
                sample[(i, j)],
                covariance[(i, j)]
            );
        }
    }
}
