//! `mono-slam eval`: absolute and relative trajectory error, as `evo` computes them.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::json;
use slam_io::read_tum;
use trajectory_eval::{
    AbsoluteError, Alignment, RelativeError, Statistics, absolute_error, relative_error,
};

use super::threshold::{check_ate, metres};
use crate::failure::{Failure, print};

/// Arguments of `mono-slam eval`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Estimated trajectory in TUM format
    #[arg(value_name = "ESTIMATE.tum")]
    estimate: PathBuf,
    /// Reference trajectory in TUM format
    #[arg(value_name = "REFERENCE.tum")]
    reference: PathBuf,
    /// Motion to remove from the estimate before errors are taken
    #[arg(long, value_enum, default_value_t = Align::None)]
    align: Align,
    /// Frames from one end of a relative step to the other
    #[arg(long, value_name = "FRAMES", default_value_t = 1)]
    delta: usize,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Exit with code 3 when the absolute error (RMSE of position) is larger
    #[arg(long, value_name = "METRES", value_parser = metres)]
    max_ate: Option<f64>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Align {
    /// Nothing
    None,
    /// One rotation about z through the start: the first heading of the reference is free
    Heading,
    /// Rotation about z and translation in the plane
    Se2,
    /// Rotation about z, translation in the plane and scale
    Sim2,
    /// Rotation and translation
    Se3,
    /// Rotation, translation and scale
    Sim3,
}

impl From<Align> for Alignment {
    fn from(align: Align) -> Self {
        match align {
            Align::None => Alignment::None,
            Align::Heading => Alignment::Heading,
            Align::Se2 => Alignment::Se2,
            Align::Sim2 => Alignment::Sim2,
            Align::Se3 => Alignment::Se3,
            Align::Sim3 => Alignment::Sim3,
        }
    }
}

/// Compares, prints, judges.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let estimate = read_tum(&arguments.estimate)?;
    let reference = read_tum(&arguments.reference)?;
    let alignment = Alignment::from(arguments.align);
    let absolute = absolute_error(&estimate, &reference, alignment)?;
    let relative = relative_error(&estimate, &reference, arguments.delta, alignment)?;
    print(&if arguments.json {
        as_json(alignment, &absolute, &relative)
    } else {
        as_text(alignment, &absolute, &relative)
    })?;
    check_ate(absolute.translation_m.rmse, arguments.max_ate)
}

fn as_json(alignment: Alignment, absolute: &AbsoluteError, relative: &RelativeError) -> String {
    let (_, _, turn) = absolute
        .applied
        .reference_from_estimate
        .rotation
        .euler_angles();
    let value = json!({
        "alignment": alignment.to_string(),
        "heading_applied_rad": turn,
        "scale": absolute.applied.scale,
        "pairs": absolute.matched.len(),
        "ate": {
            "translation_m": absolute.translation_m,
            "rotation_rad": absolute.rotation_rad,
            "final_translation_m": absolute.last().translation_m,
            "final_rotation_rad": absolute.last().rotation_rad,
        },
        "rpe": {
            "delta_frames": relative.delta,
            "steps": relative.steps,
            "translation_m": relative.translation_m,
            "rotation_rad": relative.rotation_rad,
        },
    });
    format!("{value:#}\n")
}

fn as_text(alignment: Alignment, absolute: &AbsoluteError, relative: &RelativeError) -> String {
    let mut text = String::new();
    // Writing into a String cannot fail.
    let _ = writeln!(
        text,
        "{} matched poses, alignment {alignment}",
        absolute.matched.len()
    );
    if alignment == Alignment::Heading {
        let (_, _, turn) = absolute
            .applied
            .reference_from_estimate
            .rotation
            .euler_angles();
        let _ = writeln!(
            text,
            "heading applied to the estimate {:.3} mrad",
            turn * 1e3
        );
    }
    if matches!(alignment, Alignment::Sim2 | Alignment::Sim3) {
        let _ = writeln!(
            text,
            "scale applied to the estimate {:.6}",
            absolute.applied.scale
        );
    }
    let _ = writeln!(text);
    let _ = writeln!(
        text,
        "{:<28}{:>12}{:>12}{:>12}{:>12}{:>12}",
        "", "rmse", "mean", "median", "max", "final"
    );
    let last = absolute.last();
    row(
        &mut text,
        "ATE position (m)",
        &absolute.translation_m,
        1.0,
        Some(last.translation_m),
    );
    let degrees = 1.0_f64.to_degrees();
    row(
        &mut text,
        "ATE rotation (deg)",
        &absolute.rotation_rad,
        degrees,
        Some(last.rotation_rad),
    );
    let frames = if relative.delta == 1 {
        "1 frame".to_string()
    } else {
        format!("{} frames", relative.delta)
    };
    row(
        &mut text,
        &format!("RPE {frames} (m)"),
        &relative.translation_m,
        1.0,
        None,
    );
    row(
        &mut text,
        &format!("RPE {frames} (deg)"),
        &relative.rotation_rad,
        degrees,
        None,
    );
    text
}

fn row(text: &mut String, name: &str, figures: &Statistics, unit: f64, last: Option<f64>) {
    let _ = write!(text, "{name:<28}");
    for value in [figures.rmse, figures.mean, figures.median, figures.max] {
        let _ = write!(text, "{:>12.6}", value * unit);
    }
    if let Some(last) = last {
        let _ = write!(text, "{:>12.6}", last * unit);
    }
    let _ = writeln!(text);
}
