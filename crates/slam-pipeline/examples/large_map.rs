//! Time and memory of large maps: `large_map [PARTICLES]`, by default a hundred. For every size of the map it prints the
//! resident memory (megabytes; 0 where there is no `/proc`) when the map is loaded and when sixty frames have been driven in
//! it, and the milliseconds of a frame between keyframes and of a keyframe. Rows of shelves one behind the other are the hard
//! case: the map does not know that the first hides the others, so that a robot that wakes up in it does not find its place.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use std::time::Instant;

#[path = "../benches/large_map/mod.rs"]
mod large_map;

use large_map::{driven, map, rig, step};

/// Frames that are driven.
const FRAMES: usize = 60;

fn resident_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kb = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
    kb.unwrap_or(0.0) / 1024.0
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let particles = match std::env::args().nth(1) {
        Some(given) => given.parse()?,
        None => 100,
    };
    let rig = rig().ok_or("the camera is refused")?;
    println!(
        "| rows of | landmarks | MB loaded | MB driven | ms between | ms keyframe | keyframes | matches |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for rows_of in [usize::MAX, 200] {
        for landmarks in [1_000, 10_000, 100_000] {
            let map = map(&rig, landmarks, rows_of);
            let before = resident_mb();
            let mut slam = driven(&rig, &map, particles, 0)?;
            let loaded = resident_mb() - before;
            let (mut times, mut counts, mut matches) = ([0.0; 2], [0_usize; 2], 0);
            for index in 0..FRAMES {
                let started = Instant::now();
                let (keyframe, matched) = step(&mut slam, &rig, &map, index)?;
                // The first frames find the place.
                if index >= 5 {
                    times[usize::from(keyframe)] += started.elapsed().as_secs_f64() * 1e3;
                    counts[usize::from(keyframe)] += 1;
                    matches += matched;
                }
            }
            let mean = |kind: usize| times[kind] / counts[kind].max(1) as f64;
            let rows = if rows_of == usize::MAX {
                "all".to_owned()
            } else {
                rows_of.to_string()
            };
            println!(
                "| {rows} | {landmarks} | {loaded:.0} | {:.0} | {:.2} | {:.2} | {} | {} |",
                resident_mb() - before,
                mean(0),
                mean(1),
                counts[1],
                matches / (FRAMES - 5),
            );
        }
    }
    Ok(())
}
