//! A robot drives along a wall, looking at it sideways: how the depth of a point becomes known.
//!
//! Prints, for each step of 0.1 m, the parallax and the standard deviation of the depth, or why the point has to wait.

#![expect(clippy::print_stdout, reason = "an example shows its result")]

use mono_geometry::triangulation::{Acceptance, Observation, triangulate};
use mono_geometry::{Mount, NoiseShape, Pinhole, Se2};
use nalgebra::{Matrix3, Vector3};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let pinhole = Pinhole {
        width: 320,
        height: 240,
        fx: 368.8262,
        fy: 369.90239,
        cx: 159.67029,
        cy: 121.54136,
    };
    let looking_left = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    let mount = Mount::new(&looking_left, &Vector3::new(0.002, 0.0, 0.1))?;
    let landmark = Vector3::new(0.3, 2.0, 0.4);

    let mut observations = Vec::new();
    for step in 0..8 {
        let world_from_body = Se2::new(0.1 * f64::from(step), 0.0, 0.0);
        let camera_from_world = mount
            .world_from_camera(&world_from_body, 0.0, 0.0, 0.0)
            .inverse();
        let Some(pixel_ideal) = pinhole.project(&camera_from_world.transform_point(&landmark))
        else {
            continue;
        };
        if !pinhole.contains(&pixel_ideal, 0.0) {
            continue;
        }
        observations.push(Observation {
            camera_from_world,
            pixel_ideal,
            sigma_px: 0.5,
            shape: NoiseShape::ROUND,
        });
        match triangulate(&pinhole, &observations, &Acceptance::default()) {
            Ok(found) => println!(
                "view {step}: parallax {:5.2} deg, depth {:.3} m, sigma {:.4} m",
                found.parallax_rad.to_degrees(),
                found.point.y,
                found.covariance[(1, 1)].sqrt()
            ),
            Err(reason) => println!("view {step}: waits, {reason}"),
        }
    }
    Ok(())
}
