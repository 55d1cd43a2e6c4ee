//! A camera with its lens cap on: the filter lives on odometry alone and its covariance grows.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use mono_geometry::{Camera, Distortion, Mount, Pinhole};
use slam_pipeline::config::Config;
use slam_pipeline::{FrameInput, OdometryInterval, Rig, Slam};
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
    let rig = Rig {
        camera: Camera::new(pinhole, Distortion::None)?,
        mount: Mount::forward(),
    };
    let config = Config::default().check()?;
    let mut slam = Slam::new(rig, &config)?;
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
        let report = slam.step(&input, &mut |_| {})?;
        println!(
            "frame {frame}: ({:.2}, {:.2}) m, known to {:.3} m",
            report.estimate.pose.x,
            report.estimate.pose.y,
            (report.estimate.covariance[(0, 0)] + report.estimate.covariance[(1, 1)]).sqrt()
        );
    }
    Ok(())
}
