//! The truth is found again, and the covariance says how far.

use estimation_base::{chi_square_quantile, wrap};
use mono_geometry::{Distortion, RobustLoss};
use nalgebra::{Vector2, Vector3};
use slam_batch::{Constant, Constants, NoiseFactors, Solution, solve};

use crate::simulation::{Drive, Settings, rmse, settings};

/// Normalised estimation error squared of the last pose.
fn nees(solution: &Solution, drive: &Drive) -> f64 {
    let estimate = solution.poses.last().unwrap();
    let truth = drive.truth.last().unwrap();
    let e = Vector3::new(
        estimate.pose.x - truth.x,
        estimate.pose.y - truth.y,
        wrap(estimate.pose.phi - truth.phi),
    );
    e.dot(&estimate.covariance.cholesky().unwrap().solve(&e))
}

/// The band in which the sum of `n` chi-squares of `k` degrees lies but once in a thousand times on either side.
fn band(n: usize, k: usize) -> (f64, f64) {
    let q = |p: f64| chi_square_quantile((n * k) as f64, p).unwrap() / n as f64;
    (q(0.001), q(0.999))
}

#[test]
fn the_truth_is_recovered_within_the_covariance() {
    const SEEDS: usize = 30;
    let (mut sum, mut batch, mut wheels) = (0.0, 0.0, 0.0);
    let mut fit = 0.0;
    for seed in 0..SEEDS {
        let drive = Drive::new(&settings(), seed as u64);
        let solution = solve(&drive.problem).unwrap();
        assert!(solution.converged, "{seed}: {:?}", solution.fit);
        assert!(
            solution.iterations <= 15,
            "{} iterations",
            solution.iterations
        );
        sum += nees(&solution, &drive);

        batch += rmse(solution.poses.iter().map(|p| p.pose), &drive.truth);
        wheels += rmse(drive.dead_reckoning.iter().copied(), &drive.truth);
        // 6 numbers of carrier and odometry a keyframe weigh against as many beliefs.
        let freedom = solution.fit.degrees_of_freedom + 6 * drive.truth.len();
        fit += (solution.fit.pixel_chi_square + solution.fit.motion_chi_square)
            / (freedom * SEEDS) as f64;
    }
    let nees = sum / SEEDS as f64;
    let (low, high) = band(SEEDS, 3);
    assert!((low..high).contains(&nees), "{nees} outside {low}..{high}");
    // 150,000 degrees of freedom: four standard errors are 0.015.
    assert!((fit - 1.0).abs() < 0.015, "chi-square {fit}");
    assert!(batch < 0.3 * wheels, "{batch} against {wheels}");
}

/// The constants are found within their sigmas, and the last pose within its covariance.
fn learns(constants: Constants, priors: Constants, change: impl Fn(&mut Settings)) {
    const SEEDS: u64 = 24;
    let mut sums = [0.0; Constant::COUNT];
    let mut nees_sum = 0.0;
    for seed in 0..SEEDS {
        let mut settings = settings();
        settings.truth = constants;
        settings.model.constants = priors;
        change(&mut settings);
        let drive = Drive::new(&settings, 100 + seed);
        let solution = solve(&drive.problem).unwrap();
        assert!(solution.converged);
        nees_sum += nees(&solution, &drive);
        for learned in &solution.constants {
            let error = (learned.value - constants[learned.constant]) / learned.sigma;
            sums[learned.constant as usize] += error * error;
            // The drive says more than the prior did.
            assert!(learned.sigma < 0.8 * learned.prior_sigma, "{learned:?}");
        }
    }
    let (low, high) = band(SEEDS as usize, 1);
    for (constant, prior) in priors.iter() {
        if prior > 0.0 {
            let mean = sums[constant as usize] / SEEDS as f64;
            assert!((low..high).contains(&mean), "{constant:?}: {mean}");
        }
    }
    let (low, high) = band(SEEDS as usize, 3);
    let nees = nees_sum / SEEDS as f64;
    assert!((low..high).contains(&nees), "NEES {nees}");
}

#[test]
fn constants_of_the_carrier_are_learned() {
    let truth = Constants::ZERO
        .with(Constant::TurningCentre, 0.12)
        .with(Constant::SlipAngle, 0.015)
        .with(Constant::TurnRateBias, 0.02);
    let priors = Constants::ZERO
        .with(Constant::TurningCentre, 0.2)
        .with(Constant::SlipAngle, 0.03)
        .with(Constant::TurnRateBias, 0.03);
    learns(truth, priors, |_| {});
}

#[test]
fn a_wheel_scale_that_nothing_tells_keeps_its_prior() {
    // A camera at the body's origin: a smaller world with smaller wheels has the same pixels. The wrong form, with the
    // noise in the metres of the world, makes it smaller by the number of motions times the prior variance.
    const SEEDS: u64 = 12;
    let prior = 0.02;
    let mut sum = 0.0;
    for seed in 0..SEEDS {
        let mut settings = settings();
        settings.model.constants = Constants::ZERO.with(Constant::WheelScale, prior);
        let mut drive = Drive::new(&settings, 400 + seed);
        let forward = mono_geometry::Mount::forward();
        let arm = drive.problem.rig.mount.body_from_camera.translation;
        drive.problem.rig.mount = forward;
        // The body is where its camera was.
        for keyframe in &mut drive.problem.keyframes {
            keyframe.start = mono_geometry::Se2::new(0.0, 0.0, keyframe.start.phi).compose(
                &mono_geometry::Se2::new(keyframe.start.x - arm.x, keyframe.start.y - arm.y, 0.0),
            );
        }
        let solution = solve(&drive.problem).unwrap();
        let learned = solution.learned(Constant::WheelScale).unwrap();
        assert!((learned.sigma / prior - 1.0).abs() < 0.05, "{learned:?}");
        sum += learned.value / SEEDS as f64;
    }
    // 29 motions of two coordinates: the wrong form says -0.023.
    assert!(sum.abs() < 0.1 * prior, "{sum}");
}

#[test]
fn the_calibration_is_learned() {
    let truth = Constants::ZERO
        .with(Constant::MountYaw, 0.02)
        .with(Constant::FocalScale, 0.008)
        .with(Constant::PrincipalX, 3.0)
        .with(Constant::PrincipalY, -2.0)
        .with(Constant::Lens, 0.02);
    let priors = Constants::ZERO
        .with(Constant::MountYaw, 0.03)
        .with(Constant::FocalScale, 0.01)
        .with(Constant::PrincipalX, 4.0)
        .with(Constant::PrincipalY, 4.0)
        .with(Constant::Lens, 0.03);
    learns(truth, priors, |s| {
        s.lens = Distortion::Radtan {
            k1: -0.15,
            k2: 0.03,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
        };
    });
}

#[test]
fn a_robot_that_is_not_the_nominal_one_needs_its_constants() {
    // The wrong form: a bias that is there and not an unknown.
    let mut settings = settings();
    settings.truth = Constants::ZERO
        .with(Constant::TurnRateBias, 0.06)
        .with(Constant::TurningCentre, 0.3);
    let drive = Drive::new(&settings, 7);
    let without = solve(&drive.problem).unwrap();
    let mut problem = drive.problem.clone();
    problem.model.constants = Constants::ZERO
        .with(Constant::TurnRateBias, 0.06)
        .with(Constant::TurningCentre, 0.3);
    let with = solve(&problem).unwrap();
    assert!(nees(&with, &drive) < 16.3, "{}", nees(&with, &drive));
    // What no constant takes is process noise.
    assert_eq!(with.noise, NoiseFactors::NOMINAL);
    assert!(without.noise.sideways > 1.5, "{:?}", without.noise);
}

#[test]
fn a_drifting_scale_gives_the_map_freedom_and_no_bias() {
    // The filter's own model: the map is not rigid. On rigid data the answer stays within its wider covariance.
    const SEEDS: usize = 12;
    let mut sum = 0.0;
    for seed in 0..SEEDS {
        let drive = Drive::new(&settings(), 300 + seed as u64);
        let rigid = solve(&drive.problem).unwrap();
        let mut problem = drive.problem.clone();
        problem.model.scale_drift = 0.01;
        let free = solve(&problem).unwrap();
        assert!(free.converged);
        let (a, b) = (
            rigid.poses.last().unwrap().covariance,
            free.poses.last().unwrap().covariance,
        );
        assert!(b.trace() > a.trace());
        sum += nees(&free, &drive);
    }
    let nees = sum / SEEDS as f64;
    let high = band(SEEDS, 3).1;
    assert!(nees < high && nees > 0.3, "{nees}");
}

#[test]
fn wrong_matches_pull_less_with_a_loss() {
    let mut drive = Drive::new(&settings(), 11);
    for track in drive.problem.tracks.iter_mut().step_by(7) {
        if let Some(sighting) = track.sightings.get_mut(1) {
            sighting.pixel += Vector2::new(15.0, -20.0);
        }
    }
    let error = |loss: RobustLoss| {
        let mut problem = drive.problem.clone();
        problem.model.loss = loss;
        let solution = solve(&problem).unwrap();
        rmse(solution.poses.iter().map(|p| p.pose), &drive.truth)
    };
    let (plain, huber) = (
        error(RobustLoss::None),
        error(RobustLoss::Huber { threshold: 2.5 }),
    );
    assert!(huber < 0.5 * plain, "{huber} against {plain}");
}

#[test]
fn landmarks_come_where_they_are() {
    let drive = Drive::new(&settings(), 3);
    let solution = solve(&drive.problem).unwrap();
    // The cloud reaches from 0.8 m below the body to 1.2 m above it.
    let heights: Vec<f64> = solution.landmarks.iter().map(|l| l.position.z).collect();
    assert!(heights.len() > 200, "{}", heights.len());
    let inside = heights.iter().filter(|z| (-0.9..1.3).contains(*z)).count();
    assert!(
        inside * 100 > heights.len() * 95,
        "{inside} of {}",
        heights.len()
    );
}

#[test]
fn two_drives_of_one_robot_share_their_constants() {
    let mut settings = settings();
    settings.truth = Constants::ZERO.with(Constant::FocalScale, 0.008);
    settings.model.constants = Constants::ZERO.with(Constant::FocalScale, 0.01);
    let (first, second) = (Drive::new(&settings, 21), Drive::new(&settings, 22));
    let alone = solve(&first.problem).unwrap();
    let mut both = first.problem;
    let offset = both.keyframes.len();
    both.append(second.problem.clone());
    let together = solve(&both).unwrap();
    let sigma = |s: &Solution| s.learned(Constant::FocalScale).unwrap().sigma;
    assert!(sigma(&together) < 0.85 * sigma(&alone));
    // Each drive starts where it was told.
    assert_eq!(
        together.poses[offset].pose,
        second.problem.keyframes[0].start
    );
    assert_eq!(
        together.poses[offset].covariance,
        nalgebra::Matrix3::zeros()
    );
}

/// A robot that sways ten times more than is stated: a batch that believes the stated noise bends its path to it.
#[test]
fn regress_a_robot_that_sways_is_not_bent_to_its_stated_noise() {
    const SEEDS: usize = 5;
    let mut wide = settings();
    wide.model.odometry.sideways_per_sqrt_m *= 10.0;
    let (mut told, mut believed) = (0.0, 0.0);
    for seed in 0..SEEDS {
        let drive = Drive::new(&wide, 300 + seed as u64);
        let mut problem = drive.problem.clone();
        problem.model = settings().model;
        let solution = solve(&problem).unwrap();
        assert!(
            (4.0..14.0).contains(&solution.noise.sideways),
            "{seed}: {:?}",
            solution.noise
        );
        assert_eq!(solution.noise.heading, 1.0, "{seed}");
        believed += rmse(solution.poses.iter().map(|p| p.pose), &drive.truth);
        let known = solve(&drive.problem).unwrap();
        assert_eq!(known.noise.sideways, 1.0, "{seed}");
        told += rmse(known.poses.iter().map(|p| p.pose), &drive.truth);
    }
    assert!(believed < 1.2 * told, "{believed} against {told}");
}
