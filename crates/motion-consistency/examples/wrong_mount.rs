//! A camera that looks to the left of its robot, and a mount that says it looks ahead.

#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use mono_geometry::motion::OdometrySample;
use mono_geometry::{Mount, Pinhole};
use motion_consistency::{FramePair, check_motion};
use nalgebra::Vector2;

fn main() {
    let camera = Pinhole {
        width: 640,
        height: 480,
        fx: 500.0,
        fy: 500.0,
        cx: 319.5,
        cy: 239.5,
    };
    // The robot drives 0.1 m between two frames along a wall with things 1 to 3 m away: they pass to the left of the image.
    let pair = |k: u32| FramePair {
        from_s: 0.5 * f64::from(k),
        to_s: 0.5 * f64::from(k + 1),
        matches: (0..60)
            .map(|i| {
                let depth_m = 1.0 + f64::from(i % 5) * 0.5;
                let from = Vector2::new(
                    120.0 + f64::from(i * 31 % 400),
                    40.0 + f64::from(i * 17 % 400),
                );
                [from, from - Vector2::new(500.0 * 0.1 / depth_m, 0.0)]
            })
            .collect(),
    };
    let pairs: Vec<FramePair> = (0..20).map(pair).collect();
    let odometry = [OdometrySample {
        t_s: 0.0,
        v_mps: 0.2,
        omega_radps: 0.0,
    }];
    for finding in check_motion(&pairs, &odometry, &camera, &Mount::forward()) {
        println!("[{}] {finding}", finding.name());
    }
}
