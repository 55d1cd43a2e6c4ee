//! A board, a camera, pictures of them.

use camera_calibration::{BoardSize, GreyView};
use mono_geometry::{Camera, Se3, so3};
use nalgebra::Vector3;
use std::sync::{Arc, OnceLock};
use wall_scenes::{Board, BoardRenderer, BoardSetSpec, GreyImage, Look, Picture, board_poses};

/// The board of most tests.
pub(crate) const BOARD: Board = Board {
    columns: 9,
    rows: 6,
    square_m: 0.04,
};

/// The size of a board as the detection asks for it.
pub(crate) fn size(board: &Board) -> BoardSize {
    BoardSize {
        columns: board.columns,
        rows: board.rows,
    }
}

/// A rendered image as the detection looks at it.
pub(crate) fn view(image: &GreyImage) -> GreyView<'_> {
    GreyView {
        width: image.width,
        height: image.height,
        pixels: &image.pixels,
    }
}

/// A camera of the given width with visible distortion.
pub(crate) fn camera(width: usize) -> Camera {
    let spec = BoardSetSpec {
        image: (width, width * 3 / 4),
        ..BoardSetSpec::small(1, 1)
    };
    spec.camera().unwrap()
}

/// The renderer of a width, made once for a width of 480.
pub(crate) fn renderer(width: usize) -> Arc<BoardRenderer> {
    static USUAL: OnceLock<Arc<BoardRenderer>> = OnceLock::new();
    let new = || Arc::new(BoardRenderer::new(camera(width)));
    if width == 480 {
        USUAL.get_or_init(new).clone()
    } else {
        new()
    }
}

/// Pictures at random poses.
pub(crate) fn pictures(
    board: &Board,
    width: usize,
    look: &Look,
    count: usize,
    seed: u64,
) -> Vec<Picture> {
    let camera = camera(width);
    let renderer = renderer(width);
    board_poses(board, &camera, count, seed)
        .iter()
        .enumerate()
        .map(|(k, pose)| renderer.render(board, pose, look, seed, k as u64))
        .collect()
}

/// A board whose centre is straight ahead at `depth`, turned about the vertical axis, then in the image.
pub(crate) fn ahead(board: &Board, depth: f64, tilt: f64, turn: f64) -> Se3 {
    let rotation =
        so3::exp(&Vector3::new(0.0, 0.0, turn)) * so3::exp(&Vector3::new(0.0, tilt, 0.0));
    let middle = Vector3::new(
        0.5 * board.square_m * (board.columns - 1) as f64,
        0.5 * board.square_m * (board.rows - 1) as f64,
        0.0,
    );
    Se3::new(rotation, Vector3::new(0.0, 0.0, depth) - rotation * middle)
}

/// Largest distance of found corners from the truth, pixels.
pub(crate) fn worst(found: &[[f64; 2]], truth: &[[f64; 2]]) -> f64 {
    assert_eq!(found.len(), truth.len());
    found
        .iter()
        .zip(truth)
        .map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]))
        .fold(0.0, f64::max)
}
