//! COLMAP's cameras, `cameras.txt` and `cameras.bin`.
//!
//! ```text
//! # CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
//! 1 OPENCV 752 480 458.654 457.296 367.715 248.875 -0.28 0.07 0.0002 0.00002
//! ```
//!
//! The binary file is a count (u64), then for every camera id (u32), model (i32), width and height (u64) and the
//! parameters (f64), little endian. COLMAP puts the *corner* of the top-left pixel at (0, 0), and so its centre at
//! (0.5, 0.5): half a pixel is taken off the principal point. Models with a field-of-view lens or a thin prism are refused.

use std::path::Path;

use mono_geometry::Distortion;

use super::file::{CameraFile, file_fault};
use super::read::Wanted;
use crate::error::SequenceError;
use crate::text::{content_lines, finite, line_fault};

/// COLMAP's centre of the top-left pixel.
const HALF_PIXEL: f64 = 0.5;
/// Bytes of a binary camera before its parameters.
const RECORD_HEAD: usize = 24;

/// Name and number of parameters by the id of the binary file.
const MODELS: [(&str, usize); 12] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
];

/// One camera of the file.
#[derive(PartialEq)]
struct Entry {
    id: u64,
    model: &'static str,
    size: [u32; 2],
    parameters: Vec<f64>,
}

/// Whether a line is one of `cameras.txt`.
pub(super) fn recognises(line: &str) -> bool {
    let mut cells = line.split_ascii_whitespace();
    cells.next().is_some_and(|id| id.parse::<u64>().is_ok())
        && cells.next().is_some_and(|name| model(name).is_some())
}

/// The text file.
pub(super) fn parse_text(
    path: &Path,
    text: &str,
    wanted: &mut Wanted<'_>,
) -> Result<CameraFile, SequenceError> {
    let mut entries = Vec::new();
    for (line, content) in content_lines(text) {
        let cells: Vec<&str> = content.split_ascii_whitespace().collect();
        let &[id, name, width, height, ref parameters @ ..] = cells.as_slice() else {
            return Err(line_fault(
                path,
                line,
                "a camera as id, model, width, height, parameters",
                format!("{} values", cells.len()),
            ));
        };
        let whole = |name: &str, text: &str| {
            text.parse::<u32>()
                .map_err(|_not_whole| line_fault(path, line, format!("a whole {name}"), text))
        };
        let Some((model, count)) = model(name) else {
            return Err(line_fault(path, line, "a camera model of COLMAP", name));
        };
        let parameters = parameters
            .iter()
            .map(|cell| finite(path, line, "a parameter", cell))
            .collect::<Result<Vec<_>, _>>()?;
        if parameters.len() != count {
            return Err(line_fault(
                path,
                line,
                format!("{count} parameters for {model}"),
                parameters.len().to_string(),
            ));
        }
        entries.push(Entry {
            id: u64::from(whole("camera id", id)?),
            model,
            size: [whole("width", width)?, whole("height", height)?],
            parameters,
        });
    }
    chosen(path, &entries, wanted)
}

/// The binary file; `None` where the bytes are no such file to their last one.
pub(super) fn parse_binary(
    path: &Path,
    bytes: &[u8],
    wanted: &mut Wanted<'_>,
) -> Option<Result<CameraFile, SequenceError>> {
    let (count, mut rest) = take::<8>(bytes)?;
    let count = u64::from_le_bytes(count);
    // Every camera has at least three parameters: a count beyond the file allocates nothing.
    if count == 0 || count > (bytes.len() / (RECORD_HEAD + 24)) as u64 {
        return None;
    }
    let mut entries = Vec::new();
    for _ in 0..count {
        let (id, after) = take::<4>(rest)?;
        let (kind, after) = take::<4>(after)?;
        let (width, after) = take::<8>(after)?;
        let (height, mut after) = take::<8>(after)?;
        let &(model, parameters) = MODELS.get(usize::try_from(i32::from_le_bytes(kind)).ok()?)?;
        let mut values = Vec::with_capacity(parameters);
        for _ in 0..parameters {
            let (value, left) = take::<8>(after)?;
            values.push(f64::from_le_bytes(value));
            after = left;
        }
        rest = after;
        entries.push(Entry {
            id: u64::from(u32::from_le_bytes(id)),
            model,
            size: [
                u32::try_from(u64::from_le_bytes(width)).ok()?,
                u32::try_from(u64::from_le_bytes(height)).ok()?,
            ],
            parameters: values,
        });
    }
    rest.is_empty().then(|| chosen(path, &entries, wanted))
}

fn take<const N: usize>(bytes: &[u8]) -> Option<([u8; N], &[u8])> {
    let (head, rest) = bytes.split_first_chunk::<N>()?;
    Some((*head, rest))
}

fn model(name: &str) -> Option<(&'static str, usize)> {
    MODELS.iter().find(|(known, _)| *known == name).copied()
}

/// The camera asked for, or the only one, or the one that all of them are.
fn chosen(
    path: &Path,
    entries: &[Entry],
    wanted: &mut Wanted<'_>,
) -> Result<CameraFile, SequenceError> {
    let ids = || {
        let ids: Vec<String> = entries.iter().map(|entry| entry.id.to_string()).collect();
        super::read::listed(&ids)
    };
    let equal = |a: &Entry, b: &Entry| {
        a.model == b.model && a.size == b.size && a.parameters == b.parameters
    };
    let entry = match wanted.camera {
        Some(name) => entries
            .iter()
            .find(|entry| entry.id.to_string() == name)
            .ok_or_else(|| file_fault(path, format!("a camera {name}"), ids()))?,
        None => match entries {
            [] => return Err(file_fault(path, "at least one camera", "none")),
            [first, others @ ..] if others.iter().all(|other| equal(first, other)) => first,
            _ => {
                return Err(file_fault(
                    path,
                    "one camera, or --camera with an id",
                    format!("the cameras {}", ids()),
                ));
            }
        },
    };
    camera(path, entry, wanted)
}

fn camera(
    path: &Path,
    entry: &Entry,
    wanted: &mut Wanted<'_>,
) -> Result<CameraFile, SequenceError> {
    let radtan = |k1, k2, p1, p2| Distortion::Radtan {
        k1,
        k2,
        p1,
        p2,
        k3: 0.0,
    };
    let fisheye = |k1, k2, k3, k4| Distortion::KannalaBrandt { k1, k2, k3, k4 };
    let (numbers, lens) = match (entry.model, entry.parameters.as_slice()) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f, cx, cy], Distortion::None),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy, cx, cy], Distortion::None),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => ([f, f, cx, cy], radtan(k, 0.0, 0.0, 0.0)),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], radtan(k1, k2, 0.0, 0.0)),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => ([fx, fy, cx, cy], radtan(k1, k2, p1, p2)),
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
            ([fx, fy, cx, cy], fisheye(k1, k2, k3, k4))
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => (
            [fx, fy, cx, cy],
            Distortion::Rational {
                k1,
                k2,
                p1,
                p2,
                k3,
                k4,
                k5,
                k6,
            },
        ),
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => ([f, f, cx, cy], fisheye(k, 0.0, 0.0, 0.0)),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], fisheye(k1, k2, 0.0, 0.0)),
        (other, _) => {
            return Err(file_fault(
                path,
                "a pinhole, radial, OPENCV, OPENCV_FISHEYE or FULL_OPENCV camera",
                other,
            ));
        }
    };
    let [fx, fy, cx, cy] = numbers;
    let size = wanted.size_of(path, Some(entry.size), "a size")?;
    Ok(CameraFile::of(
        size,
        [fx, fy, cx - HALF_PIXEL, cy - HALF_PIXEL],
        lens,
    ))
}
