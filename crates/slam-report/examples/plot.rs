//! Writes a plot as an SVG file: `plot FILE.svg`.

use slam_report::{Colour, Layer, Plot};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("usage: plot FILE.svg")?;
    let time = |k: i32| 0.05 * f64::from(k);
    let mut plot = Plot::new("A damped oscillation", "time (s)", "position (m)");
    plot.layers.push(Layer::Band {
        label: "envelope".into(),
        colour: Colour::Blue,
        points: (0..200)
            .map(|k| (time(k), -(-0.3 * time(k)).exp(), (-0.3 * time(k)).exp()))
            .collect(),
    });
    plot.layers.push(Layer::line(
        "position",
        Colour::Orange,
        (0..200)
            .map(|k| (time(k), (-0.3 * time(k)).exp() * (3.0 * time(k)).cos()))
            .collect(),
    ));
    std::fs::write(path, plot.to_svg_file())?;
    Ok(())
}
