//! Motion of a camera that moves in a plane and turns about its normal, as on a wheeled robot: two points, or one.
//!
//! Between two views the body turns by phi about its z axis and the camera's centre travels in the body's xy plane, in
//! direction beta (in the axes of the first pose) over an unknown length. With rays rotated to body axes by the mount,
//! f1 = (p, q, r) and f2 = (a, b, d), coplanarity f1 . (u x Rz(phi) f2) = 0, u = (cos beta, sin beta, 0), is linear in
//! two unit vectors, gamma = phi - beta:
//!
//! ```text
//! d (p sin beta - q cos beta) + r (b cos gamma + a sin gamma) = 0
//! ```
//!
//! **Two points.** The null space of the 2 x 4 system, spanned by N1 (for beta) over N2 (for gamma), 2 x 2 each: the vectors N1 w and
//! N2 w must be equally long, w^T (N1^T N1 - N2^T N2) w = 0. This quadratic gives at most two motions. The mount may have any
//! rotation; its lever arm does not enter, as beta is where the *camera* goes: for a body that moves by (x, y) it is
//! (x, y) + (Rz(phi) - I) lever arm.
//!
//! **One point.** A body without side slip drives an arc; if the camera does, too, it travels along the chord, beta = phi / 2:
//! tan(phi / 2) = (q d - r b) / (p d + r a). Exact for a camera anywhere on the line of the fixed axle (sideways arms do not
//! matter, short of the centre of the turn). A forward arm l is *neglected*: over a step s it turns the direction by about
//! phi l / s, which the step, not observable from one camera, would tell.
//!
//! The two signs of u give the same matrix; [`PlanarMotion::oriented`] chooses by cheirality.
//!
//! Degenerate, no model: no motion, or turning on the spot (every beta fits; the quadratic vanishes); a sample on the
//! horizon: r and d are the vertical components of the rays, matches at the camera's height carry nothing and those
//! near it little. A camera looking sideways (90 degrees in the paper's Table I) sees the horizon as its middle row, and its
//! epipole, for travel straight on, at infinity to the side: well conditioned for direction. A camera looking straight up or down
//! has affine ambiguities of its own and is better served by a 2D rigid fit.
//!
//! Sources: Ortín and Montiel, Indoor robot motion based on monocular images, Robotica 2001; Scaramuzza, 1-point-RANSAC
//! structure from motion for vehicle-mounted cameras, IJCV 2011; Choi and Kim, Fast and reliable minimal relative pose
//! estimation under planar motion, 2018.

use estimation_base::wrap;
use nalgebra::{Matrix2, Matrix3, Rotation3, SMatrix, SVector, Vector2, Vector3};

use super::pair::Correspondence;
use super::refine::{Freedom, refine};
use super::relative_pose::in_front;
use super::scorer::EpipolarModel;
use crate::linalg::null_space;
use crate::mount::Mount;
use crate::ransac::Solver;
use crate::se3::Se3;
use crate::so3::hat;

/// Sums of a few products of unit vectors.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A planar motion of the camera up to scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarMotion {
    /// Turn of the body about its z axis, counter-clockwise, radians in (-pi, pi].
    pub turn_rad: f64,
    /// Direction in which the camera travels, in the body axes of the first view, radians in (-pi, pi]; of a solver's
    /// result up to pi.
    pub direction_rad: f64,
    body_from_camera: Rotation3<f64>,
    essential: Matrix3<f64>,
}

impl PlanarMotion {
    /// The motion of a camera on `mount`; only the mount's rotation is used.
    #[must_use]
    pub fn new(mount: &Mount, turn_rad: f64, direction_rad: f64) -> Self {
        Self::with_rotation(mount.body_from_camera.rotation, turn_rad, direction_rad)
    }

    fn with_rotation(body_from_camera: Rotation3<f64>, turn_rad: f64, direction_rad: f64) -> Self {
        let mut motion = Self {
            turn_rad: wrap(turn_rad),
            direction_rad: wrap(direction_rad),
            body_from_camera,
            essential: Matrix3::zeros(),
        };
        let pose = motion.second_from_first();
        motion.essential = hat(&pose.translation) * pose.rotation.matrix();
        motion
    }

    /// Motion of the camera, |t| = 1.
    #[must_use]
    pub fn second_from_first(&self) -> Se3 {
        let camera_from_body = self.body_from_camera.inverse();
        let (sine, cosine) = self.direction_rad.sin_cos();
        let rotation = camera_from_body
            * Rotation3::from_axis_angle(&Vector3::z_axis(), -self.turn_rad)
            * self.body_from_camera;
        let travel = camera_from_body * Vector3::new(cosine, sine, 0.0);
        Se3::new(rotation, -(rotation * travel))
    }

    /// The same matrix with the direction, forth or back, that has more of the indexed matches (normalised coordinates) in front of
    /// both cameras; unchanged on a tie. See [`in_front`] for `min_parallax_rad`.
    #[must_use]
    pub fn oriented(
        &self,
        matches: &[Correspondence],
        indices: &[usize],
        min_parallax_rad: f64,
    ) -> Self {
        let back = Self::with_rotation(
            self.body_from_camera,
            self.turn_rad,
            self.direction_rad + std::f64::consts::PI,
        );
        let votes =
            |m: &Self| in_front(&m.second_from_first(), matches, indices, min_parallax_rad).0;
        if votes(&back) > votes(self) {
            back
        } else {
            *self
        }
    }

    /// dE by the turn, then by the direction.
    fn derivatives(&self) -> [Matrix3<f64>; 2] {
        let camera_from_body = self.body_from_camera.inverse();
        let up = hat(&(camera_from_body * Vector3::z()));
        let pose = self.second_from_first();
        let rotation = pose.rotation.matrix();
        let (sine, cosine) = self.direction_rad.sin_cos();
        // E = -R [travel]x, R = exp(-turn up).
        let travel = hat(&(camera_from_body * Vector3::new(cosine, sine, 0.0)));
        let across = hat(&(camera_from_body * Vector3::new(-sine, cosine, 0.0)));
        [up * rotation * travel, -(rotation * across)]
    }
}

impl EpipolarModel for PlanarMotion {
    fn matrix(&self) -> &Matrix3<f64> {
        &self.essential
    }
}

/// Parameters (turn, direction).
impl Freedom<2> for PlanarMotion {
    fn essential(&self) -> Matrix3<f64> {
        self.essential
    }

    fn tangents(&self) -> [Matrix3<f64>; 2] {
        self.derivatives()
    }

    fn moved(&self, delta: &SVector<f64, 2>) -> Self {
        Self::with_rotation(
            self.body_from_camera,
            self.turn_rad + delta[0],
            self.direction_rad + delta[1],
        )
    }
}

/// Motion along an arc: the direction is half the turn (plus pi for driving backwards).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Arc(PlanarMotion);

impl Freedom<1> for Arc {
    fn essential(&self) -> Matrix3<f64> {
        self.0.essential
    }

    fn tangents(&self) -> [Matrix3<f64>; 1] {
        let [by_turn, by_direction] = self.0.derivatives();
        [by_turn + by_direction * 0.5]
    }

    fn moved(&self, delta: &SVector<f64, 1>) -> Self {
        Self(self.0.moved(&Vector2::new(delta[0], 0.5 * delta[0])))
    }
}

/// Every planar motion that fits two matches in normalised coordinates: at most two, directions up to pi. O(1).
pub fn planar_from_two(
    mount: &Mount,
    sample: &[Correspondence; 2],
    motions: &mut Vec<PlanarMotion>,
) {
    let rotation = mount.body_from_camera.rotation;
    let [Some(one), Some(other)] = sample.map(|m| body_rays(&rotation, &m)) else {
        return;
    };
    let rays = [one, other];
    if turned_only(&rays) {
        return;
    }
    let rows = rays.map(|pair| planar_row(&pair));
    // A match on the horizon has a row of rounding errors, which scaling would take for numbers.
    if rows
        .iter()
        .any(|row| SVector::from(*row).norm() <= ROUNDING)
    {
        return;
    }
    let system = SMatrix::<f64, 2, 4>::from_fn(|i, j| rows[i][j]);
    let Some(null) = null_space::<2, 4, 2>(&system, ROUNDING) else {
        return;
    };
    let for_direction: Matrix2<f64> = null.fixed_rows::<2>(0).into();
    let for_gamma: Matrix2<f64> = null.fixed_rows::<2>(2).into();
    let form = for_direction.tr_mul(&for_direction) - for_gamma.tr_mul(&for_gamma);
    // Of size eps if every motion of the family fits.
    if form.amax() <= ROUNDING {
        return;
    }
    for w in zeros_of_form(&form).into_iter().flatten() {
        let (u, v) = (for_direction * w, for_gamma * w);
        if u.norm() <= ROUNDING {
            continue;
        }
        let direction = u.y.atan2(u.x);
        motions.push(PlanarMotion::with_rotation(
            rotation,
            v.y.atan2(v.x) + direction,
            direction,
        ));
    }
}

/// The motion along an arc that fits one match in normalised coordinates; direction up to pi. O(1).
///
/// `None` for a match that fits no turn better than another: on the horizon, or not moved.
#[must_use]
pub fn arc_from_one(mount: &Mount, m: &Correspondence) -> Option<PlanarMotion> {
    let rotation = mount.body_from_camera.rotation;
    let [by_cos_beta, by_sin_beta, by_cos_gamma, by_sin_gamma] =
        planar_row(&body_rays(&rotation, m)?);
    // beta = gamma = phi / 2.
    let (by_cosine, by_sine) = (by_cos_beta + by_cos_gamma, by_sin_beta + by_sin_gamma);
    if by_cosine.hypot(by_sine) <= ROUNDING {
        return None;
    }
    // The half turn with |phi / 2| <= pi / 2: its opposite is the same phi.
    let mut half = (-by_cosine).atan2(by_sine);
    if half.abs() > std::f64::consts::FRAC_PI_2 {
        half -= std::f64::consts::PI.copysign(half);
    }
    Some(PlanarMotion::with_rotation(rotation, 2.0 * half, half))
}

/// The two-point solver for RANSAC: data in normalised coordinates, refits by least squares on Sampson distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarTwoPoint {
    /// The camera on the robot; only its rotation is used.
    pub mount: Mount,
}

impl Solver for PlanarTwoPoint {
    type Datum = Correspondence;
    type Model = PlanarMotion;

    fn sample_size(&self) -> usize {
        2
    }

    fn fit(&self, data: &[Correspondence], sample: &[usize], models: &mut Vec<PlanarMotion>) {
        if let [a, b] = *sample {
            planar_from_two(&self.mount, &[data[a], data[b]], models);
        }
    }

    fn refit(
        &self,
        data: &[Correspondence],
        inliers: &[usize],
        model: &PlanarMotion,
    ) -> Option<PlanarMotion> {
        let refined = refine(model, data, inliers, &Vector2::repeat(1.0), 5).ok()?;
        Some(refined.model)
    }
}

/// The one-point solver for RANSAC (without side slip, forward lever arm neglected); data in normalised coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArcOnePoint {
    /// The camera on the robot; only its rotation is used.
    pub mount: Mount,
}

impl Solver for ArcOnePoint {
    type Datum = Correspondence;
    type Model = PlanarMotion;

    fn sample_size(&self) -> usize {
        1
    }

    fn fit(&self, data: &[Correspondence], sample: &[usize], models: &mut Vec<PlanarMotion>) {
        models.extend(
            sample
                .first()
                .and_then(|i| arc_from_one(&self.mount, &data[*i])),
        );
    }

    fn refit(
        &self,
        data: &[Correspondence],
        inliers: &[usize],
        model: &PlanarMotion,
    ) -> Option<PlanarMotion> {
        let refined = refine(&Arc(*model), data, inliers, &Vector2::repeat(1.0), 5).ok()?;
        Some(refined.model.0)
    }
}

/// Unit rays in body axes; `None` if a coordinate is not finite.
fn body_rays(
    body_from_camera: &Rotation3<f64>,
    m: &Correspondence,
) -> Option<(Vector3<f64>, Vector3<f64>)> {
    m.is_finite().then(|| {
        (
            body_from_camera * m.first.push(1.0).normalize(),
            body_from_camera * m.second.push(1.0).normalize(),
        )
    })
}

/// Coefficients of (cos beta, sin beta, cos gamma, sin gamma).
fn planar_row((first, second): &(Vector3<f64>, Vector3<f64>)) -> [f64; 4] {
    [
        -first.y * second.z,
        first.x * second.z,
        first.z * second.y,
        first.z * second.x,
    ]
}

/// Whether one turn about the vertical maps all second rays to the first, to rounding: every direction would fit.
fn turned_only(rays: &[(Vector3<f64>, Vector3<f64>); 2]) -> bool {
    let turns = rays.map(|(f, s)| Vector2::new(f.xy().dot(&s.xy()), s.xy().perp(&f.xy())));
    rays.iter().all(|(f, s)| (f.z - s.z).abs() <= ROUNDING)
        && turns[0].perp(&turns[1]).abs() <= ROUNDING
        && turns[0].dot(&turns[1]) >= 0.0
}

/// Unit vectors w with w^T Q w = 0, up to sign: two, one or none.
fn zeros_of_form(form: &Matrix2<f64>) -> [Option<Vector2<f64>>; 2] {
    // In polar form: mean + amplitude cos(2 theta - phase) = 0.
    let mean = 0.5 * (form[(0, 0)] + form[(1, 1)]);
    let half = 0.5 * (form[(0, 0)] - form[(1, 1)]);
    let amplitude = half.hypot(form[(0, 1)]);
    let phase = form[(0, 1)].atan2(half);
    let cosine = -mean / amplitude;
    // A double zero may be missed or split by rounding: taken if within it.
    if cosine.is_nan() || cosine.abs() > 1.0 + ROUNDING {
        return [None, None];
    }
    let spread = cosine.clamp(-1.0, 1.0).acos();
    let unit = |theta: f64| Vector2::new(theta.cos(), theta.sin());
    let one = Some(unit(0.5 * (phase + spread)));
    if spread == 0.0 {
        return [one, None];
    }
    [one, Some(unit(0.5 * (phase - spread)))]
}
