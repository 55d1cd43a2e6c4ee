//! A revisit against the joint Gaussian it conditions, and the path that follows it.

use std::collections::BTreeMap;

use estimation_base::Manifold;
use mono_geometry::{PlacedCamera, Se2, Se3};
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};
use rbpf_core::PersistentPath;

use super::common::{normal, particle, place, pose, rng};
use crate::filter::drift::{Draw, Drift, Support, transport};
use crate::filter::metric::ScaleNote;
use crate::filter::metric_path::MetricPath;
use crate::filter::particle::{Keyframe, Particle};
use crate::filter::path_correction::PathCorrection;
use crate::filter::revisit::Revisit;
use crate::known_map::KnownKeyframe;

/// Keyframes whose joint covariance is kept.
const WINDOW: usize = 256;

/// Positions of a square lap of `n` keyframes with sides of 2 m.
fn lap(n: usize) -> Vec<Vector2<f64>> {
    (0..n)
        .map(|k| {
            let s = 4.0 * k as f64 / n as f64;
            let (side, t) = (s.floor(), 2.0 * s.fract());
            match side as u32 {
                0 => Vector2::new(t, 0.0),
                1 => Vector2::new(2.0, t),
                2 => Vector2::new(2.0 - t, 2.0),
                _ => Vector2::new(0.0, 2.0 - t),
            }
        })
        .collect()
}

fn body(position: &Vector2<f64>) -> Se2 {
    Se2::new(position.x, position.y, 0.0)
}

fn step_noise() -> Matrix3<f64> {
    Matrix3::new(4e-4, 1e-5, 0.0, 1e-5, 1e-4, 2e-5, 0.0, 2e-5, 9e-4)
}

/// Dead reckoning along `positions`, and the joint covariance of its errors by their definition.
fn dead_reckoning(positions: &[Vector2<f64>]) -> (Drift, DMatrix<f64>) {
    let n = positions.len();
    let mut drift = Drift::keeping(WINDOW as u32);
    let mut joint = DMatrix::zeros(3 * n, 3 * n);
    for (t, p) in positions.iter().enumerate() {
        drift.push(&body(p), None, &step_noise(), &Draw::Final);
        if t == 0 {
            continue;
        }
        let carry = transport(&positions[t - 1], p);
        for b in 0..t {
            let before: Matrix3<f64> = joint.fixed_view::<3, 3>(3 * (t - 1), 3 * b).into();
            let block = carry * before;
            joint.fixed_view_mut::<3, 3>(3 * t, 3 * b).copy_from(&block);
            joint
                .fixed_view_mut::<3, 3>(3 * b, 3 * t)
                .copy_from(&block.transpose());
        }
        let before: Matrix3<f64> = joint.fixed_view::<3, 3>(3 * (t - 1), 3 * (t - 1)).into();
        let own = carry * before * carry.transpose() + step_noise();
        joint.fixed_view_mut::<3, 3>(3 * t, 3 * t).copy_from(&own);
    }
    (drift, joint)
}

#[test]
fn errors_and_covariance_after_a_revisit_are_those_of_the_joint_gaussian() {
    let positions = lap(40);
    let (mut drift, joint) = dead_reckoning(&positions);
    let here = Vector2::new(0.1, 0.05);
    let anchors = [(2_u32, 0.25), (5, 0.75)];
    let noise = Matrix3::from_diagonal(&Vector3::new(1e-5, 2e-5, 4e-6));
    let h = Vector3::new(0.05, -0.12, 0.03);
    let revisit = Revisit::new(&drift, &here, &anchors, &noise).unwrap();

    let mut measure = DMatrix::zeros(3, joint.nrows());
    let mut add = |k: usize, weight: f64| {
        let t = transport(&positions[k], &here) * weight;
        let mut block = measure.fixed_view_mut::<3, 3>(0, 3 * k);
        block += t;
    };
    add(39, 1.0);
    add(2, -0.25);
    add(5, -0.75);
    let gain_s = &joint * measure.transpose();
    let s = &measure * &gain_s + DMatrix::from_iterator(3, 3, noise.iter().copied());
    let solved = s.cholesky().unwrap();
    let errors = &gain_s * solved.solve(&DVector::from_column_slice(h.as_slice()));
    let after = &joint - &gain_s * solved.solve(&gain_s.transpose());

    let correction = revisit.correction(&h).unwrap();
    for (k, p) in positions.iter().enumerate() {
        let expected = errors.fixed_rows::<3>(3 * k).into_owned();
        let found = correction.at(k as u32, p);
        assert!(
            (found - expected).norm() < 1e-12,
            "keyframe {k}: {found} {expected}"
        );
    }
    // The lap closes up to the noise of the measurement.
    let closed =
        correction.at(39, &here) - correction.at(2, &here) * 0.25 - correction.at(5, &here) * 0.75;
    assert!((closed - h).norm() < 0.01 * h.norm(), "{closed}");
    revisit.condition(&mut drift);
    for (k, p) in positions.iter().enumerate() {
        let expected = after.fixed_view::<3, 3>(3 * k, 3 * k).into_owned();
        let found = drift.covariance_of(k as u32, p);
        assert!((found - expected).amax() < 1e-12, "keyframe {k}");
        assert!((found + Matrix3::identity() * 1e-15).cholesky().is_some());
    }
    // Half way round some of the error is gone, at the first keyframe there was none.
    let middle = |c: &DMatrix<f64>| c[(60, 60)] + c[(61, 61)];
    assert!(middle(&after) < 0.75 * middle(&joint));
    assert_eq!(correction.at(0, &positions[0]), Vector3::zeros());
}

#[test]
fn a_thinned_history_keeps_the_covariance_of_the_present_and_nearly_that_of_the_past() {
    let positions = lap(2 * WINDOW + 40);
    let (drift, joint) = dead_reckoning(&positions);
    for k in [0, 40, 200, WINDOW + 80, 2 * WINDOW + 39] {
        let expected: Matrix3<f64> = joint.fixed_view::<3, 3>(3 * k, 3 * k).into();
        let found = drift.covariance_of(k as u32, &positions[k]);
        let share = if k > WINDOW { 1e-12 } else { 0.1 };
        assert!(
            (found - expected).amax() <= share * expected.amax(),
            "keyframe {k}: {found} {expected}"
        );
    }
    assert!((drift.length_since(0, &positions[2 * WINDOW + 39]) - 8.0).abs() < 0.1);
}

#[test]
fn the_errors_of_a_known_map_are_those_of_the_run_that_made_it() {
    let positions = lap(WINDOW + 100);
    let (drift, _) = dead_reckoning(&positions);
    let saved = drift.errors();
    assert!(saved.keyframes.len() <= WINDOW / 2 && saved.keyframes[0] == 0);
    let known: Vec<KnownKeyframe> = positions
        .iter()
        .enumerate()
        .map(|(k, p)| KnownKeyframe {
            world_from_camera: Se3::identity(),
            body: body(p),
            covariance: drift.covariance_of(k as u32, p),
        })
        .collect();
    let loaded = Drift::of_map(&known, &saved, WINDOW as u32, |_| Matrix3::zeros());
    for k in saved.keyframes {
        let at = &positions[k as usize];
        let (found, expected) = (loaded.covariance_of(k, at), drift.covariance_of(k, at));
        assert!((found - expected).amax() < 1e-12);
    }
    let mut loaded = loaded;
    let last = positions[positions.len() - 1];
    let next = loaded.push(&body(&last), None, &step_noise(), &Draw::Final);
    let before = drift.covariance_of(positions.len() as u32 - 1, &last);
    assert!((next - before - step_noise()).amax() < 1e-12);
}

fn path_of(bodies: &[Se2]) -> Particle {
    let mut p = particle(pose(0.0, 0.0, 0.0));
    p.path = bodies
        .iter()
        .map(|body| {
            let pose = pose(body.x, body.y, body.phi);
            Keyframe {
                pose,
                camera: place(&pose),
                scale: ScaleNote::METRE,
            }
        })
        .collect::<PersistentPath<_>>();
    p.pose = p.path.last().unwrap().pose;
    p
}

/// A loop that closed on a street put the robot where one scale for the whole street has it: by as much beside its
/// position as the unit had drifted.
#[test]
fn regress_a_robot_that_closes_a_loop_stands_where_its_own_scale_says() {
    let bodies: Vec<Se2> = (0..30)
        .map(|k| Se2::new(0.1 * f64::from(k), 0.0, 0.0))
        .collect();
    let mut drift = Drift::keeping(WINDOW as u32);
    for body in &bodies {
        drift.push(body, None, &step_noise(), &Draw::Final);
    }
    let here = Vector2::new(bodies[29].x, bodies[29].y);
    let noise = Matrix3::identity() * 1e-12;
    let revisit = Revisit::new(&drift, &here, &[(25, 1.0)], &noise).unwrap();
    let mut particle = path_of(&bodies);
    particle.path = particle
        .path
        .iter()
        .enumerate()
        .map(|(k, keyframe)| Keyframe {
            scale: ScaleNote {
                mean: 1.0 - 0.01 * k as f64,
                variance: 1e-12,
                drift: 1e-4,
            },
            ..*keyframe
        })
        .collect::<PersistentPath<_>>();
    let tied: Vec<bool> = (0..30).map(|k| k >= 25).collect();
    let expected = MetricPath::new(&particle, Vector2::zeros(), &tied).body(29, &particle.pose);
    let correction = PathCorrection {
        errors: revisit.correction(&Vector3::zeros()).unwrap(),
        scale: 1.0 - 0.29,
        height: 0.0,
        tied,
        lever_m: Vector2::zeros(),
    };
    let mut particles = vec![particle];
    correction.apply(&mut particles);
    let stands = particles[0].metric.position();
    assert!((stands.x - expected.x).abs() < 1e-12, "{stands}");
    // The sum of the steps in the scale of each; all in the last scale are 0.4 m less.
    assert!((stands.x - 2.5).abs() < 0.1, "{stands}");
}

/// An error that is rigid from keyframe 0 on moves and turns the whole path; a point that moves with its anchor is seen
/// at the same pixel from everywhere, and the particles go on sharing the path.
#[test]
fn a_rigid_error_leaves_every_pixel_where_it_was() {
    let mut rng = rng(5);
    let rigid = Vector3::new(0.3, -0.2, 0.15);
    // One error at the origin, carried along without noise: all of the correction is that error.
    let mut drift = Drift::keeping(WINDOW as u32);
    let mut bodies = Vec::new();
    for k in 0..30 {
        let body = Se2::new(0.1 * f64::from(k), 0.02 * f64::from(k), 0.03 * f64::from(k));
        let noise = if k == 1 {
            Matrix3::identity()
        } else {
            Matrix3::zeros()
        };
        drift.push(&body, None, &noise, &Draw::Final);
        bodies.push(body);
    }
    let at_first = Vector2::new(bodies[1].x, bodies[1].y);
    let here = Vector2::new(bodies[29].x, bodies[29].y);
    let noise = Matrix3::identity() * 1e-12;
    let revisit = Revisit::new(&drift, &here, &[(0, 1.0)], &noise).unwrap();
    let h = transport(&at_first, &here) * rigid;
    let correction = PathCorrection {
        errors: revisit.correction(&h).unwrap(),
        scale: 1.0,
        height: 0.0,
        tied: Vec::new(),
        lever_m: Vector2::zeros(),
    };
    let original = path_of(&bodies);
    let mut particles = vec![original.clone(), original.clone()];
    particles[1].pose = particles[1]
        .pose
        .retract(&nalgebra::SVector::from_fn(|_, _| 1e-3 * normal(&mut rng)));
    correction.apply(&mut particles);
    let moved = &particles[0];
    let relative = |a: &PlacedCamera, b: &PlacedCamera| {
        (
            a.camera_from_world * (b.centre - a.centre),
            a.camera_from_world * b.camera_from_world.transpose(),
        )
    };
    let camera = |p: &Particle, k: usize| p.path.get(k).unwrap().camera;
    for k in 2..30 {
        let before = relative(&camera(&original, 1), &camera(&original, k));
        let after = relative(&camera(moved, 1), &camera(moved, k));
        // To first order in an error of 0.15 rad over 3 m.
        assert!(
            (before.0 - after.0).norm() < 0.5 * 0.15 * 0.15 * 3.0,
            "keyframe {k}"
        );
        assert!((before.1 - after.1).norm() < 1e-9, "keyframe {k}");
        let pose = moved.path.get(k).unwrap().pose;
        assert!((pose.phi - (bodies[k].phi - 0.15)).abs() < 1e-9);
        assert!(
            (place(&pose).camera_from_world - camera(moved, k).camera_from_world).norm() < 1e-9
        );
    }
    assert_eq!(moved.path.get(0), original.path.get(0));
    assert_eq!(moved.pose, moved.path.last().unwrap().pose);
    let position = moved.metric.position();
    assert!((position - moved.pose.centre.xy()).norm() < 1e-12);
    let address = |p: &Particle| core::ptr::from_ref(p.path.get(3).unwrap());
    assert_eq!(address(&particles[0]), address(&particles[1]));
}

/// A second lap leans on the landmarks of the first. What the first reported beyond the joint covariance (an unknown scale, say)
/// is in their places for good, however sure the filter has become meanwhile.
#[test]
fn regress_an_old_place_is_known_no_better_than_when_it_was_mapped() {
    let positions = lap(40);
    let none = Matrix3::zeros();
    let reported = Matrix3::from_diagonal(&Vector3::new(9e-4, 4e-4, 1e-5));
    let mut drift = Drift::keeping(WINDOW as u32);
    drift.push(&body(&positions[0]), None, &none, &Draw::Final);
    for p in &positions[1..] {
        drift.push(&body(p), None, &none, &Draw::Final);
        drift.note_reported(&reported);
    }
    let leaning = Support {
        gains: BTreeMap::from([
            (20, Matrix3::identity() * 0.5),
            (19, Matrix3::identity() * 0.5),
        ]),
        covariance: none,
    };
    let again = drift.push(&body(&positions[20]), Some(&leaning), &none, &Draw::Final);
    assert!(
        again[(0, 0)] > 0.9 * reported[(0, 0)] && again[(0, 0)] < 1.2 * reported[(0, 0)],
        "{again}"
    );
    assert!(
        again[(1, 1)] > 0.9 * reported[(1, 1)] && again[(1, 1)] < 1.2 * reported[(1, 1)],
        "{again}"
    );
}
