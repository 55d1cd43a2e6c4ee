//! A robot drives along a wall and looks at it: the bundle that tests, bench and example share.
//!
//! Path of 0.1 m a frame, wall at 2 m with a relief of 0.1 m, camera of 640x480 pixels and 90 degrees to the left, pixel
//! noise 0.5, odometry good to 5 % of the step and 0.012 rad. The start is dead reckoning, and landmarks at the median
//! of the points 2 m deep on their rays.

use mono_geometry::bundle::{
    BundlePose, OdometryFactor, PixelObservation, PlanarProblem, Problem, SpatialProblem,
};
use mono_geometry::{Mount, NoiseShape, Pinhole, Se2, Se3};
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const STEP_M: f64 = 0.1;
const WALL_M: f64 = 2.0;

#[derive(Debug, Clone, Copy)]
pub(crate) struct WallRun {
    pub(crate) frames: usize,
    pub(crate) landmarks: usize,
    pub(crate) sigma_px: f64,
    /// Share of the pixels that are anywhere in the image.
    pub(crate) outlier_share: f64,
    /// Factor on the noise of the odometry (0: the path is what odometry says).
    pub(crate) odometry_noise: f64,
    pub(crate) seed: u64,
}

impl WallRun {
    /// 38 frames, 1000 landmarks, about 20 000 sightings.
    pub(crate) fn full(seed: u64) -> Self {
        Self {
            frames: 38,
            landmarks: 1000,
            sigma_px: 0.5,
            outlier_share: 0.0,
            odometry_noise: 1.0,
            seed,
        }
    }
}

/// A problem at its start, and the truth.
#[derive(Debug, Clone)]
pub(crate) struct Simulated<P, const D: usize> {
    pub(crate) problem: Problem<P, D>,
    pub(crate) poses: Vec<P>,
    pub(crate) landmarks: Vec<Vector3<f64>>,
    /// Whether each observation is an outlier.
    pub(crate) outlier: Vec<bool>,
}

pub(crate) fn pinhole() -> Pinhole {
    Pinhole {
        width: 640,
        height: 480,
        fx: 320.0,
        fy: 320.0,
        cx: 319.5,
        cy: 239.5,
    }
}

pub(crate) fn mount() -> Mount {
    let looking_left = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    Mount::new(&looking_left, &Vector3::new(0.05, 0.02, 0.1)).expect("a rotation")
}

pub(crate) fn planar(run: &WallRun) -> Simulated<Se2, 3> {
    let sigmas = Vector3::new(0.05 * STEP_M, 0.001, 0.012);
    let motion = |k: usize| Se2::exp(&Vector3::new(STEP_M, 0.0, turn(k)));
    let problem = PlanarProblem::new(pinhole(), mount().body_from_camera);
    simulate(run, problem, Se2::identity(), motion, &sigmas)
}

pub(crate) fn spatial(run: &WallRun) -> Simulated<Se3, 6> {
    let sigmas = Vector6::new(0.05 * STEP_M, 0.001, 0.001, 0.002, 0.002, 0.012);
    let motion = |k: usize| Se3::exp(&Vector6::new(STEP_M, 0.0, 0.0, 0.0, 0.0, turn(k)));
    let problem = SpatialProblem::new(pinhole(), mount().body_from_camera);
    simulate(run, problem, Se3::identity(), motion, &sigmas)
}

/// A gentle weave, radians a step.
fn turn(k: usize) -> f64 {
    0.02 * (k as f64 / 4.0).sin()
}

fn simulate<P: BundlePose<D>, const D: usize>(
    run: &WallRun,
    mut problem: Problem<P, D>,
    origin: P,
    motion: impl Fn(usize) -> P,
    sigmas: &SVector<f64, D>,
) -> Simulated<P, D> {
    let mut rng = ChaCha8Rng::seed_from_u64(run.seed);
    let mut poses = vec![origin];
    problem.poses = vec![origin];
    problem.fixed_poses = vec![0];
    for k in 1..run.frames {
        let measured = motion(k);
        let noise = sigmas.map(|s| s * gauss(&mut rng)) * run.odometry_noise;
        let step = measured.retract(&noise);
        poses.push(chain(&poses[k - 1], &step));
        let dead_reckoned = chain(&problem.poses[k - 1], &measured);
        problem.poses.push(dead_reckoned);
        problem.odometry.push(OdometryFactor {
            from: k - 1,
            to: k,
            motion: measured,
            covariance: SMatrix::from_diagonal(&sigmas.component_mul(sigmas)),
        });
    }
    let mut simulated = Simulated {
        problem,
        poses,
        landmarks: Vec::new(),
        outlier: Vec::new(),
    };
    while simulated.landmarks.len() < run.landmarks {
        let point = Vector3::new(
            rng.random_range(-WALL_M..STEP_M * run.frames as f64 + WALL_M),
            WALL_M + rng.random_range(-0.1..0.1),
            rng.random_range(-1.0..1.2),
        );
        simulated.see(run, &point, &mut rng);
    }
    simulated
}

impl<P: BundlePose<D>, const D: usize> Simulated<P, D> {
    /// Adds a landmark if two frames see it.
    fn see(&mut self, run: &WallRun, point: &Vector3<f64>, rng: &mut ChaCha8Rng) {
        let landmark = self.landmarks.len();
        let mount = self.problem.body_from_camera;
        let camera = self.problem.pinhole;
        let mut seen = Vec::new();
        for (pose, body) in self.poses.iter().enumerate() {
            let in_camera = body
                .world_from_body()
                .compose(&mount)
                .inverse()
                .transform_point(point);
            let Some(pixel) = camera.project(&in_camera) else {
                continue;
            };
            let noisy = pixel + Vector2::new(gauss(rng), gauss(rng)) * run.sigma_px;
            let outlier = rng.random::<f64>() < run.outlier_share;
            let anywhere = Vector2::new(rng.random_range(0.0..639.0), rng.random_range(0.0..479.0));
            if camera.contains(&pixel, 0.0) {
                let pixel_ideal = if outlier { anywhere } else { noisy };
                seen.push((pose, pixel_ideal, outlier));
            }
        }
        if seen.len() < 2 {
            return;
        }
        let guesses: Vec<_> = seen
            .iter()
            .map(|(pose, pixel, _)| {
                let world_from_camera = self.problem.poses[*pose].world_from_body().compose(&mount);
                let ray = camera.normalize(pixel);
                world_from_camera.transform_point(&(Vector3::new(ray.x, ray.y, 1.0) * WALL_M))
            })
            .collect();
        self.problem.landmarks.push(Vector3::from_fn(|axis, _| {
            let mut values: Vec<_> = guesses.iter().map(|g| g[axis]).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        }));
        self.landmarks.push(*point);
        for (pose, pixel_ideal, outlier) in seen {
            self.problem.observations.push(PixelObservation {
                pose,
                landmark,
                pixel_ideal,
                sigma_px: run.sigma_px.max(0.5),
                shape: NoiseShape::ROUND,
            });
            self.outlier.push(outlier);
        }
    }
}

/// from * motion through the retraction, so that one text serves both groups.
fn chain<P: BundlePose<D>, const D: usize>(from: &P, motion: &P) -> P {
    from.retract(&motion.log_with_jacobian().0)
}

fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}
