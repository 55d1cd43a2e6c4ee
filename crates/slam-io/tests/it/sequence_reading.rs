//! A good folder reads back what was written; each fault is one sentence with file and line.

use std::fs;

use crate::common::sequence::{CAMERA, fault, good, names_of, with, with_camera};
use crate::common::{ScratchFolder, data_folder};
use mono_geometry::Distortion;
use slam_io::{MountFile, OdometrySource, Sequence, SequenceFormat};

#[test]
fn a_good_folder_reads_back_what_was_written() {
    let folder = good();
    let sequence = Sequence::open(folder.path()).unwrap();
    assert_eq!(sequence.images.len(), 4);
    let names: Vec<String> = (0..4).map(|index| sequence.images.name(index)).collect();
    assert_eq!(
        names,
        ["000000.png", "000001.PNG", "000002.jpg", "000003.jpeg"]
    );
    assert_eq!(sequence.format, SequenceFormat::Native);
    assert_eq!(
        sequence.odometry_source,
        OdometrySource::File("odometry.csv".into())
    );
    // The even pictures of these tests show nothing.
    assert_eq!(names_of(&sequence.warnings), ["images-without-contrast"]);
    assert_eq!(sequence.times_s, [0.0, 0.5, 1.0, 1.5]);
    assert_eq!((sequence.camera.width, sequence.camera.height), (8, 6));
    assert_eq!((sequence.camera.fx, sequence.camera.fy), (10.0, 11.0));
    assert_eq!(sequence.camera.distortion, Distortion::None);
    assert_eq!(sequence.camera.mount, MountFile::default());
    assert_eq!(sequence.odometry.len(), 3);
    assert_eq!(sequence.reference, None);
    assert_eq!(
        sequence.name,
        folder.path().file_name().unwrap().to_string_lossy()
    );
    for index in 0..4 {
        let grey = sequence.load_image(index).unwrap();
        assert_eq!((grey.width, grey.height, grey.pixels.len()), (8, 6, 48));
        assert!(
            grey.pixels
                .iter()
                .all(|&value| value.abs_diff(40 * index as u8) <= 2)
        );
    }
    let message = sequence.load_image(4).unwrap_err().to_string();
    assert_eq!(message, "frame 4 was asked for, the sequence has 4 frames");
}

#[test]
fn without_a_mount_the_camera_looks_along_body_x() {
    let rows = MountFile::default().rotation_body_from_camera;
    let axis = |column: usize| rows.map(|row| row[column]);
    assert_eq!(axis(2), [1.0, 0.0, 0.0], "optical axis is body x");
    assert_eq!(axis(0), [0.0, -1.0, 0.0], "right is minus body y");
    assert_eq!(axis(1), [0.0, 0.0, -1.0], "down is minus body z");
}

#[test]
fn distortion_and_mount_are_read() {
    let folder = good();
    with_camera(
        "[distortion]\nmodel = \"radtan\"\nk1 = 0.1\nk2 = -0.2\np1 = 0.01\np2 = 0.02\n\
         [mount]\nposition_in_body = [1, 2.5, 3]\nrotation_body_from_camera = [[-1, 0, 0], [0, 0, -1], [0, -1, 0]]\n",
    )(folder.path());
    let camera = Sequence::open(folder.path()).unwrap().camera;
    let expected = Distortion::Radtan {
        k1: 0.1,
        k2: -0.2,
        p1: 0.01,
        p2: 0.02,
        k3: 0.0,
    };
    assert_eq!(camera.distortion, expected);
    assert_eq!(camera.mount.position_in_body, [1.0, 2.5, 3.0]);
    let written = [[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]];
    assert_eq!(
        camera.mount.rotation_body_from_camera, written,
        "an exact rotation stays exact"
    );

    with_camera("[distortion]\nmodel = \"kannala-brandt\"\nk1 = 1\nk2 = 2\nk3 = 3\nk4 = 4\n")(
        folder.path(),
    );
    let camera = Sequence::open(folder.path()).unwrap().camera;
    let expected = Distortion::KannalaBrandt {
        k1: 1.0,
        k2: 2.0,
        k3: 3.0,
        k4: 4.0,
    };
    assert_eq!(camera.distortion, expected);
}

#[test]
fn a_rounded_rotation_becomes_orthonormal() {
    let folder = good();
    // 30 degrees about z with four decimals, times the default mount.
    with_camera(
        "[mount]\nposition_in_body = [0, 0, 0]\n\
         rotation_body_from_camera = [[0.5, 0, 0.866], [-0.866, 0, 0.5], [0, -1, 0]]\n",
    )(folder.path());
    let rows = Sequence::open(folder.path())
        .unwrap()
        .camera
        .mount
        .rotation_body_from_camera;
    for i in 0..3 {
        for j in 0..3 {
            let dot: f64 = (0..3).map(|row| rows[row][i] * rows[row][j]).sum();
            let expected = f64::from(u8::from(i == j));
            assert!(
                (dot - expected).abs() < 4.0 * f64::EPSILON,
                "columns {i} and {j}: {dot}"
            );
        }
    }
    assert!((rows[0][2] - 0.75_f64.sqrt()).abs() < 1e-4);
}

#[test]
fn odometry_pieces_fill_the_interval() {
    let folder = good();
    let sequence = Sequence::open(folder.path()).unwrap();
    let close = |pieces: Vec<(f64, f64, f64)>, expected: &[(f64, f64, f64)]| {
        assert_eq!(pieces.len(), expected.len(), "{pieces:?}");
        for (piece, expected) in pieces.iter().zip(expected) {
            assert!((piece.0 - expected.0).abs() < 1e-12, "{pieces:?}");
            assert_eq!((piece.1, piece.2), (expected.1, expected.2), "{pieces:?}");
        }
    };
    close(sequence.odometry_between(0.0, 0.4), &[(0.4, 1.0, 0.1)]);
    close(
        sequence.odometry_between(0.1, 1.5),
        &[(0.3, 1.0, 0.1), (0.8, 2.0, 0.2), (0.3, 3.0, -0.3)],
    );
    close(sequence.odometry_between(5.0, 7.0), &[(2.0, 3.0, -0.3)]);
    close(sequence.odometry_between(0.4, 1.2), &[(0.8, 2.0, 0.2)]);
    // Before the first row nothing is known.
    close(sequence.odometry_between(-1.0, 0.2), &[(0.2, 1.0, 0.1)]);
    close(sequence.odometry_between(-2.0, -1.0), &[]);
    close(sequence.odometry_between(1.0, 1.0), &[]);
    close(sequence.odometry_between(1.0, 0.5), &[]);
}

#[test]
fn a_planar_reference_starts_at_the_first_frame() {
    let folder = good();
    // Body at (1, 1) heading along y; then one metre ahead, turned left by 0.2.
    let quarter = std::f64::consts::FRAC_PI_2;
    let text = format!(
        "frame,t_s,x_m,y_m,phi_rad\n0,0.0,1,1,{quarter}\n1,0.5,1,2,{}\n2,1.0,0,2,{}\n",
        quarter + 0.2,
        quarter + 4.0,
    );
    fs::write(folder.path().join("groundtruth_planar.csv"), text).unwrap();
    let reference = Sequence::open(folder.path()).unwrap().reference.unwrap();
    let expected = [
        (0.0, 0.0, 0.0, 0.0),
        (0.5, 1.0, 0.0, 0.2),
        (1.0, 1.0, 1.0, 4.0 - std::f64::consts::TAU),
    ];
    for ((t_s, pose), expected) in reference.iter().zip(expected) {
        assert_eq!(*t_s, expected.0);
        for (value, expected) in [
            (pose.x, expected.1),
            (pose.y, expected.2),
            (pose.phi, expected.3),
        ] {
            assert!((value - expected).abs() < 1e-12, "{pose:?}");
        }
    }
}

#[test]
fn a_camera_reference_is_moved_to_the_body() {
    let folder = good();
    // The camera looks along body x, 1 m ahead of the turning centre. The body turns left by
    // 90 degrees on the spot: the camera, in its own first axes, goes 1 m left and 1 m back
    // (x right, z forward) and turns by -90 degrees about its y (down) axis.
    with_camera(
        "[mount]\nposition_in_body = [1, 0, 0]\nrotation_body_from_camera = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]\n",
    )(folder.path());
    let half = 0.5_f64.sqrt();
    let text = format!("# camera-to-world\n0.0 0 0 0 0 0 0 1\n0.5 -1 0 -1 0 -{half} 0 {half}\n");
    fs::write(folder.path().join("groundtruth.txt"), text).unwrap();
    let reference = Sequence::open(folder.path()).unwrap().reference.unwrap();
    let pose = reference[1].1;
    assert!(pose.x.hypot(pose.y) < 1e-12, "{pose:?}");
    assert!(
        (pose.phi - std::f64::consts::FRAC_PI_2).abs() < 1e-12,
        "{pose:?}"
    );
}

#[test]
fn val_real_sequences_agree_with_their_planar_files() {
    for (name, frames) in [
        ("robot_lab_sideways", 240),
        ("kitti06_first51", 51),
        ("kitti00_first200", 200),
    ] {
        let Some(folder) = data_folder(name) else {
            continue;
        };
        let planar = Sequence::open(&folder).unwrap();
        assert_eq!(
            (planar.images.len(), planar.times_s.len()),
            (frames, frames)
        );
        assert!(planar.load_image(frames - 1).is_ok());
        // The same folder without its planar file, so that the camera's poses are used.
        let copy = ScratchFolder::new();
        for file in [
            "times.txt",
            "camera.toml",
            "odometry.csv",
            "groundtruth.txt",
        ] {
            fs::copy(folder.join(file), copy.path().join(file)).unwrap();
        }
        fs::create_dir(copy.path().join("images")).unwrap();
        for index in 0..frames {
            let image = planar.images.path(index).unwrap();
            fs::copy(
                image,
                copy.path().join("images").join(image.file_name().unwrap()),
            )
            .unwrap();
        }
        let moved = Sequence::open(copy.path()).unwrap();
        let expected = planar.reference.unwrap();
        let found = moved.reference.unwrap();
        assert_eq!(found.len(), expected.len());
        for ((_, found), (_, expected)) in found.iter().zip(&expected) {
            // Tolerances: the planar files carry four decimals and the published mounts six.
            let turn =
                (found.phi - expected.phi + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
            assert!(
                (turn - std::f64::consts::PI).abs() < 2e-5,
                "{name}: {found:?} {expected:?}"
            );
            assert!(
                (found.x - expected.x).hypot(found.y - expected.y) < 2e-4,
                "{name}: {found:?} {expected:?}"
            );
        }
    }
}

#[test]
fn wrong_times_are_named() {
    assert_eq!(
        fault(with("times.txt", "0.0\n0.5\n1.0\n")),
        "SEQ/times.txt: expected 4 times, one per image, found 3"
    );
    assert_eq!(
        fault(with("times.txt", "0.0\n0.5\n0.5\n1.5\n")),
        "SEQ/times.txt, line 3: expected a time after 0.5 s, found 0.5 s, equal to the time before"
    );
    for wrong in ["NaN", "inf", "soon", "1.0 2.0"] {
        let text = format!("0.0\n\n{wrong}\n1.0\n1.5\n");
        let message = fault(|root| fs::write(root.join("times.txt"), text).unwrap());
        assert_eq!(
            message,
            format!(
                "SEQ/times.txt, line 3: expected a finite number for the time of an image, found {wrong:?}"
            )
        );
    }
    let message = fault(|root| fs::write(root.join("times.txt"), [b'0', 0xff]).unwrap());
    assert_eq!(
        message,
        "SEQ/times.txt: expected UTF-8 text, found a foreign byte at offset 1"
    );
}

#[test]
fn wrong_odometry_is_named() {
    let cases = [
        (
            "t,left,right\n0,1,0\n",
            "line 1: expected the header t_s,v_mps,omega_radps, found \"t,left,right\"",
        ),
        (
            "0,1,0\n0.1,1,0\n",
            "line 1: expected the header t_s,v_mps,omega_radps, found \"0,1,0\"",
        ),
        (
            "t_s,v_mps,omega_radps\n0,1\n",
            "line 2: expected 3 values, found 2",
        ),
        (
            "t_s,v_mps,omega_radps\n0,1,0\n0.1,nan,0\n",
            "line 3: expected a finite number for v_mps, found \"nan\"",
        ),
        (
            "t_s,v_mps,omega_radps\n0,1,0\n0.1,1,-inf\n",
            "line 3: expected a finite number for omega_radps, found \"-inf\"",
        ),
        (
            "t_s,v_mps,omega_radps\n0,1,0\n0.2,1,0\n0.1,1,0\n",
            "line 4: expected a time after 0.2 s, found 0.1 s",
        ),
        (
            "t_s,v_mps,omega_radps\n0,-101,0\n",
            "line 2: expected |v_mps| of at most 100, found -101 (in millimetres per second? v_mps is in metres per second)",
        ),
        (
            "t_s,v_mps,omega_radps\n0,1,51\n",
            "line 2: expected |omega_radps| of at most 50, found 51 (in degrees per second? omega_radps is in radians per second)",
        ),
        (
            "t_s,v_mps,omega_radps\n0.2,1,0\n",
            "line 2: expected a first row no later than the first frame at 0 s, found 0.2 s; leave out the first image, the odometry covers the others",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(
            fault(with("odometry.csv", text)),
            format!("SEQ/odometry.csv, {expected}")
        );
    }
    let expected =
        "SEQ/odometry.csv: expected the header t_s,v_mps,omega_radps and at least one row, found";
    assert_eq!(
        fault(with("odometry.csv", "")),
        format!("{expected} an empty file")
    );
    assert_eq!(
        fault(with("odometry.csv", "t_s,v_mps,omega_radps\n")),
        format!("{expected} the header alone")
    );
}

/// The message without the number of its line, where it has one.
fn without_line(message: &str) -> String {
    match message.split_once(", line ") {
        Some((path, rest)) => format!("{path}{}", rest.trim_start_matches(char::is_numeric)),
        None => message.to_owned(),
    }
}

#[test]
fn wrong_cameras_are_named() {
    let unknown = fault(with_camera("zoom = 3\n"));
    assert!(
        unknown.starts_with(
            "SEQ/camera.toml, line 8: expected one of the keys width, height, model, fx"
        ),
        "{unknown}"
    );
    let missing = fault(with(
        "camera.toml",
        "width = 8\nheight = 6\nmodel = \"pinhole\"\nfx = 1.0\nfy = 1.0\ncx = 1.0\n",
    ));
    assert!(
        missing.contains("expected the key cy, found none"),
        "{missing}"
    );
    let broken = fault(with("camera.toml", "width = 8\nheight = = 6\n"));
    assert!(broken.starts_with("SEQ/camera.toml, line 2: "), "{broken}");
    let cases = [
        (
            "model = \"pinhole\"",
            "model = \"fisheye\"",
            "expected model = \"pinhole\", found \"fisheye\"",
        ),
        (
            "width = 8",
            "width = 0",
            "expected width from 1 to 65535, found 0",
        ),
        (
            "fx = 10.0",
            "fx = -10.0",
            "expected a positive fx, found -10",
        ),
        ("fy = 11", "fy = nan", "expected a positive fy, found NaN"),
        ("cx = 3.5", "cx = inf", "expected a finite cx, found inf"),
    ];
    for (good, wrong, expected) in cases {
        let message =
            fault(|root| fs::write(root.join("camera.toml"), CAMERA.replace(good, wrong)).unwrap());
        assert_eq!(
            without_line(&message),
            format!("SEQ/camera.toml: {expected}")
        );
    }
}

#[test]
fn wrong_distortions_and_mounts_are_named() {
    let cases = [
        (
            "[distortion]\nmodel = \"division\"\n",
            "expected \"radtan\", \"rational\" or \"kannala-brandt\" as model of [distortion], found \"division\"",
        ),
        (
            "[distortion]\nmodel = \"radtan\"\nk1 = 0.1\nk2 = 0.1\np1 = 0.1\n",
            "expected p2 in [distortion] for model \"radtan\", found none",
        ),
        (
            "[distortion]\nmodel = \"radtan\"\nk4 = 0.1\n",
            "expected no k4 in [distortion] for model \"radtan\", found k4 = 0.1",
        ),
        (
            "[distortion]\nmodel = \"kannala-brandt\"\nk1 = nan\n",
            "expected a finite k1 in [distortion], found NaN",
        ),
        (
            "[mount]\nposition_in_body = [0, nan, 0]\nrotation_body_from_camera = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]\n",
            "expected a finite position_in_body in [mount], found [0.0, NaN, 0.0]",
        ),
        (
            "[mount]\nposition_in_body = [100, 0, 900]\nrotation_body_from_camera = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]\n",
            "expected metres within 50 of the robot's centre as position_in_body in [mount], found 100: are these millimetres?",
        ),
        (
            "[mount]\nposition_in_body = [0, 0, 0]\nrotation_body_from_camera = [[0, 0, 1], [-1, 0, 0], [0, 1, 0]]\n",
            "expected a right-handed rotation_body_from_camera in [mount] (determinant +1), found a determinant of -1",
        ),
        (
            "[mount]\nposition_in_body = [0, 0, 0]\nrotation_body_from_camera = [[0, 0, 2], [-1, 0, 0], [0, -1, 0]]\n",
            "expected orthonormal columns, within 0.001, of the rotation_body_from_camera in [mount], found a deviation of 3",
        ),
    ];
    for (extra, expected) in cases {
        assert_eq!(
            without_line(&fault(with_camera(extra))),
            format!("SEQ/camera.toml: {expected}")
        );
    }
    let nan = fault(with_camera(
        "[mount]\nposition_in_body = [0, 0, 0]\nrotation_body_from_camera = [[nan, 0, 1], [-1, 0, 0], [0, -1, 0]]\n",
    ));
    assert!(
        nan.starts_with("SEQ/camera.toml, line 10: expected orthonormal columns"),
        "{nan}"
    );
    let unknown = fault(with_camera("[mount]\nheight = 1\n"));
    assert!(
        unknown.contains("line 9: expected one of the keys position_in_body, rotation_body_from_camera in [mount]"),
        "{unknown}"
    );
}

#[test]
fn wrong_references_are_named() {
    let cases = [
        (
            "groundtruth.txt",
            "# only a comment\n",
            ": expected at least one line t x y z qx qy qz qw, found none",
        ),
        (
            "groundtruth.txt",
            "0 0 0 0 0 0 1\n",
            ", line 1: expected eight numbers (t x y z qx qy qz qw), found 7 in \"0 0 0 0 0 0 1\"",
        ),
        (
            "groundtruth.txt",
            "# c\n0 0 0 x 0 0 0 1\n",
            ", line 2: expected a finite number for z, found \"x\"",
        ),
        (
            "groundtruth.txt",
            "0 0 0 0 0 0 0 0\n",
            ", line 1: expected a quaternion of unit length, found length 0",
        ),
        (
            "groundtruth.txt",
            "1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n",
            ", line 2: expected a time after 1 s, found 0 s",
        ),
        (
            "groundtruth_planar.csv",
            "frame,t_s,x_m,y_m,phi_rad\n0.5,0,0,0,0\n",
            ", line 2: expected a whole frame number, found 0.5",
        ),
        (
            "groundtruth_planar.csv",
            "frame,t_s,x_m,y_m,phi_rad\n0,0,0,0,inf\n",
            ", line 2: expected a finite number for phi_rad, found \"inf\"",
        ),
    ];
    for (name, text, expected) in cases {
        assert_eq!(fault(with(name, text)), format!("SEQ/{name}{expected}"));
    }
}
