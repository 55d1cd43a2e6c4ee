//! Spoils the odometry or the mount of sequences in turn and prints what the images say of it.
//!
//! `cargo run --release -p mono-slam --example spoiled_inputs -- SEQ...`

#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use mono_geometry::motion::OdometrySample;
use mono_geometry::{Mount, Se3};
use mono_slam::pairs::PairCollector;
use motion_consistency::check_motion;
use nalgebra::{Rotation3, Vector3};
use slam_io::Sequence;
use slam_pipeline::config::Config;
use slam_pipeline::detector_of;
use vision_sift::{Features, GrayImage, Workspace};

/// Name, factors of speed and turn rate, turns of the mount about the vertical and about the optical axis in degrees.
const SPOILED: [(&str, f64, f64, f64, f64); 14] = [
    ("nothing", 1.0, 1.0, 0.0, 0.0),
    ("speed times -1", -1.0, 1.0, 0.0, 0.0),
    ("speed times 0.01", 0.01, 1.0, 0.0, 0.0),
    ("turn rate times -1", 1.0, -1.0, 0.0, 0.0),
    ("turn rate times 57.3", 1.0, 57.3, 0.0, 0.0),
    ("turn rate times 1.5", 1.0, 1.5, 0.0, 0.0),
    ("turn rate times 0.5", 1.0, 0.5, 0.0, 0.0),
    ("turn rate times 0", 1.0, 0.0, 0.0, 0.0),
    ("at rest", 0.0, 0.0, 0.0, 0.0),
    ("mount turned by 90", 1.0, 1.0, 90.0, 0.0),
    ("mount turned by 180", 1.0, 1.0, 180.0, 0.0),
    ("mount turned by 30", 1.0, 1.0, 30.0, 0.0),
    ("mount rolled by 180", 1.0, 1.0, 0.0, 180.0),
    ("mount rolled by 90", 1.0, 1.0, 0.0, 90.0),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for folder in std::env::args().skip(1) {
        let sequence = Sequence::open(folder.as_ref())?;
        let (camera, mount) = sequence.camera.camera_and_mount()?;
        let detector = detector_of(&Config::default().check()?)?;
        let mut workspace = Workspace::new();
        let mut features = Features::default();
        let mut pairs = PairCollector::new(sequence.images.len());
        for (index, &time_s) in sequence.times_s.iter().enumerate() {
            let image = sequence.load_image(index)?;
            let view = GrayImage::new(image.width, image.height, &image.pixels)?;
            detector.detect(&view, &mut workspace, &mut features)?;
            pairs.observe(index, time_s, &features, &camera);
        }
        for (name, speed, turn_rate, yaw, roll) in SPOILED {
            let rows: Vec<OdometrySample> = sequence
                .odometry
                .iter()
                .map(|row| OdometrySample {
                    t_s: row.t_s,
                    v_mps: speed * row.v_mps,
                    omega_radps: turn_rate * row.omega_radps,
                })
                .collect();
            let findings = check_motion(
                pairs.pairs(),
                &rows,
                camera.pinhole(),
                &turned(&mount, yaw, roll),
            );
            let said: Vec<String> = findings
                .iter()
                .map(|f| format!("[{}] {f}", f.name()))
                .collect();
            println!("{}: {name}: {}", sequence.name, said.join(" "));
        }
    }
    Ok(())
}

fn turned(mount: &Mount, yaw_degrees: f64, roll_degrees: f64) -> Mount {
    let about_z =
        |degrees: f64| Rotation3::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
    Mount {
        body_from_camera: Se3 {
            rotation: about_z(yaw_degrees)
                * mount.body_from_camera.rotation
                * about_z(roll_degrees),
            translation: mount.body_from_camera.translation,
        },
    }
}
