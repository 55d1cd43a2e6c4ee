//! Finds a checkerboard in images and prints its corners: `find_board 9x6 IMAGE...`.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use std::path::PathBuf;

use camera_calibration::{BoardSize, GreyView, find_board};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let size = arguments.next().ok_or("usage: find_board 9x6 IMAGE...")?;
    let size: BoardSize = size.to_string_lossy().parse()?;
    for path in arguments.map(PathBuf::from) {
        let grey = image::open(&path)?.into_luma8();
        let view = GreyView {
            width: grey.width() as usize,
            height: grey.height() as usize,
            pixels: grey.as_raw(),
        };
        match find_board(view, size) {
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
