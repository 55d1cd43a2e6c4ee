//! The loop of a robot: images and odometry from memory, a pose with its covariance after every frame. At the end the map
//! is saved; another day the robot is switched on somewhere, loads it, and finds itself.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use std::error::Error;
use std::ops::Range;

use mono_geometry::{Camera, Distortion};
use slam_pipeline::config::Config;
use slam_pipeline::{FrameInput, MapUse, OdometryInterval, Rig, Slam, detector_of};
use vision_sift::{Detector, Features, GrayImage, Workspace};
use wall_scenes::{Scene, SceneSpec, Skins};

/// One frame after the other, as camera and wheels deliver them.
fn drive(
    slam: &mut Slam,
    (scene, skins): (&Scene, &Skins),
    detector: &Detector,
    frames: Range<usize>,
) -> Result<(), Box<dyn Error>> {
    let mut workspace = Workspace::new();
    let mut features = Features::default();
    for frame in frames.clone() {
        // A real robot asks its camera and its wheels here.
        let image = scene.render(skins, frame);
        let rows = scene.odometry_before(frame);
        let odometry: Vec<OdometryInterval> = rows
            .iter()
            // Nobody knows how it came to where it is switched on.
            .filter(|_| frame > frames.start)
            .map(|(duration_s, row)| OdometryInterval {
                duration_s: *duration_s,
                v_mps: row.v_mps,
                omega_radps: row.omega_radps,
            })
            .collect();
        let view = GrayImage::new(image.width, image.height, &image.pixels)?;
        detector.detect(&view, &mut workspace, &mut features)?;
        let input = FrameInput {
            features: &features,
            odometry: &odometry,
        };
        let report = slam.step(&input, &mut |_| {})?;
        let (pose, c) = (report.estimate.pose, report.estimate.covariance);
        println!(
            "frame {frame:2}: ({:6.3}, {:6.3}) m, {:6.1} mrad, known to {:5.1} mm and {:4.1} mrad, {}",
            pose.x,
            pose.y,
            1e3 * pose.phi,
            1e3 * (c[(0, 0)] + c[(1, 1)]).sqrt(),
            1e3 * c[(2, 2)].sqrt(),
            report.tracking.name()
        );
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Scene::new(SceneSpec::wall(3))?;
    let skins = scene.skins();
    let rig = Rig {
        camera: Camera::new(Scene::pinhole(), Distortion::None)?,
        mount: Scene::mount(),
    };
    let config = Config::default().check()?;
    let detector = detector_of(&config)?;

    let mut slam = Slam::new(rig, &config)?;
    drive(&mut slam, (&scene, &skins), &detector, 0..24)?;
    let file = std::env::temp_dir().join(format!("live-{}.slam", std::process::id()));
    slam_io::write_map(&file, &slam.landmarks(), Some(&slam.known_map()))?;
    println!("{} landmarks saved", slam.landmarks().len());

    let map = slam_io::read_known_map(&file)?;
    std::fs::remove_file(&file)?;
    let mut again = Slam::with_map(rig, &config, &map, MapUse::Localise)?;
    drive(&mut again, (&scene, &skins), &detector, 10..20)
}
