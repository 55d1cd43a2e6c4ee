//! Finds a checkerboard in images and prints its corners: `find_board 9x6 IMAGE...`.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use std::path::PathBuf;

use slam_pipeline::checkerboard::{BoardSize, find_board};
use slam_pipeline::sequence::read_grey;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let size = arguments.next().ok_or("usage: find_board 9x6 IMAGE...")?;
    let size: BoardSize = size.to_string_lossy().parse()?;
    for path in arguments.map(PathBuf::from) {
        match find_board(&read_grey(&path)?, size) {
            Ok(board) => {
                println!(
                    "{}: level {}, blur {:.2} px, corners good to {:.3} px",
                    path.display(),
                    board.level,
                    board.blur_px,
                    board.sigmas_px.iter().copied().fold(0.0, f64::max)
                );
                for [x, y] in board.corners {
                    println!("{x:.4} {y:.4}");
                }
            }
            Err(reason) => println!("{}: {reason}", path.display()),
        }
    }
    Ok(())
}
