//! Pictures of boards agree with their truth, and equal specifications give equal bytes.

use wall_scenes::{BoardRenderer, BoardSetSpec, board_poses, write_board_set};

#[test]
fn squares_around_a_true_corner_are_dark_and_bright_in_turn() {
    let mut spec = BoardSetSpec::small(4, 3);
    spec.look.noise = 0.0;
    spec.look.clutter = false;
    let camera = spec.camera().unwrap();
    let renderer = BoardRenderer::new(camera);
    let poses = board_poses(&spec.board, &camera, spec.count, spec.seed);
    assert_eq!(poses.len(), 4);
    for (index, pose) in poses.iter().enumerate() {
        let picture = renderer.render(&spec.board, pose, &spec.look, spec.seed, index as u64);
        let (columns, rows) = (spec.board.columns, spec.board.rows);
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                // The middle of the square behind the corner: dark where column + row is even.
                let at = |c: usize, r: usize| picture.corners[r * columns + c];
                let (a, b) = (at(column, row), at(column + 1, row + 1));
                let (u, v) = (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]));
                let level = picture.image.pixels
                    [v.round() as usize * picture.image.width + u.round() as usize];
                let dark = (column + row) % 2 == 0;
                assert_eq!(level < 110, dark, "{index}: {column} {row} is {level}");
            }
        }
    }
}

#[test]
fn a_set_on_disk_is_the_same_whenever_it_is_written() {
    let folder = std::env::temp_dir().join(format!("board-set-{}", std::process::id()));
    let spec = BoardSetSpec::small(2, 5);
    let written = |name: &str| {
        let folder = folder.join(name);
        write_board_set(&spec, &folder).unwrap();
        [
            "images/board_00.png",
            "images/board_01.png",
            "corners.csv",
            "camera.toml",
        ]
        .map(|file| std::fs::read(folder.join(file)).unwrap())
    };
    let (one, two) = (written("one"), written("two"));
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(one, two);
    let lines = String::from_utf8_lossy(&one[2]).lines().count();
    assert_eq!(lines, 1 + 2 * 9 * 6);
}

#[test]
fn an_image_without_pixels_is_refused() {
    let spec = BoardSetSpec {
        image: (0, 0),
        ..BoardSetSpec::small(1, 1)
    };
    assert!(spec.camera().is_err());
}
