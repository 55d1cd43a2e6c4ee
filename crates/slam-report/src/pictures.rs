//! A strip of frames with their keypoints drawn on them, for readers without scripts and for paper.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use slam_io::{FrameSnapshot, RunRecord};

use crate::keypoint_marks::{COLUMNS, FATES, Mark, RADII, marks, rows};

/// Pictures on the page.
const MOST_PICTURES: usize = 8;

/// The section; empty when the run kept no pictures.
pub(super) fn section(run: &RunRecord) -> String {
    let kept: Vec<&FrameSnapshot> = run
        .snapshots
        .iter()
        .filter(|snapshot| !snapshot.jpeg.is_empty() && snapshot.width > 0)
        .collect();
    let shown = kept.len().min(MOST_PICTURES);
    let mut figures = String::new();
    for place in 0..shown {
        // Evenly spread, first and last included.
        let index = if shown > 1 {
            place * (kept.len() - 1) / (shown - 1)
        } else {
            0
        };
        figures.push_str(&figure(run, kept[index]));
    }
    if figures.is_empty() {
        return String::new();
    }
    format!(
        "<section>\n<h2>What the camera saw</h2>\n<p class=\"intro keys\">{}</p>\n{}<div class=\"strip\">\n{figures}</div>\n</section>\n",
        keys(),
        rings()
    )
}

/// The legend of the keypoints.
pub(super) fn keys() -> String {
    let mut keys = String::new();
    for (_, name, colour) in FATES.iter().rev() {
        let _ = write!(
            keys,
            "<span class=\"key\"><i class=\"ring\" style=\"--c:var(--bright-{colour})\"></i>{name}</span>"
        );
    }
    keys.push_str(
        "<span class=\"key\">circles have the keypoint’s scale; a tail leads to where the landmark was predicted</span>",
    );
    keys
}

/// The circles that the corners of the pictures' lines carry: one for each fate and size.
fn rings() -> String {
    let mut rings = String::from("<svg width=\"0\" height=\"0\" class=\"rings\"><defs>");
    for (_, _, colour) in FATES {
        for (size, radius) in RADII.iter().enumerate() {
            let _ = write!(
                rings,
                "<marker id=\"ring-{colour}-{size}\" viewBox=\"-9 -9 18 18\" markerWidth=\"18\" markerHeight=\"18\" \
                 markerUnits=\"userSpaceOnUse\"><circle class=\"kp {colour}\" r=\"{radius}\"/></marker>"
            );
        }
    }
    rings.push_str("</defs></svg>\n");
    rings
}

fn figure(run: &RunRecord, snapshot: &FrameSnapshot) -> String {
    let uri = format!("data:image/jpeg;base64,{}", STANDARD.encode(&snapshot.jpeg));
    let (width, height) = (COLUMNS, rows(snapshot));
    let mut overlay = String::new();
    for ((_, _, colour), group) in FATES.iter().zip(marks(snapshot)) {
        let tails: String = group.iter().filter_map(tail).collect();
        if !tails.is_empty() {
            let _ = write!(overlay, "<path class=\"kp {colour}\" d=\"{tails}\"/>");
        }
        for size in 0..RADII.len() {
            let corners: String = group
                .iter()
                .filter(|mark| mark.size == size)
                .map(|mark| format!(" {} {}", mark.column, mark.row))
                .collect();
            if !corners.is_empty() {
                let ring = format!("url(#ring-{colour}-{size})");
                let _ = write!(
                    overlay,
                    "<path fill=\"none\" style=\"marker:{ring}\" d=\"M{}\"/>",
                    corners.trim_start()
                );
            }
        }
    }
    let caption = run
        .frames
        .iter()
        .find(|frame| frame.index == snapshot.index)
        .map_or_else(
            || format!("frame {}", snapshot.index),
            |frame| {
                format!(
                    "<b>frame {}</b> {:.2} s · {} matched · {} new · {} rejected",
                    frame.index,
                    frame.time_s,
                    frame.report.matches,
                    frame.report.new_landmarks,
                    frame.report.outliers
                )
            },
        );
    format!(
        "<figure><svg viewBox=\"-0.5 -0.5 {width} {height}\" role=\"img\" aria-label=\"frame {}\" style=\"--px:.8\">\
         <image href=\"{uri}\" x=\"-0.5\" y=\"-0.5\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\"/>{overlay}</svg>\
         <figcaption>{caption}</figcaption></figure>\n",
        snapshot.index,
    )
}

/// The line from a keypoint to its prediction, where they are apart.
fn tail(mark: &Mark) -> Option<String> {
    let (x, y) = mark.tail.filter(|tail| *tail != (0, 0))?;
    Some(format!(
        "M{} {}l{} {}",
        mark.column,
        mark.row,
        x * x.abs(),
        y * y.abs()
    ))
}
