//! Bundle adjustment: degenerate and bad input, and problems that scipy solved.

use mono_geometry::bundle::{
    BundlePose, OdometryFactor, Options, PlanarProblem, PosePrior, Problem, adjust, covariance,
};
use mono_geometry::{GeometryError, Mount, RobustLoss, Se2, Se3, so3};
use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::common::bundle::{observe, require_gauge_error, small, solved};
use crate::common::wall_run::{self, pinhole};

#[test]
fn landmarks_with_too_little_information_are_counted_and_do_no_harm() {
    let simulated = wall_run::planar(&small(6));
    let (plain, cost) = solved(&simulated.problem, &Options::default());
    let mut problem = simulated.problem;
    let first = problem.landmarks.len();
    // Never seen; seen once; seen twice from the same place; seen on the optical axis; at infinity from all poses.
    problem.landmarks.push(Vector3::new(1.0, 2.0, 3.0));
    problem.landmarks.push(Vector3::new(0.3, 2.0, 0.1));
    problem
        .observations
        .push(observe(3, first + 1, 300.0, 200.0, 0.5));
    problem.landmarks.push(Vector3::new(0.2, 2.1, 0.1));
    problem
        .observations
        .push(observe(0, first + 2, 310.0, 200.0, 0.5));
    problem
        .observations
        .push(observe(0, first + 2, 310.0, 200.0, 0.5));
    problem.landmarks.push(Vector3::new(0.05, 3.0, 0.1));
    problem
        .observations
        .push(observe(0, first + 3, 319.5, 239.5, 0.5));
    let far = Vector3::new(0.0, 1e12, 1e11);
    problem.landmarks.push(far);
    for (pose, body) in plain.poses.iter().enumerate() {
        let camera = body
            .world_from_body()
            .compose(&problem.body_from_camera)
            .inverse();
        let pixel = pinhole()
            .project(&camera.transform_point(&far))
            .expect("in front");
        problem
            .observations
            .push(observe(pose, first + 4, pixel.x, pixel.y, 0.5));
    }
    let adjusted = adjust(&problem, &Options::default()).expect("valid");
    assert!(
        adjusted.termination.converged(),
        "{:?}",
        adjusted.termination
    );
    let expected: Vec<_> = (first..first + 5).collect();
    assert_eq!(adjusted.undetermined_landmarks, expected);
    assert!((adjusted.cost - cost).abs() < 1e-6 * cost);
    assert!(
        adjusted
            .landmarks
            .iter()
            .all(|p| p.iter().all(|v| v.is_finite()))
    );
    assert_eq!(adjusted.landmarks[first], problem.landmarks[first]);
    for (a, b) in adjusted.poses.iter().zip(&plain.poses) {
        // The far point confirms headings where they are.
        assert!(a.between(b).log().norm() < 1e-5);
    }
    // A rotation alone has no parallax: every landmark of it is undetermined, and the turn is found.
    let mut turning = PlanarProblem::new(pinhole(), Mount::forward().body_from_camera);
    turning.body_from_camera.translation = Vector3::zeros();
    turning.poses = vec![Se2::identity(), Se2::identity()];
    turning.fixed_poses = vec![0];
    turning.odometry.push(OdometryFactor {
        from: 0,
        to: 1,
        motion: Se2::identity(),
        covariance: Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 1.0)),
    });
    for k in 0..20 {
        let point = Vector3::new(3.0, f64::from(k) * 0.1 - 1.0, 0.3 * f64::from(k % 3));
        turning.landmarks.push(point);
        for (pose, phi) in [(0, 0.0), (1, 0.1)] {
            let camera = Mount::forward()
                .world_from_camera(&Se2::new(0.0, 0.0, phi), 0.0, 0.0, 0.0)
                .inverse();
            let pixel = pinhole()
                .project(&camera.transform_point(&point))
                .expect("in front");
            turning
                .observations
                .push(observe(pose, k as usize, pixel.x, pixel.y, 0.5));
        }
    }
    let adjusted = adjust(&turning, &Options::default()).expect("valid");
    assert!(
        (adjusted.poses[1].phi - 0.1).abs() < 1e-3,
        "{:?}",
        adjusted.poses[1]
    );
}

#[test]
fn empty_problems_are_solved_at_once() {
    let mut problem = PlanarProblem::new(pinhole(), Se3::identity());
    let nothing = adjust(&problem, &Options::default()).expect("nothing to do");
    assert!(nothing.termination.converged() && nothing.cost == 0.0);
    assert!(covariance(&problem, &RobustLoss::None).is_ok());
    problem.poses = vec![Se2::identity(); 3];
    problem.landmarks = vec![Vector3::z(); 2];
    let still = adjust(&problem, &Options::default()).expect("nothing to do");
    assert!(still.termination.converged());
    assert_eq!(still.undetermined_landmarks, vec![0, 1]);
    assert_eq!(still.poses, problem.poses);
    require_gauge_error(&problem);
}

#[test]
fn bad_input_is_named_with_its_index() {
    let good = wall_run::planar(&small(1)).problem;
    let error = |change: &dyn Fn(&mut PlanarProblem)| {
        let mut problem = good.clone();
        change(&mut problem);
        let error = adjust(&problem, &Options::default()).expect_err("bad input");
        assert!(covariance(&problem, &RobustLoss::None).is_err());
        match error {
            GeometryError::InvalidElement { list, index, .. } => (list, index),
            other => panic!("{other}"),
        }
    };
    assert_eq!(
        error(&|p| p.observations[17].pixel_ideal.x = f64::NAN),
        ("observation", 17)
    );
    assert_eq!(
        error(&|p| p.observations[3].pixel_ideal.y = f64::INFINITY),
        ("observation", 3)
    );
    assert_eq!(error(&|p| p.observations[5].pose = 8), ("observation", 5));
    assert_eq!(
        error(&|p| p.observations[6].landmark = 60),
        ("observation", 6)
    );
    assert_eq!(
        error(&|p| p.observations[2].sigma_px = 0.0),
        ("observation", 2)
    );
    assert_eq!(
        error(&|p| p.odometry[4].to = usize::MAX),
        ("odometry factor", 4)
    );
    assert_eq!(error(&|p| p.odometry[4].to = 4), ("odometry factor", 4));
    assert_eq!(
        error(&|p| p.odometry[1].covariance[(2, 2)] = 0.0),
        ("odometry factor", 1)
    );
    assert_eq!(
        error(&|p| p.odometry[1].motion.x = f64::NAN),
        ("odometry factor", 1)
    );
    assert_eq!(error(&|p| p.poses[2].phi = f64::NAN), ("pose", 2));
    assert_eq!(error(&|p| p.landmarks[9].z = f64::NAN), ("landmark", 9));
    assert_eq!(error(&|p| p.fixed_poses.push(99)), ("fixed pose", 1));
    let prior = |p: &mut PlanarProblem| {
        p.priors.push(PosePrior {
            pose: 1,
            mean: Se2::identity(),
            covariance: -Matrix3::identity(),
        });
    };
    assert_eq!(error(&prior), ("prior", 0));
    let mut lost = wall_run::spatial(&small(1)).problem;
    lost.poses[1].translation.y = f64::NAN;
    assert!(matches!(
        adjust(&lost, &Options::default()),
        Err(GeometryError::InvalidElement {
            list: "pose",
            index: 1,
            ..
        })
    ));
    let mut huge = good.clone();
    huge.observations[0].pixel_ideal.x = 1e200;
    assert!(adjust(&huge, &Options::default()).is_err());
    let mut no_focus = good.clone();
    no_focus.pinhole.fx = 0.0;
    assert!(adjust(&no_focus, &Options::default()).is_err());
    let options = Options {
        step_tolerance: f64::NAN,
        ..Options::default()
    };
    assert!(adjust(&good, &options).is_err());
}

/// A problem of `reference/bundle_scipy.csv`: the text of docs/results/bundle_adjustment_scipy.py, with scipy's minimum.
struct Reference<'a> {
    kind: &'a str,
    loss: RobustLoss,
    lines: Vec<(&'a str, Vec<f64>)>,
}

impl Reference<'_> {
    fn all<'b>(&'b self, name: &'b str) -> impl Iterator<Item = &'b [f64]> {
        self.lines
            .iter()
            .filter(move |(n, _)| *n == name)
            .map(|(_, values)| values.as_slice())
    }
}

fn pose_of(values: &[f64]) -> Se3 {
    let rotation = Matrix3::from_row_slice(&values[..9]);
    Se3::new(
        so3::rotation_from_matrix(&rotation).expect("a rotation"),
        Vector3::from_column_slice(&values[9..12]),
    )
}

fn check_reference<P: BundlePose<D>, const D: usize>(
    reference: &Reference<'_>,
    pose: impl Fn(&[f64]) -> P,
) {
    let camera = reference.all("camera").next().expect("a camera");
    let mut model = pinhole();
    (model.fx, model.fy, model.cx, model.cy) = (camera[0], camera[1], camera[2], camera[3]);
    let mount = pose_of(reference.all("mount").next().expect("a mount"));
    let mut problem = Problem::<P, D>::new(model, mount);
    problem.poses = reference.all("pose").map(&pose).collect();
    problem.fixed_poses = vec![0];
    problem.landmarks = reference
        .all("landmark")
        .map(Vector3::from_column_slice)
        .collect();
    problem.observations = reference
        .all("observation")
        .map(|v| observe(v[0] as usize, v[1] as usize, v[2], v[3], v[4]))
        .collect();
    problem.odometry = reference
        .all("odometry")
        .map(|v| OdometryFactor {
            from: v[0] as usize,
            to: v[1] as usize,
            motion: pose(&v[2..14]),
            covariance: SMatrix::from_row_slice(&v[14..]),
        })
        .collect();
    let options = Options {
        loss: reference.loss,
        ..Options::default()
    };
    let (after, cost) = solved(&problem, &options);
    let expected = reference.all("cost").next().expect("a cost")[0];
    assert!((cost / expected - 1.0).abs() < 1e-9, "{cost} {expected}");
    let solved: Vec<_> = reference.all("solved").map(&pose).collect();
    assert_eq!(solved.len(), after.poses.len());
    for (ours, theirs) in after.poses.iter().zip(&solved) {
        // scipy stops at 1e-12 of the cost, which leaves the poses at the root of that.
        assert!(theirs.between(ours).log_with_jacobian().0.norm() < 1e-6);
    }
}

#[test]
fn val_scipy_cost_and_poses_agree() {
    let text = include_str!("../reference/bundle_scipy.csv");
    let mut problems: Vec<Reference<'_>> = Vec::new();
    for line in text.lines().filter(|l| !l.starts_with('#')) {
        let (name, rest) = line.split_once(',').expect("a name");
        if name == "problem" {
            let (kind, loss) = rest.split_once(',').expect("a loss");
            let loss = match loss {
                "none" => RobustLoss::None,
                "huber" => RobustLoss::Huber { threshold: 0.0 },
                _ => RobustLoss::Cauchy { threshold: 0.0 },
            };
            problems.push(Reference {
                kind,
                loss,
                lines: Vec::new(),
            });
            continue;
        }
        let values: Vec<f64> = rest
            .split(',')
            .map(|v| v.parse().expect("a number"))
            .collect();
        let last = problems.last_mut().expect("a problem first");
        if name == "threshold"
            && let RobustLoss::Huber { threshold } | RobustLoss::Cauchy { threshold } =
                &mut last.loss
        {
            *threshold = values[0];
        }
        last.lines.push((name, values));
    }
    assert_eq!(problems.len(), 3);
    for reference in &problems {
        if reference.kind == "planar" {
            check_reference(reference, |v| {
                let pose = pose_of(v);
                let rotation = pose.rotation.matrix();
                Se2::new(
                    pose.translation.x,
                    pose.translation.y,
                    rotation[(1, 0)].atan2(rotation[(0, 0)]),
                )
            });
        } else {
            check_reference(reference, pose_of);
        }
    }
}
