//! Keypoints on a coarse grid, and the few bytes that the page keeps of them.
//!
//! A picture is a grid of [`COLUMNS`] square cells across; a keypoint becomes the cell it lies in, one of four sizes and,
//! when it was matched, the offset of its prediction as a signed square in either direction. The keypoints of one fate
//! are sorted by cell, row by row, so that the gap to the last one takes a byte or little more:
//!
//! | bytes | content, for each of [`FATES`] |
//! |---|---|
//! | 2 | number of keypoints, low byte first |
//! | one each, more where gaps are wide | gap to the cell before, a byte of 255 adds to the next one |
//! | a quarter each, whole bytes together | size, the first in the lowest two bits |
//! | one each, matched and rejected only | offset along x in the lower half, along y in the upper, each plus eight |

use slam_io::{DrawnKeypoint, FrameSnapshot};
use slam_pipeline::KeypointFate;

/// Fates of a keypoint with their name on the page and the class that draws them, least important first.
pub(crate) const FATES: [(KeypointFate, &str, &str); 4] = [
    (KeypointFate::Unused, "unused", "grey"),
    (KeypointFate::New, "new landmark", "blue"),
    (KeypointFate::Matched, "matched", "green"),
    (KeypointFate::Outlier, "rejected", "red"),
];
/// Cells across a picture.
pub(crate) const COLUMNS: usize = 256;
/// Cells down a picture at most.
const MOST_ROWS: usize = 2048;
/// Radii of the four sizes, cells.
pub(crate) const RADII: [f32; 4] = [1.2, 2.2, 4.0, 8.0];

/// A keypoint on the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Mark {
    /// Row.
    pub(crate) row: usize,
    /// Column.
    pub(crate) column: usize,
    /// Which of [`RADII`].
    pub(crate) size: usize,
    /// Signed roots of the offset to the prediction, cells.
    pub(crate) tail: Option<(i32, i32)>,
}

/// Cells down the picture of a snapshot.
pub(crate) fn rows(snapshot: &FrameSnapshot) -> usize {
    let rows = COLUMNS.saturating_mul(snapshot.height) / snapshot.width.max(1);
    rows.clamp(1, MOST_ROWS)
}

/// The keypoints of a snapshot on the grid: one list for each of [`FATES`], each sorted.
pub(crate) fn marks(snapshot: &FrameSnapshot) -> [Vec<Mark>; 4] {
    let per_pixel = COLUMNS as f32 / snapshot.width.max(1) as f32;
    let rows = rows(snapshot);
    FATES.map(|(fate, _, _)| {
        let mut marks: Vec<Mark> = snapshot
            .keypoints
            .iter()
            .filter(|keypoint| keypoint.fate == fate)
            .map(|keypoint| mark(keypoint, per_pixel, rows))
            .collect();
        marks.sort_unstable();
        marks
    })
}

fn mark(keypoint: &DrawnKeypoint, per_pixel: f32, rows: usize) -> Mark {
    // The centre of the first pixel is at zero. A cast of what is not finite gives zero.
    let cell = |value: f32, cells: usize| (((value + 0.5) * per_pixel) as usize).min(cells - 1);
    let radius = keypoint.sigma * per_pixel;
    let size = RADII
        .windows(2)
        .take_while(|pair| radius > (pair[0] * pair[1]).sqrt())
        .count();
    let root = |offset: f32| {
        let cells = offset * per_pixel;
        (cells.signum() * cells.abs().sqrt().round().min(7.0)) as i32
    };
    let matched = matches!(keypoint.fate, KeypointFate::Matched | KeypointFate::Outlier);
    let tail = keypoint.predicted.unwrap_or([keypoint.x, keypoint.y]);
    Mark {
        row: cell(keypoint.y, rows),
        column: cell(keypoint.x, COLUMNS),
        size,
        tail: matched.then(|| (root(tail[0] - keypoint.x), root(tail[1] - keypoint.y))),
    }
}

/// The bytes of the page.
pub(crate) fn encoded(marks: &[Vec<Mark>; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for group in marks {
        let count = group.len().min(usize::from(u16::MAX));
        let group = &group[..count];
        bytes.extend((count as u16).to_le_bytes());
        let mut before = 0;
        for mark in group {
            let cell = mark.row * COLUMNS + mark.column;
            let gap = cell - before;
            bytes.extend(std::iter::repeat_n(255, gap / 255));
            bytes.push((gap % 255) as u8);
            before = cell;
        }
        for four in group.chunks(4) {
            let packed = four
                .iter()
                .rev()
                .fold(0, |byte, m| byte << 2 | m.size as u8);
            bytes.push(packed);
        }
        bytes.extend(
            group
                .iter()
                .filter_map(|mark| mark.tail)
                .map(|(x, y)| ((x + 8) | (y + 8) << 4) as u8),
        );
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot() -> FrameSnapshot {
        let fates = FATES.map(|fate| fate.0);
        let keypoints = (0..997_usize)
            .map(|k| DrawnKeypoint {
                x: (k * 7919 % 6400) as f32 / 10.0,
                y: (k * 104_729 % 4800) as f32 / 10.0,
                sigma: 0.8 + (k % 13) as f32 * 3.0,
                fate: fates[k % 11 % 4],
                predicted: (k % 2 == 0).then_some([(k % 640) as f32, 3.0]),
            })
            .collect();
        FrameSnapshot {
            index: 0,
            width: 640,
            height: 480,
            jpeg: Vec::new(),
            keypoints,
        }
    }

    /// Reads what [`encoded`] wrote, as the script of the page does.
    fn decoded(bytes: &[u8]) -> [Vec<Mark>; 4] {
        let mut rest = bytes.iter().map(|&byte| usize::from(byte));
        let mut next = move || rest.next().unwrap();
        [false, false, true, true].map(|tails| {
            let count = next() + 256 * next();
            let mut cell = 0;
            let mut group: Vec<Mark> = (0..count)
                .map(|_| {
                    loop {
                        let gap = next();
                        cell += gap;
                        if gap < 255 {
                            break;
                        }
                    }
                    Mark {
                        row: cell / COLUMNS,
                        column: cell % COLUMNS,
                        size: 0,
                        tail: None,
                    }
                })
                .collect();
            for four in group.chunks_mut(4) {
                let byte = next();
                for (place, mark) in four.iter_mut().enumerate() {
                    mark.size = byte >> (2 * place) & 3;
                }
            }
            if tails {
                for mark in &mut group {
                    let byte = next() as i32;
                    mark.tail = Some(((byte & 15) - 8, (byte >> 4) - 8));
                }
            }
            group
        })
    }

    #[test]
    fn the_bytes_of_the_page_give_the_keypoints_back() {
        let snapshot = snapshot();
        let marks = marks(&snapshot);
        let bytes = encoded(&marks);
        assert_eq!(decoded(&bytes), marks);
        assert!(
            bytes.len() < 3 * snapshot.keypoints.len(),
            "{}",
            bytes.len()
        );
        let sizes: Vec<_> = marks.iter().map(Vec::len).collect();
        let counts: Vec<_> = FATES
            .map(|(fate, _, _)| snapshot.keypoints.iter().filter(|k| k.fate == fate).count())
            .to_vec();
        assert_eq!(sizes, counts);
        assert!((0..4).all(|size| marks.iter().flatten().any(|m| m.size == size)));
    }

    #[test]
    fn a_mark_lies_where_its_keypoint_is() {
        let snapshot = snapshot();
        let per_pixel = 256.0 / 640.0;
        for keypoint in &snapshot.keypoints {
            let mark = mark(keypoint, per_pixel, rows(&snapshot));
            let off = |cell: usize, pixel: f32| (cell as f32 + 0.5) / per_pixel - 0.5 - pixel;
            assert!(off(mark.column, keypoint.x).abs() <= 0.5 / per_pixel + 1e-3);
            assert!(off(mark.row, keypoint.y).abs() <= 0.5 / per_pixel + 1e-3);
            if let (Some((x, _)), Some(predicted)) = (mark.tail, keypoint.predicted) {
                let offset = (predicted[0] - keypoint.x) * per_pixel;
                assert!(x == 0 || x.signum() as f32 == offset.signum());
                assert!(x.abs() == 7 || ((x * x) as f32 - offset.abs()).abs() <= 7.0);
            }
        }
    }

    #[test]
    fn odd_pictures_have_marks_too() {
        let odd = FrameSnapshot {
            width: 0,
            height: usize::MAX,
            ..snapshot()
        };
        assert_eq!(decoded(&encoded(&marks(&odd))), marks(&odd));
    }
}
