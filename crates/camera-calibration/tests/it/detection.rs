//! Which boards are found, in which order, and why others are not.

use camera_calibration::{BoardSize, NotFound, find_board};
use wall_scenes::{Board, GreyImage, Look, Picture};

use crate::common::{BOARD, ahead, pictures, renderer, size, view, worst};

fn board(columns: usize, rows: usize) -> Board {
    Board {
        columns,
        rows,
        ..BOARD
    }
}

/// One picture straight ahead.
fn picture(board: &Board, width: usize, look: &Look, depth: f64, tilt: f64, turn: f64) -> Picture {
    renderer(width).render(board, &ahead(board, depth, tilt, turn), look, 3, 0)
}

#[test]
fn every_board_is_found_whatever_the_camera_does_to_it() {
    let plain = Look::default();
    let looks = [
        ("plain", plain),
        (
            "noisy",
            Look {
                noise: 8.0,
                ..plain
            },
        ),
        (
            "soft",
            Look {
                blur_px: 2.0,
                ..plain
            },
        ),
        (
            "uneven light",
            Look {
                vignetting: 0.7,
                slope: 0.5,
                ..plain
            },
        ),
        (
            "faint",
            Look {
                tones: (110.0, 150.0),
                ..plain
            },
        ),
        (
            "narrow margin",
            Look {
                margin: 0.15,
                ..plain
            },
        ),
    ];
    for (k, (name, look)) in looks.iter().enumerate() {
        for (index, picture) in pictures(&BOARD, 480, look, 6, 100 + k as u64)
            .iter()
            .enumerate()
        {
            let found = find_board(view(&picture.image), size(&BOARD))
                .unwrap_or_else(|reason| panic!("{name} {index}: {reason}"));
            let off = worst(&found.corners, &picture.corners);
            // Nine grey levels of noise on squares of nine pixels leave a third of a pixel at worst.
            assert!(off < 0.35, "{name} {index}: {off} px");
        }
    }
}

#[test]
fn large_and_blurred_images_are_searched_at_coarser_levels() {
    for (width, blur_px, depth) in [(1300, 1.0, 0.55), (640, 5.0, 0.4)] {
        let look = Look {
            blur_px,
            ..Look::default()
        };
        let picture = picture(&BOARD, width, &look, depth, 0.4, 0.2);
        let found = find_board(view(&picture.image), size(&BOARD)).unwrap();
        assert!(found.level > 0, "{width}: level {}", found.level);
        let off = worst(&found.corners, &picture.corners);
        assert!(off < 0.06 * blur_px, "{width}: {off} px");
        assert!(
            (found.blur_px / blur_px.hypot(0.29) - 1.0).abs() < 0.1,
            "{}",
            found.blur_px
        );
    }
}

#[test]
fn strong_tilt_and_any_turn_are_found() {
    for turn in [0.0, 0.8, 1.6, 2.4, 3.2, 4.0, 4.8, 5.6] {
        let picture = picture(&BOARD, 480, &Look::default(), 0.52, 1.1, turn);
        let found = find_board(view(&picture.image), size(&BOARD))
            .unwrap_or_else(|reason| panic!("turn {turn}: {reason}"));
        // 9 + 6 is odd: the colours name the first corner at any turn.
        assert!(
            worst(&found.corners, &picture.corners) < 0.15,
            "turn {turn}"
        );
    }
}

#[test]
fn numbering_is_unique_up_to_what_colours_leave_open() {
    for (columns, rows) in [(9, 6), (6, 9), (7, 5), (8, 6), (5, 5), (6, 6), (4, 3)] {
        let board = board(columns, rows);
        for turn in [0.1, 1.7, 3.0, 4.6] {
            let picture = picture(&board, 480, &Look::default(), 0.7, 0.3, turn);
            let found = find_board(view(&picture.image), size(&board)).unwrap();
            let count = size(&board).corners();
            let same = |order: &dyn Fn(usize) -> usize| {
                let turned: Vec<[f64; 2]> = (0..count).map(|k| picture.corners[order(k)]).collect();
                worst(&found.corners, &turned) < 0.3
            };
            let straight = same(&|k| k);
            let half = same(&|k| count - 1 - k);
            let quarter = |clockwise: bool| {
                columns == rows
                    && same(&|k| {
                        let (column, row) = (k % columns, k / columns);
                        if clockwise {
                            column * columns + columns - 1 - row
                        } else {
                            (columns - 1 - column) * columns + row
                        }
                    })
            };
            let (right, left) = (quarter(true), quarter(false));
            // Never mirrored: one of the turns it is.
            assert_eq!(
                [straight, half, right, left]
                    .iter()
                    .filter(|&&is| is)
                    .count(),
                1,
                "{columns}x{rows} at {turn}"
            );
            if (columns + rows) % 2 == 1 {
                assert!(
                    straight,
                    "{columns}x{rows} at {turn}: the dark square comes first"
                );
            }
            if columns == rows && columns % 2 == 1 {
                assert!(
                    straight || half,
                    "a quarter turn changes the colours of an odd square board"
                );
            }
            let again = find_board(view(&picture.image), size(&board)).unwrap();
            assert_eq!(found, again);
        }
    }
}

/// Sets a rectangle of pixels to one level.
fn cover(image: &mut GreyImage, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) {
    for y in rows {
        for x in columns.clone() {
            image.pixels[y * image.width + x] = 128;
        }
    }
}

#[test]
fn parts_of_boards_are_refused_with_the_reason() {
    let picture = picture(&BOARD, 480, &Look::default(), 0.55, 0.2, 0.1);
    let size = size(&BOARD);
    assert!(find_board(view(&picture.image), size).is_ok());

    // One corner covered: a disc of paper of less than a square.
    let [x, y] = picture.corners[22].map(|value| value as usize);
    let mut covered = picture.image.clone();
    cover(&mut covered, x - 9..x + 10, y - 9..y + 10);
    assert!(
        matches!(
            find_board(view(&covered), size),
            Err(NotFound::Incomplete { .. } | NotFound::Unmeasurable { corners: 1 })
        ),
        "{:?}",
        find_board(view(&covered), size)
    );

    // The right third outside the image.
    let cut = 2 * picture.image.width / 3;
    let mut cropped = GreyImage {
        width: cut,
        height: picture.image.height,
        pixels: Vec::new(),
    };
    for row in picture.image.pixels.chunks(picture.image.width) {
        cropped.pixels.extend_from_slice(&row[..cut]);
    }
    let reason = find_board(view(&cropped), size);
    assert!(
        matches!(reason, Err(NotFound::Incomplete { columns, rows, .. }) if columns < 9 && rows == 6),
        "{reason:?}"
    );

    // Another size asked for than is there.
    for (columns, rows) in [(8, 6), (9, 5), (5, 5)] {
        let smaller = BoardSize { columns, rows };
        assert_eq!(
            find_board(view(&picture.image), smaller),
            Err(NotFound::Larger {
                columns: 9,
                rows: 6
            }),
            "{smaller}"
        );
    }
    let larger = BoardSize {
        columns: 10,
        rows: 7,
    };
    let reason = find_board(view(&picture.image), larger);
    assert!(
        matches!(reason, Err(NotFound::Incomplete { found, .. }) if (54..70).contains(&found)),
        "{reason:?}"
    );
}

#[test]
fn two_boards_and_no_board_are_refused() {
    let size = size(&BOARD);
    let one = picture(
        &BOARD,
        480,
        &Look {
            clutter: false,
            ..Look::default()
        },
        0.95,
        0.2,
        0.1,
    );
    assert!(find_board(view(&one.image), size).is_ok());
    let mut two = GreyImage {
        width: 2 * one.image.width,
        height: one.image.height,
        pixels: Vec::new(),
    };
    for row in one.image.pixels.chunks(one.image.width) {
        two.pixels.extend_from_slice(row);
        two.pixels.extend_from_slice(row);
    }
    assert_eq!(
        find_board(view(&two), size),
        Err(NotFound::Several { boards: 2 })
    );

    // Clutter without a board: the board is behind the camera.
    let behind = ahead(&BOARD, -1.0, 0.0, 0.0);
    for index in 0..4 {
        let nothing = renderer(480).render(&BOARD, &behind, &Look::default(), 9, index);
        assert!(find_board(view(&nothing.image), size).is_err(), "{index}");
    }
}
