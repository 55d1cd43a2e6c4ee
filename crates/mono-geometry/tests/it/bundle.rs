//! Bundle adjustment from outside: closed forms, truth, gauge, consistency over seeds, outliers.

use mono_geometry::bundle::{
    BundlePose, OdometryFactor, Options, PlanarProblem, PosePrior, Problem, SpatialProblem, adjust,
    covariance,
};
use mono_geometry::motion::Increment;
use mono_geometry::{GeometryError, Mount, RobustLoss, Se2, Se3, Termination, so3};
use nalgebra::{DVector, Matrix3, SMatrix, SVector, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common::bundle::{observe, require_gauge_error, small, solved};
use crate::common::long_chain;
use crate::common::wall_run::{self, Simulated, WallRun, pinhole};

/// Rectified stereo: depth from the disparity, v the mean of the two, the cost what is left of their difference.
#[test]
fn one_landmark_in_two_poses_has_a_closed_form() {
    let camera = pinhole();
    let (half, sigma) = (0.2, 0.5);
    let mut problem = SpatialProblem::new(camera, Se3::identity());
    for x in [-half, half] {
        problem.poses.push(Se3::new(
            so3::exp(&Vector3::zeros()),
            Vector3::new(x, 0.0, 0.0),
        ));
    }
    problem.fixed_poses = vec![0, 1];
    problem.landmarks = vec![Vector3::new(0.1, 0.0, 3.0)];
    let (u0, u1, v0, v1) = (360.0, 300.0, 221.0, 224.0);
    problem.observations = vec![observe(0, 0, u0, v0, sigma), observe(1, 0, u1, v1, sigma)];
    let (after, cost) = solved(&problem, &Options::default());
    let disparity = u0 - u1;
    let z = camera.fx * 2.0 * half / disparity;
    let x = (0.5 * (u0 + u1) - camera.cx) * z / camera.fx;
    let y = (0.5 * (v0 + v1) - camera.cy) * z / camera.fy;
    assert!((after.landmarks[0] - Vector3::new(x, y, z)).norm() < 1e-9);
    assert!((cost - 0.25 * (v1 - v0) * (v1 - v0) / (sigma * sigma)).abs() < 1e-9);
    // sigma_z = z^2 sqrt(2) sigma / (f b).
    let sure = covariance(&after, &RobustLoss::None).expect("fixed poses");
    let sigma_z = sure.landmark(0).expect("parallax")[(2, 2)].sqrt();
    let expected = z * z * 2.0_f64.sqrt() * sigma / (camera.fx * 2.0 * half);
    assert!((sigma_z / expected - 1.0).abs() < 1e-9);
    assert_eq!(after.poses, problem.poses);
}

/// Two measured motions between the same poses and a prior: weighted mean, and covariances that add along the chain.
#[test]
fn odometry_alone_is_a_weighted_mean() {
    let mut problem = PlanarProblem::new(pinhole(), Mount::forward().body_from_camera);
    problem.poses = vec![Se2::new(5.0, -2.0, 0.3), Se2::new(0.0, 0.0, 1.0)];
    let prior = Matrix3::from_diagonal(&Vector3::new(0.04, 0.09, 0.01));
    problem.priors.push(PosePrior {
        pose: 0,
        mean: Se2::identity(),
        covariance: prior,
    });
    for (x, variance) in [(1.0, 0.01), (1.3, 0.02)] {
        let increment = Increment {
            mean: Se2::new(x, 0.0, 0.0),
            covariance: Matrix3::from_diagonal(&Vector3::new(variance, variance, 0.001)),
            turn_bias_gain: Vector3::zeros(),
        };
        problem
            .odometry
            .push(OdometryFactor::from_increment(0, 1, &increment));
    }
    let (after, cost) = solved(&problem, &Options::default());
    let mean = (1.0 / 0.01 + 1.3 / 0.02) / (1.0 / 0.01 + 1.0 / 0.02);
    assert!(after.poses[0].between(&Se2::identity()).log().norm() < 1e-10);
    assert!(
        after.poses[1]
            .between(&Se2::new(mean, 0.0, 0.0))
            .log()
            .norm()
            < 1e-10
    );
    assert!((cost - 0.5 * 0.3 * 0.3 / 0.03).abs() < 1e-10);
    let sure = covariance(&after, &RobustLoss::None).expect("a prior");
    assert!((sure.pose(0).expect("in range") - prior).amax() < 1e-12);
    let adjoint = Se2::new(-mean, 0.0, 0.0).adjoint();
    let both = 1.0 / (1.0 / 0.01 + 1.0 / 0.02);
    let motion = Matrix3::from_diagonal(&Vector3::new(both, both, 0.0005));
    // The errors of the two headings differ by the Jacobian of a residual that is not zero: second order here.
    let expected = adjoint * prior * adjoint.transpose() + motion;
    let difference = (sure.pose(1).expect("in range") - expected).amax();
    assert!(difference < 1e-3 * expected.amax(), "{difference}");
}

fn converges_to_truth<P: BundlePose<D>, const D: usize>(
    simulated: &Simulated<P, D>,
    start: impl Fn(usize) -> SVector<f64, D>,
) {
    let mut problem = simulated.problem.clone();
    for k in 1..problem.poses.len() {
        problem.poses[k] = problem.poses[k].retract(&start(k));
    }
    for (k, point) in problem.landmarks.iter_mut().enumerate() {
        *point = simulated.landmarks[k] + Vector3::new(0.05, -0.3, 0.1) * (k as f64).sin();
    }
    let adjusted = adjust(&problem, &Options::default()).expect("valid");
    assert!(adjusted.termination.converged());
    assert!(adjusted.initial_cost > 1e3);
    // Pixels near 300 carry rounding of 6e-14, that is 1e-13 standard deviations each.
    assert!(adjusted.cost < 1e-20, "{}", adjusted.cost);
    for (pose, truth) in adjusted.poses.iter().zip(&simulated.poses) {
        assert!(truth.between(pose).log_with_jacobian().0.norm() < 1e-10);
    }
    for (point, truth) in adjusted.landmarks.iter().zip(&simulated.landmarks) {
        assert!((point - truth).norm() < 1e-9);
    }
}

#[test]
fn without_noise_it_converges_to_the_truth() {
    let run = WallRun {
        sigma_px: 0.0,
        odometry_noise: 0.0,
        ..small(4)
    };
    converges_to_truth(&wall_run::planar(&run), |k| {
        Vector3::new(0.05, -0.04, 0.03) * (k as f64).cos()
    });
    converges_to_truth(&wall_run::spatial(&run), |k| {
        Vector6::new(0.05, -0.04, 0.02, 0.02, -0.02, 0.03) * (k as f64).cos()
    });
}

fn gauge_is_free<P: BundlePose<D>, const D: usize>(problem: &Problem<P, D>, moved_by: &P) {
    let (plain, cost) = solved(problem, &Options::default());
    let space = moved_by.world_from_body();
    let move_pose = |pose: &P| moved_by.retract(&pose.log_with_jacobian().0);
    let mut moved = problem.clone();
    moved.poses = problem.poses.iter().map(move_pose).collect();
    moved.landmarks = problem
        .landmarks
        .iter()
        .map(|p| space.transform_point(p))
        .collect();
    let (after, moved_cost) = solved(&moved, &Options::default());
    assert!((moved_cost / cost - 1.0).abs() < 1e-11);
    // The cost is flat at its minimum: poses agree to the tolerance on the last step, not to rounding.
    for (a, b) in plain.poses.iter().map(move_pose).zip(&after.poses) {
        assert!(a.between(b).log_with_jacobian().0.norm() < 1e-6);
    }
    for (a, b) in plain.landmarks.iter().zip(&after.landmarks) {
        assert!((space.transform_point(a) - b).norm() < 1e-5);
    }
}

#[test]
fn a_rigid_motion_of_the_input_moves_the_result() {
    let run = small(5);
    gauge_is_free(&wall_run::planar(&run).problem, &Se2::new(3.0, -7.0, 3.1));
    gauge_is_free(
        &wall_run::spatial(&run).problem,
        &Se3::new(
            so3::exp(&Vector3::new(1.0, -2.0, 0.5)),
            Vector3::new(4.0, 5.0, -6.0),
        ),
    );
}

/// Squared error of all free poses in units of their joint covariance.
fn nees<P: BundlePose<D>, const D: usize>(simulated: &Simulated<P, D>) -> (f64, usize) {
    let (after, _) = solved(&simulated.problem, &Options::default());
    let sure = covariance(&after, &RobustLoss::None).expect("fixed gauge");
    let error: Vec<f64> = after.poses[1..]
        .iter()
        .zip(&simulated.poses[1..])
        .flat_map(|(mean, truth)| {
            mean.between(truth)
                .log_with_jacobian()
                .0
                .iter()
                .copied()
                .collect::<Vec<_>>()
        })
        .collect();
    let error = DVector::from_vec(error);
    let factor = sure.joint().clone().cholesky().expect("positive definite");
    (error.dot(&factor.solve(&error)), error.len())
}

fn nees_is_in_its_band(runs: u64, one: impl Fn(u64) -> (f64, usize)) {
    let all: Vec<_> = (0..runs).map(|seed| one(1000 + seed)).collect();
    let sum: f64 = all.iter().map(|(value, _)| value).sum();
    let freedom: usize = all.iter().map(|(_, n)| n).sum();
    // A sum of chi-squares has variance twice its degrees of freedom.
    let bound = 4.5 * (2.0 * freedom as f64).sqrt();
    let excess = sum - freedom as f64;
    assert!(
        excess.abs() < bound,
        "{sum} for {freedom} degrees of freedom"
    );
}

#[test]
fn the_covariance_of_the_poses_is_consistent() {
    nees_is_in_its_band(80, |seed| nees(&wall_run::planar(&small(seed))));
    nees_is_in_its_band(30, |seed| nees(&wall_run::spatial(&small(seed))));
}

/// The same with an odometry believed three times too good: the test can fail.
#[test]
fn a_wrong_odometry_covariance_leaves_the_band() {
    let freedom = 80.0 * 21.0;
    let sum: f64 = (0..80)
        .map(|seed| {
            let mut simulated = wall_run::planar(&small(1000 + seed));
            for factor in &mut simulated.problem.odometry {
                factor.covariance /= 9.0;
            }
            nees(&simulated).0
        })
        .sum();
    assert!(sum > freedom + 10.0 * (2.0_f64 * freedom).sqrt(), "{sum}");
}

fn scale_needs_odometry<P: BundlePose<D>, const D: usize>(simulated: &Simulated<P, D>) {
    let (with, _) = solved(&simulated.problem, &Options::default());
    let sure = covariance(&with, &RobustLoss::None).expect("odometry gives the scale");
    let mut without = simulated.problem.clone();
    without.odometry.clear();
    let (mut without, _) = solved(&without, &Options::default());
    require_gauge_error(&without);
    // Another fixed pose holds it too.
    without.fixed_poses.push(without.poses.len() - 1);
    assert!(covariance(&without, &RobustLoss::None).is_ok());
    // All odometry and no fixed pose: the place is free. A prior holds it, and only it adds to the first pose.
    let mut afloat = with.clone();
    afloat.fixed_poses.clear();
    require_gauge_error(&afloat);
    let prior = SMatrix::<f64, D, D>::identity() * 1e-4;
    afloat.priors.push(PosePrior {
        pose: 0,
        mean: afloat.poses[0],
        covariance: prior,
    });
    let held = covariance(&afloat, &RobustLoss::None).expect("a prior");
    assert!((held.pose(0).expect("in range") - prior).amax() < 1e-6 * prior.amax());
    let last = with.poses.len() - 1;
    let (a, b) = (sure.pose(last), held.pose(last));
    assert!(b.expect("in range").trace() > a.expect("in range").trace());
    // And the solver does not mind a free gauge.
    afloat.priors.clear();
    afloat.poses = simulated.problem.poses.clone();
    afloat.landmarks = simulated.problem.landmarks.clone();
    let (_, cost) = solved(&afloat, &Options::default());
    let (_, fixed_cost) = solved(&simulated.problem, &Options::default());
    assert!((cost / fixed_cost - 1.0).abs() < 1e-9);
}

#[test]
fn scale_is_seen_by_odometry_only_and_the_error_says_so() {
    for seed in 20..24 {
        scale_needs_odometry(&wall_run::planar(&small(seed)));
        scale_needs_odometry(&wall_run::spatial(&small(seed)));
        let run = WallRun {
            frames: 38,
            landmarks: 200,
            ..small(seed)
        };
        scale_needs_odometry(&wall_run::planar(&run));
    }
}

fn rmse(poses: &[Se2], truth: &[Se2]) -> f64 {
    let squares: f64 = poses
        .iter()
        .zip(truth)
        .map(|(p, t)| (p.x - t.x).powi(2) + (p.y - t.y).powi(2) + (p.phi - t.phi).powi(2))
        .sum();
    (squares / truth.len() as f64).sqrt()
}

#[test]
fn a_robust_loss_survives_outliers_and_least_squares_does_not() {
    for seed in 0..5 {
        let clean = WallRun {
            frames: 12,
            landmarks: 150,
            ..WallRun::full(seed)
        };
        let simulated = wall_run::planar(&WallRun {
            outlier_share: 0.1,
            ..clean
        });
        let outliers = simulated.outlier.iter().filter(|o| **o).count() as f64;
        let share = outliers / simulated.outlier.len() as f64;
        assert!((0.07..0.13).contains(&share));
        // What is left without the outliers, known here from the simulation.
        let mut without = simulated.problem.clone();
        let mut keep = simulated.outlier.iter().map(|o| !o);
        without
            .observations
            .retain(|_| keep.next().expect("as many"));
        let (best, _) = solved(&without, &Options::default());
        let reference = rmse(&best.poses, &simulated.poses);
        let with = |loss| {
            let options = Options {
                loss,
                ..Options::default()
            };
            let adjusted = adjust(&simulated.problem, &options).expect("valid");
            rmse(&adjusted.poses, &best.poses)
        };
        let plain = with(RobustLoss::None);
        let huber = with(RobustLoss::Huber { threshold: 2.0 });
        let cauchy = with(RobustLoss::Cauchy { threshold: 2.0 });
        assert!(plain > 0.05, "plain {plain}");
        assert!(
            huber < 0.3 * plain && cauchy < 0.1 * plain,
            "{huber} {cauchy} {plain}"
        );
        // Nearer to the solution without outliers than that one is to the truth.
        assert!(cauchy < reference.max(0.004), "{cauchy} {reference}");
    }
}

#[test]
fn the_order_of_observations_does_not_matter() {
    let simulated = wall_run::planar(&WallRun {
        outlier_share: 0.05,
        ..small(9)
    });
    let options = Options {
        loss: RobustLoss::Huber { threshold: 2.0 },
        ..Options::default()
    };
    let (straight, cost) = solved(&simulated.problem, &options);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut shuffled = simulated.problem;
    for k in (1..shuffled.observations.len()).rev() {
        shuffled.observations.swap(k, rng.random_range(0..=k));
    }
    shuffled.odometry.reverse();
    let (other, other_cost) = solved(&shuffled, &options);
    assert!((cost - other_cost).abs() < 1e-12 * cost);
    for (a, b) in straight.poses.iter().zip(&other.poses) {
        assert!(a.between(b).log().norm() < 1e-9);
    }
}

/// Twice the same sighting is once with half the variance.
#[test]
fn a_landmark_seen_twice_from_one_pose_counts_twice() {
    let simulated = wall_run::spatial(&small(2));
    let mut twice = simulated.problem.clone();
    let mut sharper = simulated.problem.clone();
    for k in 0..simulated.problem.observations.len() {
        if k % 3 == 0 {
            twice.observations.push(simulated.problem.observations[k]);
            sharper.observations[k].sigma_px /= 2.0_f64.sqrt();
        }
    }
    let (a, cost_a) = solved(&twice, &Options::default());
    let (b, cost_b) = solved(&sharper, &Options::default());
    assert!((cost_a / cost_b - 1.0).abs() < 1e-11);
    let (a, b) = (
        covariance(&a, &RobustLoss::None).expect("fixed gauge"),
        covariance(&b, &RobustLoss::None).expect("fixed gauge"),
    );
    assert!((a.joint() - b.joint()).amax() < 1e-6 * a.joint().amax());
}

#[test]
fn the_cost_curve_and_the_reason_fit_together() {
    let problem = wall_run::planar(&small(3)).problem;
    let adjusted = adjust(&problem, &Options::default()).expect("valid");
    let mut before = adjusted.initial_cost;
    let mut taken = 0;
    for i in &adjusted.iterations {
        assert!(i.damping > 0.0 && i.step_norm > 0.0);
        if i.accepted {
            assert!(i.cost < before && i.gain_ratio.expect("a cost") > 0.0);
            taken += 1;
        } else {
            assert_eq!(i.cost, before);
        }
        before = i.cost;
    }
    assert_eq!(before, adjusted.cost);
    assert_eq!(adjusted.jacobian_evaluations, taken + 1);
    assert!(adjusted.cost_evaluations > taken);
    match adjusted.termination {
        Termination::CostChange {
            relative,
            threshold,
        } => assert!(relative <= threshold),
        other => panic!("{other:?}"),
    }
    let with = |options: Options| adjust(&problem, &options).expect("valid").termination;
    let open = Options {
        cost_tolerance: 0.0,
        step_tolerance: 0.0,
        gradient_tolerance: 0.0,
        ..Options::default()
    };
    let one = with(Options {
        max_iterations: 1,
        ..open
    });
    assert!(
        matches!(one, Termination::IterationLimit { iterations: 1, relative } if relative > 0.5)
    );
    assert!(!one.converged());
    assert!(matches!(
        with(Options { gradient_tolerance: 1e-3, ..open }),
        Termination::Gradient { largest, threshold } if largest <= threshold
    ));
    assert!(matches!(
        with(Options { step_tolerance: 1e-3, ..open }),
        Termination::Step { length, threshold } if length <= threshold
    ));
    // With no tolerance at all, rounding ends it: no step lowers the cost any more.
    assert!(matches!(
        with(Options { max_iterations: 1000, ..open }),
        Termination::Stalled { damping, limit } if damping > limit
    ));
}

/// From ten times too deep, Gauss-Newton throws the landmark behind the cameras: it stays, the others move, it is found.
#[test]
fn a_step_behind_the_camera_is_not_taken_and_holds_nothing_else_up() {
    let mut problem = SpatialProblem::new(pinhole(), Se3::identity());
    for x in [-0.2, 0.2] {
        problem.poses.push(Se3::new(
            so3::exp(&Vector3::zeros()),
            Vector3::new(x, 0.0, 0.0),
        ));
    }
    problem.fixed_poses = vec![0, 1];
    problem.landmarks = vec![Vector3::new(0.0, 0.0, 20.0)];
    let camera = pinhole();
    let shift = camera.fx * 0.2 / 2.0;
    problem.observations = vec![
        observe(0, 0, camera.cx + shift, camera.cy, 0.5),
        observe(1, 0, camera.cx - shift, camera.cy, 0.5),
    ];
    let adjusted = adjust(&problem, &Options::default()).expect("valid");
    assert!(adjusted.termination.converged());
    let first = adjusted.iterations[0];
    assert!(!first.accepted && first.gain_ratio == Some(0.0));
    let truth = Vector3::new(0.0, 0.0, 2.0);
    assert!((adjusted.landmarks[0] - truth).norm() < 1e-9);
    // One that begins near its place is there after the first step.
    let mut both = problem.clone();
    both.landmarks.push(Vector3::new(0.0, 0.0, 2.01));
    for k in 0..2 {
        let mut again = problem.observations[k];
        again.landmark = 1;
        both.observations.push(again);
    }
    let once = Options {
        max_iterations: 1,
        ..Options::default()
    };
    let adjusted = adjust(&both, &once).expect("valid");
    assert!(adjusted.iterations[0].accepted);
    assert!((adjusted.landmarks[1] - truth).norm() < 1e-4);
    // Back before its camera, up to rounding.
    assert!((adjusted.landmarks[0] - problem.landmarks[0]).norm() < 1e-12);
    let adjusted = adjust(&both, &Options::default()).expect("valid");
    assert!((adjusted.landmarks[0] - truth).norm() < 1e-9);
    // At the start it is an error that names the observation.
    problem.landmarks[0].z = -2.0;
    assert!(matches!(
        adjust(&problem, &Options::default()),
        Err(GeometryError::InvalidElement { index: 0, value, .. }) if value == -2.0
    ));
}

/// Two thousand poses around a circle that closes: a dense system of 6000 rows would take 288 MB and minutes. Pixels are exact,
/// the odometry drifts by a quarter of a metre and more; what is left is what its noise can pull.
#[test]
fn a_chain_of_two_thousand_poses_that_closes_a_loop_is_adjusted() {
    let (problem, truth) = long_chain::circle(2000, 3);
    // the heading passes the cut: places alone
    let off = |poses: &[Se2]| {
        let squares = poses
            .iter()
            .zip(&truth)
            .map(|(p, t)| (p.x - t.x).powi(2) + (p.y - t.y).powi(2));
        (squares.sum::<f64>() / truth.len() as f64).sqrt()
    };
    let before = off(&problem.poses);
    let adjusted = adjust(&problem, &Options::default()).expect("a minimum");
    assert!(
        adjusted.termination.converged(),
        "{:?}",
        adjusted.termination
    );
    let after = off(&adjusted.poses);
    assert!(before > 0.1 && after < 0.3 * before, "{before} {after}");
}

/// 150 poses are solved dense, 400 by their envelope. A pose that nothing ties to the others but its own prior makes no
/// difference to them: with 250 such poses behind it the chain of 150 has the answer of the chain alone.
#[test]
fn an_envelope_gives_the_answer_of_the_dense_system() {
    let (alone, _) = long_chain::circle(150, 5);
    let mut extended = alone.clone();
    for k in 0..250 {
        let pose = extended.poses.len();
        let mean = Se2::new(f64::from(k), 1.0, 0.1);
        extended.poses.push(mean);
        extended.priors.push(PosePrior {
            pose,
            mean,
            covariance: Matrix3::identity() * 0.01,
        });
    }
    let options = Options::default();
    let dense = adjust(&alone, &options).expect("a minimum");
    let by_envelope = adjust(&extended, &options).expect("a minimum");
    for (a, b) in dense.poses.iter().zip(&by_envelope.poses) {
        assert!(a.between(b).log().amax() < 1e-9);
    }
    assert!((dense.cost - by_envelope.cost).abs() < 1e-9 * dense.cost);
}
