//! Spans in which only one of the two moves.

use mono_geometry::Pinhole;
use mono_geometry::motion::OdometrySample;

use crate::finding::Finding;
use crate::pair::{Claim, FramePair, median};

/// An odometry that moves less than this is at rest, metres and radians.
const REST_M: f64 = 1e-3;
const REST_RAD: f64 = 1e-3;
/// A robot that drives or turns this far moves the image of everything but the far distance.
const DRIVEN_M: f64 = 0.3;
const TURNED_RAD: f64 = 0.05;
/// An image that moves less than this stands still, pixels.
const STILL_PX: f64 = 0.3;
/// An image that moves more than this does not, as a share of the focal length.
const MOVED_SHARE: f64 = 0.02;
/// Spans that must contradict.
const MIN_SPANS: usize = 3;

/// Contradictions between rest and motion.
pub(crate) fn at_rest(
    pairs: &[&FramePair],
    rows: &[OdometrySample],
    camera: &Pinhole,
) -> Vec<Finding> {
    let moved_px = MOVED_SHARE * camera.fx.max(camera.fy);
    let mut resting = 0;
    let mut moving_px = Vec::new();
    let mut driven = 0;
    let (mut frozen, mut distance_m, mut turn_rad) = (0, 0.0, 0.0);
    for pair in pairs {
        let Some(displacement_px) = pair.median_displacement_px() else {
            continue;
        };
        let claim = Claim::of(rows, pair.from_s, pair.to_s);
        let (distance, turn) = (claim.distance_m.abs(), claim.turn_rad.abs());
        if distance < REST_M && turn < REST_RAD {
            resting += 1;
            if displacement_px > moved_px {
                moving_px.push(displacement_px);
            }
        } else if distance > DRIVEN_M || turn > TURNED_RAD {
            driven += 1;
            if displacement_px < STILL_PX {
                frozen += 1;
                distance_m += distance;
                turn_rad += turn;
            }
        }
    }
    let mut findings = Vec::new();
    let moving = moving_px.len();
    if moving >= MIN_SPANS
        && 2 * moving > resting
        && let Some(displacement_px) = median(moving_px)
    {
        findings.push(Finding::OdometryAtRest {
            moving,
            resting,
            displacement_px,
        });
    }
    if frozen >= MIN_SPANS {
        findings.push(Finding::ImagesAtRest {
            frozen,
            driven,
            distance_m,
            turn_rad,
        });
    }
    findings
}
