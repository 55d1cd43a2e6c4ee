//! How well the matches of a pair fit a planar motion of the robot, for every turn and every direction of travel.
//!
//! Let the body drive the arc of length `s` and turn `psi`, with the direction of travel turned by `delta` from what mount
//! and odometry say. A point on the ray `x` of the earlier camera, at inverse depth `rho`, lies in the later camera along
//! `A x + rho b` with `A = R_cb R(psi)^T R_bc`, `b = R_cb (R(psi)^T (p - R(delta) t) - p)`, where `p` is the camera's place
//! in the body and `t` the displacement of the arc. In the image this is a straight segment from the point at infinity,
//! `rho = 0`, to the nearest depth that is believable; the residual of a match is its distance from that segment. The
//! segment asks for the right side (no point lies behind the camera), not only for the epipolar line, so it tells forwards
//! from backwards, and it shrinks to a point for a turn on the spot. A mount that is turned by `theta` about the body's
//! vertical has the same `A`, and its `b` is that of `delta = -theta`.

use mono_geometry::motion::exact_arc;
use mono_geometry::{Mount, Pinhole};
use nalgebra::{Matrix3, Rotation2, Rotation3, Vector2, Vector3};

use crate::pair::{Claim, FramePair};

/// Turns between two frames that are tried, radians: further ones leave no overlap.
const MAX_TURN_RAD: f64 = 0.8;
/// Step between two tried turns, radians: less than half of the tolerance.
const TURN_STEP_RAD: f64 = 0.005;
const TURNS: usize = 321;
/// Residual at which a match counts nothing, radians at the focal length: a robot pitches and rolls by some tenths of a degree.
const TOLERANCE_RAD: f64 = 0.012;
/// The same, pixels, for cameras of few pixels.
const MIN_TOLERANCE_PX: f64 = 3.0;
/// Nearest depth that is believed, metres.
const NEAREST_M: f64 = 0.1;
/// Nearest depth that is believed, in lengths of the baseline.
const NEAREST_IN_BASELINES: f64 = 0.5;
/// Matches of a pair that are looked at.
const MAX_MATCHES: usize = 60;

/// The agreement of one pair, 0 to 1, over turns, for one direction of travel.
#[derive(Debug, Clone)]
pub(crate) struct Agreement {
    /// Mean weight of the matches at each tried turn.
    by_turn: Vec<f64>,
}

impl Agreement {
    /// Agreement of `pair` for every turn, where the robot drives `claim.distance_m` in a direction turned by `direction_rad`.
    ///
    /// Time: some 20,000 distances to a segment.
    pub(crate) fn of(
        pair: &FramePair,
        claim: &Claim,
        direction_rad: f64,
        camera: &Pinhole,
        mount: &Mount,
    ) -> Self {
        let rays = rays(pair, camera);
        let focal = camera.fx.max(camera.fy);
        let tolerance = TOLERANCE_RAD.max(MIN_TOLERANCE_PX / focal);
        let by_turn = (0..TURNS)
            .map(|step| {
                let motion =
                    CameraMotion::of(claim.distance_m, turn_of(step), direction_rad, mount);
                let sum: f64 = rays
                    .iter()
                    .map(|[from, to]| {
                        (1.0 - motion.squared_residual(from, to) / (tolerance * tolerance)).max(0.0)
                    })
                    .sum();
                sum / rays.len().max(1) as f64
            })
            .collect();
        Self { by_turn }
    }

    /// Best agreement at a turn within `half_width_rad` of `turn_rad`; 0 outside the turns that are tried.
    pub(crate) fn near(&self, turn_rad: f64, half_width_rad: f64) -> f64 {
        let step_of = |turn: f64| (turn + MAX_TURN_RAD) / TURN_STEP_RAD;
        let first = step_of(turn_rad - half_width_rad).ceil().max(0.0);
        let last = step_of(turn_rad + half_width_rad)
            .floor()
            .min((TURNS - 1) as f64);
        if first > last {
            return 0.0;
        }
        // Both lie within the table.
        self.by_turn[first as usize..=last as usize]
            .iter()
            .copied()
            .fold(0.0, f64::max)
    }

    /// The turn of the best agreement, radians, and that agreement.
    pub(crate) fn best(&self) -> (f64, f64) {
        let (step, &value) = self
            .by_turn
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .unwrap_or((TURNS / 2, &0.0));
        (turn_of(step) + TURN_STEP_RAD * self.parabola(step), value)
    }

    /// Where between its neighbours the top of `step` lies, in steps.
    fn parabola(&self, step: usize) -> f64 {
        if step == 0 || step + 1 >= TURNS {
            return 0.0;
        }
        let [before, here, after] = [
            self.by_turn[step - 1],
            self.by_turn[step],
            self.by_turn[step + 1],
        ];
        let curvature = before - 2.0 * here + after;
        if curvature < 0.0 {
            (0.5 * (before - after) / curvature).clamp(-0.5, 0.5)
        } else {
            0.0
        }
    }
}

fn turn_of(step: usize) -> f64 {
    step as f64 * TURN_STEP_RAD - MAX_TURN_RAD
}

/// At most [`MAX_MATCHES`] matches, evenly picked, as normalised image points.
fn rays(pair: &FramePair, camera: &Pinhole) -> Vec<[Vector2<f64>; 2]> {
    let every = pair.matches.len().div_ceil(MAX_MATCHES).max(1);
    pair.matches
        .iter()
        .step_by(every)
        .map(|match_| match_.map(|pixel| camera.normalize(&pixel)))
        .collect()
}

/// The motion of the camera between two frames.
pub(crate) struct CameraMotion {
    /// `A`: later camera axes from earlier ones.
    rotation: Matrix3<f64>,
    /// `b`, metres.
    shift: Vector3<f64>,
    /// Largest believable inverse depth, 1/m.
    max_inverse_depth: f64,
}

impl CameraMotion {
    pub(crate) fn of(distance_m: f64, turn_rad: f64, direction_rad: f64, mount: &Mount) -> Self {
        let arc = exact_arc(distance_m, turn_rad, 1.0);
        let driven = Rotation2::new(direction_rad) * Vector2::new(arc.x, arc.y);
        let driven = Vector3::new(driven.x, driven.y, 0.0);
        let body_from_camera = mount.body_from_camera.rotation.matrix();
        let place = mount.body_from_camera.translation;
        let later_from_earlier = Rotation3::from_axis_angle(&Vector3::z_axis(), -turn_rad);
        let in_body = later_from_earlier * (place - driven) - place;
        let shift = body_from_camera.transpose() * in_body;
        Self {
            rotation: body_from_camera.transpose() * later_from_earlier.matrix() * body_from_camera,
            shift,
            max_inverse_depth: (1.0 / NEAREST_M).min(1.0 / (NEAREST_IN_BASELINES * shift.norm())),
        }
    }

    /// Squared distance of the later point from the segment on which the earlier one can be seen again, radians squared.
    fn squared_residual(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> f64 {
        let (infinity, along, depth) = self.segment(from);
        if depth <= 0.0 {
            return f64::INFINITY;
        }
        let offset = to - infinity;
        let length = along.norm_squared();
        if length == 0.0 {
            return offset.norm_squared();
        }
        let nearest_depth = depth + self.max_inverse_depth * self.shift.z;
        let end = if nearest_depth > 0.0 {
            self.max_inverse_depth / nearest_depth
        } else {
            f64::INFINITY
        };
        let nearest = (offset.dot(&along) / length).clamp(0.0, end);
        (offset - along * nearest).norm_squared()
    }

    /// The distance of the later point from the point at infinity, along the segment, radians; NaN for a ray that turns behind
    /// the camera.
    pub(crate) fn parallax_rad(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> f64 {
        let (infinity, along, depth) = self.segment(from);
        if depth > 0.0 {
            (to - infinity).dot(&along) / along.norm()
        } else {
            f64::NAN
        }
    }

    /// The parallax of a point at `inverse_depth` (1/m) in the earlier camera, radians.
    pub(crate) fn parallax_at(&self, from: &Vector2<f64>, inverse_depth: f64) -> f64 {
        let (_, along, depth) = self.segment(from);
        along.norm() * inverse_depth / (depth + inverse_depth * self.shift.z)
    }

    /// Inverse depth in the later camera, 1/m, of a point with this parallax.
    pub(crate) fn later_inverse_depth(&self, from: &Vector2<f64>, parallax_rad: f64) -> f64 {
        // parallax = length rho / (z + rho b_z), and the later depth is z / rho + b_z.
        let (_, along, _) = self.segment(from);
        parallax_rad / along.norm()
    }

    /// Where the point at infinity lies, the direction of the segment, and the depth of the ray's unit point.
    fn segment(&self, from: &Vector2<f64>) -> (Vector2<f64>, Vector2<f64>, f64) {
        let ray = self.rotation * Vector3::new(from.x, from.y, 1.0);
        let infinity = Vector2::new(ray.x, ray.y) / ray.z;
        let along = Vector2::new(self.shift.x, self.shift.y) - infinity * self.shift.z;
        (infinity, along, ray.z)
    }
}
