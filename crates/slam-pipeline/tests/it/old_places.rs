//! Maps that outlive their run, robots that wake up in one, are lifted or blinded.

use mono_geometry::Se2;
use nalgebra::{Matrix2, Vector2, Vector3};
use slam_pipeline::config::{Config, Method};
use slam_pipeline::{
    FrameInput, FrameReport, KnownMap, MapUse, OdometryInterval, Slam, SlamError, Tracking,
};
use vision_sift::Features;

use crate::drive::{Drive, FRAMES, config, rig};

/// A system after the whole of `drive`.
fn mapped(drive: &Drive, seed: u64) -> Slam {
    let mut slam = Slam::new(rig(), &config(30, seed)).unwrap();
    for i in 0..FRAMES {
        slam.step(&drive.input(i), &mut |_| {}).unwrap();
    }
    slam
}

fn step(slam: &mut Slam, features: &Features, odometry: &[OdometryInterval]) -> FrameReport {
    let input = FrameInput { features, odometry };
    slam.step(&input, &mut |_| {}).unwrap()
}

/// Distance of the estimate from `truth`, metres, and the same in standard deviations.
fn error(report: &FrameReport, truth: &Se2) -> (f64, f64) {
    let pose = &report.estimate.pose;
    let d = Vector2::new(pose.x - truth.x, pose.y - truth.y);
    let covariance: Matrix2<f64> = report.estimate.covariance.fixed_view::<2, 2>(0, 0).into();
    let covariance = covariance.cholesky().unwrap();
    (d.norm(), d.dot(&covariance.solve(&d)).sqrt())
}

#[test]
fn a_known_map_is_the_map_of_the_run_in_metres() {
    let slam = mapped(&Drive::new(5), 5);
    let map = slam.known_map();
    let landmarks = slam.landmarks();
    assert!(map.landmarks.len() > 100);
    let mut compared = 0;
    for known in &map.landmarks {
        // Landmarks without a positive depth have no point.
        let Some(point) = landmarks.iter().find(|l| l.id == known.id) else {
            continue;
        };
        let [alpha, beta, rho] = known.parameters.into();
        let in_camera = Vector3::new(alpha, beta, 1.0) / rho;
        let keyframe = &map.keyframes[known.anchor as usize];
        let world = keyframe.world_from_camera.transform_point(&in_camera);
        assert!(
            (world - point.position).norm() < 1e-9,
            "landmark {}",
            known.id
        );
        compared += 1;
    }
    assert!(compared > 100);
    let path = slam.smoothed_path();
    let last = map.keyframes[map.keyframes.len() - 1];
    assert!(
        path.iter()
            .any(|p| (p.x - last.body.x).hypot(p.y - last.body.y) < 1e-9)
    );
    assert_eq!(
        map.keyframes[0].covariance.fixed_view::<2, 2>(0, 0).norm(),
        0.0
    );
    assert!(last.covariance[(0, 0)] > 0.0);
}

/// The scale error of the wheels, the first heading and the yaw of the mount were in the covariances of the map, and were
/// added to them again by the system that was begun in it.
#[test]
fn regress_a_map_read_again_counts_scale_and_calibration_once() {
    let (scale, heading, yaw) = (0.05, 0.03, 0.05);
    let mut config = Config::clone(&config(30, 5));
    config.odometry.scale_bias = scale;
    config.carrier.first_heading_sigma = heading;
    config.carrier.mount_yaw_sigma = yaw;
    let config = config.check().unwrap();
    let drive = Drive::new(5);
    let mut slam = Slam::new(rig(), &config).unwrap();
    for i in 0..FRAMES {
        slam.step(&drive.input(i), &mut |_| {}).unwrap();
    }
    let map = slam.known_map();
    for usage in [MapUse::Localise, MapUse::Extend] {
        let again = Slam::with_map(rig(), &config, &map, usage)
            .unwrap()
            .known_map();
        let mut compared = 0;
        for (old, new) in map.keyframes.iter().zip(&again.keyframes) {
            let (x, y) = (old.body.x, old.body.y);
            let turn = heading * heading + yaw * yaw;
            let added = [
                scale * scale * x * x + turn * y * y,
                scale * scale * y * y + turn * x * x,
                heading * heading,
            ];
            for (i, added) in added.into_iter().enumerate() {
                let (old, new) = (old.covariance[(i, i)], new.covariance[(i, i)]);
                // Where it is most of the covariance, and then twice would be half as much again.
                if added > 0.5 * old {
                    assert!((0.9..1.1).contains(&(new / old)), "{i}: {old} became {new}");
                    compared += 1;
                }
            }
        }
        assert!(compared > map.keyframes.len(), "{compared}");
    }
}

#[test]
fn a_robot_that_wakes_up_in_a_known_map_finds_itself_within_five_frames() {
    let map = mapped(&Drive::new(5), 5).known_map();
    let drive = Drive::again(5, 77);
    for usage in [MapUse::Localise, MapUse::Extend] {
        for start in [0, 13, 27] {
            let mut slam = Slam::with_map(rig(), &config(30, 9), &map, usage).unwrap();
            let mut found = None;
            for i in start..start + 10 {
                let odometry = if i == start {
                    &[][..]
                } else {
                    drive.input(i).odometry
                };
                let report = step(&mut slam, &drive.features[i], odometry);
                let (metres, sigmas) = error(&report, &drive.truth[i]);
                match report.tracking {
                    Tracking::Lost => {
                        assert!(found.is_none(), "lost again at {i} after {found:?}");
                        assert!(sigmas < 4.0);
                    }
                    _ => {
                        found.get_or_insert(i);
                        assert!(metres < 0.08 && sigmas < 4.0, "{i}: {metres} m, {sigmas}");
                    }
                }
            }
            assert!(found.unwrap() < start + 5, "{start}: {found:?}");
            // Frames before it was found are placed by odometry, back from where it was found.
            for (p, truth) in slam.smoothed_path().iter().zip(&drive.truth[start..]) {
                assert!(
                    (p.x - truth.x).hypot(p.y - truth.y) < 0.1,
                    "{p:?} {truth:?}"
                );
            }
            let after = slam.known_map();
            let old: Vec<u32> = map.landmarks.iter().map(|l| l.id).collect();
            match usage {
                MapUse::Localise => {
                    let same = |a: &KnownMap| -> Vec<_> {
                        a.landmarks.iter().map(|l| (l.id, l.anchor)).collect()
                    };
                    assert_eq!(same(&after), same(&map));
                    for (a, b) in after.landmarks.iter().zip(&map.landmarks) {
                        assert_eq!((a.parameters, a.covariance), (b.parameters, b.covariance));
                    }
                }
                MapUse::Extend => {
                    assert!(after.keyframes.len() > map.keyframes.len());
                    let new = after.landmarks.iter().filter(|l| !old.contains(&l.id));
                    assert!(new.clone().all(|l| l.id > old[old.len() - 1]));
                }
            }
        }
    }
}

#[test]
fn a_robot_that_is_lifted_is_found_where_it_is_set_down() {
    let drive = Drive::new(8);
    let mut slam = Slam::new(rig(), &config(30, 3)).unwrap();
    for i in 0..33 {
        slam.step(&drive.input(i), &mut |_| {}).unwrap();
    }
    // Two metres back, and odometry says nothing.
    let drive = Drive::again(8, 1);
    let mut recovered = None;
    for i in 11..21 {
        let odometry = if i == 11 {
            &[][..]
        } else {
            drive.input(i).odometry
        };
        let report = step(&mut slam, &drive.features[i], odometry);
        if report.tracking == Tracking::Relocalised {
            recovered = Some(i);
        }
        if recovered.is_some() {
            let (metres, sigmas) = error(&report, &drive.truth[i]);
            assert!(metres < 0.1 && sigmas < 4.0, "{i}: {metres} m, {sigmas}");
        }
    }
    assert!(recovered.is_some_and(|i| i < 16), "{recovered:?}");
}

#[test]
fn a_blind_robot_is_lost_and_its_covariance_grows_until_it_sees_again() {
    let drive = Drive::new(12);
    let mut slam = Slam::new(rig(), &config(30, 3)).unwrap();
    let mut variances = Vec::new();
    for i in 0..FRAMES {
        let dark = (20..26).contains(&i);
        let nothing = Features::default();
        let features = if dark { &nothing } else { &drive.features[i] };
        let report = step(&mut slam, features, drive.input(i).odometry);
        let expected = match i {
            20..26 => Tracking::Lost,
            _ => Tracking::Tracking,
        };
        assert_eq!(report.tracking, expected, "frame {i}");
        assert!(!(dark && report.keyframe));
        if dark {
            variances.push(report.estimate.covariance.fixed_view::<2, 2>(0, 0).trace());
        }
        if i > 0 {
            let (_, sigmas) = error(&report, &drive.truth[i]);
            assert!(sigmas < 4.5, "frame {i}: {sigmas}");
        }
    }
    assert!(variances.windows(2).all(|v| v[1] > v[0]), "{variances:?}");
}

#[test]
fn a_map_that_contradicts_itself_is_refused_with_the_number() {
    let map = mapped(&Drive::new(5), 5).known_map();
    let refused = |change: &dyn Fn(&mut KnownMap)| {
        let mut map = map.clone();
        change(&mut map);
        match Slam::with_map(rig(), &config(5, 1), &map, MapUse::Extend) {
            Err(SlamError::Map { reason }) => reason,
            other => format!("not refused: {:?}", other.map(|_| ())),
        }
    };
    assert_eq!(
        refused(&|m| m.keyframes.clear()),
        "0 keyframes, required: at least 1"
    );
    let count = map.keyframes.len();
    let id = map.landmarks[3].id;
    assert_eq!(
        refused(&|m| m.landmarks[3].anchor = 1000),
        format!("landmark {id} is anchored in keyframe 1000 of {count}")
    );
    let before = map.landmarks[2].id;
    assert_eq!(
        refused(&|m| m.landmarks[3].id = before),
        format!("landmark {before} follows landmark {before}, required: ascending ids")
    );
    assert_eq!(
        refused(&|m| m.landmarks[3].parameters.z = f64::NAN),
        format!("landmark {id} is not usable")
    );
    assert_eq!(
        refused(&|m| m.keyframes[1].body.x = f64::INFINITY),
        "keyframe 1 is not finite"
    );
    let same = Vector2::new(map.keyframes[0].body.x, map.keyframes[0].body.y);
    assert_eq!(same, Vector2::zeros());
}

/// The other methods went on from the last keyframe of the map as if the robot stood there, and said that they tracked.
#[test]
fn regress_methods_that_find_no_place_are_refused_a_map() {
    let map = mapped(&Drive::new(5), 5).known_map();
    for method in [Method::Paper, Method::Conventional] {
        let mut config = (*config(5, 1)).clone();
        config.filter.method = method;
        let config = config.check().unwrap();
        let refused = Slam::with_map(rig(), &config, &map, MapUse::Localise).unwrap_err();
        let told = format!("the method {} does not find its place", method.name());
        assert!(refused.to_string().contains(&told), "{refused}");
    }
}

/// A robot that drives to and fro along a wall it knows measures the scale of its map again and again. Its drift was let grow
/// as if all of this were new, so that only the odometry of the last metres counted, and the far end of the wall lay now here,
/// now there.
#[test]
fn regress_the_scale_of_an_old_place_does_not_wander() {
    let first = Drive::new(5);
    let mut slam = Slam::new(rig(), &config(30, 4)).unwrap();
    let last = FRAMES - 1;
    for i in 0..FRAMES {
        slam.step(&first.input(i), &mut |_| {}).unwrap();
    }
    let mut ends = Vec::new();
    for round in 0..12 {
        let back = Drive::again(5, 100 + round);
        for i in (0..last).rev() {
            let there = back.odometry[i];
            let odometry = OdometryInterval {
                v_mps: -there.v_mps,
                omega_radps: -there.omega_radps,
                ..there
            };
            step(&mut slam, &back.features[i], &[odometry]);
        }
        let to = Drive::again(5, 200 + round);
        let mut report = None;
        for i in 1..FRAMES {
            report = Some(step(&mut slam, &to.features[i], &to.odometry[i - 1..i]));
        }
        ends.push(report.unwrap().estimate.pose.x);
    }
    let settled = &ends[2..];
    let n = settled.len() as f64;
    let mean = settled.iter().sum::<f64>() / n;
    let spread = (settled.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let truth = first.truth[last].x;
    assert!(spread < 0.004 * truth, "{spread} m of {truth} m: {ends:?}");
}

/// Rows of shelves: behind the wall that the robot sees stand others, each mapped from its own aisle. The map does not know that
/// the first hides the rest; all of them were expected in view, next to none was found, and no place was believed.
#[test]
fn regress_walls_behind_the_wall_are_not_expected() {
    let mut map = mapped(&Drive::new(5), 5).known_map();
    let (keyframes, landmarks) = (map.keyframes.clone(), map.landmarks.clone());
    for row in 1..=6_u32 {
        let aisle = Vector3::new(0.0, 12.0 * f64::from(row), 0.0);
        let first = map.keyframes.len() as u32;
        map.keyframes.extend(keyframes.iter().map(|k| {
            let mut k = *k;
            k.world_from_camera.translation += aisle;
            k.body.y += aisle.y;
            k
        }));
        let next = map.landmarks[map.landmarks.len() - 1].id + 1;
        map.landmarks
            .extend(landmarks.iter().zip(next..).map(|(l, id)| {
                let mut l = l.clone();
                l.id = id;
                l.anchor += first;
                // Another wall looks different.
                for (i, d) in l.descriptor.iter_mut().enumerate() {
                    *d = (id as u8)
                        .wrapping_mul(97)
                        .wrapping_add((i as u8).wrapping_mul(row as u8 * 31))
                        / 2;
                }
                l
            }));
    }
    let drive = Drive::again(5, 77);
    let mut slam = Slam::with_map(rig(), &config(30, 9), &map, MapUse::Localise).unwrap();
    let found = (13..18).position(|i| {
        let odometry = if i == 13 {
            &[]
        } else {
            &drive.odometry[i - 1..i]
        };
        step(&mut slam, &drive.features[i], odometry).tracking != Tracking::Lost
    });
    assert!(found.is_some(), "not found in five frames");
}

/// The same wall twice in a map, the second time without its far end: where both look alike the robot may stand at either, and
/// says so; the far end decides.
#[test]
fn places_that_look_alike_are_kept_until_one_is_left() {
    let mut map = mapped(&Drive::new(5), 5).known_map();
    let away = Vector3::new(40.0, 0.0, 0.0);
    let (keyframes, landmarks) = (map.keyframes.clone(), map.landmarks.clone());
    let first = keyframes.len() as u32;
    map.keyframes.extend(keyframes.iter().map(|k| {
        let mut k = *k;
        k.world_from_camera.translation += away;
        k.body.x += away.x;
        k
    }));
    let next = landmarks[landmarks.len() - 1].id + 1;
    let twins = landmarks.iter().filter(|l| {
        let at = Vector3::new(l.parameters.x, l.parameters.y, 1.0) / l.parameters.z;
        let world = keyframes[l.anchor as usize]
            .world_from_camera
            .transform_point(&at);
        world.x < 1.8
    });
    map.landmarks.extend(twins.zip(next..).map(|(l, id)| {
        let mut l = l.clone();
        l.id = id;
        l.anchor += first;
        l
    }));
    let drive = Drive::again(5, 77);
    for usage in [MapUse::Localise, MapUse::Extend] {
        let mut slam = Slam::with_map(rig(), &config(30, 9), &map, usage).unwrap();
        let mut open = 0;
        let mut found = None;
        for i in 5..30 {
            let odometry = if i == 5 {
                &[][..]
            } else {
                drive.input(i).odometry
            };
            let report = step(&mut slam, &drive.features[i], odometry);
            let (metres, sigmas) = error(&report, &drive.truth[i]);
            assert!(sigmas < 4.0, "{i}: {metres} m, {sigmas}");
            if report.tracking == Tracking::Lost {
                assert!(found.is_none(), "lost again at {i}");
                // Here or forty metres away.
                let sigma = report.estimate.covariance[(0, 0)].sqrt();
                open += usize::from((sigma - 20.0).abs() < 3.0);
            } else {
                found.get_or_insert(i);
                assert!(metres < 0.1, "{i}: {metres} m");
            }
        }
        assert!(open >= 3 && found.is_some(), "{open} {found:?}");
    }
}
