//! Prints the landmarks of a map: `show_map MAP.slam`.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use std::path::PathBuf;

use slam_io::{read_map, uncertainty_m};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).map(PathBuf::from);
    let path = path.ok_or("usage: show_map MAP.slam")?;
    for landmark in read_map(&path)? {
        let p = landmark.position;
        println!(
            "{:>6}  ({:8.3}, {:8.3}, {:8.3}) m, uncertain by {:.3} m, seen {} times",
            landmark.id,
            p.x,
            p.y,
            p.z,
            uncertainty_m(&landmark),
            landmark.observations
        );
    }
    Ok(())
}
