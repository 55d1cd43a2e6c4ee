#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`check_motion`] takes [`FramePair`]s and answers with [`Finding`]s; [`check_path`] takes the poses of a filter. Nothing is
//! estimated that a filter could use.

mod agreement;
mod contradiction;
mod finding;
mod pair;
mod path;
mod rest;
mod slip;

use mono_geometry::motion::OdometrySample;
use mono_geometry::{Mount, Pinhole};

pub use finding::{Finding, Support};
pub use mono_geometry;
pub use nalgebra;
pub use pair::FramePair;
pub use path::check_path;

/// Pairs that the search for contradictions looks at.
const MAX_PAIRS: usize = 24;
/// Matches that a pair needs to be looked at.
const MIN_MATCHES: usize = 12;

/// The contradictions between `odometry` and what a camera saw in `pairs`, most telling first; empty where they fit.
///
/// `odometry` are rows in order of time, each holding until the next. Pairs should show a motion of several pixels; those
/// with fewer than twelve matches are left out. Deterministic. Time: some 150 ms for 24 pairs or more, on one core;
/// memory: a few megabytes.
///
/// ```
/// use mono_geometry::motion::OdometrySample;
/// use mono_geometry::{Mount, Pinhole};
/// use motion_consistency::{FramePair, check_motion};
/// use nalgebra::Vector2;
///
/// // A camera that looks ahead turns left by 0.05 rad between two frames: far points move right in the image.
/// let camera = Pinhole { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5 };
/// let right_px = 500.0 * 0.05_f64.tan();
/// let pair = |k: u32| FramePair {
///     from_s: f64::from(k),
///     to_s: f64::from(k + 1),
///     matches: (0..40).map(|i| Vector2::new(200.0 + 5.0 * f64::from(i), 239.5)).map(|p| [p, p + Vector2::new(right_px, 0.0)]).collect(),
/// };
/// let pairs: Vec<FramePair> = (0..10).map(pair).collect();
/// // The odometry claims the same turns to the right.
/// let odometry = [OdometrySample { t_s: 0.0, v_mps: 0.0, omega_radps: -0.05 }];
/// let findings = check_motion(&pairs, &odometry, &camera, &Mount::forward());
/// assert_eq!(findings[0].name(), "turn-sign");
/// ```
#[must_use]
pub fn check_motion(
    pairs: &[FramePair],
    odometry: &[OdometrySample],
    camera: &Pinhole,
    mount: &Mount,
) -> Vec<Finding> {
    let usable: Vec<&FramePair> = pairs
        .iter()
        .filter(|pair| pair.matches.len() >= MIN_MATCHES && pair.to_s > pair.from_s)
        .collect();
    if usable.is_empty() || odometry.is_empty() {
        return Vec::new();
    }
    let mut findings = rest::at_rest(&usable, odometry, camera);
    if findings.is_empty() {
        let every = usable.len().div_ceil(MAX_PAIRS).max(1);
        let some: Vec<&FramePair> = usable.iter().copied().step_by(every).collect();
        match contradiction::contradiction(&some, odometry, camera, mount) {
            Some(contradiction) => findings.push(contradiction),
            None => findings.extend(slip::slip(&usable, odometry, camera, mount)),
        }
    }
    findings
}
