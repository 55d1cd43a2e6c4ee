//! Scenes: truth that agrees with the images, and determinism.

use nalgebra::Point3;
use wall_scenes::{CalibrationError, Carrier, FrameRate, Scene, SceneKind, SceneSpec};

/// Fewer frames than the real thing, so that debug tests stay short.
fn small(kind: SceneKind, seed: u64) -> Scene {
    let spec = match kind {
        SceneKind::Wall => SceneSpec::wall(seed),
        SceneKind::Room => SceneSpec::room(seed),
    };
    Scene::new(SceneSpec { frames: 12, ..spec }).unwrap()
}

#[test]
fn a_point_seen_in_one_frame_is_seen_in_the_next_unless_hidden() {
    let fisheye = Scene::new(SceneSpec {
        frames: 12,
        fisheye_px: Some(330.0),
        ..SceneSpec::room(7)
    })
    .unwrap();
    let (wall, room) = (small(SceneKind::Wall, 7), small(SceneKind::Room, 7));
    for (kind, scene) in [("wall", wall), ("room", room), ("fisheye", fisheye)] {
        let (mut seen, mut hidden) = (0, 0);
        for k in 0..600_u32 {
            let (u, v) = (
                f64::from(k * 131 % 319) + 0.3,
                f64::from(k * 57 % 239) + 0.6,
            );
            let point = scene.point_at(4, u, v).unwrap();
            let [bu, bv] = scene.project(4, &point).unwrap();
            assert!((bu - u).abs() < 1e-9 && (bv - v).abs() < 1e-9);
            let Some([u2, v2]) = scene.project(5, &point) else {
                continue;
            };
            let there = scene.point_at(5, u2, v2).unwrap();
            let range = |p: &Point3<f64>| {
                (p - scene.world_from_camera(5).translation.vector)
                    .coords
                    .norm()
            };
            if (there - point).norm() < 1e-9 {
                seen += 1;
            } else {
                // Only something nearer may stand in the way.
                assert!(range(&there) < range(&point));
                hidden += 1;
            }
        }
        assert!(
            seen > 10 * hidden && seen > 300,
            "{kind}: {seen} seen, {hidden} hidden"
        );
    }
}

/// Where the rays of the pinhole meet the scene, the fisheye shows the same brightness, and at the same pixel another.
#[test]
fn a_fisheye_shows_the_scene_where_it_projects_it() {
    let spec = SceneSpec {
        frames: 4,
        noise_px: 0.0,
        ..SceneSpec::room(5)
    };
    let pinhole = Scene::new(spec).unwrap();
    let fisheye = Scene::new(SceneSpec {
        fisheye_px: Some(369.0),
        ..spec
    })
    .unwrap();
    let skins = pinhole.skins();
    let (plain, bent) = (pinhole.render(&skins, 2), fisheye.render(&skins, 2));
    let at = |pixels: &[u8], u: f64, v: f64| f64::from(pixels[v as usize * 320 + u as usize]);
    let (mut projected, mut same, mut count) = (0.0, 0.0, 0.0);
    // Towards the rim, where the two pictures are up to ten pixels apart.
    for v in (4..236).step_by(3) {
        for u in (4..60).step_by(3) {
            let (u, v) = (f64::from(u), f64::from(v));
            let point = pinhole.point_at(2, u, v).unwrap();
            let [bu, bv] = fisheye.project(2, &point).unwrap();
            let seen = at(&plain.pixels, u, v);
            projected += (at(&bent.pixels, bu.round(), bv.round()) - seen).abs();
            same += (at(&bent.pixels, u, v) - seen).abs();
            count += 1.0;
        }
    }
    // Half a pixel of rounding, and the light that the corners lose.
    let (projected, same) = (projected / count, same / count);
    assert!(projected < 0.25 * same, "{projected} against {same}");
}

#[test]
fn wall_is_two_metres_away_with_relief_in_front() {
    let scene = small(SceneKind::Wall, 1);
    let depths: Vec<f64> = (0..320 * 240)
        .step_by(37)
        .map(|k| {
            scene
                .depth_at(0, f64::from(k % 320), f64::from(k / 320))
                .unwrap()
        })
        .collect();
    let far = depths.iter().copied().fold(0.0, f64::max);
    let near = depths.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((far - 2.0021).abs() < 0.01, "{far}");
    assert!((1.4..1.97).contains(&near), "{near}");
}

#[test]
fn every_ray_of_the_room_ends_on_a_surface() {
    let scene = Scene::new(SceneSpec {
        frames: 60,
        ..SceneSpec::room(2)
    })
    .unwrap();
    for frame in 0..60 {
        for (u, v) in [
            (0.0, 0.0),
            (319.0, 0.0),
            (0.0, 239.0),
            (319.0, 239.0),
            (160.0, 120.0),
        ] {
            let depth = scene.depth_at(frame, u, v).unwrap();
            assert!((0.8..6.0).contains(&depth), "frame {frame}: {depth}");
        }
    }
}

#[test]
fn same_seed_same_pixels_whatever_the_threads() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let scene = small(SceneKind::Wall, 5);
            (scene.render(&scene.skins(), 3), scene.odometry().to_vec())
        })
    };
    let one = on(1);
    assert_eq!(one, on(3));
    let other = small(SceneKind::Wall, 6);
    assert_ne!(one.0, other.render(&other.skins(), 3));
}

#[test]
fn more_frames_leave_the_path_of_the_first_ones_alone() {
    let short = small(SceneKind::Wall, 5);
    let long = Scene::new(SceneSpec {
        frames: 20,
        ..SceneSpec::wall(5)
    })
    .unwrap();
    assert_eq!(short.path().poses[..], long.path().poses[..12]);
}

#[test]
fn odometry_between_images_is_whole_at_every_frame_rate() {
    for (multiple, divisor) in [(1, 1), (8, 1), (3, 2), (1, 4)] {
        let spec = SceneSpec {
            frames: 9,
            frame_rate: FrameRate { multiple, divisor },
            ..SceneSpec::wall(5)
        };
        let scene = Scene::new(spec).unwrap();
        assert!(scene.odometry_before(0).is_empty());
        let times = &scene.path().times_s;
        let (mut driven, mut now) = (0.0, 0.0);
        for image in 1..scene.images() {
            for (duration_s, row) in scene.odometry_before(image) {
                // The row that holds at this time: it began at or before it and has not ended.
                assert!(row.t_s < now + 1e-9 && now + duration_s < row.t_s + 0.1 + 1e-9);
                driven += duration_s * row.v_mps;
                now += duration_s;
            }
            assert!((now - times[image]).abs() < 1e-9);
        }
        let all: f64 = scene.odometry().iter().map(|row| 0.1 * row.v_mps).sum();
        if divisor == 1 {
            assert!((driven - all).abs() < 1e-9, "{driven} {all}");
        }
    }
}

#[test]
fn the_body_of_an_offset_robot_is_where_its_files_say() {
    let spec = SceneSpec {
        frames: 3,
        carrier: Carrier {
            origin_ahead_m: 0.4,
            roll_rad: 0.01,
            slope_rad: 0.05,
            ..Carrier::IDEAL
        },
        calibration: CalibrationError {
            mount_yaw_rad: 0.005,
            focal_ratio: 0.005,
        },
        ..SceneSpec::wall(8)
    };
    let folder = std::env::temp_dir().join(format!("scene-offset-{}", std::process::id()));
    let scene = Scene::new(spec).unwrap();
    scene.write(&folder).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let (planar, camera) = (read("groundtruth_planar.csv"), read("camera.toml"));
    let again = Scene::read(&folder.join("scene.json")).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(again.spec(), scene.spec());
    assert!(planar.contains("\n0,0.000000,0.000000000,0.000000000,0.000000000\n"));
    let last = scene.path().poses[2];
    assert!(planar.contains(&format!(
        "2,1.000000,{:.9},{:.9},{:.9}",
        last.x, last.y, last.phi
    )));
    // Table I times 1.005, and the sine of the yaw in the mount.
    assert!(camera.contains("fx = 370.67033"), "{camera}");
    assert!(camera.contains("[0.00499997916"), "{camera}");
    // The images are those of the true camera, which the body carries at a height that the slope gives.
    let mount = Scene::mount().body_from_camera.translation;
    assert!(scene.world_from_camera(2).translation.z > mount.z);
}

#[test]
fn a_written_scene_reads_back_as_itself() {
    let folder = std::env::temp_dir().join(format!("scene-round-trip-{}", std::process::id()));
    let scene = Scene::new(SceneSpec {
        frames: 2,
        ..SceneSpec::wall(8)
    })
    .unwrap();
    scene.write(&folder).unwrap();
    let again = Scene::read(&folder.join("scene.json")).unwrap();
    let image = image::open(folder.join("images/000001.png"))
        .unwrap()
        .to_luma8();
    let description = std::fs::read(folder.join("scene.json")).unwrap();
    let copy = folder.join("copy");
    again.write(&copy).unwrap();
    let described_again = std::fs::read(copy.join("scene.json")).unwrap();
    let refused = scene.write(&folder).unwrap_err().to_string();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(again.spec(), scene.spec());
    assert_eq!(description, described_again);
    assert_eq!(image.into_raw(), again.render(&again.skins(), 1).pixels);
    assert!(refused.contains("already holds"), "{refused}");
}

#[test]
fn impossible_scenes_are_refused_with_the_number_given() {
    for spec in [
        SceneSpec {
            frames: 1,
            ..SceneSpec::wall(0)
        },
        SceneSpec {
            noise_px: f64::NAN,
            ..SceneSpec::wall(0)
        },
        SceneSpec {
            noise_px: -1.0,
            ..SceneSpec::wall(0)
        },
        SceneSpec {
            laps: 101,
            ..SceneSpec::room(0)
        },
    ] {
        let message = Scene::new(spec).unwrap_err().to_string();
        assert!(
            message.contains('1') || message.contains("NaN"),
            "{message}"
        );
    }
}

#[test]
fn the_camera_and_mount_given_out_are_those_of_the_truth() {
    let scene = small(SceneKind::Wall, 4);
    let pinhole = Scene::pinhole();
    // In the first frame the body is the world.
    let world_from_camera = Scene::mount().body_from_camera;
    let point = scene.point_at(0, 100.0, 80.0).unwrap();
    let seen = world_from_camera.inverse().transform_point(&point.coords);
    let (u, v) = (
        pinhole.fx * seen.x / seen.z + pinhole.cx,
        pinhole.fy * seen.y / seen.z + pinhole.cy,
    );
    assert!(
        (u - 100.0).abs() < 1e-9 && (v - 80.0).abs() < 1e-9,
        "{u} {v}"
    );
}
