//! Drawings side by side.

use std::fmt::Write as _;

/// Width of a panel, pixels.
pub(super) const PANEL_WIDTH: f64 = 620.0;
/// Room between the panels, pixels.
const GAP: f64 = 16.0;

/// Drawings of one width side by side in two columns.
pub(super) fn grid(panels: &[String], title: &str) -> String {
    let sizes: Vec<f64> = panels.iter().map(|panel| height(panel)).collect();
    let row_height = sizes.iter().copied().fold(0.0, f64::max);
    let columns = panels.len().min(2);
    let rows = panels.len().div_ceil(2);
    let width = columns as f64 * (PANEL_WIDTH + GAP) - GAP;
    let total = rows as f64 * (row_height + GAP) - GAP;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{total:.0}\" viewBox=\"0 0 {width:.0} {total:.0}\" role=\"img\" aria-label=\"{title}\">\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    for (index, (panel, height)) in panels.iter().zip(sizes).enumerate() {
        let x = (index % 2) as f64 * (PANEL_WIDTH + GAP);
        let y = (index / 2) as f64 * (row_height + GAP);
        let place = format!(
            "<svg x=\"{x:.0}\" y=\"{y:.0}\" width=\"{PANEL_WIDTH:.0}\" height=\"{height:.0}\" "
        );
        let _ = writeln!(out, "{}", panel.replacen("<svg ", &place, 1));
    }
    out.push_str("</svg>\n");
    out
}

/// Height of a drawing from its view box.
fn height(svg: &str) -> f64 {
    svg.split_once("viewBox=\"")
        .and_then(|(_, rest)| rest.split_once('"'))
        .and_then(|(numbers, _)| numbers.split(' ').nth(3)?.parse().ok())
        .unwrap_or(PANEL_WIDTH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use slam_report::Plot;

    #[test]
    fn panels_stand_in_two_columns_at_their_own_height() {
        let panel = |h: f64| {
            let mut plot = Plot::new("t", "x", "y");
            plot.width = PANEL_WIDTH;
            plot.height = h;
            plot.to_svg_file()
        };
        let drawings = [panel(200.0), panel(300.0), panel(200.0)];
        assert_eq!(height(&drawings[1]), 300.0);
        let whole = grid(&drawings, "three");
        assert!(whole.contains("viewBox=\"0 0 1256 616\""), "{whole}");
        assert!(whole.contains("<svg x=\"636\" y=\"0\" width=\"620\" height=\"300\""));
        assert!(whole.contains("<svg x=\"0\" y=\"316\" width=\"620\" height=\"200\""));
        assert_eq!(
            whole.matches("<svg").count(),
            whole.matches("</svg>").count()
        );
    }
}
