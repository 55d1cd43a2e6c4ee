//! Landmark updates per second on the first setting of `kim2008`.
//!
//! `RAYON_NUM_THREADS=1 cargo run --release -p range-bearing-slam --example fastslam_rate -- 100`
//!
//! The argument is the number of particles. Each filter prints one line: updates (particles times
//! measurements of landmarks already in the map), seconds for the whole run (prediction at 40 Hz,
//! proposal, weights, resampling, maps), updates per second. A second argument names a file for the map,
//! which then holds `lm 2 COUNT` and `wp 2 COUNT`, each followed by lines of x and y in the frame of the
//! first pose.

#[path = "support/filters.rs"]
mod filters;
#[path = "support/motion.rs"]
mod motion;
#[path = "support/published.rs"]
mod published;
#[path = "support/simulation.rs"]
mod simulation;

use filters::{Filter, Trial};
use nalgebra::Vector2;
use simulation::{RECTANGLE, Scan, Settings, World, simulate};
use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Write;
use std::time::Instant;

/// Number of measurements of landmarks that were seen before.
fn known(scans: &[Scan]) -> usize {
    let mut seen = BTreeSet::new();
    scans
        .iter()
        .flat_map(|scan| &scan.measurements)
        .filter(|(id, _)| !seen.insert(*id))
        .count()
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let particles: usize = arguments.next().ok_or("how many particles?")?.parse()?;
    let settings = Settings::slow(20.0, 0.2, 8.0);
    // the first leg lies on the x axis, so the frame of the world is that of the first pose
    let world = World::along(&RECTANGLE, 6.0, 10.0, 1);
    if let Some(file) = arguments.next() {
        let mut text = String::new();
        for (name, points) in [("lm", &world.landmarks), ("wp", &world.waypoints)] {
            writeln!(text, "{name} 2 {}", points.len())?;
            points
                .iter()
                .try_for_each(|at| writeln!(text, "{:.4} {:.4}", at.x, at.y))?;
        }
        std::fs::write(&file, text).map_err(|error| format!("{file}: {error}"))?;
    }
    let (_, scans) = simulate(&world, &settings, 1);
    let updates = particles * known(&scans);
    for filter in [
        Filter::FastSlam1,
        Filter::FastSlam2Published,
        Filter::FastSlam2,
        Filter::UnscentedLandmarks,
        Filter::UnscentedPoses,
        Filter::Unscented,
        Filter::Moved,
    ] {
        let start = Instant::now();
        let mut error = 0.0;
        let trial = Trial {
            filter,
            particles,
            scans: &scans,
            settings: &settings,
            block: 1,
            seed: 1,
        };
        trial.run(|poses, weights, scan| {
            let position: Vector2<f64> = poses
                .iter()
                .zip(weights)
                .map(|(pose, &weight)| pose.xy() * weight)
                .sum();
            error = (position - scan.truth.xy()).norm();
        })?;
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{filter:?}: {updates} updates, {seconds:.4} s, {:.0} per second, {error:.2} m off at the end",
            updates as f64 / seconds,
        );
    }
    Ok(())
}
