//! Whether the numbers of a camera can belong to a camera at all, and whether they are odd.
//!
//! A file can be read without fault and still describe no lens that was ever made: a focal length in millimetres, the
//! relative numbers of another tool, the calibration of another image size, coefficients in another order. Everything
//! behind it then runs and is wrong. Four questions are asked of every camera, of whatever format:
//!
//! - the angle of view along either side, 2 atan(side / 2 f) for a lens with an image plane and side / f for a
//!   fisheye: from [`LEAST_VIEW_DEG`] to [`MOST_VIEW_DEG`] (fisheye [`MOST_FISHEYE_DEG`]);
//! - fx against fy: at most a factor of [`MOST_ASPECT`];
//! - the principal point: inside the image;
//! - the lens: of the pixels of the image at least the share [`LEAST_FIELD`] lies inside its fold, where it can be
//!   inverted; of a fisheye [`LEAST_FISHEYE_FIELD`], because its image circle often ends inside the image and this
//!   program's rays end at 90 degrees.
//!
//! Outside these a camera is refused. Within wider limits than most cameras need it is only remarked upon: cropped
//! images, anamorphic lenses and strong wide angles exist.

use std::path::Path;

use mono_geometry::{Camera, Distortion};
use nalgebra::Vector2;

use super::file::{CameraFile, file_fault};
use crate::error::SequenceError;

/// Widest view of a lens with an image plane, degrees: f = 0.09 of the side.
const MOST_VIEW_DEG: f64 = 160.0;
/// Widest view of a fisheye, degrees.
const MOST_FISHEYE_DEG: f64 = 300.0;
/// Narrowest view, degrees: f = 115 times the side.
const LEAST_VIEW_DEG: f64 = 0.5;
/// Views beyond these are odd.
const USUAL_VIEW_DEG: [f64; 2] = [8.0, 130.0];
const USUAL_FISHEYE_DEG: f64 = 220.0;
/// Largest quotient of the focal lengths.
const MOST_ASPECT: f64 = 4.0;
const USUAL_ASPECT: f64 = 1.2;
/// A principal point further from the middle, as a share of the side, is odd.
const USUAL_OFF_CENTRE: f64 = 0.2;
/// Smallest share of the pixels inside the fold of the lens.
const LEAST_FIELD: f64 = 0.75;
const LEAST_FISHEYE_FIELD: f64 = 0.4;
/// Points a side of the grid that measures that share; the border is among them.
const GRID: usize = 41;

impl CameraFile {
    /// Why these numbers can belong to no camera, in one sentence with the numbers; `None` where they can.
    ///
    /// Angle of view, quotient of the focal lengths, principal point and the fold of the lens are asked for.
    pub fn implausible(&self) -> Option<String> {
        assess(self).impossible
    }

    /// Remarks upon numbers that are possible and unusual, one sentence each.
    pub fn oddities(&self) -> Vec<String> {
        assess(self).odd
    }

    /// The camera, or the fault of a file that describes none.
    pub(super) fn plausible(self, path: &Path) -> Result<Self, SequenceError> {
        match self.implausible() {
            None => Ok(self),
            Some(reason) => Err(file_fault(path, "a camera that can exist", reason)),
        }
    }
}

/// The answer about one camera.
struct Assessment {
    /// Why the numbers can belong to no camera.
    impossible: Option<String>,
    /// Remarks upon unusual numbers, one sentence each.
    odd: Vec<String>,
}

/// Asks the four questions. `camera` has positive sides and focal lengths and finite numbers.
fn assess(camera: &CameraFile) -> Assessment {
    let mut answer = Assessment {
        impossible: None,
        odd: Vec::new(),
    };
    for question in [view, aspect, centre, field] {
        match question(camera) {
            Verdict::Usual => {}
            Verdict::Odd(remark) => answer.odd.push(remark),
            Verdict::Impossible(reason) => {
                answer.impossible = Some(reason);
                break;
            }
        }
    }
    answer
}

enum Verdict {
    Usual,
    Odd(String),
    Impossible(String),
}

fn view(camera: &CameraFile) -> Verdict {
    let fisheye = matches!(camera.distortion, Distortion::KannalaBrandt { .. });
    let sides = [
        ("fx", camera.fx, f64::from(camera.width), "columns"),
        ("fy", camera.fy, f64::from(camera.height), "rows"),
    ];
    let mut verdict = Verdict::Usual;
    for (name, focal, side, unit) in sides {
        let angle = if fisheye {
            side / focal
        } else {
            2.0 * (0.5 * side / focal).atan()
        }
        .to_degrees();
        let [most, usual] = if fisheye {
            [MOST_FISHEYE_DEG, USUAL_FISHEYE_DEG]
        } else {
            [MOST_VIEW_DEG, USUAL_VIEW_DEG[1]]
        };
        let says = format!(
            "{name} = {} px, which over {side} {unit} is a view of {} degrees",
            short(focal),
            short(angle)
        );
        if angle > most {
            return Verdict::Impossible(format!(
                "{says}; focal lengths are in pixels, not in millimetres or shares of the image"
            ));
        }
        if angle < LEAST_VIEW_DEG {
            return Verdict::Impossible(format!("{says}; focal lengths are in pixels"));
        }
        if !(USUAL_VIEW_DEG[0]..=usual).contains(&angle) {
            verdict = Verdict::Odd(format!("{says}: check its unit and the image size"));
        }
    }
    verdict
}

fn aspect(camera: &CameraFile) -> Verdict {
    let ratio = (camera.fx / camera.fy).max(camera.fy / camera.fx);
    let says = format!(
        "fx = {} px and fy = {} px, a factor of {}",
        short(camera.fx),
        short(camera.fy),
        short(ratio)
    );
    if ratio > MOST_ASPECT {
        Verdict::Impossible(format!("{says} between them"))
    } else if ratio > USUAL_ASPECT {
        Verdict::Odd(format!(
            "{says}: right only for images stretched along one side"
        ))
    } else {
        Verdict::Usual
    }
}

fn centre(camera: &CameraFile) -> Verdict {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let says = format!(
        "a principal point at ({}, {}) px",
        short(camera.cx),
        short(camera.cy)
    );
    let share = [
        (camera.cx + 0.5) / width - 0.5,
        (camera.cy + 0.5) / height - 0.5,
    ];
    if share.iter().any(|share| share.abs() > 0.5) {
        return Verdict::Impossible(format!(
            "{says} outside the image of {width}x{height} pixels"
        ));
    }
    if share.iter().any(|share| share.abs() > USUAL_OFF_CENTRE) {
        return Verdict::Odd(format!(
            "{says} far from the middle of {width}x{height} pixels: is the calibration that of another image size?"
        ));
    }
    Verdict::Usual
}

fn field(file: &CameraFile) -> Verdict {
    // Numbers that describe no camera are faults of their own, found where the camera is made.
    let Ok((camera, _)) = file.camera_and_mount() else {
        return Verdict::Usual;
    };
    let Some((inside, nearest)) = invertible(&camera, file) else {
        return Verdict::Usual;
    };
    let fisheye = matches!(file.distortion, Distortion::KannalaBrandt { .. });
    let least = if fisheye {
        LEAST_FISHEYE_FIELD
    } else {
        LEAST_FIELD
    };
    let percent = short(100.0 * inside);
    if inside < least {
        let first = file
            .distortion
            .parameters()
            .first()
            .copied()
            .unwrap_or_default();
        Verdict::Impossible(format!(
            "a lens (k1 = {}) that folds over {} px from the principal point, so that only {percent} % of the image \
             have a direction; check order and signs of its coefficients",
            short(first),
            short(nearest)
        ))
    } else {
        Verdict::Odd(format!(
            "the lens ends {} px from the principal point, inside the image: the outer {} % of its pixels have no \
             direction and are not used",
            short(nearest),
            short(100.0 * (1.0 - inside))
        ))
    }
}

/// Share of the pixels inside the fold and the least distance of one beyond it; `None` where all are inside.
fn invertible(camera: &Camera, file: &CameraFile) -> Option<(f64, f64)> {
    let mut inside = 0_usize;
    let mut nearest = f64::INFINITY;
    let at = |index: usize, side: u32| {
        index as f64 / (GRID - 1) as f64 * (f64::from(side) - 1.0).max(0.0)
    };
    for row in 0..GRID {
        for column in 0..GRID {
            let pixel = Vector2::new(at(column, file.width), at(row, file.height));
            if camera.undistort(&pixel).is_ok() {
                inside += 1;
            } else {
                nearest = nearest.min((pixel.x - file.cx).hypot(pixel.y - file.cy));
            }
        }
    }
    (inside < GRID * GRID).then(|| (inside as f64 / (GRID * GRID) as f64, nearest))
}

/// Three digits, as one says a number.
fn short(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude >= 100.0 || magnitude == 0.0 {
        format!("{value:.0}")
    } else if magnitude >= 1.0 {
        let text = format!("{value:.1}");
        text.strip_suffix(".0").map(String::from).unwrap_or(text)
    } else {
        format!("{value:.3}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::file::{MountFile, SigmaFile};

    fn camera(size: [u32; 2], numbers: [f64; 4], distortion: Distortion) -> CameraFile {
        let [fx, fy, cx, cy] = numbers;
        CameraFile {
            width: size[0],
            height: size[1],
            fx,
            fy,
            cx,
            cy,
            distortion,
            mount: MountFile::default(),
            sigma: SigmaFile::default(),
        }
    }

    fn barrel(k1: f64) -> Distortion {
        Distortion::Radtan {
            k1,
            k2: 0.0,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
        }
    }

    #[test]
    fn regress_cameras_that_cannot_be_are_refused_with_their_numbers() {
        let fisheye = Distortion::KannalaBrandt {
            k1: 0.0,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
        };
        let cases = [
            // Millimetres of a data sheet, shares of the image, metres.
            (
                [3.6, 3.6, 160.0, 120.0],
                Distortion::None,
                "fx = 3.6 px, which over 320 columns is a view of 177 degrees",
            ),
            (
                [1.15, 1.54, 0.5, 0.5],
                Distortion::None,
                "a view of 179 degrees",
            ),
            ([3.6, 3.6, 160.0, 120.0], fisheye, "a view of 5093 degrees"),
            ([4e5, 4e5, 160.0, 120.0], Distortion::None, "fx = 400000 px"),
            (
                [1500.0, 100.0, 160.0, 120.0],
                Distortion::None,
                "a factor of 15",
            ),
            (
                [300.0, 300.0, 400.0, 120.0],
                Distortion::None,
                "a principal point at (400, 120) px outside the image of 320x240",
            ),
            ([369.0, 370.0, 160.0, 121.0], barrel(-1.5), "folds over"),
        ];
        for (numbers, lens, expected) in cases {
            let reason = assess(&camera([320, 240], numbers, lens))
                .impossible
                .unwrap();
            assert!(reason.contains(expected), "{reason}");
        }
    }

    #[test]
    fn odd_cameras_are_remarked_upon_and_usual_ones_are_not() {
        let odd = |numbers, lens| {
            let answer = assess(&camera([320, 240], numbers, lens));
            assert!(answer.impossible.is_none(), "{:?}", answer.impossible);
            answer.odd
        };
        assert!(odd([300.0, 301.0, 158.0, 121.0], Distortion::None).is_empty());
        assert!(odd([300.0, 301.0, 158.0, 121.0], barrel(-0.3)).is_empty());
        for (numbers, lens, expected) in [
            ([60.0, 60.0, 160.0, 120.0], Distortion::None, "139 degrees"),
            (
                [9000.0, 9000.0, 160.0, 120.0],
                Distortion::None,
                "a view of 1.5 degrees",
            ),
            (
                [300.0, 400.0, 160.0, 120.0],
                Distortion::None,
                "a factor of 1.3",
            ),
            (
                [300.0, 300.0, 80.0, 60.0],
                Distortion::None,
                "far from the middle",
            ),
            (
                [300.0, 300.0, 160.0, 120.0],
                barrel(-0.36),
                "the lens ends ",
            ),
        ] {
            let remarks = odd(numbers, lens);
            assert!(
                remarks.iter().any(|remark| remark.contains(expected)),
                "{expected}: {remarks:?}"
            );
        }
    }
}
