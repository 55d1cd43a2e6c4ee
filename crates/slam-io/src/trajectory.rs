//! Trajectories of other tools for comparison: TUM lines, and tables with a header, read by its names.
//!
//! | file | how it is read |
//! |---|---|
//! | `t x y z qx qy qz qw` a line, TUM | spaces or commas between |
//! | `t x y z` a line | positions alone |
//! | EuRoC `data.csv`, TUM-VI `mocap0/data.csv` | by the header: nanoseconds, qw first |
//! | any table with a header | columns by their names: t or timestamp, x, y, z, qx, qy, qz, qw, or a heading phi, theta, yaw |
//!
//! Lines with NaN, as references without a view of the markers have them, are left out; quaternions are normalised; a stamp
//! may repeat; stamps that are a date of this century in milli-, micro- or nanoseconds are taken for that. Each of it is said
//! in a note. Times that go back, and rows of another number of columns, are faults.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use trajectory_eval::StampedPose;

use crate::error::SequenceError;
use crate::text::{line_fault, quoted, read_text};

/// Deviation of a quaternion's norm that is worth a note.
const NOTED_NORM: f64 = 1e-3;
/// Norm below which a quaternion says nothing.
const NO_ROTATION: f64 = 1e-6;
/// Seconds since 1970 of a recording made by a digital camera: the years 2001 to 2096.
const DATES_S: std::ops::Range<f64> = 1e9..4e9;

/// A trajectory as it was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// The poses, times in seconds and never decreasing.
    pub poses: Vec<StampedPose>,
    /// Whether every pose has a rotation; without, those of [`Self::poses`] mean nothing.
    pub rotations: bool,
    /// One sentence for everything that was left out or assumed.
    pub notes: Vec<String>,
}

/// Reads a trajectory file.
///
/// # Errors
/// [`SequenceError`] for an unreadable file, a line that is no pose, times that go back, no pose at all, and for the
/// layouts that have no time (KITTI's twelve numbers).
pub fn read_trajectory(path: &Path) -> Result<Trajectory, SequenceError> {
    parse(path, &read_text(path)?)
}

/// Where the numbers of a pose stand in a line.
struct Columns {
    /// Values a line.
    count: usize,
    /// Whether a comment names them.
    remark: bool,
    time: usize,
    time_unit_s: f64,
    position: [Option<usize>; 3],
    rotation: Rotation,
}

enum Rotation {
    None,
    /// x, y, z, w.
    Quaternion([usize; 4]),
    /// About z, radians.
    Heading(usize),
}

fn parse(path: &Path, text: &str) -> Result<Trajectory, SequenceError> {
    let mut columns: Option<Columns> = None;
    let mut rows: Vec<(u64, Vec<f64>)> = Vec::new();
    let mut holes = 0_usize;
    for (content, line) in text.lines().zip(1_u64..) {
        let content = content.trim();
        if content.is_empty() {
            continue;
        }
        let bare = content.trim_start_matches('#').trim();
        if rows.is_empty() && holes == 0 && bare.chars().next().is_some_and(char::is_alphabetic) {
            // The last line of words before the numbers is the header, if it names a time and a place.
            if let Some(mut named) = header(bare) {
                named.remark = content.starts_with('#');
                columns = Some(named);
            } else if !content.starts_with('#') {
                return Err(line_fault(
                    path,
                    line,
                    "a pose, or a header with the columns t, x, y, z, qx, qy, qz, qw",
                    quoted(content),
                ));
            }
            continue;
        }
        if content.starts_with('#') {
            continue;
        }
        let cells = cells_of(content);
        // A comment that is no header of these numbers is a comment.
        let unlike = |layout: &Columns| layout.remark && layout.count != cells.len();
        if rows.is_empty() && holes == 0 && columns.as_ref().is_some_and(unlike) {
            columns = None;
        }
        let layout = match &columns {
            Some(layout) => layout,
            None => &*columns.insert(unnamed(path, line, content, cells.len())?),
        };
        if layout.count != cells.len() {
            return Err(line_fault(
                path,
                line,
                match layout.rotation {
                    Rotation::Quaternion([4, 5, 6, 7]) => {
                        "eight numbers (t x y z qx qy qz qw)".to_owned()
                    }
                    _ => format!("{} values as the lines before", layout.count),
                },
                format!("{} in {}", cells.len(), quoted(content)),
            ));
        }
        match numbers(path, line, layout, &cells)? {
            Some(row) => rows.push((line, row)),
            None => holes += 1,
        }
    }
    let Some(columns) = columns.filter(|_| !rows.is_empty()) else {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: "at least one line t x y z qx qy qz qw".into(),
            found: if holes > 0 {
                format!("{holes} lines of NaN")
            } else {
                "none".into()
            },
        });
    };
    assembled(path, &columns, rows, holes)
}

fn cells_of(content: &str) -> Vec<&str> {
    if content.contains([',', ';']) {
        let content = content.trim_end_matches([',', ';']);
        content.split([',', ';']).map(str::trim).collect()
    } else {
        content.split_whitespace().collect()
    }
}

/// The layout of lines without a header.
fn unnamed(path: &Path, line: u64, content: &str, count: usize) -> Result<Columns, SequenceError> {
    let rotation = match count {
        8 => Rotation::Quaternion([4, 5, 6, 7]),
        4 => Rotation::None,
        _ => {
            let hint = match count {
                12 => {
                    ": the pose of KITTI, which has no time; put the times of times.txt before t x y z and a quaternion"
                }
                17 => ": EuRoC's table, which is read with its header line",
                _ => "",
            };
            return Err(line_fault(
                path,
                line,
                "eight numbers (t x y z qx qy qz qw)",
                format!("{count} in {}{hint}", quoted(content)),
            ));
        }
    };
    Ok(Columns {
        count,
        remark: false,
        time: 0,
        time_unit_s: 1.0,
        position: [Some(1), Some(2), Some(3)],
        rotation,
    })
}

/// The layout that a header names; `None` where it is no header of a trajectory.
fn header(text: &str) -> Option<Columns> {
    // Units in brackets are parted from the names by spaces, which part the columns of files without commas.
    let names: Vec<String> = cells_of(text)
        .iter()
        .filter(|name| !name.starts_with(['[', '(']))
        .map(|name| name.to_lowercase())
        .collect();
    let plain: Vec<&str> = names
        .iter()
        .map(|name| {
            name.split(['[', '('])
                .next()
                .unwrap_or("")
                .trim()
                .trim_matches('"')
        })
        .collect();
    let find = |wanted: &[&str]| {
        wanted
            .iter()
            .find_map(|wanted| plain.iter().position(|name| name == wanted))
    };
    let time = find(&[
        "t",
        "time",
        "timestamp",
        "t_s",
        "time_s",
        "stamp",
        "timestamp_s",
        "t_ns",
        "timestamp_ns",
        "#timestamp",
    ])?;
    let axis = |axis: &str| {
        find(&[
            axis,
            &format!("{axis}_m"),
            &format!("p{axis}"),
            &format!("t{axis}"),
            &format!("p_{axis}"),
            &format!("t_{axis}"),
            &format!("pos_{axis}"),
            &format!("position_{axis}"),
            &format!("p_rs_r_{axis}"),
            &format!("pose.position.{axis}"),
            &format!("position.{axis}"),
        ])
    };
    let turn = |axis: &str| {
        find(&[
            &format!("q{axis}"),
            &format!("q_{axis}"),
            &format!("quat_{axis}"),
            &format!("q_rs_{axis}"),
            &format!("orientation_{axis}"),
            &format!("pose.orientation.{axis}"),
            &format!("orientation.{axis}"),
            &format!("rot_{axis}"),
        ])
    };
    let position = [axis("x"), axis("y"), axis("z")];
    position[0].and(position[1])?;
    let rotation = match (turn("x"), turn("y"), turn("z"), turn("w")) {
        (Some(x), Some(y), Some(z), Some(w)) => Rotation::Quaternion([x, y, z, w]),
        _ => match find(&[
            "phi",
            "phi_rad",
            "theta",
            "theta_rad",
            "yaw",
            "yaw_rad",
            "heading",
            "heading_rad",
        ]) {
            Some(heading) => Rotation::Heading(heading),
            None => Rotation::None,
        },
    };
    let unit = &names[time];
    let time_unit_s = if unit.contains("ns") || unit.contains("nano") {
        1e-9
    } else if unit.contains("us]") || unit.contains("micro") {
        1e-6
    } else if unit.contains("ms]") || unit.contains("milli") {
        1e-3
    } else {
        1.0
    };
    Some(Columns {
        count: names.len(),
        remark: false,
        time,
        time_unit_s,
        position,
        rotation,
    })
}

/// t, x, y, z, and what turns, of one line; `None` for a line with NaN.
fn numbers(
    path: &Path,
    line: u64,
    columns: &Columns,
    cells: &[&str],
) -> Result<Option<Vec<f64>>, SequenceError> {
    let value = |name: &str, index: usize| -> Result<f64, SequenceError> {
        let cell = cells.get(index).copied().unwrap_or("");
        match cell.parse::<f64>() {
            Ok(value) if !value.is_infinite() => Ok(value),
            _ => Err(line_fault(
                path,
                line,
                format!("a finite number for {name}"),
                quoted(cell),
            )),
        }
    };
    let mut row = vec![value("time", columns.time)?];
    for (name, index) in ["x", "y", "z"].into_iter().zip(columns.position) {
        row.push(match index {
            Some(index) => value(name, index)?,
            None => 0.0,
        });
    }
    match columns.rotation {
        Rotation::None => {}
        Rotation::Heading(index) => row.push(value("heading", index)?),
        Rotation::Quaternion(indices) => {
            for (name, index) in ["qx", "qy", "qz", "qw"].into_iter().zip(indices) {
                row.push(value(name, index)?);
            }
        }
    }
    Ok(row.iter().all(|value| value.is_finite()).then_some(row))
}

/// The unit that makes every time a date between 2001 and 2096, if it is not the second.
fn unit_of_a_date(rows: &[(u64, Vec<f64>)]) -> Option<(&'static str, f64)> {
    [
        ("milliseconds", 1e-3),
        ("microseconds", 1e-6),
        ("nanoseconds", 1e-9),
    ]
    .into_iter()
    .find(|(_, unit_s)| {
        rows.iter()
            .all(|(_, row)| DATES_S.contains(&(row[0] * unit_s)))
    })
}

fn assembled(
    path: &Path,
    columns: &Columns,
    rows: Vec<(u64, Vec<f64>)>,
    holes: usize,
) -> Result<Trajectory, SequenceError> {
    let mut notes = Vec::new();
    if holes > 0 {
        notes.push(format!("{holes} lines with NaN are left out"));
    }
    let mut unit_s = columns.time_unit_s;
    if unit_s == 1.0
        && let Some((name, found_s)) = unit_of_a_date(&rows)
    {
        notes.push(format!("times of {:e} are taken for {name}", rows[0].1[0]));
        unit_s = found_s;
    }
    let mut poses: Vec<StampedPose> = Vec::with_capacity(rows.len());
    let (mut repeated, mut turnless) = (0_usize, 0_usize);
    let mut unmoored = [f64::INFINITY, f64::NEG_INFINITY];
    for (line, row) in rows {
        let t_s = row[0] * unit_s;
        if let Some(before) = poses.last().map(|pose| pose.t_s) {
            if t_s < before {
                return Err(line_fault(
                    path,
                    line,
                    format!("a time of {before} s or later"),
                    format!("{t_s} s"),
                ));
            }
            repeated += usize::from(t_s == before);
        }
        let rotation = match row[4..] {
            [x, y, z, w] => {
                let quaternion = Quaternion::new(w, x, y, z);
                let norm = quaternion.norm();
                if norm < NO_ROTATION {
                    turnless += 1;
                    UnitQuaternion::identity()
                } else {
                    unmoored = [unmoored[0].min(norm), unmoored[1].max(norm)];
                    UnitQuaternion::from_quaternion(quaternion)
                }
            }
            [heading] => UnitQuaternion::from_euler_angles(0.0, 0.0, heading),
            _ => UnitQuaternion::identity(),
        };
        poses.push(StampedPose {
            t_s,
            world_from_frame: Isometry3::from_parts(
                Translation3::new(row[1], row[2], row[3]),
                rotation,
            ),
        });
    }
    if repeated > 0 {
        notes.push(format!(
            "{repeated} poses repeat the time before them; the first of each time is compared"
        ));
    }
    if (1.0 - unmoored[0]).max(unmoored[1] - 1.0) > NOTED_NORM {
        notes.push(format!(
            "quaternions of length {:.4} to {:.4} are normalised",
            unmoored[0], unmoored[1]
        ));
    }
    let rotations = turnless == 0 && !matches!(columns.rotation, Rotation::None);
    if turnless > 0 {
        notes.push(format!(
            "{turnless} poses have a quaternion of zeros: positions are compared, rotations are not"
        ));
    } else if !rotations {
        notes.push("there are positions only: rotations are not compared".to_owned());
    }
    Ok(Trajectory {
        poses,
        rotations,
        notes,
    })
}
