//! Printed results of `mono-slam eval`: a page of figures for one estimate, a table for several, JSON for scripts.

use std::fmt::Write as _;

use serde_json::{Value, json};
use trajectory_eval::{AbsoluteError, Alignment, RelativeError, Statistics};

/// Widest name of a file in the table.
const WIDEST_NAME: usize = 36;

/// The comparison of one estimate.
pub(super) struct Compared {
    pub(super) file: String,
    /// Poses of the estimate and of the reference.
    pub(super) poses: [usize; 2],
    /// Whether both have rotations.
    pub(super) rotations: bool,
    pub(super) absolute: AbsoluteError,
    /// Left out where the matched part is too short, or rotations are missing.
    pub(super) relative: Option<RelativeError>,
}

/// One estimate as an object, several as a list of them.
pub(super) fn as_json(alignment: Alignment, compared: &[Compared]) -> String {
    let value = match compared {
        [one] => object(alignment, one),
        several => json!({
            "estimates": several.iter().map(|one| object(alignment, one)).collect::<Vec<_>>(),
        }),
    };
    format!("{value:#}\n")
}

fn object(alignment: Alignment, one: &Compared) -> Value {
    let absolute = &one.absolute;
    let rotation = |value: Value| if one.rotations { value } else { Value::Null };
    json!({
        "file": one.file,
        "alignment": alignment.to_string(),
        "heading_applied_rad": heading(one),
        "scale": absolute.applied.scale,
        "pairs": absolute.matched.len(),
        "poses": { "estimate": one.poses[0], "reference": one.poses[1] },
        "ate": {
            "translation_m": absolute.translation_m,
            "rotation_rad": rotation(json!(absolute.rotation_rad)),
            "final_translation_m": absolute.last().translation_m,
            "final_rotation_rad": rotation(json!(absolute.last().rotation_rad)),
        },
        "rpe": one.relative.as_ref().map(|relative| json!({
            "delta_frames": relative.delta,
            "steps": relative.steps,
            "translation_m": relative.translation_m,
            "rotation_rad": relative.rotation_rad,
        })),
    })
}

/// Turn about z that the alignment applied, radians.
fn heading(one: &Compared) -> f64 {
    let applied = &one.absolute.applied.reference_from_estimate;
    applied.rotation.euler_angles().2
}

/// The figures of one estimate.
pub(super) fn as_text(alignment: Alignment, one: &Compared) -> String {
    let (absolute, degrees) = (&one.absolute, 1.0_f64.to_degrees());
    let mut text = String::new();
    // Writing into a String cannot fail.
    let _ = writeln!(
        text,
        "{} matched poses of {} (reference {}), alignment {alignment}",
        absolute.matched.len(),
        one.poses[0],
        one.poses[1]
    );
    if alignment == Alignment::Heading {
        let _ = writeln!(
            text,
            "heading applied to the estimate {:.3} mrad",
            heading(one) * 1e3
        );
    }
    if matches!(alignment, Alignment::Sim2 | Alignment::Sim3) {
        let _ = writeln!(
            text,
            "scale applied to the estimate {:.6}",
            absolute.applied.scale
        );
    }
    let _ = writeln!(
        text,
        "\n{:<28}{:>12}{:>12}{:>12}{:>12}{:>12}",
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
    if one.rotations {
        row(
            &mut text,
            "ATE rotation (deg)",
            &absolute.rotation_rad,
            degrees,
            Some(last.rotation_rad),
        );
    }
    if let Some(relative) = &one.relative {
        let frames = if relative.delta == 1 {
            "1 frame".to_string()
        } else {
            format!("{} frames", relative.delta)
        };
        let named = |unit: &str| format!("RPE {frames} ({unit})");
        row(&mut text, &named("m"), &relative.translation_m, 1.0, None);
        row(
            &mut text,
            &named("deg"),
            &relative.rotation_rad,
            degrees,
            None,
        );
    }
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

/// One line an estimate.
pub(super) fn as_table(alignment: Alignment, compared: &[Compared]) -> String {
    let shown = |name: &str| -> String {
        let count = name.chars().count();
        if count <= WIDEST_NAME {
            return name.to_owned();
        }
        // The end of a path tells files apart.
        let tail: String = name.chars().skip(count - WIDEST_NAME + 1).collect();
        format!("…{tail}")
    };
    let width = compared
        .iter()
        .map(|one| shown(&one.file).chars().count())
        .max()
        .unwrap_or(0);
    let mut text = format!(
        "alignment {alignment}, position in m, rotation in deg\n\n{:<width$}{:>14}{:>11}{:>11}{:>11}{:>11}{:>11}{:>11}\n",
        "", "matched", "ATE rmse", "mean", "max", "final", "rot rmse", "RPE rmse"
    );
    for one in compared {
        let absolute = &one.absolute;
        let figures = &absolute.translation_m;
        let matched = format!("{} of {}", absolute.matched.len(), one.poses[0]);
        let _ = write!(text, "{:<width$}{matched:>14}", shown(&one.file));
        let numbers = [
            Some(figures.rmse),
            Some(figures.mean),
            Some(figures.max),
            Some(absolute.last().translation_m),
            one.rotations
                .then(|| absolute.rotation_rad.rmse.to_degrees()),
            one.relative.as_ref().map(|r| r.translation_m.rmse),
        ];
        for number in numbers {
            let _ = match number {
                Some(number) => write!(text, "{number:>11.5}"),
                None => write!(text, "{:>11}", "-"),
            };
        }
        text.push('\n');
    }
    text
}
