//! The views that fit best and worst, with the corners that were found and the errors enlarged.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use camera_calibration::{CalibrationRun, FoundBoard};
use slam_io::GreyImage;

use crate::escape::escape;

/// Larger pictures are reduced.
const WIDEST_PIXELS: usize = 480;
/// Length of a usual error in the picture, as a share of its width.
const USUAL_ARROW: f64 = 0.012;

/// The section; empty when neither picture can be read again.
pub(super) fn section(run: &CalibrationRun, load: &dyn Fn(usize) -> Option<GreyImage>) -> String {
    let views = &run.calibration.views;
    let by_error = |a: &usize, b: &usize| views[*a].rms_px.total_cmp(&views[*b].rms_px);
    let worst = (0..views.len()).max_by(by_error);
    let best = (0..views.len()).min_by(by_error);
    let enlarged = enlargement(USUAL_ARROW * run.width as f64 / run.calibration.rms_px);
    let used: Vec<(usize, &FoundBoard)> = run.used().collect();
    let mut figures = String::new();
    for (title, view) in [("fits best", best), ("fits worst", worst)] {
        if let Some(figure) = view.and_then(|view| {
            let (image, board) = *used.get(view)?;
            figure(
                run,
                title,
                view,
                (&run.images[image].name, board),
                &load(image)?,
                enlarged,
            )
        }) {
            figures.push_str(&figure);
        }
    }
    if figures.is_empty() {
        return String::new();
    }
    format!(
        "<section>\n<h2>Two of the images</h2>\n<p class=\"intro keys\"><span class=\"key\"><i class=\"ring\" style=\"--c:#ffd24a\"></i>first corner</span>\
         <span class=\"key\"><i style=\"--c:var(--bright-blue)\"></i>rows</span><span class=\"key\"><i class=\"ring\" style=\"--c:var(--bright-green)\"></i>corner</span>\
         <span class=\"key\"><i style=\"--c:var(--bright-red)\"></i>error, {enlarged:.0} times enlarged</span></p>\n<div class=\"pictures\">\n{figures}</div>\n</section>\n"
    )
}

/// The largest of 1, 2, 5, 10, ... 5000 that is at most `wanted`.
fn enlargement(wanted: f64) -> f64 {
    let steps = (0..4).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10_f64.powi(power)));
    steps
        .take_while(|step| *step <= wanted)
        .last()
        .unwrap_or(1.0)
}

fn figure(
    run: &CalibrationRun,
    title: &str,
    view: usize,
    (name, board): (&str, &FoundBoard),
    grey: &GreyImage,
    enlarged: f64,
) -> Option<String> {
    let png = grey.reduced(WIDEST_PIXELS).png()?;
    let uri = format!("data:image/png;base64,{}", STANDARD.encode(png));
    let (width, height) = (grey.width, grey.height);
    let report = &run.calibration.views[view];
    let scale = width as f64 / 420.0;
    let radius = 2.6 * scale;
    let circle = |path: &mut String, [x, y]: [f64; 2], r: f64| {
        let _ = write!(
            path,
            "M{:.1} {y:.1}a{r:.1} {r:.1} 0 1 0 {d:.1} 0a{r:.1} {r:.1} 0 1 0 -{d:.1} 0",
            x - r,
            d = 2.0 * r
        );
    };
    let (mut rows, mut circles, mut arrows, mut first) =
        (String::new(), String::new(), String::new(), String::new());
    for (k, &corner) in board.corners.iter().enumerate() {
        let letter = if k % run.settings.board.columns == 0 {
            'M'
        } else {
            'L'
        };
        let _ = write!(rows, "{letter}{:.1} {:.1}", corner[0], corner[1]);
        circle(&mut circles, corner, radius);
        if let Some(residual) = report.residuals_px.get(k) {
            let _ = write!(
                arrows,
                "M{:.1} {:.1}l{:.1} {:.1}",
                corner[0],
                corner[1],
                enlarged * residual.x,
                enlarged * residual.y
            );
        }
    }
    circle(&mut first, *board.corners.first()?, 2.4 * radius);
    Some(format!(
        "<figure><svg viewBox=\"-0.5 -0.5 {width} {height}\" role=\"img\" aria-label=\"{name}\" style=\"--px:{scale:.2}\">\
         <image href=\"{uri}\" x=\"-0.5\" y=\"-0.5\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\"/>\
         <path class=\"kp row\" d=\"{rows}\"/><path class=\"kp green\" d=\"{circles}\"/><path class=\"kp arrow\" d=\"{arrows}\"/>\
         <path class=\"kp first\" d=\"{first}\"/></svg>\
         <figcaption><b>{name}</b> {title}: RMS {:.3} px</figcaption></figure>\n",
        report.rms_px,
        name = escape(name),
    ))
}
