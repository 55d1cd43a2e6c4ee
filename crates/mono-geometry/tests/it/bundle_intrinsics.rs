//! The camera as an unknown of a bundle, from outside: truth, consistency over seeds, what is refused.

use estimation_base::chi_square_quantile;
use mono_geometry::bundle::{Intrinsics, Options, SpatialProblem, adjust, covariance};
use mono_geometry::{Camera, Distortion, GeometryError, NoiseShape, RobustLoss, Se3};
use nalgebra::{DVector, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common::bundle::small;
use crate::common::gauss;
use crate::common::wall_run::{self, pinhole};

/// Standard deviations of fx, fy, cx, cy, k1, k2; the rest of the lens is held. With these no lens drawn folds inside the picture.
const SIGMAS: [f64; 9] = [6.0, 6.0, 4.0, 4.0, 0.01, 0.01, 0.0, 0.0, 0.0];
const SIGMA_PX: f64 = 0.5;

fn calibrated() -> Camera {
    let lens = Distortion::Radtan {
        k1: -0.2,
        k2: 0.05,
        p1: 3e-4,
        p2: -2e-4,
        k3: 0.0,
    };
    Camera::new(pinhole(), lens).expect("a camera")
}

/// A wall run whose pixels the camera `taken_by` sees with noise, and which is told of the calibrated one. Points stand before and
/// behind the wall, so that focal length and distance can be told apart.
struct Run {
    problem: SpatialProblem,
    poses: Vec<Se3>,
}

fn run(seed: u64, taken_by: &Camera, sigma_px: f64) -> Run {
    let mut noiseless = small(seed);
    noiseless.sigma_px = 0.0;
    noiseless.landmarks = 100;
    let simulated = wall_run::spatial(&noiseless);
    let calibrated = calibrated();
    let mut problem = simulated.problem;
    let mut rng = ChaCha8Rng::seed_from_u64(77_000 + seed);
    let landmarks: Vec<_> = simulated
        .landmarks
        .iter()
        .map(|p| p + Vector3::y() * rng.random_range(-0.8..1.5))
        .collect();
    problem.landmarks.clone_from(&landmarks);
    let mount = problem.body_from_camera;
    let poses = &simulated.poses;
    problem.observations.retain_mut(|o| {
        let placed = poses[o.pose].compose(&mount).inverse();
        let point = placed.transform_point(&landmarks[o.landmark]);
        let noise = Vector2::new(gauss(&mut rng), gauss(&mut rng)) * sigma_px;
        let Some(pixel) = taken_by
            .project(&point)
            .filter(|p| taken_by.contains(p, 0.0))
        else {
            return false;
        };
        let Ok((pixel_ideal, shape)) = calibrated.undistort_with_shape(&(pixel + noise)) else {
            return false;
        };
        o.pixel_ideal = pixel_ideal;
        o.shape = shape;
        o.sigma_px = SIGMA_PX;
        true
    });
    // points of few sightings may run to infinity
    let mut sightings = vec![0; landmarks.len()];
    for o in &problem.observations {
        sightings[o.landmark] += 1;
    }
    problem.observations.retain(|o| sightings[o.landmark] > 3);
    Run {
        problem,
        poses: simulated.poses,
    }
}

/// The calibrated camera with its parameters off by the prior's noise.
fn drawn(seed: u64) -> Camera {
    let mut rng = ChaCha8Rng::seed_from_u64(5000 + seed);
    let calibrated = calibrated();
    let off = DVector::from_iterator(9, SIGMAS.iter().map(|s| s * gauss(&mut rng)));
    calibrated
        .with_parameters((calibrated.parameters() + off).as_slice())
        .expect("a camera")
}

fn off_by(focal: f64, k1: f64) -> Camera {
    let mut parameters = calibrated().parameters();
    parameters[0] *= focal;
    parameters[1] *= focal;
    parameters[4] += k1;
    calibrated()
        .with_parameters(parameters.as_slice())
        .expect("a camera")
}

#[test]
fn without_noise_a_wrong_camera_comes_back() {
    let truth = off_by(1.05, 0.03);
    let mut run = run(1, &truth, 0.0);
    // No prior of its own: the path is measured, and true here.
    let sigmas = vec![
        f64::INFINITY,
        f64::INFINITY,
        0.0,
        0.0,
        f64::INFINITY,
        0.0,
        0.0,
        0.0,
        0.0,
    ];
    run.problem.poses = run.poses.clone();
    for k in 1..run.poses.len() {
        run.problem.odometry[k - 1].motion = run.poses[k - 1].inverse().compose(&run.poses[k]);
    }
    let held = adjust(&run.problem, &Options::default()).expect("valid");
    assert!(held.cost > 10.0 && held.camera.is_none(), "{}", held.cost);
    run.problem.intrinsics = Some(Intrinsics::new(calibrated(), sigmas));
    let adjusted = adjust(&run.problem, &Options::default()).expect("valid");
    assert!(adjusted.termination.converged());
    assert!(adjusted.cost < 1e-12, "{}", adjusted.cost);
    let found = adjusted.camera.expect("free").parameters();
    for (k, (found, truth)) in found.iter().zip(&truth.parameters()).enumerate() {
        assert!((found - truth).abs() < 1e-6, "{k}: {found} {truth}");
    }
}

/// NEES of the six free parameters and of the last pose, and of the same pose with the camera believed.
fn nees(seed: u64) -> (f64, f64, f64) {
    let truth = drawn(seed);
    let run = run(seed, &truth, SIGMA_PX);
    let pose_nees = |problem: &SpatialProblem, sure: &mono_geometry::bundle::Covariance<6>| {
        let last = run.poses.len() - 1;
        let off = run.poses[last]
            .inverse()
            .compose(&problem.poses[last])
            .log();
        let block = sure.pose(last).expect("in range");
        off.dot(&block.cholesky().expect("definite").solve(&off))
    };
    let solve = |problem: &SpatialProblem| {
        let adjusted = adjust(problem, &Options::default()).expect("valid");
        assert!(
            adjusted.termination.converged(),
            "{:?}",
            adjusted.termination
        );
        let mut problem = problem.clone();
        problem.poses = adjusted.poses;
        problem.landmarks = adjusted.landmarks;
        if let (Some(intrinsics), Some(camera)) = (&mut problem.intrinsics, adjusted.camera) {
            intrinsics.estimate = camera;
        }
        let sure = covariance(&problem, &RobustLoss::None).expect("regular");
        (problem, sure)
    };
    let believed = solve(&run.problem);
    let mut free = run.problem.clone();
    free.intrinsics = Some(Intrinsics::new(calibrated(), SIGMAS.to_vec()));
    let (solved, sure) = solve(&free);
    let camera = solved.intrinsics.as_ref().expect("free").estimate;
    let off = (camera.parameters() - truth.parameters())
        .rows(0, 6)
        .into_owned();
    let block = sure.intrinsics().view((0, 0), (6, 6)).into_owned();
    for (k, sigma) in SIGMAS[..6].iter().enumerate() {
        assert!(
            block[(k, k)].sqrt() < *sigma,
            "{k}: no better than the prior"
        );
    }
    (
        off.dot(&block.cholesky().expect("definite").solve(&off)),
        pose_nees(&solved, &sure),
        pose_nees(&believed.0, &believed.1),
    )
}

/// Sums over seeds against the band of chi-square at one in ten thousand on either side; with the camera believed the pose is far off.
#[test]
fn wrong_cameras_are_found_as_well_as_their_covariance_says() {
    const SEEDS: u64 = 120;
    let mut sums = [0.0; 3];
    for seed in 0..SEEDS {
        let (camera, pose, believed) = nees(seed);
        sums[0] += camera;
        sums[1] += pose;
        sums[2] += believed;
    }
    let freedom = 6.0 * SEEDS as f64;
    let (low, high) = (
        chi_square_quantile(freedom, 1e-4).expect("a quantile"),
        chi_square_quantile(freedom, 1.0 - 1e-4).expect("a quantile"),
    );
    for (name, sum) in [("camera", sums[0]), ("pose", sums[1])] {
        assert!(low < sum && sum < high, "{name}: {sum}, {low} to {high}");
    }
    assert!(sums[2] > 1.5 * high, "{}", sums[2]);
}

/// Nothing free is no border at all, to the bit; and a prior of next to nothing is nearly that.
#[test]
fn a_camera_that_is_held_gives_the_answer_of_one_that_is_known() {
    let run = run(3, &calibrated(), SIGMA_PX);
    let known = adjust(&run.problem, &Options::default()).expect("valid");
    let mut held = run.problem.clone();
    held.intrinsics = Some(Intrinsics::new(calibrated(), vec![0.0; 9]));
    let same = adjust(&held, &Options::default()).expect("valid");
    assert_eq!(same, known);
    let sure = covariance(&held, &RobustLoss::None).expect("regular");
    let plain = covariance(&run.problem, &RobustLoss::None).expect("regular");
    assert_eq!(sure.joint(), plain.joint());
    assert_eq!(sure.intrinsics().amax(), 0.0);

    // without a lens real and ideal pixels are one, so the residuals are the same
    let bare = Camera::new(pinhole(), Distortion::None).expect("a camera");
    let mut run = run;
    for o in &mut run.problem.observations {
        o.shape = NoiseShape::ROUND;
    }
    let known = adjust(&run.problem, &Options::default()).expect("valid");
    run.problem.intrinsics = Some(Intrinsics::new(bare, vec![1e-9; 4]));
    let tight = adjust(&run.problem, &Options::default()).expect("valid");
    assert!((tight.cost / known.cost - 1.0).abs() < 1e-9);
    for (a, b) in tight.poses.iter().zip(&known.poses) {
        assert!(a.inverse().compose(b).log().norm() < 1e-8);
    }
    let found = tight.camera.expect("free").parameters();
    assert!((found - bare.parameters()).amax() < 1e-9);
}

#[test]
fn cameras_that_do_not_fit_are_refused_with_their_numbers() {
    let run = run(4, &calibrated(), SIGMA_PX);
    let error = |change: &dyn Fn(&mut Intrinsics)| {
        let mut problem = run.problem.clone();
        let mut intrinsics = Intrinsics::new(calibrated(), SIGMAS.to_vec());
        change(&mut intrinsics);
        problem.intrinsics = Some(intrinsics);
        adjust(&problem, &Options::default())
            .expect_err("refused")
            .to_string()
    };
    assert_eq!(
        error(&|i| i.sigmas[4] = -0.5),
        "camera parameter 4: prior standard deviation is -0.5, required: 0 (held) or above, infinite for none"
    );
    assert!(error(&|i| i.sigmas[0] = f64::NAN).contains("camera parameter 0"));
    assert!(error(&|i| i.sigmas.truncate(3)).contains("3 rows"));
    assert!(
        error(&|i| i.estimate = Camera::new(pinhole(), Distortion::None).expect("a camera"))
            .contains("lens model")
    );
    let other = off_by(1.1, 0.0);
    assert!(error(&|i| i.calibrated = other).contains("value in the pinhole of the problem"));

    // A parameter that no pixel tells: the coefficient of a lens seen on its axis only.
    let mut blind = run.problem.clone();
    for (k, landmark) in blind.landmarks.iter_mut().enumerate() {
        *landmark = Vector3::new(0.0, 2.0 + 0.1 * k as f64, 0.0);
    }
    blind.observations.clear();
    let mut sigmas = vec![0.0; 9];
    sigmas[5] = f64::INFINITY;
    blind.intrinsics = Some(Intrinsics::new(calibrated(), sigmas));
    match covariance(&blind, &RobustLoss::None) {
        Err(GeometryError::InvalidElement {
            list, index, value, ..
        }) => {
            assert_eq!((list, index, value), ("camera parameter", 5, 0.0));
        }
        other => panic!("{:?}", other.map(|c| c.intrinsics())),
    }
}
