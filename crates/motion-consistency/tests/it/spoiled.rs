//! The table of `check_motion`: each contradiction, and the name it is given.

use mono_geometry::motion::OdometrySample;
use mono_geometry::{Mount, Se3};
use motion_consistency::{Finding, FramePair, check_motion};
use nalgebra::{Vector2, Vector3};

use crate::drive::{CAMERA, Drive, looking_left, turned};

/// Name of the only finding, for three drives: they must all say the same.
fn named(drive_mount: Mount, v: f64, omega: f64, told_mount: Mount) -> String {
    let names: Vec<String> = (0..3)
        .map(|seed| {
            let drive = Drive::new(seed, drive_mount);
            let findings = check_motion(
                &drive.pairs,
                &drive.spoiled(v, omega, 0.0),
                &CAMERA,
                &told_mount,
            );
            findings
                .iter()
                .map(Finding::name)
                .collect::<Vec<_>>()
                .join(" ")
        })
        .collect();
    assert!(names.iter().all(|name| name == &names[0]), "{names:?}");
    names[0].clone()
}

#[test]
fn every_contradiction_has_its_name() {
    let (forward, left) = (Mount::forward(), looking_left());
    for (v, omega, name) in [
        (1.0, 1.0, ""),
        (1.0, -1.0, "turn-sign"),
        (-1.0, 1.0, "driving-direction"),
        (-1.0, -1.0, "camera-upside-down"),
        (1.0, 180.0 / std::f64::consts::PI, "turn-ratio"),
        (0.0, 0.0, "odometry-at-rest"),
    ] {
        assert_eq!(
            named(forward, v, omega, forward),
            name,
            "forward, v {v}, omega {omega}"
        );
        assert_eq!(
            named(left, v, omega, left),
            name,
            "left, v {v}, omega {omega}"
        );
    }
    for (real, told, name) in [
        // The camera looks to the left, and the mount was left out.
        (left, forward, "mount-turned"),
        (left, turned(&left, 180.0, 0.0), "driving-direction"),
        (forward, turned(&forward, 180.0, 0.0), "driving-direction"),
        (forward, turned(&forward, -90.0, 0.0), "mount-turned"),
        // On a plane an upside-down camera that looks ahead only turns the other way.
        (forward, turned(&forward, 0.0, 180.0), "turn-sign"),
        (left, turned(&left, 0.0, 180.0), "camera-upside-down"),
        (left, turned(&left, 0.0, 90.0), "mount-rolled"),
    ] {
        assert_eq!(named(real, 1.0, 1.0, told), name);
    }
}

#[test]
fn the_numbers_are_those_of_the_contradiction() {
    let drive = Drive::new(7, looking_left());
    let only =
        |odometry: &[_], mount: &Mount| check_motion(&drive.pairs, odometry, &CAMERA, mount)[0];
    let Finding::TurnRatio { ratio, support } = only(&drive.spoiled(1.0, 57.3, 0.0), &drive.mount)
    else {
        panic!("no turn ratio");
    };
    assert!((ratio - 1.0 / 57.3).abs() < 1e-3, "{ratio}");
    // A tenth of the matches is wrong.
    assert!(support.found > 0.8 && support.stated < 0.4, "{support:?}");
    // The mount was left out: the camera travels to its right, the mount says ahead.
    let Finding::MountTurned {
        angle_rad,
        mirrored,
        ..
    } = only(&drive.odometry, &Mount::forward())
    else {
        panic!("no turned mount");
    };
    assert!(!mirrored);
    assert!((angle_rad.to_degrees() + 90.0).abs() < 16.0, "{angle_rad}");
    let sentence = only(&drive.odometry, &Mount::forward()).to_string();
    assert!(
        sentence.contains("90 degrees further to its right"),
        "{sentence}"
    );
    assert!(sentence.contains("left out"), "{sentence}");
}

#[test]
fn a_turn_rate_that_is_twice_as_large_is_told() {
    for seed in 0..5 {
        let drive = Drive::new(seed, Mount::forward());
        let findings = check_motion(
            &drive.pairs,
            &drive.spoiled(1.0, 2.0, 0.0),
            &CAMERA,
            &drive.mount,
        );
        let [Finding::TurnRatio { ratio, .. }] = findings[..] else {
            panic!("seed {seed}: {findings:?}");
        };
        assert!((0.4..=0.7).contains(&ratio), "seed {seed}: {ratio}");
    }
}

#[test]
fn wheels_that_slip_are_told_with_time_and_ratio() {
    for (factor, from, to) in [(3.0, 60, 110), (0.4, 60, 110)] {
        for seed in 0..5 {
            let drive = Drive::new(seed, looking_left());
            let mut odometry = drive.odometry.clone();
            for row in &mut odometry[from..to] {
                row.v_mps *= factor;
            }
            let findings = check_motion(&drive.pairs, &odometry, &CAMERA, &drive.mount);
            let [Finding::WheelSlip { at_s, jump }] = findings[..] else {
                panic!("seed {seed}, {factor}: {findings:?}");
            };
            let (begin_s, end_s) = (drive.odometry[from].t_s, drive.odometry[to].t_s);
            let expected = if (at_s - begin_s).abs() < 0.6 {
                factor
            } else {
                1.0 / factor
            };
            assert!(
                (at_s - begin_s).abs() < 0.6 || (at_s - end_s).abs() < 0.6,
                "seed {seed}: {at_s}"
            );
            assert!((jump / expected).ln().abs() < 0.35, "seed {seed}: {jump}");
        }
    }
}

#[test]
fn a_camera_that_stops_is_told() {
    let drive = Drive::new(4, Mount::forward());
    let mut pairs = drive.pairs.clone();
    for pair in &mut pairs[20..] {
        for [from, to] in &mut pair.matches {
            *to = *from;
        }
    }
    let findings = check_motion(&pairs, &drive.spoiled(3.0, 1.0, 0.0), &CAMERA, &drive.mount);
    let [
        Finding::ImagesAtRest {
            frozen,
            driven,
            distance_m,
            ..
        },
    ] = findings[..]
    else {
        panic!("{findings:?}");
    };
    assert_eq!((frozen, driven), (19, 39));
    let driven_m: f64 = drive.odometry[100..]
        .iter()
        .map(|row| 3.0 * row.v_mps * 0.1)
        .sum();
    assert!((distance_m - driven_m).abs() < 0.05 * driven_m);
}

#[test]
fn a_lever_arm_does_not_hide_a_sign() {
    // A camera 30 cm beside the turning centre swings when the robot turns.
    let mut mount = Mount::forward();
    mount.body_from_camera = Se3 {
        translation: Vector3::new(0.1, 0.3, 0.4),
        ..mount.body_from_camera
    };
    assert_eq!(named(mount, 1.0, 1.0, mount), "");
    assert_eq!(named(mount, 1.0, -1.0, mount), "turn-sign");
    assert_eq!(named(mount, -1.0, 1.0, mount), "driving-direction");
}

#[test]
fn speeds_in_another_unit_are_told_where_things_are_near() {
    // The robot drives 0.1 m between two frames along a wall with things 1 to 3 m away; a hundredth of that is told.
    let pairs: Vec<FramePair> = (0..20)
        .map(|k| FramePair {
            from_s: 0.5 * f64::from(k),
            to_s: 0.5 * f64::from(k + 1),
            matches: (0..60)
                .map(|i| {
                    let depth_m = 1.0 + f64::from(i % 5) * 0.5;
                    let from = Vector2::new(
                        120.0 + f64::from(i * 31 % 400),
                        40.0 + f64::from(i * 17 % 400),
                    );
                    [from, from - Vector2::new(500.0 * 0.1 / depth_m, 0.0)]
                })
                .collect(),
        })
        .collect();
    let told = |v_mps| {
        let odometry = [OdometrySample {
            t_s: 0.0,
            v_mps,
            omega_radps: 0.0,
        }];
        let findings = check_motion(&pairs, &odometry, &CAMERA, &looking_left());
        findings
            .iter()
            .map(Finding::name)
            .collect::<Vec<_>>()
            .join(" ")
    };
    assert_eq!(told(0.2), "");
    assert_eq!(told(0.002), "speed-too-small");
}
