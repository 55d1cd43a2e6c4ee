//! The reduced system: normal equations of poses, scales and constants, the landmarks eliminated as they are met.
//!
//! With J_p and J_l the derivatives of a whitened residual r by the unknowns and by its landmark, and the weights of
//! the loss inside,
//!
//! > V = sum J_l^T J_l,  W = sum J_p^T J_l,  S = sum J_p^T J_p - W V^-1 W^T,  g = sum J_p^T r - W V^-1 sum J_l^T r.
//!
//! S is filled from the tracks directly, one landmark after the other: Z = W G with V^-1 = G G^T, S -= Z Z^T. Only its
//! lower triangle is kept. Rows of neighbouring keyframes lie side by side, so the inner loop runs over them at once.
//!
//! Cost: a landmark seen by n keyframes takes 3 (6 n)^2 / 2 multiplications; the factorisation size^3 / 6.

use nalgebra::{DMatrix, Matrix3, RowVector3, SMatrix, SVector, Vector3};
use slam_pipeline::{Control, OdometryInterval};

use crate::constants::Constant;
use crate::landmark::{Landmark, Pixels};
use crate::motion::motion_error;
use crate::pixel::{BEHIND_SIGMAS, CALIBRATION, Seen, View};
use crate::problem::Model;
use crate::process_noise::MotionSquares;
use crate::state::{FIXED, HEADING, HEIGHT, Layout, PITCH, POSE, ROLL, State};

/// Positions and angles repeat no better than these, metres and radians: the floors of the filter's motion prior.
const POSITION_FLOOR_M: f64 = 1e-4;
const ANGLE_FLOOR: f64 = 1e-4;
/// Floor of a step of the scale.
const SCALE_FLOOR: f64 = 1e-6;

/// A motion between two keyframes, ready to be weighed.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    /// Keyframe at its end; it starts at the one before.
    pub(crate) to: usize,
    /// Whether it is the first of its drive.
    pub(crate) first: bool,
    /// Rows of odometry.
    pub(crate) rows: Vec<OdometryInterval>,
    /// Lower factor of the covariance of (forward, left, turn).
    pub(crate) factor: Matrix3<f64>,
    /// Seconds and metres of it.
    pub(crate) dt_s: f64,
    /// Metres driven.
    pub(crate) distance_m: f64,
}

impl Motion {
    pub(crate) fn new(
        to: usize,
        first: bool,
        rows: Vec<OdometryInterval>,
        control: &Control,
    ) -> Self {
        let floors = Vector3::new(POSITION_FLOOR_M, POSITION_FLOOR_M, ANGLE_FLOOR);
        let covariance = control.covariance + Matrix3::from_diagonal(&floors.map(|f| f * f));
        let factor = covariance.cholesky().map_or_else(
            || Matrix3::from_diagonal(&covariance.diagonal().map(f64::sqrt)),
            |c| c.l(),
        );
        Self {
            to,
            first,
            rows,
            factor,
            dt_s: control.dt_s,
            distance_m: control.distance_m,
        }
    }

    /// Share of a tilt that is left at the end.
    fn kept_tilt(&self, model: &Model) -> f64 {
        if model.tilt_time_s > 0.0 {
            (-self.dt_s / model.tilt_time_s).exp()
        } else {
            0.0
        }
    }
}

/// Everything that is not a pixel: motions, tilts, heights, scales, priors of the constants.
#[derive(Debug)]
pub(crate) struct Beliefs<'a> {
    pub(crate) model: &'a Model,
    pub(crate) motions: &'a [Motion],
    /// Keyframes that start a drive.
    pub(crate) starts: &'a [usize],
}

/// A whitened residual of few unknowns: its value, and derivatives by unknowns (several may name the same one never).
type Scalar = (f64, Vec<(usize, f64)>);

impl Beliefs<'_> {
    /// All whitened residuals at `state`; `lever_m` is the arm of the camera with its constants.
    pub(crate) fn residuals(
        &self,
        state: &State,
        layout: &Layout,
        nominal_lever_m: &nalgebra::Vector2<f64>,
    ) -> Vec<Scalar> {
        let mut all = Vec::new();
        let model = self.model;
        let constants = &state.constants;
        let lever = nominal_lever_m
            + nalgebra::Vector2::new(constants[Constant::LeverX], constants[Constant::LeverY]);
        for &start in self.starts {
            if model.tilt_sigma > 0.0 {
                for (axis, value) in [
                    (ROLL, state.poses[start].roll),
                    (PITCH, state.poses[start].pitch),
                ] {
                    let index = layout.poses[start][axis];
                    all.push((
                        value / model.tilt_sigma,
                        vec![(index, 1.0 / model.tilt_sigma)],
                    ));
                }
            }
        }
        for motion in self.motions {
            self.motion(motion, state, layout, &lever, &mut all);
            self.carrier(motion, state, layout, &mut all);
        }
        for (constant, sigma) in model.constants.iter() {
            let index = layout.constants[constant as usize];
            if index != FIXED {
                all.push((constants[constant] / sigma, vec![(index, 1.0 / sigma)]));
            }
        }
        all
    }

    /// Sums of the squared residuals of the motions by axis; `lever_m` is the nominal arm of the camera.
    pub(crate) fn motion_squares(
        &self,
        state: &State,
        layout: &Layout,
        lever_m: &nalgebra::Vector2<f64>,
    ) -> MotionSquares {
        let constants = &state.constants;
        let lever = lever_m
            + nalgebra::Vector2::new(constants[Constant::LeverX], constants[Constant::LeverY]);
        let mut sums = MotionSquares {
            motions: self.motions.len(),
            ..MotionSquares::default()
        };
        for motion in self.motions {
            let mut rows = Vec::new();
            self.motion(motion, state, layout, &lever, &mut rows);
            self.carrier(motion, state, layout, &mut rows);
            // Each axis by itself: an error sideways is none of the heading, however the two go together in an arc.
            let whitened = Vector3::from_fn(|i, _| rows[i].0);
            let axis = |j: usize| {
                let row = motion.factor.row(j);
                (row * whitened).x / row.norm()
            };
            sums.sideways += axis(1).powi(2);
            sums.heading += axis(2).powi(2);
            let mut square = rows[3..].iter().map(|(residual, _)| residual * residual);
            let mut next = || square.next().unwrap_or(0.0);
            if self.model.tilt_sigma > 0.0 {
                sums.tilt += 0.5 * (next() + next());
            }
            if self.model.slope_sigma > 0.0 {
                sums.height += next();
            }
        }
        sums
    }

    fn motion(
        &self,
        motion: &Motion,
        state: &State,
        layout: &Layout,
        lever: &nalgebra::Vector2<f64>,
        all: &mut Vec<Scalar>,
    ) {
        let to = motion.to;
        let found = motion_error(
            &state.poses[to - 1],
            &state.poses[to],
            state.scales[to],
            &motion.rows,
            lever,
            &state.constants,
        );
        let whiten = |m: Vector3<f64>| {
            motion
                .factor
                .solve_lower_triangular(&m)
                .unwrap_or_else(Vector3::zeros)
        };
        let error = whiten(found.error);
        let mut columns: Vec<(usize, Vector3<f64>)> = Vec::new();
        let mut add = |index: usize, column: Vector3<f64>| {
            if index != FIXED {
                columns.push((index, whiten(column)));
            }
        };
        for (i, axis) in [0, 1, HEADING].into_iter().enumerate() {
            add(layout.poses[to - 1][axis], found.by_from.column(i).into());
            add(layout.poses[to][axis], found.by_to.column(i).into());
        }
        add(layout.scales[to], found.by_scale);
        for i in 0..Constant::OF_MOTION {
            add(layout.constants[i], found.by_constants.column(i).into());
        }
        for row in 0..3 {
            all.push((
                error[row],
                columns.iter().map(|(index, c)| (*index, c[row])).collect(),
            ));
        }
    }

    /// Reverting tilt, height along the slope, drift of the scale.
    fn carrier(&self, motion: &Motion, state: &State, layout: &Layout, all: &mut Vec<Scalar>) {
        let model = self.model;
        let to = motion.to;
        let (before, after) = (&state.poses[to - 1], &state.poses[to]);
        let (from_index, to_index) = (&layout.poses[to - 1], &layout.poses[to]);
        if model.tilt_sigma > 0.0 {
            let keep = motion.kept_tilt(model);
            let sigma = (model.tilt_sigma * model.tilt_sigma * (1.0 - keep * keep)
                + ANGLE_FLOOR * ANGLE_FLOOR)
                .sqrt();
            for (axis, difference) in [
                (ROLL, after.roll - keep * before.roll),
                (PITCH, after.pitch - keep * before.pitch),
            ] {
                all.push((
                    difference / sigma,
                    vec![
                        (to_index[axis], 1.0 / sigma),
                        (from_index[axis], -keep / sigma),
                    ],
                ));
            }
        }
        if model.slope_sigma > 0.0 {
            // A slope has no unit: the height is in the metres of the map, the distance in those of the wheels.
            let wheel_scale = 1.0 + state.constants[Constant::WheelScale];
            let sigma = (model.slope_sigma * motion.distance_m).hypot(POSITION_FLOOR_M);
            let (rise, scale) = (after.centre.z - before.centre.z, state.scales[to]);
            let inverse = 1.0 / (sigma * wheel_scale);
            all.push((
                scale * rise * inverse,
                [
                    (to_index[HEIGHT], scale * inverse),
                    (from_index[HEIGHT], -scale * inverse),
                    (layout.scales[to], rise * inverse),
                    (
                        layout.constants[Constant::WheelScale as usize],
                        -scale * rise * inverse / wheel_scale,
                    ),
                ]
                .into_iter()
                .filter(|(index, _)| *index != FIXED)
                .collect(),
            ));
        }
        if model.scale_drift > 0.0 {
            let index = layout.scales[to];
            if motion.first {
                let sigma = model.scale_sigma.hypot(SCALE_FLOOR);
                all.push(((state.scales[to] - 1.0) / sigma, vec![(index, 1.0 / sigma)]));
            } else {
                let variance = model.scale_drift * model.scale_drift * motion.distance_m;
                let sigma = variance.sqrt().hypot(SCALE_FLOOR);
                all.push((
                    (state.scales[to] - state.scales[to - 1]) / sigma,
                    vec![(index, 1.0 / sigma), (layout.scales[to - 1], -1.0 / sigma)],
                ));
            }
        }
    }
}

/// The normal equations after the landmarks have left.
#[derive(Debug)]
pub(crate) struct System {
    /// Lower triangle of S.
    pub(crate) matrix: DMatrix<f64>,
    /// Gradient.
    pub(crate) gradient: Vec<f64>,
    /// Size of rounding errors on the diagonal, in units of eps.
    pub(crate) rounding: Vec<f64>,
    z: [Vec<f64>; 3],
}

/// One row of W: the unknown and its coupling with the landmark.
type Coupling = (usize, RowVector3<f64>);

impl System {
    pub(crate) fn new(size: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(size, size),
            gradient: vec![0.0; size],
            rounding: vec![0.0; size],
            z: Default::default(),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.matrix.fill(0.0);
        self.gradient.fill(0.0);
        self.rounding.fill(0.0);
    }

    /// Adds scalar residuals.
    pub(crate) fn add_scalars(&mut self, scalars: &[Scalar]) {
        for (residual, columns) in scalars {
            for (a, by_a) in columns {
                self.gradient[*a] += by_a * residual;
                for (b, by_b) in columns {
                    if b <= a {
                        self.matrix[(*a, *b)] += by_a * by_b;
                    }
                }
            }
        }
    }

    /// Adds all sightings of one landmark and eliminates it.
    pub(crate) fn add_landmark(
        &mut self,
        pixels: &Pixels<'_>,
        layout: &Layout,
        views: &[View],
        landmark: &Landmark,
        seen: &[Seen],
    ) {
        let placed = landmark.place(views);
        let mut v = Matrix3::zeros();
        let mut landmark_gradient = Vector3::zeros();
        let mut couplings: Vec<Coupling> = Vec::with_capacity(seen.len() * POSE + CALIBRATION);
        let mut calibration = SMatrix::<f64, CALIBRATION, 3>::zeros();
        let constants = &layout.constants[Constant::OF_MOTION..];
        let calibrates = constants.iter().any(|index| *index != FIXED);
        for s in seen {
            let view = &views[s.keyframe];
            let q = placed.in_view(view);
            let Some((residual, by_point)) = pixels.sensor.linearise(s, &q) else {
                continue;
            };
            let squared = residual.norm_squared();
            if squared > BEHIND_SIGMAS * BEHIND_SIGMAS {
                continue;
            }
            let weight = pixels.loss.at(squared).weight;
            let by_landmark = by_point * placed.in_view_by_parameters(view);
            // The anchor is a parameter of its own here: origin and direction stay where they are.
            let by_pose = by_point * view.point_by_pose(&q, placed.rho);
            v += by_landmark.tr_mul(&by_landmark) * weight;
            landmark_gradient += by_landmark.tr_mul(&residual) * weight;
            let index = &layout.poses[s.keyframe];
            let hessian = by_pose.tr_mul(&by_pose) * weight;
            let gradient = by_pose.tr_mul(&residual) * weight;
            let w = by_pose.tr_mul(&by_landmark) * weight;
            for a in 0..POSE {
                if index[a] == FIXED {
                    continue;
                }
                self.gradient[index[a]] += gradient[a];
                for b in 0..=a {
                    if index[b] != FIXED {
                        self.matrix[(index[a], index[b])] += hessian[(a, b)];
                    }
                }
                couplings.push((index[a], w.row(a).into()));
            }
            if calibrates {
                let by = pixels.sensor.by_calibration(s, &q);
                let own = by.tr_mul(&by) * weight;
                let cross = by.tr_mul(&by_pose) * weight;
                let gradient: SVector<f64, CALIBRATION> = by.tr_mul(&residual) * weight;
                calibration += by.tr_mul(&by_landmark) * weight;
                for (a, &at) in constants.iter().enumerate() {
                    if at == FIXED {
                        continue;
                    }
                    self.gradient[at] += gradient[a];
                    for (b, &bt) in constants.iter().enumerate().take(a + 1) {
                        if bt != FIXED {
                            self.matrix[(at, bt)] += own[(a, b)];
                        }
                    }
                    for b in 0..POSE {
                        if index[b] != FIXED {
                            self.matrix[(at, index[b])] += cross[(a, b)];
                        }
                    }
                }
            }
        }
        if calibrates {
            for (a, &at) in constants.iter().enumerate() {
                if at != FIXED {
                    couplings.push((at, calibration.row(a).into()));
                }
            }
        }
        v[(2, 2)] += pixels.rho_information;
        self.eliminate(&v, &landmark_gradient, &couplings);
    }

    /// S -= W V^-1 W^T, g -= W V^-1 g_l; couplings ascend.
    fn eliminate(&mut self, v: &Matrix3<f64>, gradient: &Vector3<f64>, couplings: &[Coupling]) {
        let Some(lower) = v.cholesky().map(|c| c.l()) else {
            return;
        };
        // G = L^-T, so W G = (L^-1 W^T)^T.
        let Some(whitened) = lower.solve_lower_triangular(gradient) else {
            return;
        };
        for z in &mut self.z {
            z.clear();
        }
        for (index, w) in couplings {
            let Some(z) = lower.solve_lower_triangular(&w.transpose()) else {
                return;
            };
            for axis in 0..3 {
                self.z[axis].push(z[axis]);
            }
            self.gradient[*index] -= z.dot(&whitened);
            self.rounding[*index] += z.norm_squared();
        }
        let size = self.matrix.nrows();
        let entries = self.matrix.as_mut_slice();
        let [z0, z1, z2] = &self.z;
        let runs = runs(couplings);
        for (r, run) in runs.iter().enumerate() {
            for a in 0..run.length {
                let row = run.local + a;
                let column = &mut entries[(run.first + a) * size..][..size];
                let factors = [z0[row], z1[row], z2[row]];
                subtract(
                    &mut column[run.first + a..run.first + run.length],
                    [&z0[row..], &z1[row..], &z2[row..]],
                    factors,
                );
                for below in &runs[r + 1..] {
                    let first = below.local;
                    subtract(
                        &mut column[below.first..below.first + below.length],
                        [&z0[first..], &z1[first..], &z2[first..]],
                        factors,
                    );
                }
            }
        }
    }
}

/// Couplings whose unknowns are neighbours.
struct Run {
    /// First coupling.
    local: usize,
    /// Its unknown.
    first: usize,
    length: usize,
}

fn runs(couplings: &[Coupling]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (local, (index, _)) in couplings.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if run.first + run.length == *index => run.length += 1,
            _ => runs.push(Run {
                local,
                first: *index,
                length: 1,
            }),
        }
    }
    runs
}

/// target -= z0 f0 + z1 f1 + z2 f2.
#[inline]
fn subtract(target: &mut [f64], z: [&[f64]; 3], factors: [f64; 3]) {
    let length = target.len();
    let (z0, z1, z2) = (&z[0][..length], &z[1][..length], &z[2][..length]);
    for i in 0..length {
        target[i] -= z0[i] * factors[0] + z1[i] * factors[1] + z2[i] * factors[2];
    }
}

/// Twice the cost of scalar residuals.
pub(crate) fn squares(scalars: &[Scalar]) -> f64 {
    scalars.iter().map(|(r, _)| r * r).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::Constants;
    use crate::problem::{Keyframe, Problem};
    use mono_geometry::{Camera, Distortion, Mount, Pinhole, Se2};
    use slam_pipeline::config::Config;
    use slam_pipeline::{Odometer, Rig};

    fn problem() -> Problem {
        let pinhole = Pinhole {
            width: 320,
            height: 240,
            fx: 300.0,
            fy: 300.0,
            cx: 160.0,
            cy: 120.0,
        };
        let lens = Distortion::KannalaBrandt {
            k1: 0.01,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
        };
        let rows = vec![
            OdometryInterval {
                duration_s: 0.4,
                v_mps: 0.5,
                omega_radps: 0.3,
            };
            2
        ];
        let mut model = Model::of(&Config::default().check().unwrap());
        for constant in Constant::ALL {
            model.constants[constant] = 0.1;
        }
        Problem {
            rig: Rig {
                camera: Camera::new(pinhole, lens).unwrap(),
                mount: Mount::new(
                    Mount::forward().body_from_camera.rotation.matrix(),
                    &Vector3::new(0.2, -0.1, 0.3),
                )
                .unwrap(),
            },
            keyframes: (0..4)
                .map(|k| Keyframe {
                    start: Se2::new(0.38 * f64::from(k), 0.05 * f64::from(k), 0.2 * f64::from(k)),
                    motion: (k > 0).then(|| rows.clone()),
                })
                .collect(),
            tracks: Vec::new(),
            model,
        }
    }

    #[test]
    fn derivatives_of_all_beliefs_are_those_of_finite_differences() {
        let problem = problem();
        let layout = Layout::new(&problem);
        let motions: Vec<Motion> = (1..4)
            .map(|to| {
                let rows = problem.keyframes[to].motion.clone().unwrap();
                let mut odometer = Odometer::new(&problem.model.odometry);
                for row in &rows {
                    odometer.push(row).unwrap();
                }
                Motion::new(to, to == 1, rows, &odometer.control())
            })
            .collect();
        let beliefs = Beliefs {
            model: &problem.model,
            motions: &motions,
            starts: &[0],
        };
        let lever = problem.rig.mount.body_from_camera.translation.xy();
        // Somewhere off the start, so that no derivative is zero by chance.
        let off: Vec<f64> = (0..layout.size).map(|i| 0.02 * (i as f64).sin()).collect();
        let state = State::start(&problem).moved(&layout, &off);
        let at = |index: usize, h: f64| {
            let mut step = vec![0.0; layout.size];
            step[index] = h;
            beliefs.residuals(&state.moved(&layout, &step), &layout, &lever)
        };
        let found = beliefs.residuals(&state, &layout, &lever);
        // Motions of 3, tilts of 2, heights and scales of 1 each; 2 tilts at the start; the constants.
        assert_eq!(found.len(), 3 * 7 + 2 + Constant::COUNT);
        let h = 1e-6;
        for index in 0..layout.size {
            let (plus, minus) = (at(index, h), at(index, -h));
            for (row, (_, columns)) in found.iter().enumerate() {
                let by: f64 = columns
                    .iter()
                    .filter(|(column, _)| *column == index)
                    .map(|(_, by)| by)
                    .sum();
                let slope = (plus[row].0 - minus[row].0) / (2.0 * h);
                assert!(
                    (by - slope).abs() < 1e-5 * slope.abs().max(1.0),
                    "residual {row} by unknown {index}: {by} against {slope}"
                );
            }
        }
        assert_ne!(state.constants, Constants::ZERO);
    }
}
