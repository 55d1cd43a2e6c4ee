//! The loop of a robot: images and odometry from memory, a pose with its covariance after every frame. At the end the map
//! is saved; another day the robot is switched on somewhere, loads it, and finds itself.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use std::error::Error;
use std::ops::Range;

use mono_geometry::{Camera, Distortion};
use slam_pipeline::config::Config;
use slam_pipeline::{FrameInput, MapUse, OdometryInterval, Rig, Slam, detector_of};
use vision_sift::{Features, GrayImage, Workspace};
use wall_scenes::{Scene, SceneSpec};

/// One frame after the other, as camera and wheels deliver them.
fn drive(slam: &mut Slam, scene: &Scene, frames: Range<usize>) -> Result<(), Box<dyn Error>> {
    let detector = detector_of(&Config::default().check()?)?;
    let (mut workspace, mut features, skins) =
        (Workspace::new(), Features::default(), scene.skins());
    for frame in frames.clone() {
        // A real robot asks its camera and its wheels here. How it came to where it is switched on, nobody knows.
        let image = scene.render(&skins, frame);
        let rows = scene.odometry_before(frame);
        let rows = if frame > frames.start { &rows[..] } else { &[] };
        let interval = |&(duration_s, row): &(f64, wall_scenes::OdometryRow)| OdometryInterval {
            duration_s,
            v_mps: row.v_mps,
            omega_radps: row.omega_radps,
        };
        let odometry: Vec<_> = rows.iter().map(interval).collect();

        let view = GrayImage::new(image.width, image.height, &image.pixels)?;
        detector.detect(&view, &mut workspace, &mut features)?;
        let (features, odometry) = (&features, &odometry);
        let report = slam.step(&FrameInput { features, odometry }, &mut |_| {})?;
        let (p, c) = (report.estimate.pose, report.estimate.covariance);
        let known_mm = 1e3 * (c[(0, 0)] + c[(1, 1)]).sqrt();
        let word = report.tracking.name();
        println!(
            "frame {frame:2}: ({:6.3}, {:6.3}) m, known to {known_mm:5.1} mm, {word}",
            p.x, p.y
        );
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Scene::new(SceneSpec::wall(3))?;
    let camera = Camera::new(Scene::pinhole(), Distortion::None)?;
    let mount = Scene::mount();
    let (rig, config) = (Rig { camera, mount }, Config::default().check()?);

    let mut slam = Slam::new(rig, &config)?;
    drive(&mut slam, &scene, 0..24)?;
    let file = std::env::temp_dir().join(format!("live-{}.slam", std::process::id()));
    slam_io::write_map(&file, &slam.landmarks(), Some(&slam.known_map()))?;

    let map = slam_io::read_known_map(&file)?;
    std::fs::remove_file(&file)?;
    let mut again = Slam::with_map(rig, &config, &map, MapUse::Localise)?;
    drive(&mut again, &scene, 10..20)
}
