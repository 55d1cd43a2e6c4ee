//! A strip of frames with their keypoints drawn on them.

use std::borrow::Cow;
use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use slam_io::{DrawnKeypoint, FrameSnapshot, RunRecord};
use slam_pipeline::KeypointFate;

/// Pictures on the page.
const MOST_PICTURES: usize = 8;
/// Wider pictures are reduced by a whole factor.
const WIDEST_PIXELS: usize = 480;
/// Fates of a keypoint with their name on the page and the class that draws them, least important first.
const FATES: [(KeypointFate, &str, &str); 4] = [
    (KeypointFate::Unused, "unused", "grey"),
    (KeypointFate::New, "new landmark", "blue"),
    (KeypointFate::Matched, "matched", "green"),
    (KeypointFate::Outlier, "rejected", "red"),
];

/// The section; empty when the run kept no pictures.
pub(super) fn section(run: &RunRecord) -> String {
    let count = run.snapshots.len();
    let shown = count.min(MOST_PICTURES);
    let mut figures = String::new();
    for place in 0..shown {
        // Evenly spread, first and last included.
        let index = if shown > 1 {
            place * (count - 1) / (shown - 1)
        } else {
            0
        };
        if let Some(figure) = figure(run, &run.snapshots[index]) {
            figures.push_str(&figure);
        }
    }
    if figures.is_empty() {
        return String::new();
    }
    let mut keys = String::new();
    for (_, name, colour) in FATES.iter().rev() {
        let _ = write!(
            keys,
            "<span class=\"key\"><i class=\"ring\" style=\"--c:var(--bright-{colour})\"></i>{name}</span>"
        );
    }
    format!(
        "<section>\n<h2>What the camera saw</h2>\n<p class=\"intro keys\">{keys}<span class=\"key\">circles have the keypoint’s scale; \
         a tail leads to where the landmark was predicted</span></p>\n<div class=\"strip\">\n{figures}</div>\n</section>\n"
    )
}

fn figure(run: &RunRecord, snapshot: &FrameSnapshot) -> Option<String> {
    let uri = png_data_uri(&reduced(snapshot))?;
    let (width, height) = (snapshot.width, snapshot.height);
    let mut overlay = String::new();
    for (fate, _, colour) in FATES {
        let path: String = snapshot
            .keypoints
            .iter()
            .filter(|keypoint| keypoint.fate == fate)
            .map(mark)
            .collect();
        if !path.is_empty() {
            let _ = write!(overlay, "<path class=\"kp {colour}\" d=\"{path}\"/>");
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
    Some(format!(
        "<figure><svg viewBox=\"-0.5 -0.5 {width} {height}\" role=\"img\" aria-label=\"frame {}\" style=\"--px:{:.2}\">\
         <image href=\"{uri}\" x=\"-0.5\" y=\"-0.5\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\"/>{overlay}</svg>\
         <figcaption>{caption}</figcaption></figure>\n",
        snapshot.index,
        width as f64 / 320.0
    ))
}

/// A circle of the keypoint's scale and, when matched, a tail to the prediction.
fn mark(keypoint: &DrawnKeypoint) -> String {
    let DrawnKeypoint {
        x,
        y,
        sigma,
        predicted,
        ..
    } = *keypoint;
    if ![x, y, sigma]
        .iter()
        .all(|value| value.is_finite() && value.abs() < 1e5)
    {
        return String::new();
    }
    let radius = sigma.clamp(1.2, 20.0);
    let mut path = format!(
        "M{:.1} {y:.1}a{radius:.1} {radius:.1} 0 1 0 {d:.1} 0a{radius:.1} {radius:.1} 0 1 0 -{d:.1} 0",
        x - radius,
        d = 2.0 * radius
    );
    if let Some([u, v]) = predicted
        && u.is_finite()
        && v.is_finite()
    {
        let _ = write!(
            path,
            "M{x:.1} {y:.1}L{:.1} {:.1}",
            u.clamp(-1e4, 1e4),
            v.clamp(-1e4, 1e4)
        );
    }
    path
}

/// The picture at most [`WIDEST_PIXELS`] wide, by averaging blocks.
pub(super) fn reduced(snapshot: &FrameSnapshot) -> Cow<'_, FrameSnapshot> {
    let factor = snapshot.width.div_ceil(WIDEST_PIXELS);
    let fits = snapshot.width.checked_mul(snapshot.height) == Some(snapshot.pixels.len());
    if factor <= 1 || !fits || snapshot.height < factor {
        return Cow::Borrowed(snapshot);
    }
    let (width, height) = (snapshot.width / factor, snapshot.height / factor);
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        for column in 0..width {
            let mut sum = 0_u64;
            for y in row * factor..(row + 1) * factor {
                let start = y * snapshot.width + column * factor;
                sum += snapshot.pixels[start..start + factor]
                    .iter()
                    .map(|&value| u64::from(value))
                    .sum::<u64>();
            }
            // A mean of bytes is a byte.
            pixels.push((sum / (factor * factor) as u64) as u8);
        }
    }
    Cow::Owned(FrameSnapshot {
        index: snapshot.index,
        width,
        height,
        pixels,
        keypoints: Vec::new(),
    })
}

/// A snapshot as the address of an inline picture; `None` when its pixels do not fill its size.
pub(super) fn png_data_uri(snapshot: &FrameSnapshot) -> Option<String> {
    let png = snapshot.png().ok()?;
    Some(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_pictures_are_averaged() {
        let snapshot = FrameSnapshot {
            index: 0,
            width: 962,
            height: 7,
            pixels: (0..962 * 7).map(|k| ((k % 962) / 3 % 200) as u8).collect(),
            keypoints: Vec::new(),
        };
        let small = reduced(&snapshot);
        assert_eq!(
            (small.width, small.height, small.pixels.len()),
            (320, 2, 640)
        );
        assert_eq!(
            (small.pixels[0], small.pixels[5], small.pixels[325]),
            (0, 5, 5)
        );
        let narrow = FrameSnapshot {
            width: 7,
            height: 962,
            ..snapshot
        };
        assert!(matches!(reduced(&narrow), Cow::Borrowed(_)));
    }
}
