//! A camera with its lens cap on: the filter lives on odometry alone and its covariance grows.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use mono_geometry::{Camera, Distortion, Mount, Pinhole};
use slam_pipeline::config::Config;
use slam_pipeline::odometry::OdometryInterval;
use slam_pipeline::slam::{FrameInput, Slam};
use vision_sift::Features;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let pinhole = Pinhole {
        width: 320,
        height: 240,
        fx: 368.8,
        fy: 369.9,
        cx: 159.7,
        cy: 121.5,
    };
    let camera = Camera::new(pinhole, Distortion::None)?;
    let mount = Mount::forward().body_from_camera;
    let config = Config::default().check()?;
    let mut slam = Slam::new(camera, mount.rotation.matrix(), &mount.translation, &config)?;
    for frame in 0..20 {
        let odometry = [OdometryInterval {
            duration_s: 0.5,
            v_mps: 0.2,
            omega_radps: 0.1,
        }];
        let input = FrameInput {
            features: &Features::default(),
            odometry: &odometry,
        };
        let outcome = slam.step(&input, &|| 0.0)?;
        println!(
            "frame {frame}: ({:.2}, {:.2}) m, known to {:.3} m",
            outcome.pose.x,
            outcome.pose.y,
            (outcome.covariance[(0, 0)] + outcome.covariance[(1, 1)]).sqrt()
        );
    }
    Ok(())
}
