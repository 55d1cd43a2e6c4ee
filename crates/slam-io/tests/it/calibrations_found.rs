//! Calibrations as robots and their owners have them: each kind that was once refused or taken for another.

use std::fs;

use mono_geometry::Distortion;
use slam_io::{CalibrationRequest, CameraFile, FoundCalibration, Sequence, read_calibration};

use crate::common::ScratchFolder;

/// The calibration read from a file with these bytes; the fault without the folder's name.
fn found(bytes: &[u8], request: &CalibrationRequest) -> Result<FoundCalibration, String> {
    let folder = ScratchFolder::new();
    let path = folder.path().join("cam.any");
    fs::write(&path, bytes).unwrap();
    read_calibration(&path, request).map_err(|error| {
        let message = error.to_string();
        assert_eq!(message.lines().count(), 1, "{message}");
        message.replace(&format!("{}/", folder.path().display()), "")
    })
}

fn read(text: &str) -> FoundCalibration {
    found(text.as_bytes(), &CalibrationRequest::default()).unwrap()
}

fn refused(text: &str) -> String {
    let message = found(text.as_bytes(), &CalibrationRequest::default()).unwrap_err();
    assert!(message.len() < 240, "fits on a line or two: {message}");
    message
}

pub(crate) fn sized(width: u32, height: u32) -> CalibrationRequest {
    CalibrationRequest {
        size: Some([width, height]),
        ..CalibrationRequest::default()
    }
}

pub(crate) fn of(name: &str) -> CalibrationRequest {
    CalibrationRequest {
        camera: Some(name.to_owned()),
        ..CalibrationRequest::default()
    }
}

pub(crate) fn numbers(camera: &CameraFile) -> (u32, u32, [f64; 4]) {
    (
        camera.width,
        camera.height,
        [camera.fx, camera.fy, camera.cx, camera.cy],
    )
}

pub(crate) fn radtan(k1: f64, k2: f64, p1: f64, p2: f64, k3: f64) -> Distortion {
    Distortion::Radtan { k1, k2, p1, p2, k3 }
}

pub(crate) const EUROC: (u32, u32, [f64; 4]) = (752, 480, [458.654, 457.296, 367.215, 248.375]);
const EUROC_LENS: [f64; 5] = [
    -0.283_408_11,
    0.073_959_07,
    0.000_193_59,
    1.761_871_14e-5,
    0.0,
];

pub(crate) fn euroc_lens() -> Distortion {
    let [k1, k2, p1, p2, k3] = EUROC_LENS;
    radtan(k1, k2, p1, p2, k3)
}

#[test]
fn regress_opencv_xml_was_taken_for_toml() {
    let xml = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<!-- sample -->\n<calibration_time>\"Mon Jan 1\"</calibration_time>\n\
               <image_width>752</image_width>\n<image_height>480</image_height>\n\
               <camera_matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n    \
               458.654 0. 367.215 0. 457.296 248.375 0. 0. 1.</data></camera_matrix>\n\
               <distortion_coefficients type_id=\"opencv-matrix\">\n  <rows>5</rows>\n  <cols>1</cols>\n  <dt>d</dt>\n  <data>\n    \
               -2.8340811e-01 7.395907e-02 1.9359e-04\n    1.76187114e-05 0.</data></distortion_coefficients>\n</opencv_storage>\n";
    let read = read(xml);
    assert_eq!(
        (numbers(&read.camera), read.camera.distortion),
        (EUROC, euroc_lens())
    );
    assert_eq!(
        refused(&xml.replace("457.296", "wide")),
        "cam.any, line 11: expected a finite number for data of camera_matrix, found \"wide\""
    );
    assert_eq!(
        refused("<html><body>404</body></html>"),
        "cam.any: expected an OpenCV FileStorage (<opencv_storage>), found <html>"
    );
    assert!(refused(&xml[..200]).contains("expected XML, found "));
}

#[test]
fn regress_a_fisheye_of_melodic_became_radial_tangential() {
    let head = "image_width: 1640\nimage_height: 1232\ncamera_name: front\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
                data: [ 403.9, 0.0, 871.2, 0., 404.7, 597.4, 0., 0., 1. ]\n";
    let tail = "distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: [0.1756, -0.0318, 0.00036, -0.00072]\n\
                rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]\n";
    let fisheye = Distortion::KannalaBrandt {
        k1: 0.1756,
        k2: -0.0318,
        k3: 0.00036,
        k4: -0.00072,
    };
    assert_eq!(
        read(&format!("{head}camera_model: fisheye\n{tail}"))
            .camera
            .distortion,
        fisheye
    );
    assert_eq!(
        read(&format!("{head}distortion_model: equidistant\n{tail}"))
            .camera
            .distortion,
        fisheye
    );
    // Without any word it is plumb_bob, and that is said.
    let plain = read(&format!("{head}{tail}"));
    assert!(
        plain.notes[0].contains("taken as plumb_bob"),
        "{:?}",
        plain.notes
    );
}

#[test]
fn regress_a_fraction_of_a_pixel_of_skew_was_refused() {
    let file = |skew: &str| {
        format!(
            "image_width: 3280\nimage_height: 2464\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
             data: [1138.8, {skew}, 1635.7, 0., 1138.3, 1208.6, 0., 0., 1.]\ndistortion_model: equidistant\n\
             distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: [0.0367, 0.0091, -0.0097, -0.0100]\n"
        )
    };
    let read = read(&file("-0.67"));
    assert_eq!(read.camera.fx, 1138.8);
    assert_eq!(
        read.notes[0],
        "line 3: the skew of -0.67 px is left out; it moves pixels by at most 0.74 px"
    );
    assert_eq!(
        refused(&file("-20")),
        "cam.any, line 3: expected a skew that moves pixels by at most 1.5 px for camera_matrix, found a skew of -20 px, \
         which moves them by 22.1 px"
    );
}

#[test]
fn regress_the_message_of_ros_was_not_read() {
    let ros2 = "header:\n  stamp:\n    sec: 1759842258\n    nanosec: 831630048\n  frame_id: camera\nheight: 480\nwidth: 640\n\
                distortion_model: plumb_bob\nd:\n- -0.28\n- 0.07\n- 0.0\n- 0.0\n- 0.0\nk:\n- 500.0\n- 0.0\n- 320.0\n- 0.0\n\
                - 501.0\n- 240.0\n- 0.0\n- 0.0\n- 1.0\nbinning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  height: 0\n---\n";
    let ros1 = "header: \n  seq: 12\n  stamp: \n    secs: 764\n    nsecs:  38519990\n  frame_id: \"camera\"\nheight: 480\nwidth: 640\n\
                distortion_model: \"plumb_bob\"\nD: [-0.28, 0.07, 0.0, 0.0, 0.0]\n\
                K: [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]\nbinning_x: 0\n---\nheight: 480\nwidth: 640\n---\n";
    for text in [ros2, ros1] {
        let read = read(text);
        assert_eq!(
            numbers(&read.camera),
            (640, 480, [500.0, 501.0, 320.0, 240.0])
        );
        assert_eq!(read.camera.distortion, radtan(-0.28, 0.07, 0.0, 0.0, 0.0));
        assert!(read.notes.is_empty(), "{:?}", read.notes);
    }
    // A driver without a calibration publishes zeros; one that scales its images says so.
    let zeros = "height: 480\nwidth: 640\ndistortion_model: ''\nd: []\nk: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n";
    assert!(refused(zeros).contains("as a camera that was never calibrated has them"));
    let binned = read(&ros1.replace("binning_x: 0", "binning_x: 2"));
    assert!(
        binned.notes[0].contains("binning_x is 2"),
        "{:?}",
        binned.notes
    );
}

#[test]
fn regress_kalibr_files_written_by_hand() {
    let base = "cam0:\n  camera_model: pinhole\n  intrinsics: [458.6, 457.3, 367.2, 248.4]\n  resolution: [752, 480]\n";
    for lens in [
        "  distortion_model: none\n  distortion_coeffs: []\n",
        "  distortion_model: none\n",
        "  distortion_model: radtan\n  distortion_coeffs: []\n",
        "  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0, 0, 0]\n",
        "",
    ] {
        assert_eq!(
            read(&format!("{base}{lens}")).camera.distortion,
            Distortion::None,
            "{lens}"
        );
    }
    assert!(read(base).notes[0].contains("taken for a camera without a lens"));
    // One camera is taken by whatever name; a lens that is not there is refused by its own.
    let front = base.replace("cam0", "front");
    assert_eq!(
        (
            read(&front).camera.fx,
            found(front.as_bytes(), &of("front")).unwrap().camera.fx
        ),
        (458.6, 458.6)
    );
    assert_eq!(
        refused(&front.replace("pinhole", "omni")),
        "cam.any, line 2: expected pinhole for camera_model of front, found omni"
    );
    let several = format!(
        "{}{}",
        base.replace("cam0", "left"),
        base.replace("cam0", "right")
    );
    assert_eq!(
        read(&several).notes[0],
        "camera left of left, right is taken; --camera chooses another"
    );
}

#[test]
fn regress_settings_of_orb_slam_and_vins() {
    let orb = "%YAML:1.0\n\n#----\nCamera.type: \"PinHole\"\nCamera.fx: 458.6\nCamera.fy: 457.3\nCamera.cx: 367.2\nCamera.cy: 248.4\n\
               Camera.k1: -0.28\nCamera.k2: 0.07\nCamera.p1: 0.0002\nCamera.p2: 1.7e-05\nCamera.width: 752\nCamera.height: 480\n\
               ORBextractor.nFeatures: 1000\nViewer.PointSize: 2\n";
    let lens = radtan(-0.28, 0.07, 0.0002, 1.7e-05, 0.0);
    for text in [
        orb.to_owned(),
        orb.replace("Camera.fx", "Camera1.fx")
            .replace("Camera.fy", "Camera1.fy")
            .replace("Camera.c", "Camera1.c")
            .replace("Camera.k", "Camera1.k")
            .replace("Camera.p", "Camera1.p"),
    ] {
        let read = read(&text);
        assert_eq!(
            (numbers(&read.camera), read.camera.distortion),
            ((752, 480, [458.6, 457.3, 367.2, 248.4]), lens)
        );
    }
    let fisheye = "Camera.type: \"KannalaBrandt8\"\nCamera1.fx: 190.9\nCamera1.fy: 190.9\nCamera1.cx: 254.9\nCamera1.cy: 256.8\n\
                   Camera1.k1: 0.0034\nCamera1.k2: 0.0007\nCamera1.k3: -0.002\nCamera1.k4: 0.0002\nCamera.width: 512\nCamera.height: 512\n";
    assert_eq!(
        read(fisheye).camera.distortion,
        Distortion::KannalaBrandt {
            k1: 0.0034,
            k2: 0.0007,
            k3: -0.002,
            k4: 0.0002
        }
    );
    assert!(
        refused(&fisheye.replace("KannalaBrandt8", "Omni"))
            .contains("line 1: expected PinHole, KannalaBrandt8 or Rectified")
    );

    let vins = "%YAML:1.0\n---\nmodel_type: PINHOLE\ncamera_name: camera\nimage_width: 752\nimage_height: 480\ndistortion_parameters:\n   \
                k1: -0.28\n   k2: 0.07\n   p1: 0.0002\n   p2: 1.7e-05\nprojection_parameters:\n   fx: 458.6\n   fy: 457.3\n   cx: 367.2\n   cy: 248.4\n";
    assert_eq!(read(vins).camera.distortion, lens);
    let kannala = "model_type: KANNALA_BRANDT\nimage_width: 640\nimage_height: 480\nprojection_parameters:\n   k2: -0.01\n   k3: 0.02\n   \
                   k4: -0.012\n   k5: 0.002\n   mu: 278.6\n   mv: 278.4\n   u0: 319.7\n   v0: 241.9\n";
    assert_eq!(
        read(kannala).camera.distortion,
        Distortion::KannalaBrandt {
            k1: -0.01,
            k2: 0.02,
            k3: -0.012,
            k4: 0.002
        }
    );
    let mei = "model_type: MEI\nimage_width: 752\nimage_height: 480\nmirror_parameters:\n   xi: 1.9\ndistortion_parameters:\n   k1: 0\n   k2: 0\n   \
               p1: 0\n   p2: 0\nprojection_parameters:\n   gamma1: 1269\n   gamma2: 1268\n   u0: 367\n   v0: 248\n";
    assert_eq!(
        refused(mei),
        "cam.any, line 1: expected PINHOLE, PINHOLE_FULL or KANNALA_BRANDT for model_type, found MEI with xi = 1.9, a lens that \
         this program does not have"
    );
    assert_eq!(read(&mei.replace("1.9", "0")).camera.fx, 1269.0);
    assert_eq!(
        refused("%YAML:1.0\nimu: 1\nnum_of_cam: 2\ncam0_calib: \"cam0_pinhole.yaml\"\n"),
        "cam.any: expected a calibration of camera.toml, Kalibr, OpenCV, ROS, ORB-SLAM, VINS, COLMAP, EuRoC or KITTI, found \
         settings of VINS-Fusion, whose camera is in cam0_pinhole.yaml"
    );
}

#[test]
fn regress_colmap_has_half_a_pixel() {
    let text = "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n\
                1 OPENCV 752 480 458.6 457.3 367.7 248.9 -0.28 0.07 0.0002 1.7e-05\n";
    let read_text = read(text);
    assert_eq!(
        numbers(&read_text.camera),
        (752, 480, [458.6, 457.3, 367.7 - 0.5, 248.9 - 0.5])
    );
    assert_eq!(
        read_text.camera.distortion,
        radtan(-0.28, 0.07, 0.0002, 1.7e-05, 0.0)
    );
    let mut binary = Vec::new();
    binary.extend(1_u64.to_le_bytes());
    binary.extend(7_u32.to_le_bytes());
    binary.extend(4_i32.to_le_bytes());
    binary.extend(752_u64.to_le_bytes());
    binary.extend(480_u64.to_le_bytes());
    for value in [458.6, 457.3, 367.7, 248.9, -0.28, 0.07, 0.0002, 1.7e-05_f64] {
        binary.extend(value.to_le_bytes());
    }
    assert_eq!(
        found(&binary, &CalibrationRequest::default())
            .unwrap()
            .camera,
        read_text.camera
    );
    // A count that no file of this length can have, and a file cut short.
    binary[..8].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(found(&binary, &CalibrationRequest::default()).is_err());
    assert!(found(&binary[..binary.len() - 3], &CalibrationRequest::default()).is_err());
    assert_eq!(
        refused("1 THIN_PRISM_FISHEYE 752 480 458 457 367 248 0 0 0 0 0 0 0 0\n"),
        "cam.any: expected a pinhole, radial, OPENCV, OPENCV_FISHEYE or FULL_OPENCV camera, found THIN_PRISM_FISHEYE"
    );
    assert_eq!(
        refused("1 OPENCV 752 480 458 457\n"),
        "cam.any, line 1: expected 8 parameters for OPENCV, found 2"
    );
    let two = format!("{text}2 PINHOLE 640 480 500 500 320 240\n");
    assert_eq!(
        refused(&two),
        "cam.any: expected one camera, or --camera with an id, found the cameras 1, 2"
    );
    assert_eq!(found(two.as_bytes(), &of("2")).unwrap().camera.cx, 319.5);
}

#[test]
fn regress_what_python_programs_write_needs_its_size_alone() {
    let text = "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 458.6, 0., 367.2, 0., 457.3, 248.4, 0., 0., 1. ]\n\
                D: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ -0.28, 0.07, 0., 0., 0. ]\n";
    assert_eq!(
        refused(text),
        "cam.any: expected the keys image_width and image_height, or --width and --height, found none"
    );
    let lists = "{\"mtx\": [[458.6, 0, 367.2], [0, 457.3, 248.4], [0, 0, 1]], \"dist\": [[-0.28, 0.07, 0, 0, 0]]}";
    for text in [text, lists] {
        let read = found(text.as_bytes(), &sized(752, 480)).unwrap();
        assert_eq!(
            numbers(&read.camera),
            (752, 480, [458.6, 457.3, 367.2, 248.4])
        );
    }
    // A size that contradicts the file is no wish but a mistake.
    let toml =
        "width = 320\nheight = 240\nmodel = \"pinhole\"\nfx = 300\nfy = 300\ncx = 160\ncy = 120\n";
    assert_eq!(
        found(toml.as_bytes(), &sized(640, 480)).unwrap_err(),
        "cam.any: expected images of 640x480 pixels as asked for, found 320x240"
    );
}

#[test]
fn regress_many_keys_are_not_all_listed() {
    let keys: String = (0..28)
        .map(|index| format!("Viewer.Key{index}: 1\n"))
        .collect();
    assert!(
        refused(&keys)
            .ends_with("found the keys Viewer.Key0, Viewer.Key1, Viewer.Key2 and 25 more"),
        "{}",
        refused(&keys)
    );
    let dso = "0.527334 0.827306 0.473568 0.499436 0.0\n1280 1024\ncrop\n640 480\n";
    assert!(
        refused(dso).ends_with("found \"0.527334 0.827306 0.473568 0.499436 0.0\""),
        "{}",
        refused(dso)
    );
}

#[test]
fn regress_camera_toml_in_the_words_of_its_user() {
    let base = "width = 320\nheight = 240\nmodel = \"pinhole\"\nfx = 368.8\nfy = 369.9\ncx = 159.6\ncy = 121.5\n";
    for (text, expected) in [
        (
            format!("{base}[distortion]\nmodel = \"plumb_bob\"\nk1=0.1\nk2=0\np1=0\np2=0\n"),
            "line 9: expected \"radtan\", \"rational\" or \"kannala-brandt\" as model of [distortion], found \"plumb_bob\", which \
             is called \"radtan\" here",
        ),
        (
            base.replace("368.8", "368,8"),
            "line 4: expected a number with a decimal point for fx, found 368,8",
        ),
        (
            format!("{base}[distortion]\nmodel = \"radtan\"\ncoefficients=[0.1,0,0,0]\n"),
            "line 10: expected one of the keys model, k1, k2, k3, k4, k5, k6, p1, p2 in [distortion], found coefficients",
        ),
        (
            base.replace("model = \"pinhole\"\n", ""),
            "expected the key model = \"pinhole\", found none",
        ),
        (
            base.replace("model = \"pinhole\"", "model = pinhole"),
            "line 3: expected a value of TOML for model, found \"pinhole\"",
        ),
        (
            base.replace("model = \"pinhole\"", "model = \"fisheye\""),
            "line 3: expected model = \"pinhole\", found \"fisheye\"",
        ),
        (
            base.replace("fy = 369.9", "fy = \"369.9\""),
            "line 5: expected a number for fy, found \"\\\"369.9\\\"\"",
        ),
        (
            base.replace("width = 320", "width = 320.0"),
            "line 1: expected a whole number for width, found \"320.0\"",
        ),
    ] {
        let message = refused(&text);
        assert!(message.ends_with(expected), "{message}");
    }
}

#[test]
fn regress_utf16_of_windows_is_text() {
    let text =
        "width = 320\nheight = 240\nmodel = \"pinhole\"\nfx = 300\nfy = 300\ncx = 160\ncy = 120\n";
    let request = CalibrationRequest::default();
    let plain = found(text.as_bytes(), &request).unwrap();
    for big in [false, true] {
        let bytes: Vec<u8> = format!("\u{feff}{}", text.replace('\n', "\r\n"))
            .encode_utf16()
            .flat_map(|unit| {
                if big {
                    unit.to_be_bytes()
                } else {
                    unit.to_le_bytes()
                }
            })
            .collect();
        assert_eq!(found(&bytes, &request).unwrap(), plain);
        // Half a character at the end.
        assert_eq!(
            found(&bytes[..bytes.len() - 1], &request).unwrap_err(),
            "cam.any: expected UTF-16 text, found a broken character"
        );
    }
    let marked = format!("\u{feff}{text}");
    assert_eq!(found(marked.as_bytes(), &request).unwrap(), plain);
}

#[test]
fn regress_impossible_cameras_are_refused_before_a_run() {
    let toml = |fx: &str, cx: &str, more: &str| {
        format!(
            "width = 320\nheight = 240\nmodel = \"pinhole\"\nfx = {fx}\nfy = {fx}\ncx = {cx}\ncy = 120\n{more}"
        )
    };
    assert_eq!(
        refused(&toml("3.6", "160", "")),
        "cam.any: expected a camera that can exist, found fx = 3.6 px, which over 320 columns is a view of 177 degrees; focal \
         lengths are in pixels, not in millimetres or shares of the image"
    );
    let folds = refused(&toml(
        "368.8",
        "160",
        "[distortion]\nmodel = \"radtan\"\nk1 = -1.5\nk2 = 0.0\np1 = 0.0\np2 = 0.0\n",
    ));
    assert!(
        folds.contains("a lens (k1 = -1.5) that folds over"),
        "{folds}"
    );
    assert!(
        refused(&toml("300", "500", "")).contains("a principal point at (500, 120) px outside")
    );
    let odd = found(
        toml("300", "80", "").as_bytes(),
        &CalibrationRequest::default(),
    )
    .unwrap();
    assert!(
        odd.notes[0].contains("far from the middle"),
        "{:?}",
        odd.notes
    );
}

#[test]
fn regress_another_tools_file_as_camera_toml_names_the_converter() {
    let folder = ScratchFolder::new();
    let root = folder.path();
    fs::create_dir_all(root.join("images")).unwrap();
    image::GrayImage::new(320, 240)
        .save(root.join("images/000000.png"))
        .unwrap();
    fs::write(root.join("times.txt"), "0.0\n").unwrap();
    fs::write(root.join("odometry.csv"), "t_s,v_mps,omega_radps\n0,0,0\n").unwrap();
    fs::write(
        root.join("camera.toml"),
        "image_width: 320\nimage_height: 240\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [368.8, 0, 159.6, 0, 369.9, 121.5, 0, 0, 1]\n\
         distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n",
    )
    .unwrap();
    let message = Sequence::open(root).unwrap_err().to_string();
    let path = root.join("camera.toml").display().to_string();
    assert_eq!(
        message,
        format!(
            "{path}: expected a camera.toml, found a ROS camera_info, which `mono-slam camera {path} --out {path}` converts"
        )
    );
}
