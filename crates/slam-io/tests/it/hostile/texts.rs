//! Calibrations, configurations and trajectories.

use slam_io::configuration::read_configuration;
use slam_io::{CalibrationRequest, CameraFormat, read_calibration, read_trajectory, read_tum};

use super::{TEXT, attack_file, unsealed};

/// Small files of every format, as its tool writes them.
const CALIBRATIONS: [(CameraFormat, &[u8]); 11] = [
    (
        CameraFormat::Toml,
        b"width = 752\nheight = 480\nmodel = \"pinhole\"\nfx = 458.6\nfy = 457.3\ncx = 367.2\ncy = 248.4\n\n[distortion]\n\
          model = \"radtan\"\nk1 = -0.28\nk2 = 0.07\np1 = 0.0002\np2 = 1.8e-5\n\n[mount]\nposition_in_body = [0.1, 0, 0.9]\n\
          rotation_body_from_camera = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]\n\n[sigma]\nfx = 1.5\n",
    ),
    (
        CameraFormat::Kalibr,
        b"cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]\n  distortion_model: radtan\n  \
          intrinsics: [458.6, 457.3, 367.2, 248.4]\n  resolution: [752, 480]\n",
    ),
    (
        CameraFormat::OpenCv,
        b"%YAML:1.0\n---\nimage_width: 752\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
          data: [ 458.6, 0., 367.2, 0., 457.3, 248.4, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 5\n   \
          cols: 1\n   dt: d\n   data: [ -0.28, 0.07, 0.0002, 1.8e-05, 0. ]\n",
    ),
    (
        CameraFormat::OpenCv,
        b"<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>752</image_width>\n<image_height>480</image_height>\n\
          <camera_matrix type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt><data>458.6 0. 367.2 0. 457.3 248.4 0. \
          0. 1.</data></camera_matrix>\n<distortion_coefficients type_id=\"opencv-matrix\"><rows>5</rows><cols>1</cols><dt>d</dt>\
          <data>-0.28 0.07 0.0002 1.8e-05 0.</data></distortion_coefficients>\n</opencv_storage>\n",
    ),
    (
        CameraFormat::Ros,
        b"image_width: 640\nimage_height: 480\ncamera_name: front\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [500, 0, 320, 0, \
          501, 240, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.28, 0.07, 0, \
          0, 0]\n",
    ),
    (
        CameraFormat::Ros,
        b"header:\n  stamp:\n    sec: 17\n    nanosec: 8\n  frame_id: camera\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n\
          d:\n- -0.28\n- 0.07\n- 0.0\n- 0.0\n- 0.0\nk:\n- 500.0\n- 0.0\n- 320.0\n- 0.0\n- 501.0\n- 240.0\n- 0.0\n- 0.0\n- 1.0\n\
          binning_x: 0\n---\n",
    ),
    (
        CameraFormat::OrbSlam,
        b"%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.fx: 458.6\nCamera.fy: 457.3\nCamera.cx: 367.2\nCamera.cy: 248.4\nCamera.k1: \
          -0.28\nCamera.k2: 0.07\nCamera.p1: 0.0002\nCamera.p2: 1.7e-05\nCamera.width: 752\nCamera.height: 480\n",
    ),
    (
        CameraFormat::Camodocal,
        b"%YAML:1.0\n---\nmodel_type: PINHOLE\ncamera_name: camera\nimage_width: 752\nimage_height: 480\ndistortion_parameters:\n   \
          k1: -0.28\n   k2: 0.07\n   p1: 0.0002\n   p2: 1.7e-05\nprojection_parameters:\n   fx: 458.6\n   fy: 457.3\n   cx: 367.2\n   \
          cy: 248.4\n",
    ),
    (
        CameraFormat::Colmap,
        b"# Camera list with one line of data per camera:\n1 OPENCV 752 480 458.6 457.3 367.7 248.9 -0.28 0.07 0.0002 1.7e-05\n",
    ),
    (
        CameraFormat::Euroc,
        b"%YAML:1.0\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, 0, 1, 0.1, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 1]\n\
          rate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [458.6, 457.3, 367.2, 248.4]\n\
          distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]\n",
    ),
    (
        CameraFormat::Kitti,
        b"P0: 718.8 0 607.1 0 0 718.8 185.2 0 0 0 1 0\nP1: 718.8 0 607.1 -386.1 0 718.8 185.2 0 0 0 1 0\n",
    ),
];

/// COLMAP's binary cameras.
fn colmap_binary() -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend(1_u64.to_le_bytes());
    bytes.extend(7_u32.to_le_bytes());
    bytes.extend(4_i32.to_le_bytes());
    bytes.extend(752_u64.to_le_bytes());
    bytes.extend(480_u64.to_le_bytes());
    for value in [458.6, 457.3, 367.7, 248.9, -0.28, 0.07, 0.0002, 1.7e-05_f64] {
        bytes.extend(value.to_le_bytes());
    }
    bytes
}

#[test]
fn calibrations_of_any_bytes() {
    let mut genuine: Vec<Vec<u8>> = CALIBRATIONS.iter().map(|(_, text)| text.to_vec()).collect();
    genuine.push(colmap_binary());
    let requests: Vec<CalibrationRequest> = [None]
        .into_iter()
        .chain(CALIBRATIONS.iter().map(|(format, _)| Some(*format)))
        .flat_map(|format| {
            [None, Some([752, 480])].map(|size| CalibrationRequest {
                format,
                camera: None,
                size,
            })
        })
        .collect();
    let turn = std::cell::Cell::new(0_usize);
    attack_file("calibration", &genuine, TEXT, unsealed, |path| {
        // Recognised by its contents every other time, and read as each format in turn.
        turn.set(turn.get() + 1);
        let forced = &requests[turn.get() / 2 % requests.len()];
        let request = if turn.get().is_multiple_of(2) {
            forced
        } else {
            &requests[1]
        };
        if let Ok(found) = read_calibration(path, request) {
            drop(found.camera.camera_and_mount());
        }
    });
}

/// The rows above are what their format says; otherwise the attack is one on strangers.
#[test]
fn the_genuine_calibrations_are_read() {
    let folder = crate::common::ScratchFolder::new();
    let path = folder.path().join("file.any");
    let sized = |format| CalibrationRequest {
        format,
        camera: None,
        size: Some([1241, 376]),
    };
    for (format, text) in CALIBRATIONS {
        std::fs::write(&path, text).unwrap();
        for request in [sized(None), sized(Some(format))] {
            let request = match format {
                CameraFormat::Kitti => request,
                _ => CalibrationRequest {
                    size: None,
                    ..request
                },
            };
            let read = read_calibration(&path, &request);
            assert!(read.is_ok(), "{format:?}: {}", read.unwrap_err());
        }
    }
}

#[test]
fn configurations_of_any_bytes() {
    let genuine = [
        slam_io::configuration::documented_toml().into_bytes(),
        b"[robot]\npreset = \"car\"\n[filter]\nparticles = 30\nmethod = \"exact\"\n".to_vec(),
    ];
    attack_file("configuration", &genuine, TEXT, unsealed, |path| {
        drop(read_configuration(path));
    });
}

#[test]
fn trajectories_of_any_bytes() {
    let genuine = [
        &b"# t x y z qx qy qz qw\n0 0 0 0 0 0 0 1\n0.5 0.1 0 0 0 0 0.1 0.99\n1 0.2 0 0 0 0 0.2 0.98\n"[..],
        b"0 0 0 0\n1 1 0 0\n2 2 0 0\n",
        b"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n",
        b"#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n\
          1403636580838555648,4.6,-1.7,0.7,1,0,0,0\n1403636580843555328,4.7,-1.7,0.7,1,0,0,0\n",
        b"t_s,x_m,y_m,phi_rad\n0,0,0,0\n1,1,0,0.1\n2,2,nan,0.2\n",
    ]
    .map(<[u8]>::to_vec);
    attack_file("trajectory", &genuine, TEXT, unsealed, |path| {
        drop(read_trajectory(path));
        drop(read_tum(path));
    });
}
