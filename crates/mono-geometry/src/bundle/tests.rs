//! Inside the bundle: Jacobians against complex step and central differences, the Schur solution against the dense one.

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix, DVector, Matrix3, Matrix4, SMatrix, SVector, Vector2, Vector3};

use super::layout::Layout;
use super::normal::{Estimate, Normal, Whitening, cost};
use super::pose::BundlePose;
use super::problem::{
    OdometryFactor, PixelObservation, PosePrior, Problem, odometry_error, prior_error,
};
use super::reduced::Reduced;
use super::schur::Schur;
use crate::camera::Pinhole;
use crate::noise_shape::NoiseShape;
use crate::robust_loss::RobustLoss;
use crate::se3::Se3;
use crate::so3;
use estimation_base::Se2;

type C = Complex<f64>;

/// Step of the complex derivative: no difference is taken, so it can be this small.
const H: f64 = 1e-40;

const PLANE: [usize; 3] = [0, 1, 5];
const SPACE: [usize; 6] = [0, 1, 2, 3, 4, 5];

/// A rigid motion as a complex 4x4 matrix.
fn lift(pose: &Se3) -> Matrix4<C> {
    let mut matrix = Matrix4::identity();
    for i in 0..3 {
        for j in 0..3 {
            matrix[(i, j)] = C::from(pose.rotation.matrix()[(i, j)]);
        }
        matrix[(i, 3)] = C::from(pose.translation[i]);
    }
    matrix
}

/// exp(i H e_k): a shift along, or a turn about, one axis by an imaginary amount.
fn elementary(coordinate: usize) -> Matrix4<C> {
    let mut matrix = Matrix4::identity();
    let step = C::new(0.0, H);
    if coordinate < 3 {
        matrix[(coordinate, 3)] = step;
    } else {
        let axis = coordinate - 3;
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        matrix[(i, i)] = step.cos();
        matrix[(j, j)] = step.cos();
        matrix[(j, i)] = step.sin();
        matrix[(i, j)] = -step.sin();
    }
    matrix
}

fn inverse(matrix: &Matrix4<C>) -> Matrix4<C> {
    let mut result = Matrix4::identity();
    for i in 0..3 {
        for j in 0..3 {
            result[(i, j)] = matrix[(j, i)];
        }
        result[(i, 3)] = -(0..3)
            .map(|k| matrix[(k, i)] * matrix[(k, 3)])
            .fold(C::from(0.0), |a, b| a + b);
    }
    result
}

/// f(a + i b) = f(a) + i b f'(a) for |b| at 1e-40: exact, where the complex functions of the library cancel.
fn apply(z: C, f: impl Fn(f64) -> f64, slope: impl Fn(f64) -> f64) -> C {
    C::new(f(z.re), z.im * slope(z.re))
}

fn root(z: C) -> C {
    apply(z, f64::sqrt, |a| 0.5 / a.sqrt())
}

/// log of a complex rigid motion through the quaternion; not at exactly half a turn.
fn log(matrix: &Matrix4<C>) -> [C; 6] {
    let trace = matrix[(0, 0)] + matrix[(1, 1)] + matrix[(2, 2)];
    let w = root(trace + 1.0) * 0.5;
    let vector =
        [(2, 1), (0, 2), (1, 0)].map(|(i, j)| (matrix[(i, j)] - matrix[(j, i)]) / (w * 4.0));
    let x = vector
        .iter()
        .map(|v| v * v)
        .fold(C::from(0.0), |a, b| a + b)
        / (w * w);
    // atan(sqrt x) / sqrt x, and (1 - (a/2) cot(a/2)) / a^2 as a function of a^2.
    let ratio = if x.norm() < 1e-3 {
        C::from(1.0) - x / 3.0 + x * x / 5.0 - x * x * x / 7.0 + x * x * x * x / 9.0
    } else {
        apply(root(x), f64::atan, |a| 1.0 / (1.0 + a * a)) / root(x)
    };
    let omega = vector.map(|v| v / w * ratio * 2.0);
    let a2 = omega.iter().map(|v| v * v).fold(C::from(0.0), |a, b| a + b);
    let coefficient = if a2.norm() < 1e-2 {
        C::from(1.0 / 12.0) + a2 / 720.0 + a2 * a2 / 30_240.0 + a2 * a2 * a2 / 1_209_600.0
    } else {
        let half = root(a2) * 0.5;
        let cosine = apply(half, f64::cos, |a| -a.sin());
        (C::from(1.0) - half * cosine / apply(half, f64::sin, f64::cos)) / a2
    };
    let cross = |a: [C; 3], b: [C; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let t = [matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]];
    let once = cross(omega, t);
    let twice = cross(omega, once);
    let rho = [0, 1, 2].map(|k| t[k] - once[k] * 0.5 + twice[k] * coefficient);
    [rho[0], rho[1], rho[2], omega[0], omega[1], omega[2]]
}

/// Both Jacobians of an odometry factor and that of a prior, by complex step and by central differences.
fn check_factor<P: BundlePose<D>, const D: usize>(from: P, to: P, motion: P, axes: [usize; D]) {
    let covariance = SMatrix::<f64, D, D>::identity();
    let factor = OdometryFactor {
        from: 0,
        to: 1,
        motion,
        covariance,
    };
    let (_, by_from, by_to) = odometry_error(&factor, &from, &to, &covariance);
    let prior = PosePrior {
        pose: 0,
        mean: from.retract(&motion.log_with_jacobian().0),
        covariance,
    };
    let (_, by_pose) = prior_error(&prior, &to, &covariance);
    let lifted = |pose: &P| lift(&pose.world_from_body());
    let (f, t, m) = (lifted(&from), lifted(&to), lifted(&motion));
    for (column, &axis) in axes.iter().enumerate() {
        let moved_from = log(&(inverse(&m) * inverse(&(f * elementary(axis))) * t));
        let moved_to = log(&(inverse(&m) * inverse(&f) * t * elementary(axis)));
        for (row, &component) in axes.iter().enumerate() {
            for (moved, jacobian) in [
                (&moved_from, &by_from),
                (&moved_to, &by_to),
                (&moved_to, &by_pose),
            ] {
                let exact = moved[component].im / H;
                let error = (jacobian[(row, column)] - exact).abs();
                // Near half a turn q_w^2 of the oracle has lost 1e-6 of its digits.
                assert!(error < 2e-9, "{from:?} {to:?} {row} {column}: {error}");
            }
        }
        let mut delta = SVector::<f64, D>::zeros();
        delta[column] = 1e-6;
        let error = |a: &P, b: &P| odometry_error(&factor, a, b, &covariance).0;
        let by = |plus: SVector<f64, D>, minus: SVector<f64, D>| (plus - minus) / 2e-6;
        let numeric_from = by(
            error(&from.retract(&delta), &to),
            error(&from.retract(&-delta), &to),
        );
        let numeric_to = by(
            error(&from, &to.retract(&delta)),
            error(&from, &to.retract(&-delta)),
        );
        assert!((numeric_from - by_from.column(column)).amax() < 1e-7);
        assert!((numeric_to - by_to.column(column)).amax() < 1e-7);
    }
}

#[test]
fn odometry_jacobians_match_complex_step_and_central_differences() {
    // The heading of the error runs over zero, tiny turns and the neighbourhood of half a turn; those of the poses over
    // the cut at pi.
    for turn in [0.0, 1e-12, 1e-5, -0.3, 2.0, PI - 2e-3, -PI + 2e-3] {
        for heading in [0.0, 1.0, PI - 1e-9, -PI + 1e-9, PI] {
            let from = Se2::new(0.3, -1.2, heading);
            let motion = Se2::new(0.1, 0.02, 0.05);
            let to = from.compose(&motion).compose(&Se2::new(0.2, -0.1, turn));
            check_factor(from, to, motion, PLANE);
            let axis = Vector3::new(0.48, -0.6, 0.64);
            let from = Se3::new(so3::exp(&(axis * heading)), Vector3::new(1.0, 2.0, -0.5));
            let motion = Se3::new(so3::exp(&Vector3::new(0.1, -0.2, 0.05)), Vector3::x());
            let error = Se3::new(
                so3::exp(&(Vector3::new(-0.6, 0.0, 0.8) * turn)),
                Vector3::new(0.2, 0.3, -0.1),
            );
            check_factor(from, from.compose(&motion).compose(&error), motion, SPACE);
        }
    }
}

/// The wrong form, an error that is not taken through J_r^-1 (the identity), is far off already at 0.3 rad.
#[test]
fn the_jacobian_of_the_log_matters() {
    let error = Se2::new(0.2, -0.1, 0.3);
    let (_, jacobian) = error.log_with_jacobian();
    assert!((jacobian - Matrix3::identity()).amax() > 0.1);
    // And without the adjoint the derivative by the first pose is wrong by the lever of the motion.
    let moved = Se2::new(2.0, 0.0, 0.0);
    assert!((moved.inverse_adjoint() - Matrix3::identity()).amax() > 1.9);
}

fn pinhole() -> Pinhole {
    Pinhole {
        width: 640,
        height: 480,
        fx: 320.0,
        fy: 300.0,
        cx: 319.5,
        cy: 239.5,
    }
}

/// Three poses (the first fixed) and five landmarks, one of them seen twice from the same pose; nothing at its minimum.
pub(super) fn small<P: BundlePose<D>, const D: usize>(poses: [P; 3]) -> Problem<P, D> {
    let mount = Se3::new(
        so3::exp(&Vector3::new(-1.5, 0.1, 0.05)),
        Vector3::new(0.05, 0.1, 0.2),
    );
    let mut problem = Problem::new(pinhole(), mount);
    problem.poses = poses.to_vec();
    problem.fixed_poses = vec![0];
    let mut wave = 0.0_f64;
    let mut next = |size: f64| {
        wave += 1.0;
        size * (wave * 12.9898).sin()
    };
    for landmark in 0..5 {
        let in_camera = Vector3::new(next(0.6), next(0.5), 2.0 + next(0.5));
        let point = poses[0]
            .world_from_body()
            .compose(&mount)
            .transform_point(&in_camera);
        problem.landmarks.push(point);
        for pose in [0, 1, 2, 2] {
            let seen = poses[pose]
                .world_from_body()
                .compose(&mount)
                .inverse()
                .transform_point(&point);
            let pixel = pinhole().project(&seen).expect("in front");
            problem.observations.push(PixelObservation {
                pose,
                landmark,
                pixel_ideal: pixel + Vector2::new(next(2.0), next(2.0)),
                sigma_px: 0.5 + 0.1 * landmark as f64,
                shape: NoiseShape::ROUND,
            });
        }
    }
    let covariance = SMatrix::<f64, D, D>::from_fn(|i, j| {
        if i == j {
            0.01
        } else {
            0.001 * ((i * j) as f64).cos()
        }
    });
    let covariance = (covariance + covariance.transpose()) * 0.5;
    for (from, to) in [(0, 1), (2, 1), (1, 2)] {
        let noise = SVector::<f64, D>::from_fn(|_, _| next(0.05));
        problem.odometry.push(OdometryFactor {
            from,
            to,
            motion: poses[from].between(&poses[to]).retract(&noise),
            covariance,
        });
    }
    problem.priors.push(PosePrior {
        pose: 2,
        mean: poses[2].retract(&SVector::from_fn(|_, _| next(0.1))),
        covariance: covariance * 4.0,
    });
    problem
}

pub(super) fn planar() -> Problem<Se2, 3> {
    small([
        Se2::new(0.0, 0.0, 3.1),
        Se2::new(-0.2, 0.1, -3.1),
        Se2::new(-0.4, 0.0, 3.0),
    ])
}

pub(super) fn spatial() -> Problem<Se3, 6> {
    let turn = |x, y, z| so3::exp(&Vector3::new(x, y, z));
    small([
        Se3::new(turn(0.1, -0.2, 3.0), Vector3::zeros()),
        Se3::new(turn(0.15, -0.2, 3.05), Vector3::new(-0.2, 0.1, 0.02)),
        Se3::new(turn(0.1, -0.25, 2.9), Vector3::new(-0.4, 0.0, -0.05)),
    ])
}

/// The Hessian and gradient as one dense system, poses first.
pub(super) fn dense<const D: usize>(
    layout: &Layout,
    normal: &Normal<D>,
) -> (DMatrix<f64>, DVector<f64>) {
    let poses = D * layout.free_poses.len();
    let size = poses + 3 * normal.v.len();
    let mut hessian = DMatrix::zeros(size, size);
    let mut gradient = DVector::zeros(size);
    for j in 0..poses {
        gradient[j] = normal.pose_gradient[j];
        for i in j..poses {
            hessian[(i, j)] = normal.u.get(i, j);
            hessian[(j, i)] = normal.u.get(i, j);
        }
    }
    for (l, range) in layout.starts.windows(2).enumerate() {
        let at = poses + 3 * l;
        hessian
            .fixed_view_mut::<3, 3>(at, at)
            .copy_from(&normal.v[l]);
        gradient
            .fixed_rows_mut::<3>(at)
            .copy_from(&normal.landmark_gradient[l]);
        for link in range[0].link..range[1].link {
            let row = layout.links[link] * D;
            hessian
                .fixed_view_mut::<D, 3>(row, at)
                .copy_from(&normal.w[link]);
            hessian
                .fixed_view_mut::<3, D>(at, row)
                .copy_from(&normal.w[link].transpose());
        }
    }
    (hessian, gradient)
}

/// All whitened residuals, the plain loss: what the normal equations are made of, written down without any of them.
fn residuals<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
    poses: &[P],
    landmarks: &[Vector3<f64>],
) -> DVector<f64> {
    let mut all = Vec::new();
    for o in &problem.observations {
        let camera = poses[o.pose]
            .world_from_body()
            .compose(&problem.body_from_camera)
            .inverse();
        let pixel = problem
            .pinhole
            .project(&camera.transform_point(&landmarks[o.landmark]))
            .expect("in front");
        all.extend(((pixel - o.pixel_ideal) / o.sigma_px).iter());
    }
    let mut whitened = |motion: &P, covariance: &SMatrix<f64, D, D>| {
        let lower = covariance.cholesky().expect("positive definite").l();
        let error = motion.log_with_jacobian().0;
        all.extend(
            lower
                .solve_lower_triangular(&error)
                .expect("regular")
                .iter(),
        );
    };
    for f in &problem.odometry {
        whitened(
            &f.motion.between(&poses[f.from].between(&poses[f.to])),
            &f.covariance,
        );
    }
    for p in &problem.priors {
        whitened(&p.mean.between(&poses[p.pose]), &p.covariance);
    }
    DVector::from_vec(all)
}

/// Poses and landmarks moved along one coordinate of the dense system.
pub(super) fn moved<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
    layout: &Layout,
    coordinate: usize,
    step: f64,
) -> (Vec<P>, Vec<Vector3<f64>>) {
    let (mut poses, mut landmarks) = (problem.poses.clone(), problem.landmarks.clone());
    let free = D * layout.free_poses.len();
    if coordinate < free {
        let mut delta = SVector::<f64, D>::zeros();
        delta[coordinate % D] = step;
        let pose = layout.free_poses[coordinate / D];
        poses[pose] = poses[pose].retract(&delta);
    } else {
        landmarks[(coordinate - free) / 3][(coordinate - free) % 3] += step;
    }
    (poses, landmarks)
}

pub(super) fn filled<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
    loss: RobustLoss,
) -> (Layout, Whitening<D>, Normal<D>) {
    problem.check().expect("valid");
    let layout = Layout::new(problem);
    let whitening = Whitening::new(problem).expect("valid");
    let mut normal = Normal::new(&layout);
    normal
        .fill(problem, &layout, &whitening, &loss, &Estimate::new(problem))
        .expect("in front");
    (layout, whitening, normal)
}

fn check_normal_equations<P: BundlePose<D>, const D: usize>(problem: &Problem<P, D>) {
    let (layout, whitening, normal) = filled(problem, RobustLoss::None);
    let (hessian, gradient) = dense(&layout, &normal);
    let at = residuals(problem, &problem.poses, &problem.landmarks);
    let direct = cost(
        problem,
        &layout,
        &whitening,
        &RobustLoss::None,
        &Estimate::new(problem),
    );
    assert!((direct.expect("in front") / (0.5 * at.norm_squared()) - 1.0).abs() < 1e-13);
    let h = 1e-6;
    let columns: Vec<_> = (0..gradient.len())
        .map(|k| {
            let (p, l) = moved(problem, &layout, k, h);
            let (q, m) = moved(problem, &layout, k, -h);
            (residuals(problem, &p, &l) - residuals(problem, &q, &m)) / (2.0 * h)
        })
        .collect();
    let jacobian = DMatrix::from_columns(&columns);
    // Relative to the size of the entries: truncation and rounding of the differences are both near 1e-10.
    let numeric = jacobian.transpose() * &jacobian;
    assert!((&numeric - &hessian).amax() < 1e-7 * hessian.amax());
    let numeric = jacobian.transpose() * at;
    assert!((&numeric - &gradient).amax() < 1e-7 * gradient.amax());
}

#[test]
fn normal_equations_match_numerical_jacobians() {
    check_normal_equations(&planar());
    check_normal_equations(&spatial());
}

/// The pixel's derivatives by complex step: to rounding, where differences leave 1e-9.
fn check_pixel<P: BundlePose<D>, const D: usize>(problem: &Problem<P, D>, axes: [usize; D]) {
    let mut problem = problem.clone();
    problem.odometry.clear();
    problem.priors.clear();
    problem.landmarks.truncate(1);
    let only = problem.observations[1];
    problem.observations = vec![only];
    let (layout, _, normal) = filled(&problem, RobustLoss::None);
    let (hessian, gradient) = dense(&layout, &normal);
    let pixel = |pose: Matrix4<C>, point: [C; 3]| {
        let camera = inverse(&(pose * lift(&problem.body_from_camera)));
        let p: Vec<C> = (0..3)
            .map(|i| (0..3).fold(camera[(i, 3)], |sum, k| sum + camera[(i, k)] * point[k]))
            .collect();
        let k = &problem.pinhole;
        [
            (p[0] / p[2] * k.fx + k.cx - only.pixel_ideal.x) / only.sigma_px,
            (p[1] / p[2] * k.fy + k.cy - only.pixel_ideal.y) / only.sigma_px,
        ]
    };
    let point = problem.landmarks[0];
    let real = [point.x, point.y, point.z].map(C::from);
    let pose = lift(&problem.poses[only.pose].world_from_body());
    let mut columns = vec![[0.0; 2]; gradient.len()];
    for (k, &axis) in axes.iter().enumerate() {
        columns[layout.free_index[only.pose].expect("free") * D + k] =
            pixel(pose * elementary(axis), real).map(|v| v.im / H);
    }
    let first = D * layout.free_poses.len();
    for k in 0..3 {
        let mut shifted = real;
        shifted[k].im = H;
        columns[first + k] = pixel(pose, shifted).map(|v| v.im / H);
    }
    let at = pixel(pose, real).map(|v| v.re);
    for (i, a) in columns.iter().enumerate() {
        let expected = a[0] * at[0] + a[1] * at[1];
        assert!((gradient[i] - expected).abs() < 1e-12 * (1.0 + gradient.amax()));
        for (j, b) in columns.iter().enumerate() {
            let expected = a[0] * b[0] + a[1] * b[1];
            assert!((hessian[(i, j)] - expected).abs() < 1e-12 * hessian.amax());
        }
    }
}

#[test]
fn pixel_jacobians_match_complex_step() {
    check_pixel(&planar(), PLANE);
    check_pixel(&spatial(), SPACE);
}

/// The gradient with a robust loss is that of the robust cost, not of the plain one.
#[test]
fn the_robust_gradient_is_exact() {
    let problem = planar();
    for loss in [
        RobustLoss::Huber { threshold: 1.0 },
        RobustLoss::Cauchy { threshold: 0.8 },
    ] {
        let (layout, whitening, normal) = filled(&problem, loss);
        let (_, gradient) = dense(&layout, &normal);
        let (_, _, plain) = filled(&problem, RobustLoss::None);
        let (_, plain) = dense(&layout, &plain);
        assert!((&plain - &gradient).amax() > 0.1 * gradient.amax());
        let at = |k: usize, step: f64| {
            let mut problem = problem.clone();
            (problem.poses, problem.landmarks) = moved(&problem, &layout, k, step);
            let estimate = Estimate::new(&problem);
            cost(&problem, &layout, &whitening, &loss, &estimate).expect("in front")
        };
        for k in 0..gradient.len() {
            let numeric = (at(k, 1e-6) - at(k, -1e-6)) / 2e-6;
            assert!(
                (numeric - gradient[k]).abs() < 1e-6 * gradient.amax(),
                "{loss:?} {k}"
            );
        }
    }
}

/// Damping, the step of the Schur complement and that of the dense system, for several dampings and both stores.
pub(super) fn steps<const D: usize>(
    layout: &Layout,
    normal: &Normal<D>,
    hessian: &DMatrix<f64>,
    gradient: &DVector<f64>,
) -> Vec<(f64, DVector<f64>, DVector<f64>)> {
    let mut all = Vec::new();
    for damping in [0.0, 1e-6, 0.1, 10.0] {
        let mut damped = hessian.clone();
        for j in 0..damped.nrows() {
            damped[(j, j)] *= 1.0 + damping;
        }
        let expected = damped.cholesky().expect("regular").solve(&-gradient);
        for by_envelope in [false, true] {
            let mut schur = Schur::<D>::with(layout, Reduced::stored(layout, D, by_envelope));
            schur.set_scales(normal);
            schur.step(layout, normal, damping).expect("regular");
            let mut step = schur.pose_step.clone();
            step.extend(schur.landmark_step.iter().flat_map(|s| s.iter()));
            step.extend(schur.camera_step.iter());
            all.push((damping, DVector::from_vec(step), expected.clone()));
        }
    }
    all
}

fn check_schur<P: BundlePose<D>, const D: usize>(problem: &Problem<P, D>) {
    let (layout, _, normal) = filled(problem, RobustLoss::Huber { threshold: 1.5 });
    let (hessian, gradient) = dense(&layout, &normal);
    for (damping, step, expected) in steps(&layout, &normal, &hessian, &gradient) {
        let difference = (step - &expected).amax() / expected.amax();
        assert!(difference < 1e-11, "{damping}: {difference}");
    }
    // The covariance is the corner of the dense inverse, poses and landmarks.
    let inverse = hessian.try_inverse().expect("regular");
    let covariance =
        super::covariance(problem, &RobustLoss::Huber { threshold: 1.5 }).expect("regular");
    let free = D * layout.free_poses.len();
    let difference = covariance.joint() - inverse.view((0, 0), (free, free));
    assert!(difference.amax() < 1e-11 * inverse.amax());
    for l in 0..normal.v.len() {
        let block = covariance.landmark(l).expect("seen from three poses");
        let difference = block - inverse.fixed_view::<3, 3>(free + 3 * l, free + 3 * l);
        assert!(difference.amax() < 1e-11 * inverse.amax());
    }
    assert_eq!(covariance.pose(0), Some(SMatrix::zeros()));
    assert!(covariance.pose(3).is_none() && covariance.landmark(5).is_none());
}

#[test]
fn the_schur_solution_is_the_dense_one() {
    check_schur(&planar());
    check_schur(&spatial());
    // A gap in the poses that see a landmark splits its run.
    let mut gap = planar();
    gap.fixed_poses.clear();
    gap.observations.retain(|o| o.pose != 1 || o.landmark > 2);
    check_normal_equations(&gap);
    let (layout, _, _) = filled(&gap, RobustLoss::None);
    assert!(layout.runs.len() > gap.landmarks.len());
}

/// A landmark seen once says nothing of the pose: the reduced system is as if it were not there.
#[test]
fn a_free_direction_takes_its_information_with_it() {
    let full = planar();
    let mut once = full.clone();
    once.landmarks.push(once.landmarks[0] * 1.1);
    let mut sighting = once.observations[1];
    sighting.landmark = 5;
    once.observations.push(sighting);
    let with = super::covariance(&once, &RobustLoss::None).expect("regular");
    let without = super::covariance(&full, &RobustLoss::None).expect("regular");
    let scale = without.joint().amax();
    assert!((with.joint() - without.joint()).amax() < 1e-10 * scale);
    assert!(with.landmark(5).is_none() && with.landmark(4).is_some());
}
