//! Key figures, doubts, parameters and the list of images.

use std::fmt::Write as _;

use camera_calibration::{CalibrationRun, Outcome, significant};

use super::coverage_grid::coverage_share;
use crate::escape::escape;
use crate::units::length;

/// One sentence under the title.
pub(super) fn lead(run: &CalibrationRun) -> String {
    let used = run.calibration.views.len();
    format!(
        "<b>{used} of {}</b> images of {}×{} pixels; checkerboard of {} inner corners, squares of {}; lens model <b>{}</b>.",
        run.images.len(),
        run.width,
        run.height,
        run.settings.board.to_string().replace('x', "×"),
        length(run.settings.square_m),
        lens_name(run)
    )
}

fn lens_name(run: &CalibrationRun) -> &'static str {
    use mono_geometry::Distortion;
    match run.calibration.camera.distortion() {
        Distortion::None => "pinhole",
        Distortion::Radtan { .. } => "radtan",
        Distortion::Rational { .. } => "rational",
        Distortion::KannalaBrandt { .. } => "kannala-brandt",
    }
}

/// The key figures in cards.
pub(super) fn cards(run: &CalibrationRun) -> String {
    let calibration = &run.calibration;
    let estimate = |name: &str| calibration.parameter(name).map(|p| (p.value, p.sigma));
    let mut cards: Vec<(&str, String, String)> = vec![(
        "Reprojection error",
        format!("{:.3} px", calibration.rms_px),
        format!("RMS; mean {:.3} px", calibration.mean_error_px),
    )];
    if let (Some(fx), Some(fy)) = (estimate("fx"), estimate("fy")) {
        let (value, sigma) = with_sigma(fx.0, fx.1);
        let (other, _) = with_sigma(fy.0, fy.1);
        cards.push((
            "Focal length",
            format!("{:.1} px", fx.0),
            format!("{value} ± {sigma}, down the columns {other}"),
        ));
    }
    if let (Some(cx), Some(cy)) = (estimate("cx"), estimate("cy")) {
        let short = |value: f64| format!("{value:.0}");
        cards.push(("Centre", format!("{}, {}", short(cx.0), short(cy.0)), {
            let ((x, x_sigma), (y, y_sigma)) = (with_sigma(cx.0, cx.1), with_sigma(cy.0, cy.1));
            format!("{x} ± {x_sigma}, {y} ± {y_sigma} px")
        }));
    }
    let field = 2.0 * calibration.max_corner_radius.atan().to_degrees();
    cards.push((
        "Field covered",
        format!("{field:.0}°"),
        format!(
            "by corners; {:.0} % of the image",
            100.0 * coverage_share(run)
        ),
    ));
    let corners: usize = calibration.views.iter().map(|v| v.residuals_px.len()).sum();
    cards.push((
        "Boards",
        calibration.views.len().to_string(),
        format!("{corners} corners"),
    ));
    let doubts = calibration.warnings.len();
    cards.push((
        "Doubts",
        doubts.to_string(),
        if doubts == 0 {
            "the images fix every parameter".into()
        } else {
            "<em>see below</em>".into()
        },
    ));
    let mut html = String::from("<div class=\"cards\">\n");
    for (name, value, note) in cards {
        let _ = writeln!(
            html,
            "<div><span>{name}</span><strong>{value}</strong><small>{note}</small></div>"
        );
    }
    html.push_str("</div>\n");
    html
}

/// The warnings of the calibration; empty without any.
pub(super) fn doubts(run: &CalibrationRun) -> String {
    if run.calibration.warnings.is_empty() {
        return String::new();
    }
    let mut html = String::from("<ul class=\"card doubts\">\n");
    for text in run.warnings() {
        let mut letters = text.chars();
        let first: String = letters
            .next()
            .map_or_else(String::new, |letter| letter.to_uppercase().collect());
        // Names of parameters and files keep their case.
        let sentence = if text.starts_with("the ") || text.starts_with("no ") {
            format!("{first}{}", letters.as_str())
        } else {
            text.clone()
        };
        let end = if sentence.ends_with('?') { "" } else { "." };
        let _ = writeln!(html, "<li>{}{end}</li>", escape(&sentence));
    }
    html.push_str("</ul>\n");
    html
}

/// Every parameter with its standard deviation, and the strongest correlations.
pub(super) fn parameters(run: &CalibrationRun) -> String {
    let calibration = &run.calibration;
    let mut html = String::from(
        "<section>\n<h2>Parameters</h2>\n<div class=\"grid\">\n<div class=\"card\"><h3>Estimates</h3><div class=\"scroll\"><table class=\"values\">\n\
         <thead><tr><th>parameter</th><th>value</th><th>standard deviation</th><th>unit</th></tr></thead>\n<tbody>\n",
    );
    for (index, parameter) in calibration.parameters.iter().enumerate() {
        let (value, sigma) = with_sigma(parameter.value, parameter.sigma);
        let unit = if index < 4 { "px" } else { "" };
        let _ = writeln!(
            html,
            "<tr><th>{}</th><td>{value}</td><td>± {sigma}</td><td>{unit}</td></tr>",
            parameter.name
        );
    }
    html.push_str(
        "</tbody></table></div><p class=\"note\">Standard deviations follow from the residuals and hold when these are independent.</p></div>\n",
    );
    html.push_str(&correlations(run));
    html.push_str("</div>\n</section>\n");
    html
}

/// The correlation matrix as shaded squares.
fn correlations(run: &CalibrationRun) -> String {
    let calibration = &run.calibration;
    let count = calibration.parameters.len();
    let (cell, label) = (30.0, 34.0);
    let side = label + cell * count as f64;
    let mut svg = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {side:.0} {side:.0}\" role=\"img\" aria-label=\"Correlation of the parameters\" \
         font-family=\"system-ui,sans-serif\" font-size=\"11\" style=\"max-width:{:.0}px\">",
        1.35 * side
    );
    for (row, parameter) in calibration.parameters.iter().enumerate() {
        let middle = label + cell * (row as f64 + 0.5);
        let _ = write!(
            svg,
            "<text x=\"{:.0}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"var(--soft)\">{name}</text>\
             <text x=\"{middle:.1}\" y=\"{:.0}\" text-anchor=\"middle\" fill=\"var(--soft)\">{name}</text>",
            label - 6.0,
            middle + 4.0,
            label - 8.0,
            name = parameter.name
        );
        for column in 0..count {
            let value = calibration.correlation[(row, column)];
            let colour = if value < 0.0 { "orange" } else { "blue" };
            let strength = if value.is_finite() {
                value.abs().min(1.0)
            } else {
                0.0
            };
            let _ = write!(
                svg,
                "<g><title>{} and {}: {value:.3}</title><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{w:.1}\" height=\"{w:.1}\" rx=\"4\" \
                 fill=\"var(--{colour})\" fill-opacity=\"{:.3}\"/>",
                parameter.name,
                calibration.parameters[column].name,
                label + cell * column as f64 + 1.0,
                label + cell * row as f64 + 1.0,
                0.06 + 0.84 * strength,
                w = cell - 2.0
            );
            if row != column && strength >= 0.3 {
                let _ = write!(
                    svg,
                    "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"9.5\" fill=\"{}\">{}</text>",
                    label + cell * (column as f64 + 0.5),
                    middle + 3.5,
                    if strength > 0.6 {
                        "var(--card)"
                    } else {
                        "var(--ink)"
                    },
                    format!("{value:.2}")
                        .replace("0.", ".")
                        .replace('-', "\u{2212}")
                );
            }
            svg.push_str("</g>");
        }
    }
    svg.push_str("</svg>");
    format!(
        "<figure class=\"card\"><figcaption><h3>Correlation</h3><p class=\"keys\"><span class=\"key\"><i class=\"area\" style=\"--c:var(--blue)\"></i>rise together</span>\
         <span class=\"key\"><i class=\"area\" style=\"--c:var(--orange)\"></i>one rises, one falls</span></p></figcaption>{svg}\
         <p class=\"note\">Two parameters near ±1 are known only together.</p></figure>\n"
    )
}

/// Every image and its outcome.
pub(super) fn images(run: &CalibrationRun) -> String {
    let mut html = String::from(
        "<section>\n<h2>Images</h2>\n<div class=\"card\"><div class=\"scroll\"><table>\n<thead><tr><th>image</th><th>RMS px</th><th>largest px</th>\
         <th>distance</th><th>tilt</th><th>blur px</th></tr></thead>\n<tbody>\n",
    );
    for image in &run.images {
        let name = escape(&image.name);
        match (&image.outcome, &image.board) {
            (Outcome::Used(view), Some(board)) => {
                let report = &run.calibration.views[*view];
                let largest = report
                    .residuals_px
                    .iter()
                    .map(|r| r.norm())
                    .fold(0.0, f64::max);
                let pose = &report.camera_from_board;
                let tilt = pose.rotation.matrix()[(2, 2)].clamp(-1.0, 1.0).acos();
                let _ = writeln!(
                    html,
                    "<tr><th>{name}</th><td>{:.3}</td><td>{largest:.2}</td><td>{}</td><td>{:.0}°</td><td>{}</td></tr>",
                    report.rms_px,
                    length(pose.translation.norm()),
                    tilt.to_degrees(),
                    significant(board.blur_px)
                        .chars()
                        .take(4)
                        .collect::<String>()
                );
            }
            _ => {
                let why = image.reason().unwrap_or_default();
                let _ = writeln!(
                    html,
                    "<tr class=\"out\"><th>{name}</th><td class=\"why\" colspan=\"5\">not used: {}</td></tr>",
                    escape(&why)
                );
            }
        }
    }
    html.push_str("</tbody></table></div></div>\n</section>\n");
    html
}

/// A value to the second digit of its standard deviation, and that deviation.
fn with_sigma(value: f64, sigma: f64) -> (String, String) {
    if !(sigma.is_finite() && sigma > 0.0) {
        return (significant(value), "not fixed".into());
    }
    let decimals = (1.0 - sigma.log10().floor()).clamp(0.0, 9.0) as usize;
    (
        format!("{value:.decimals$}").replace('-', "\u{2212}"),
        format!("{sigma:.decimals$}"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_the_digits_that_are_known() {
        let (value, sigma) = with_sigma(420.506_712, 0.1234);
        assert_eq!((value.as_str(), sigma.as_str()), ("420.51", "0.12"));
        let (value, sigma) = with_sigma(-0.296_681, 0.000_456);
        assert_eq!(
            (value.as_str(), sigma.as_str()),
            ("\u{2212}0.29668", "0.00046")
        );
        assert_eq!(with_sigma(1.0, f64::INFINITY).1, "not fixed");
    }
}
