//! Bundle adjustment of a long drive around a circle that closes: time, and how far the poses are off.
//!
//! `cargo run --release -p mono-geometry --example adjust_long_chain -- [POSES]` (2000 by default)

#![expect(clippy::print_stdout, reason = "an example shows its result")]

#[path = "../tests/it/common/long_chain.rs"]
mod long_chain;

use std::error::Error;
use std::time::Instant;

use mono_geometry::Se2;
use mono_geometry::bundle::{Options, adjust};

fn main() -> Result<(), Box<dyn Error>> {
    let count = std::env::args().nth(1).map_or(Ok(2000), |n| n.parse())?;
    let (problem, truth) = long_chain::circle(count, 3);
    println!(
        "{} poses, {} landmarks, {} pixels",
        problem.poses.len(),
        problem.landmarks.len(),
        problem.observations.len()
    );
    let rmse = |poses: &[Se2]| -> f64 {
        let squares = poses
            .iter()
            .zip(&truth)
            .map(|(a, b)| (a.x - b.x).powi(2) + (a.y - b.y).powi(2));
        (squares.sum::<f64>() / truth.len() as f64).sqrt()
    };
    let start = Instant::now();
    let adjusted = adjust(&problem, &Options::default())?;
    println!(
        "{:.2} s, {} steps, {}: {:.4} m off, {:.4} m before",
        start.elapsed().as_secs_f64(),
        adjusted.iterations.len(),
        adjusted.termination,
        rmse(&adjusted.poses),
        rmse(&problem.poses)
    );
    Ok(())
}
