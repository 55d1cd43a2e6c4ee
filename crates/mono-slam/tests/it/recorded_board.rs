//! The checkerboard sequence of the course "Vision Algorithms for Mobile Robotics", when it is there.

use std::path::{Path, PathBuf};

use camera_calibration::{BoardSize, CalibrationSettings};
use mono_geometry::calibration::LensModel;
use mono_geometry::{Camera, Distortion, Pinhole, Se3, so3};
use mono_slam::calibrate::calibrate_files;
use nalgebra::Vector3;
use slam_io::image_files;

/// `MONO_SLAM_DATA`, or `../shared/data` beside the workspace.
fn data() -> Option<PathBuf> {
    let root = std::env::var_os("MONO_SLAM_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let folder = root.join("checkerboard_poses");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: no {}", folder.display());
    None
}

/// The source's calibration: k1 r^2 + k2 r^4 with r in pixels, here in units of the focal length (fx = fy to 0.03 %).
fn given() -> Camera {
    let (fx, fy) = (420.506_712, 420.610_940);
    let focal2: f64 = fx * fy;
    Camera::new(
        Pinhole {
            width: 752,
            height: 480,
            fx,
            fy,
            cx: 355.208_298,
            cy: 250.336_787,
        },
        Distortion::Radtan {
            k1: -1.6774e-6 * focal2,
            k2: 2.5847e-12 * focal2 * focal2,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
        },
    )
    .unwrap()
}

fn given_poses(folder: &Path) -> Vec<Se3> {
    let text = std::fs::read_to_string(folder.join("poses.csv")).unwrap();
    text.lines()
        .skip(1)
        .map(|line| {
            let v: Vec<f64> = line
                .split(',')
                .skip(1)
                .map(|field| field.parse().unwrap())
                .collect();
            Se3::new(
                so3::exp(&Vector3::new(v[0], v[1], v[2])),
                Vector3::new(v[3], v[4], v[5]),
            )
        })
        .collect()
}

#[test]
fn val_vamr_checkerboard_is_found_and_calibrated_as_given() {
    let Some(folder) = data() else { return };
    let files = image_files(&[folder.join("images")]).unwrap();
    let settings = CalibrationSettings {
        board: BoardSize {
            columns: 9,
            rows: 6,
        },
        square_m: 0.04,
        model: LensModel::RadtanK3,
    };
    let run = calibrate_files(&files, &settings, &|| {}).unwrap();
    assert_eq!(run.calibration.views.len(), 40, "boards found in 40 images");

    // Corners against the projection of the given poses: 0.2 px is what the source's own corners leave.
    let (camera, poses) = (given(), given_poses(&folder));
    let mut distances = Vec::new();
    for ((_, board), pose) in run.used().zip(&poses) {
        for (k, corner) in board.corners.iter().enumerate() {
            let point = Vector3::new(0.04 * (k % 9) as f64, 0.04 * (k / 9) as f64, 0.0);
            let pixel = camera.project(&pose.transform_point(&point)).unwrap();
            distances.push((corner[0] - pixel.x).hypot(corner[1] - pixel.y));
        }
    }
    distances.sort_by(f64::total_cmp);
    let median = distances[distances.len() / 2];
    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
    println!(
        "given poses: median {median:.3} px, mean {mean:.3} px, largest {:.3} px",
        distances[distances.len() - 1]
    );
    // A corner one square off would be 20 px away. The given poses themselves are off by half a pixel in four images.
    assert!(mean < 0.3 && distances[distances.len() - 1] < 2.5);

    let calibration = &run.calibration;
    println!(
        "RMS {:.4} px, mean {:.4} px",
        calibration.rms_px, calibration.mean_error_px
    );
    assert!(calibration.mean_error_px <= 0.25);
    for (name, expected) in [
        ("fx", 420.506_712),
        ("fy", 420.610_940),
        ("cx", 355.208_298),
        ("cy", 250.336_787),
    ] {
        let found = calibration.parameter(name).unwrap();
        let off = (found.value - expected).abs();
        println!(
            "{name}: {:.3} +- {:.3}, given {expected}",
            found.value, found.sigma
        );
        assert!(
            off <= 0.01 * expected || off <= 3.0 * found.sigma,
            "{name}: {} against {expected}",
            found.value
        );
    }
}
