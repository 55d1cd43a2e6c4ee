//! Calibration files found in public repositories, each with the outcome that its owner would expect.

use std::path::Path;

use mono_geometry::Distortion;
use slam_io::{CalibrationRequest, FoundCalibration, read_calibration};

use crate::calibrations_found::{EUROC, euroc_lens, numbers, of, radtan, sized};
use crate::common::data_folder;

fn genuine(path: &Path, request: &CalibrationRequest) -> Result<FoundCalibration, String> {
    read_calibration(path, request).map_err(|error| error.to_string())
}

/// Files found in public repositories, each with the outcome its owner would expect.
#[test]
fn val_genuine_files_of_other_tools_are_read() {
    let Some(samples) = data_folder("format_samples") else {
        return;
    };
    let one = CalibrationRequest::default();
    let good = |name: &str, request: &CalibrationRequest| {
        genuine(&samples.join(name), request).unwrap_or_else(|error| panic!("{error}"))
    };
    let bad = |name: &str| genuine(&samples.join(name), &one).unwrap_err();

    // ORB-SLAM 2 says no image size, 3 does.
    for name in ["EuRoC", "KITTI00-02", "TUM1", "TUM2", "TUM3"] {
        let name = format!("orbslam/orbslam2_{name}.yaml");
        assert!(
            bad(&name).ends_with(
                "expected the keys Camera.width and Camera.height, or --width and --height, found none"
            ),
            "{}",
            bad(&name)
        );
    }
    let euroc = good("orbslam/orbslam2_EuRoC.yaml", &sized(752, 480));
    assert_eq!(
        (numbers(&euroc.camera), euroc.camera.distortion),
        (EUROC, euroc_lens())
    );
    let tum1 = good("orbslam/orbslam2_TUM1.yaml", &sized(640, 480)).camera;
    assert_eq!(
        tum1.distortion,
        radtan(0.262383, -0.953104, -0.005358, 0.002628, 1.163314)
    );
    let three = good("orbslam/orbslam3_v1_mono_inertial.yaml", &one);
    assert_eq!(
        (numbers(&three.camera), three.camera.distortion),
        (EUROC, euroc_lens())
    );
    assert!(
        three.notes[0].contains("Camera.newWidth"),
        "{:?}",
        three.notes
    );

    // Kalibr: the first of two cameras, another one by name, a comma of another alphabet, a fifth coefficient.
    let mav = good("kalibr/euroc_mav.yaml", &one);
    assert_eq!(
        (numbers(&mav.camera), mav.camera.distortion),
        (EUROC, euroc_lens())
    );
    assert_eq!(
        mav.notes,
        ["camera cam0 of cam0, cam1 is taken; --camera chooses another"]
    );
    let second = good("kalibr/euroc_mav.yaml", &of("cam1"));
    assert_eq!((second.camera.fx, second.notes.len()), (457.587, 0));
    for (name, width, fx) in [
        ("epfl_phone_imucam", 3472, 3512.9804344883687),
        ("kaist", 1280, 816.9037899277),
        ("kaist_vio", 640, 380.9229090195708),
        ("rpng_aruco", 752, 470.0502737897896),
        ("rpng_ironsides", 640, 276.4850207717928),
        ("rpng_sim", 752, 458.654),
        ("rs_d455", 848, 416.85223429743274),
        ("rs_t265", 848, 282.019963259348),
        ("tagslam_cameras", 1920, 1404.917),
        ("tum_vi", 512, 190.97847715128717),
        ("uzhfpv_indoor", 640, 278.66723066149086),
    ] {
        let camera = good(&format!("kalibr/{name}.yaml"), &one).camera;
        assert_eq!((camera.width, camera.fx), (width, fx), "{name}");
    }
    assert!(
        bad("kalibr/epfl_phone_calibration.yaml")
            .contains("line 15: expected a finite number for resolution"),
        "{}",
        bad("kalibr/epfl_phone_calibration.yaml")
    );

    for (name, width, fx) in [
        ("duckiebot_fisheye", 640, 333.6990741851609),
        ("jetracer_640x480", 640, 400.2333557174174),
        ("miro_left_240", 320, 230.81369),
        ("miro_left_360", 640, 336.053014),
        ("rb5_ost", 1920, 701.12395),
        ("vine_ost", 320, 426.52027),
    ] {
        let camera = good(&format!("ros_camera_info/{name}.yaml"), &one).camera;
        assert_eq!((camera.width, camera.fx), (width, fx), "{name}");
    }

    // OpenCV's stereo sample: two cameras, no size, eight coefficients and six zeros.
    assert!(bad("opencv_yml/intrinsics.yml").contains("--width and --height"));
    let stereo = good("opencv_yml/intrinsics.yml", &sized(320, 240));
    assert_eq!(
        (stereo.camera.fx, stereo.camera.cx),
        (379.09832733558267, 159.19832103901987)
    );
    assert!(
        stereo.notes[0].contains("camera 1 of 1, 2"),
        "{:?}",
        stereo.notes
    );
    let two = CalibrationRequest {
        camera: Some("2".into()),
        ..sized(320, 240)
    };
    assert_eq!(
        good("opencv_yml/intrinsics.yml", &two).camera.cx,
        162.8391805349026
    );
    assert!(bad("opencv_yml/extrinsics.yml").contains("the extrinsics of a stereo pair"));

    // COLMAP: 23 cameras, half a pixel off.
    assert!(
        bad("colmap_bin/cameras.bin")
            .contains("--camera with an id, found the cameras 1, 2, 3 and 20 more")
    );
    let colmap = good("colmap_bin/cameras.bin", &of("2")).camera;
    assert_eq!(
        numbers(&colmap),
        (3031, 2006, [6210.646484375, 6210.646484375, 1515.0, 1002.5])
    );
    assert_eq!(
        colmap.distortion,
        radtan(-0.11201857775449753, 0.0, 0.0, 0.0, 0.0)
    );
    let dense = good("colmap_bin_dense/cameras.bin", &of("1")).camera;
    assert_eq!(
        (dense.fy, dense.distortion),
        (2046.5576468097338, Distortion::None)
    );
    assert!(genuine(&samples.join("colmap_bin/points3D.bin"), &one).is_err());

    let kitti = good("kitti_raw_calib/calib_cam_to_cam.txt", &one);
    assert_eq!(
        numbers(&kitti.camera),
        (1242, 375, [721.5377, 721.5377, 609.5593, 172.854])
    );
    let colour = good("kitti_raw_calib/calib_cam_to_cam.txt", &of("2"));
    assert_eq!(colour.camera.width, 1242);
    assert!(
        bad("kitti_raw_calib/calib_imu_to_velo.txt")
            .contains("expected a calibration of camera.toml")
    );
    assert!(bad("euroc_odd/cam0_sensor.yaml").lines().count() == 1);
}

#[test]
fn val_genuine_euroc_and_kitti_sequences_have_a_calibration() {
    let one = CalibrationRequest::default();
    if let Some(euroc) = data_folder("euroc_v101_micro") {
        let read = genuine(&euroc.join("mav0/cam0/sensor.yaml"), &one).unwrap();
        assert_eq!(
            (numbers(&read.camera), read.camera.distortion),
            (EUROC, euroc_lens())
        );
    }
    if let Some(samples) = data_folder("format_samples") {
        let calib = samples.join("kitti05_mini/sequences/05/calib.txt");
        let read = genuine(&calib, &sized(1226, 370)).unwrap();
        assert_eq!(read.camera.fx, 707.0912);
        assert!(
            genuine(&calib, &one)
                .unwrap_err()
                .contains("--width and --height")
        );
    }
}
