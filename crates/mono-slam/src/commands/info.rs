//! `mono-slam info`: what lies in a sequence, and what a run of it still needs.

use std::path::{Path, PathBuf};

use mono_geometry::Distortion;
use slam_io::{CameraFile, Images, MountFile, Odometry, SequenceError, Survey};

use super::sequence_options::SequenceOptions;
use super::stand_in::StandIn;
use crate::failure::{Failure, print};

/// A step of this many usual steps is a gap of the images.
const IMAGE_GAP: f64 = 2.5;
/// The same of the odometry.
const ODOMETRY_GAP: f64 = 5.0;
/// A reference pose this near to a frame is that frame's, seconds.
const SAME_TIME_S: f64 = 0.01;

/// Arguments of `mono-slam info`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Sequence: a folder in the native layout, of EuRoC, TUM RGB-D or KITTI, or of images
    #[arg(value_name = "SEQ")]
    sequence: PathBuf,
    #[command(flatten)]
    options: SequenceOptions,
    #[command(flatten)]
    stand_in: StandIn,
}

/// Prints what was found; fails when a run is not possible.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let options = arguments.stand_in.options(arguments.options.open_options());
    let survey = Survey::of(&arguments.sequence, &options)?;
    let shown = arguments.sequence.display();
    let faults = survey.faults().len();
    print(&text(&survey))?;
    if faults == 0 {
        return print(&format!(
            "A run is possible: mono-slam run {shown} --out results\n"
        ));
    }
    let pieces = if faults == 1 { "piece" } else { "pieces" };
    Err(Failure::input(format!(
        "{shown}: a run still needs {faults} {pieces}, marked above with !"
    )))
}

/// The lines, one or a few for each piece.
fn text(survey: &Survey) -> String {
    let mut text = format!("{}: {} sequence\n", survey.root.display(), survey.format);
    let mut line = |mark: char, name: &str, words: &str| {
        text.push_str(&format!("{mark} {name:<10} {words}\n"));
    };
    match &survey.images {
        Ok(images) => line(' ', "images", &of_images(images)),
        Err(fault) => line('!', "images", &fault.to_string()),
    }
    match &survey.times_s {
        Ok(times_s) if times_s.is_empty() => {}
        Ok(times_s) => line(' ', "times", &of_steps(times_s, IMAGE_GAP, "gap")),
        Err(fault) => line('!', "times", &fault.to_string()),
    }
    match &survey.camera {
        Ok(camera) => {
            line(
                ' ',
                "camera",
                &format!("{}: {}", survey.camera_name, of_camera(camera)),
            );
            line(' ', "mount", &of_mount(&camera.mount));
        }
        Err(fault) => line('!', "camera", &fault.to_string()),
    }
    if let Err(fault) = &survey.sizes {
        line('!', "sizes", &fault.to_string());
    }
    match &survey.odometry {
        Ok(odometry) => line(' ', "odometry", &of_odometry(odometry)),
        Err(fault) => line('!', "odometry", &fault.to_string()),
    }
    line(
        if survey.reference.is_ok() { ' ' } else { '!' },
        "reference",
        &of_reference(survey),
    );
    for warning in &survey.warnings {
        line(' ', "warning", &warning.to_string());
    }
    text
}

fn of_images(images: &Images) -> String {
    let count = images.len();
    let kind = images
        .path(0)
        .and_then(Path::extension)
        .map_or_else(String::new, |ending| {
            format!(" .{}", ending.to_string_lossy().to_lowercase())
        });
    let size = images.size(0).map_or_else(
        |_| String::new(),
        |(width, height)| format!(" of {width}x{height}"),
    );
    let levels = images
        .levels()
        .map_or_else(String::new, |(low, high, top)| {
            let bits = if top > 255 { 16 } else { 8 };
            format!(", {bits} bit, levels {low} to {high} in use")
        });
    let word = if count == 1 { "image" } else { "images" };
    format!("{count}{kind} {word}{size}{levels}")
}

/// Rate, span and holes of times that increase.
fn of_steps(times_s: &[f64], gap_ratio: f64, gap_word: &str) -> String {
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else {
        return "none".into();
    };
    let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let Some(&usual) = steps.get(steps.len() / 2) else {
        return seconds(*first);
    };
    let gaps: Vec<&[f64]> = times_s
        .windows(2)
        .filter(|pair| pair[1] - pair[0] > gap_ratio * usual)
        .collect();
    let longest = gaps
        .iter()
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    let gaps = match longest {
        None => format!("no {gap_word}"),
        Some(longest) => format!(
            "{} {gap_word}{}, the longest of {:.2} s from {}",
            gaps.len(),
            if gaps.len() == 1 { "" } else { "s" },
            longest[1] - longest[0],
            seconds(longest[0])
        ),
    };
    format!(
        "{} to {} ({:.1} s), {} Hz, {gaps}",
        seconds(*first),
        seconds(*last),
        last - first,
        (100.0 / usual).round() / 100.0
    )
}

fn of_camera(camera: &CameraFile) -> String {
    let view = |side: u32, focal: f64| {
        let side = f64::from(side);
        let radians = match camera.distortion {
            Distortion::KannalaBrandt { .. } => side / focal,
            _ => 2.0 * (side / (2.0 * focal)).atan(),
        };
        radians.to_degrees()
    };
    let lens = match camera.distortion {
        Distortion::None => "no lens distortion",
        Distortion::Radtan { .. } => "radtan lens",
        Distortion::Rational { .. } => "rational lens",
        Distortion::KannalaBrandt { .. } => "kannala-brandt lens (fisheye)",
    };
    format!(
        "{}x{} pixels, view of {:.0} x {:.0} degrees, {lens}",
        camera.width,
        camera.height,
        view(camera.width, camera.fx),
        view(camera.height, camera.fy)
    )
}

/// Where the camera looks, in words and degrees, and where it sits.
fn of_mount(mount: &MountFile) -> String {
    let axis: [f64; 3] = std::array::from_fn(|row| mount.rotation_body_from_camera[row][2]);
    let down: [f64; 3] = std::array::from_fn(|row| mount.rotation_body_from_camera[row][1]);
    let yaw = axis[1].atan2(axis[0]).to_degrees();
    let pitch = axis[2].clamp(-1.0, 1.0).asin().to_degrees();
    let looks = if pitch > 60.0 {
        "looks up".to_owned()
    } else if pitch < -60.0 {
        "looks down".to_owned()
    } else {
        let side = match yaw.abs() {
            yaw if yaw < 45.0 => "forward",
            yaw if yaw > 135.0 => "backward",
            _ if yaw > 0.0 => "to the left",
            _ => "to the right",
        };
        let mut turns = Vec::new();
        if yaw.abs() >= 0.5 {
            let hand = if yaw > 0.0 { "left" } else { "right" };
            turns.push(format!("{:.0} degrees to the {hand}", yaw.abs()));
        }
        if pitch.abs() >= 0.5 {
            let way = if pitch > 0.0 { "up" } else { "down" };
            turns.push(format!("{:.0} degrees {way}", pitch.abs()));
        }
        if turns.is_empty() {
            format!("looks {side}")
        } else {
            format!("looks {side} ({})", turns.join(", "))
        }
    };
    let turned = match down[2] {
        z if z > 0.5 => ", upside down",
        z if z > -0.5 && pitch.abs() <= 60.0 => ", turned on its side",
        _ => "",
    };
    let [x, y, z] = mount.position_in_body;
    let place: Vec<String> = [
        (x, "forward", "backward"),
        (y, "left", "right"),
        (z, "up", "down"),
    ]
    .into_iter()
    .filter(|(value, _, _)| value.abs() >= 5e-4)
    .map(|(value, positive, negative)| {
        let way = if value > 0.0 { positive } else { negative };
        format!("{:.3} m {way}", value.abs())
    })
    .collect();
    if place.is_empty() {
        format!("{looks}{turned}, at the turning centre")
    } else {
        format!("{looks}{turned}, sits {}", place.join(", "))
    }
}

fn of_odometry(odometry: &Odometry) -> String {
    let rows = &odometry.rows;
    if rows.is_empty() {
        return odometry.source.to_string();
    }
    let times_s: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let most = |value: fn(&slam_io::OdometryRow) -> f64| {
        rows.iter().map(|row| value(row).abs()).fold(0.0, f64::max)
    };
    format!(
        "{}: {} rows, {}; at most {:.2} m/s and {:.2} rad/s",
        odometry.source,
        rows.len(),
        of_steps(&times_s, ODOMETRY_GAP, "hole"),
        most(|row| row.v_mps),
        most(|row| row.omega_radps)
    )
}

fn of_reference(survey: &Survey) -> String {
    let reference = match &survey.reference {
        Err(fault) => return fault.to_string(),
        Ok(None) => return "none, no error will be computed".into(),
        Ok(Some(reference)) => reference,
    };
    let (Some((first, _)), Some((last, _))) = (reference.first(), reference.last()) else {
        return "none".into();
    };
    let cover = survey.times_s.as_ref().map_or_else(
        |_: &SequenceError| String::new(),
        |times_s| {
            let near = |time_s: f64| {
                let next = reference.partition_point(|pose| pose.0 < time_s);
                [next.checked_sub(1), Some(next)]
                    .into_iter()
                    .flatten()
                    .filter_map(|index| reference.get(index))
                    .any(|pose| (pose.0 - time_s).abs() <= SAME_TIME_S)
            };
            let covered = times_s.iter().filter(|&&time_s| near(time_s)).count();
            format!(", at {covered} of {} images", times_s.len())
        },
    );
    format!(
        "{} poses, {} to {}{cover}",
        reference.len(),
        seconds(*first),
        seconds(*last)
    )
}

/// Seconds to the millisecond, without zeros at the end.
fn seconds(time_s: f64) -> String {
    let text = format!("{time_s:.3}");
    format!("{} s", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_told_with_rate_span_and_gaps() {
        assert_eq!(
            of_steps(&[0.0, 0.5, 1.0, 1.5], IMAGE_GAP, "gap"),
            "0 s to 1.5 s (1.5 s), 2 Hz, no gap"
        );
        assert_eq!(
            of_steps(&[0.0, 0.1, 0.2, 4.2, 4.3], IMAGE_GAP, "gap"),
            "0 s to 4.3 s (4.3 s), 10 Hz, 1 gap, the longest of 4.00 s from 0.2 s"
        );
        assert_eq!(of_steps(&[3.0], IMAGE_GAP, "gap"), "3 s");
    }

    #[test]
    fn mounts_are_told_in_words() {
        let told = |rows| {
            of_mount(&MountFile {
                position_in_body: [0.1, 0.0, 0.9],
                rotation_body_from_camera: rows,
            })
        };
        assert_eq!(
            of_mount(&MountFile::default()),
            "looks forward, at the turning centre"
        );
        let left = told([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]);
        assert!(
            left.ends_with(
                "looks to the left (90 degrees to the left), sits 0.100 m forward, 0.900 m up"
            ),
            "{left}"
        );
        let turned = told([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert!(turned.contains("upside down"), "{turned}");
        let down = told([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]);
        assert!(down.starts_with("looks down,"), "{down}");
    }
}
