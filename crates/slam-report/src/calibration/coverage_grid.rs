//! Cells over the image that count corners, and drawings in the units of its pixels.

use camera_calibration::CalibrationRun;

/// Cells of the coverage and of the mean residuals, along the longer side.
const CELLS: usize = 12;

/// Cells of equal size over the image: (columns, rows, side in pixels).
pub(super) fn cells(run: &CalibrationRun) -> (usize, usize, f64) {
    let side = run.width.max(run.height) as f64 / CELLS as f64;
    let across = |pixels: usize| (pixels as f64 / side).ceil().max(1.0) as usize;
    (across(run.width), across(run.height), side)
}

pub(super) fn cell_of(run: &CalibrationRun, corner: [f64; 2]) -> usize {
    let (columns, rows, side) = cells(run);
    let index = |value: f64, most: usize| (((value + 0.5) / side).max(0.0) as usize).min(most - 1);
    index(corner[1], rows) * columns + index(corner[0], columns)
}

/// Share of the cells that hold a corner.
pub(super) fn coverage_share(run: &CalibrationRun) -> f64 {
    let counts = counts(run);
    counts.iter().filter(|&&count| count > 0).count() as f64 / counts.len() as f64
}

pub(super) fn counts(run: &CalibrationRun) -> Vec<usize> {
    let (columns, rows, _) = cells(run);
    let mut counts = vec![0; columns * rows];
    for (_, board) in run.used() {
        for &corner in &board.corners {
            counts[cell_of(run, corner)] += 1;
        }
    }
    counts
}

/// An element whose units are the image's pixels, around the body given.
pub(super) fn image_svg(run: &CalibrationRun, label: &str, body: &str) -> String {
    let (width, height) = (run.width as f64, run.height as f64);
    let margin = 0.006 * width;
    format!(
        "<svg class=\"field\" viewBox=\"{:.1} {:.1} {:.1} {:.1}\" role=\"img\" aria-label=\"{label}\" style=\"--px:{:.3}\">{body}\
         <rect class=\"frame\" x=\"-0.5\" y=\"-0.5\" width=\"{width}\" height=\"{height}\"/></svg>",
        -0.5 - margin,
        -0.5 - margin,
        width + 2.0 * margin,
        height + 2.0 * margin,
        width / 520.0
    )
}
