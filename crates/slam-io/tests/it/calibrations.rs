//! Calibrations of other tools: round trips to the bit, files of OpenCV itself, faults in one sentence.

use std::fs;
use std::path::{Path, PathBuf};

use mono_geometry::{Camera, Distortion};
use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::test_runner::Config;
use slam_io::{
    CalibrationRequest, CameraFile, CameraFormat, MountFile, SequenceError, SigmaFile,
    calibration_text,
};

use crate::common::ScratchFolder;

fn read_calibration(
    path: &Path,
    format: Option<CameraFormat>,
    camera: Option<&str>,
) -> Result<CameraFile, SequenceError> {
    let request = CalibrationRequest {
        format,
        camera: camera.map(String::from),
        size: None,
    };
    slam_io::read_calibration(path, &request).map(|found| found.camera)
}

const FORMATS: [CameraFormat; 4] = [
    CameraFormat::Toml,
    CameraFormat::Kalibr,
    CameraFormat::OpenCv,
    CameraFormat::Ros,
];

fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/reference")
        .join(name)
}

fn camera(distortion: Distortion) -> CameraFile {
    CameraFile {
        width: 752,
        height: 480,
        fx: 458.654,
        fy: 457.296,
        cx: 367.215,
        cy: 248.375,
        distortion,
        mount: MountFile::default(),
        sigma: SigmaFile::default(),
    }
}

#[test]
fn standard_deviations_are_kept_by_camera_toml_alone() {
    let folder = ScratchFolder::new();
    let known = CameraFile {
        sigma: SigmaFile {
            fx: Some(1.0 / 3.0),
            mount_yaw: Some(2e-3),
            ..SigmaFile::default()
        },
        ..camera(radtan(0.0))
    };
    let path = folder.path().join("camera.toml");
    let text = calibration_text(&known, CameraFormat::Toml).unwrap();
    fs::write(&path, &text).unwrap();
    assert_eq!(read_calibration(&path, None, None).unwrap(), known);
    // Without any there is no section.
    let plain = calibration_text(&camera(radtan(0.0)), CameraFormat::Toml).unwrap();
    assert!(!plain.contains("[sigma]"), "{plain}");
    for (value, expected) in [
        ("fx = -1.0", "a finite fx of at least 0 in [sigma]"),
        ("cy = nan", "a finite cy of at least 0 in [sigma]"),
        ("fz = 1.0", "expected one of the keys fx, fy"),
    ] {
        fs::write(&path, format!("{plain}\n[sigma]\n{value}\n")).unwrap();
        let error = read_calibration(&path, None, None).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

fn radtan(k3: f64) -> Distortion {
    Distortion::Radtan {
        k1: -0.283_408_11,
        k2: 0.073_959_07,
        p1: 0.000_193_59,
        p2: 1.761_871_14e-5,
        k3,
    }
}

const RATIONAL: Distortion = Distortion::Rational {
    k1: 0.45,
    k2: -2.4,
    p1: 9e-4,
    p2: -2e-4,
    k3: 1.4,
    k4: 0.33,
    k5: -2.2,
    k6: 1.35,
};

const FISHEYE: Distortion = Distortion::KannalaBrandt {
    k1: -0.0137,
    k2: 0.0207,
    k3: -0.0127,
    k4: 0.0025,
};

/// The calibration read from a file with this text.
fn reading(
    text: &str,
    format: Option<CameraFormat>,
    name: Option<&str>,
) -> Result<CameraFile, String> {
    let folder = ScratchFolder::new();
    let path = folder.path().join("cam.any");
    fs::write(&path, text).unwrap();
    read_calibration(&path, format, name).map_err(|error| {
        let message = error.to_string();
        assert_eq!(message.lines().count(), 1, "{message}");
        let folder = folder.path().display().to_string();
        message.replace(&format!("{folder}/"), "")
    })
}

fn round_trip(file: &CameraFile, format: CameraFormat) {
    let text = calibration_text(file, format).unwrap();
    // Recognised by its content, and when told.
    assert_eq!(reading(&text, None, None).as_ref(), Ok(file), "{text}");
    assert_eq!(
        reading(&text, Some(format), None).as_ref(),
        Ok(file),
        "{text}"
    );
}

#[test]
fn every_format_gives_back_every_bit_it_has_a_place_for() {
    for format in FORMATS {
        for lens in [Distortion::None, radtan(0.0), FISHEYE] {
            round_trip(&camera(lens), format);
        }
        if format != CameraFormat::Kalibr {
            round_trip(&camera(radtan(-0.003)), format);
            round_trip(&camera(RATIONAL), format);
        }
    }
    let mut mounted = camera(RATIONAL);
    mounted.mount = MountFile {
        position_in_body: [0.1, -1e-9, 1e-300],
        rotation_body_from_camera: [[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]],
    };
    round_trip(&mounted, CameraFormat::Toml);
    // Elsewhere the mount has no place and is dropped.
    let text = calibration_text(&mounted, CameraFormat::Ros).unwrap();
    assert_eq!(reading(&text, None, None), Ok(camera(RATIONAL)));
}

#[test]
fn what_kalibr_cannot_hold_is_refused() {
    let refused = |lens| {
        calibration_text(&camera(lens), CameraFormat::Kalibr)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        refused(radtan(0.25)),
        "a Kalibr camchain has no place for k3 = 0.25"
    );
    assert_eq!(
        refused(RATIONAL),
        "a Kalibr camchain has no place for a rational lens"
    );
}

proptest! {
    #![proptest_config(Config { cases: 60, failure_persistence: None, ..Config::default() })]

    /// Numbers of every size that a camera can have, written and read: the same bits.
    #[test]
    fn numbers_survive(
        n in prop::collection::vec(prop_oneof![-1e-3..1e-3_f64, -1e-300..1e-300_f64], 8),
        fx in 300.0..1e4_f64,
        centre in (300.0..450.0_f64, 200.0..280.0_f64),
    ) {
        let lens = Distortion::Rational {
            k1: n[0], k2: n[1], p1: n[2], p2: n[3], k3: n[4], k4: n[5], k5: n[6], k6: n[7] + 1e-3,
        };
        let file = CameraFile { fx, fy: fx, cx: centre.0, cy: centre.1, ..camera(lens) };
        for format in [CameraFormat::Toml, CameraFormat::OpenCv, CameraFormat::Ros] {
            let text = calibration_text(&file, format).unwrap();
            prop_assert_eq!(reading(&text, None, None), Ok(file.clone()), "{}", text);
        }
    }

    /// Damaged files are refused or read, in one sentence, without a panic.
    #[test]
    fn damaged_files_do_not_panic(format in 0..4_usize, at in 0.0..1.0_f64, length in 0..40_usize, with in "\\PC{0,8}") {
        let text = calibration_text(&camera(radtan(0.0)), FORMATS[format]).unwrap();
        let start = (at * text.len() as f64) as usize;
        let end = (start + length).min(text.len());
        let damaged = format!("{}{with}{}", &text[..start], &text[end..]);
        let _ = reading(&damaged, None, None);
        let _ = reading(&damaged, Some(FORMATS[format]), None);
        let _ = reading(&damaged, Some(FORMATS[(format + 1) % 4]), None);
    }
}

/// `opencv_calibrations.py`: files of `cv2.FileStorage` 5.0.0, and of 4.14.0 with its other header.
#[test]
fn val_opencv_file_storage_is_read() {
    for (name, lens) in [
        ("opencv_radtan4.yml", radtan(0.0)),
        ("opencv_radtan5.yml", radtan(-0.003)),
        ("opencv4_radtan5.yml", radtan(-0.003)),
        ("opencv_rational8.yml", RATIONAL),
        ("opencv_rational14.yml", RATIONAL),
        ("opencv_fisheye.yml", FISHEYE),
        ("opencv4_fisheye.yml", FISHEYE),
    ] {
        let file = read_calibration(&reference(name), None, None).unwrap();
        assert_eq!(file, camera(lens), "{name}");
    }
    let error = read_calibration(&reference("opencv_prism12.yml"), None, None).unwrap_err();
    assert!(
        error.to_string().ends_with(
            "opencv_prism12.yml, line 11: expected a lens without thin prism and tilted sensor \
             for distortion_coefficients, found s1 = 0.01"
        ),
        "{error}"
    );
}

/// The same files through `cv2.projectPoints` and `cv2.fisheye.projectPoints`.
#[test]
fn val_opencv_pixels_through_its_own_files() {
    let table = include_str!("../reference/opencv_calibrations.csv");
    let mut count = 0;
    for line in table.lines() {
        let (name, numbers) = line.split_once(',').unwrap();
        let n: Vec<f64> = numbers.split(',').map(|v| v.parse().unwrap()).collect();
        let path = reference(&format!("opencv_{name}.yml"));
        let file = read_calibration(&path, None, None).unwrap();
        let (camera, _) = file.camera_and_mount().unwrap();
        let pixel = camera.project(&Vector3::new(n[0], n[1], n[2])).unwrap();
        let error = (pixel.x - n[3]).hypot(pixel.y - n[4]);
        assert!(error < 1e-10, "{line}: {error}");
        count += 1;
    }
    assert_eq!(count, 15);
}

/// Files as the documentation of each tool shows them, with everything around that we ignore.
#[test]
fn files_as_the_tools_write_them() {
    let kalibr = "cam0:\n  T_cam_imu:\n  - [0.01, 0.99, -0.02, 0.06]\n  - [-0.99, 0.01, 0.02, -0.01]\n  \
                  - [0.02, 0.02, 0.99, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: [1]\n  \
                  camera_model: pinhole\n  distortion_coeffs: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]\n  \
                  distortion_model: radtan\n  intrinsics: [458.654, 457.296, 367.215, 248.375]\n  \
                  resolution: [752, 480]\n  rostopic: /cam0/image_raw\n  timeshift_cam_imu: 0.0\n\
                  cam1:\n  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.1]\n  camera_model: pinhole\n  \
                  distortion_coeffs:\n  - -0.0137\n  - 0.0207\n  - -0.0127\n  - 0.0025\n  \
                  distortion_model: equidistant\n  intrinsics:\n  - 458.654\n  - 457.296\n  - 367.215\n  - 248.375\n  \
                  resolution: [752, 480]\n  rostopic: /cam1/image_raw\n";
    assert_eq!(reading(kalibr, None, None), Ok(camera(radtan(0.0))));
    assert_eq!(reading(kalibr, None, Some("cam1")), Ok(camera(FISHEYE)));
    assert_eq!(
        reading(kalibr, None, Some("cam2")),
        Err("cam.any: expected a camera cam2, found cam0, cam1".into())
    );

    let ros = "image_width: 752\nimage_height: 480\ncamera_name: narrow_stereo\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
               data: [458.654, 0, 367.215, 0, 457.296, 248.375, 0, 0, 1]\ndistortion_model: plumb_bob\n\
               distortion_coefficients:\n  rows: 1\n  cols: 5\n  \
               data: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, -0.003]\n\
               rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n\
               projection_matrix:\n  rows: 3\n  cols: 4\n  data: [430, 0, 370, 0, 0, 435, 250, 0, 0, 0, 1, 0]\n";
    assert_eq!(reading(ros, None, None), Ok(camera(radtan(-0.003))));

    let old = "%YAML:1.0\nCamera_Matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
               data: [ 458.654, 0., 367.215, 0., 457.296, 248.375, 0., 0., 1. ]\nimage_Width: 752\nimage_Height: 480\n\
               Distortion_Coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   \
               data: [ -0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, -0.003 ]\n";
    assert_eq!(reading(old, None, None), Ok(camera(radtan(-0.003))));
    let short = "cameraMatrix: {rows: 3, cols: 3, data: [458.654, 0, 367.215, 0, 457.296, 248.375, 0, 0, 1]}\n\
                 distCoeffs: {rows: 1, cols: 4, data: [0, 0, 0, 0]}\nimageSize: [752, 480]\n";
    assert_eq!(reading(short, None, None), Ok(camera(Distortion::None)));
}

#[test]
fn faults_are_one_sentence_with_the_file_and_the_line() {
    let good = |format| calibration_text(&camera(radtan(0.0)), format).unwrap();
    let (kalibr, opencv, ros) = (
        good(CameraFormat::Kalibr),
        good(CameraFormat::OpenCv),
        good(CameraFormat::Ros),
    );
    let rational = calibration_text(&camera(RATIONAL), CameraFormat::Toml).unwrap();
    let swap = |text: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from} in {text}");
        text.replacen(from, to, 1)
    };
    let cases = [
        (
            String::new(),
            "cam.any: expected a calibration of camera.toml, Kalibr, OpenCV, ROS, ORB-SLAM, VINS, COLMAP, EuRoC or KITTI, found an empty file",
        ),
        (
            "A letter to my aunt.\n".into(),
            "cam.any: expected a calibration of camera.toml, Kalibr, OpenCV, ROS, ORB-SLAM, VINS, COLMAP, EuRoC or KITTI, found \"A letter to my aunt.\"",
        ),
        (
            "name: robot\nwheels: 3\n".into(),
            "cam.any: expected a calibration of camera.toml, Kalibr, OpenCV, ROS, ORB-SLAM, VINS, COLMAP, EuRoC or KITTI, found the keys name, wheels",
        ),
        (
            swap(&kalibr, "458.654", ".nan"),
            "cam.any, line 3: expected a finite number for intrinsics of cam0, found \"NaN\"",
        ),
        (
            swap(&kalibr, "458.654", "wide"),
            "cam.any, line 3: expected a finite number for intrinsics of cam0, found \"wide\"",
        ),
        (
            swap(&kalibr, "458.654, ", ""),
            "cam.any, line 3: expected 4 numbers for intrinsics of cam0, found 3",
        ),
        (
            swap(&kalibr, "pinhole", "omni"),
            "cam.any, line 2: expected pinhole for camera_model of cam0, found omni",
        ),
        (
            swap(&kalibr, "radtan", "fov"),
            "cam.any, line 4: expected radtan, equidistant or none for distortion_model of cam0, found fov",
        ),
        (
            swap(&kalibr, "  resolution: [752, 480]\n", ""),
            "cam.any: expected the key resolution in cam0, or --width and --height, found none",
        ),
        (
            swap(&kalibr, "752, 480", "752.5, 480"),
            "cam.any, line 6: expected two whole numbers for resolution of cam0, found 752.5, 480",
        ),
        (
            swap(&kalibr, "752, 480", "0, 480"),
            "cam.any: expected width from 1 to 65535, found 0",
        ),
        (
            swap(&kalibr, "458.654", "-458.654"),
            "cam.any: expected a positive fx, found -458.654",
        ),
        (
            swap(&opencv, "cols: 5", "cols: 6"),
            "cam.any, line 14: expected 1 x 6 numbers for data of distortion_coefficients, found 5",
        ),
        (
            swap(&opencv, "image_width: 752\n", ""),
            "cam.any: expected the keys image_width and image_height, or --width and --height, found none",
        ),
        (
            swap(&opencv, "[ 458.654, 0.0,", "[ 458.654, 8.5,"),
            "cam.any, line 5: expected a skew that moves pixels by at most 1.5 px for camera_matrix, found a skew of 8.5 px, which moves them by 4.6 px",
        ),
        (
            swap(&opencv, "fisheye_model: 0", "fisheye_model: 1"),
            "cam.any, line 10: expected 4 fisheye coefficients for distortion_coefficients, found 5",
        ),
        (
            swap(&ros, "plumb_bob", "thin_prism"),
            "cam.any, line 8: expected plumb_bob, rational_polynomial or equidistant for distortion_model, found thin_prism",
        ),
        (
            swap(&ros, "plumb_bob", "equidistant"),
            "cam.any, line 9: expected 4 coefficients for distortion_coefficients, found 5",
        ),
        (
            swap(&ros, "plumb_bob", "rational_polynomial"),
            "cam.any, line 9: expected 8 coefficients for distortion_coefficients, found 5",
        ),
        (
            swap(&ros, "  cols: 3\n", ""),
            "cam.any: expected the key cols in camera_matrix, found none",
        ),
        (
            swap(&rational, "k6 = 1.35\n", ""),
            "cam.any: expected k6 in [distortion] for model \"rational\", found none",
        ),
        (
            swap(&rational, "\"rational\"", "\"radtan\""),
            "cam.any, line 16: expected no k4 in [distortion] for model \"radtan\", found k4 = 0.33",
        ),
        (
            swap(&rational, "k6 = 1.35", "k6 = nan"),
            "cam.any, line 18: expected a finite k6 in [distortion], found NaN",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(reading(&text, None, None).unwrap_err(), expected, "{text}");
    }
    let unclosed = swap(&ros, "0.0, 1.0]", "0.0, 1.0");
    let error = reading(&unclosed, None, None).unwrap_err();
    assert!(error.starts_with("cam.any, line "), "{error}");
    assert!(error.contains("expected YAML, found "), "{error}");
    let error = reading(&ros, None, Some("cam0")).unwrap_err();
    assert_eq!(
        error,
        "cam.any: expected a file of several cameras to choose cam0 from, found a file of one camera"
    );
    let missing = read_calibration(Path::new("no/such.yaml"), None, None).unwrap_err();
    assert!(
        missing
            .to_string()
            .starts_with("no/such.yaml: cannot be read: ")
    );
}

/// A file of each lens becomes the camera that was meant, parameter by parameter.
#[test]
fn the_lens_of_the_file_is_the_lens_of_the_camera() {
    let lens = |file| -> Distortion {
        let (camera, _): (Camera, _) = camera(file).camera_and_mount().unwrap();
        *camera.distortion()
    };
    assert_eq!(lens(Distortion::None), Distortion::None);
    assert_eq!(
        lens(RATIONAL).parameters(),
        [0.45, -2.4, 9e-4, -2e-4, 1.4, 0.33, -2.2, 1.35]
    );
    assert_eq!(
        lens(FISHEYE).parameters(),
        [-0.0137, 0.0207, -0.0127, 0.0025]
    );
}
