//! How far the wall moves in the image from frame to frame, and what a method could know of its depth.
//!
//! Prints, for the point in the middle of the first image, its pixel and depth in every frame that sees it.

#![expect(clippy::print_stdout, reason = "an example that prints its result")]

use wall_scenes::{Scene, SceneSpec};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = Scene::new(SceneSpec::wall(1))?;
    let point = scene
        .point_at(0, 160.0, 120.0)
        .ok_or("the middle of the image sees nothing")?;
    println!("frame  column  row  depth of the surface there (m)");
    for frame in 0..scene.spec().frames {
        let Some([u, v]) = scene.project(frame, &point) else {
            break;
        };
        let depth = scene
            .depth_at(frame, u, v)
            .ok_or("a pixel without a surface")?;
        println!("{frame:5} {u:7.1} {v:5.1} {depth:7.3}");
    }
    Ok(())
}
