//! The Gaussian of a path segment: a local bundle adjustment started at the state of a particle.
//!
//! The unknowns are the poses x_1 ... x_L of a window, the constants of the carrier and the landmarks seen in it. The path
//! before the window and the map at its beginning are those of the particle. Factors are the motion prior of every step,
//! the Gaussian of each landmark at the beginning of the window (or after its first sighting), and every match that scores,
//! both coordinates, Huber weighted. Landmarks are eliminated from each Gauss-Newton step (Schur complement) and follow it;
//! at the end the constants are eliminated as well. The result N(mean, (G G^T)^-1) over the stacked pose tangents depends
//! on the state at the beginning and on the measurements alone.
//!
//! The prior of the depth is taken out of the landmarks. One landmark's guess is harmless, but hundreds of them share it,
//! and with every depth free they would agree on a shorter path: on rendered walls the scale shrank by a twentieth.
//!
//! Derivatives: with the direction d = base + rho (c_a - c_k) of the ray and the projection pi, dz = J_pi R_k (dd - w_k x d),
//! dd = w_a x base + rho (dc_a - dc_k), and w = e_z dphi + R_z e_y dpitch + R_z R_y e_x droll.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use estimation_base::Manifold;
use mono_geometry::PlacedCamera;
use mono_geometry::inverse_depth::LandmarkGeometry;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector2, Vector3};

use super::landmark::{InverseDepthPrior, Landmark};
use super::linearised::pose_posterior;
use super::motion::{CONSTANTS, Departure};
use super::observation::Scoring;
use super::particle::Particle;
use super::pose::{CameraPose, POSE_DIM, PoseMatrix, PoseStep};
use super::segment::{SegmentDriver, WindowStep};

/// Steps tried, accepted or not.
const STEPS: usize = 8;
/// Damping after a step that failed, as a share of the diagonal; it grows and shrinks tenfold.
const FIRST_DAMPING: f64 = 1e-3;
/// The adjustment has settled when a step promises to lower the cost by less than this: a fifth of a standard deviation in
/// one direction.
const SETTLED: f64 = 0.02;
/// Linearisations of the pose in the path that the adjustment starts from.
const START_LINEARISATIONS: usize = 2;
/// Residuals beyond this many standard deviations count linearly.
const HUBER_SIGMAS: f64 = 2.5;
/// Cost of a sighting whose landmark the pose cannot see.
const UNSEEN_COST: f64 = 20.0;
/// Variance that keeps a constant which is known exactly out of a division by zero.
const LEAST_CONSTANT_VARIANCE: f64 = 1e-14;

/// Share of the prior of a depth that is left in a window; it keeps a landmark without parallax regular.
const LEFT_OF_DEPTH: f64 = 1e-3;

/// Derivative of a pixel with respect to a pose tangent.
type PoseJacobian = SMatrix<f64, 2, POSE_DIM>;

/// Gaussian over the poses of a window.
#[derive(Debug, Clone)]
pub(crate) struct SegmentGaussian {
    /// Mean of each pose.
    pub(crate) mean: Vec<CameraPose>,
    /// Lower Cholesky factor G of the precision of the stacked tangents.
    pub(crate) precision_factor: DMatrix<f64>,
}

impl SegmentGaussian {
    /// Number of unknowns, six a pose.
    #[must_use]
    pub(crate) fn dimension(&self) -> usize {
        self.precision_factor.nrows()
    }

    /// The path mean + G^-T `normal`: a draw, if `normal` is one of N(0, I). `None` when the factor is singular.
    #[must_use]
    pub(crate) fn path(&self, normal: &DVector<f64>) -> Option<Vec<CameraPose>> {
        let stacked = self.precision_factor.tr_solve_lower_triangular(normal)?;
        Some(
            self.mean
                .iter()
                .enumerate()
                .map(|(k, mean)| {
                    mean.retract(&stacked.fixed_rows::<POSE_DIM>(POSE_DIM * k).into_owned())
                })
                .collect(),
        )
    }
}

/// A landmark of the window.
struct Track {
    anchor: Option<u32>,
    /// Information at the beginning of the window, and information times mean, without the prior of the depth.
    prior_information: Matrix3<f64>,
    prior_vector: Vector3<f64>,
    mean: Vector3<f64>,
    sightings: Vec<TrackSighting>,
}

struct TrackSighting {
    step: usize,
    pixel: Vector2<f64>,
    variance_px2: f64,
}

/// A pose that may be unknown.
#[derive(Clone, Copy)]
struct Node {
    camera: PlacedCamera,
    /// Index of the unknown and the angular velocities (world axes) of heading, roll and pitch.
    unknown: Option<(usize, Matrix3<f64>)>,
}

struct Problem<'a> {
    driver: &'a SegmentDriver<'a>,
    start: &'a Particle,
    steps: &'a [Arc<WindowStep>],
    poses: Vec<CameraPose>,
    constants: Vector3<f64>,
    tracks: Vec<Track>,
}

/// One landmark's part of the normal equations.
struct Elimination {
    blocks: BTreeMap<usize, SMatrix<f64, POSE_DIM, 3>>,
    inverse: Matrix3<f64>,
    vector: Vector3<f64>,
    cost: f64,
}

/// The normal equations of poses and constants.
struct NormalEquations {
    precision: DMatrix<f64>,
    vector: DVector<f64>,
    eliminated: Vec<Option<Elimination>>,
    /// Half the sum of the squared residuals, Huber's function of the sightings; up to a constant.
    cost: f64,
}

/// The Gaussian of the path of `steps` that starts in `start`; `None` when the normal equations are singular or the
/// adjustment does not settle.
///
/// Time O(matches x poses a landmark is seen from + (6 L)^3).
#[must_use]
pub(crate) fn segment_gaussian(
    driver: &SegmentDriver<'_>,
    start: &Particle,
    steps: &[Arc<WindowStep>],
) -> Option<SegmentGaussian> {
    let mut problem = Problem::new(driver, start, steps);
    let precision = problem.solve()?;
    let n = POSE_DIM * steps.len();
    let constants = precision.view((n, n), (CONSTANTS, CONSTANTS)).into_owned();
    let cross = precision.view((0, n), (n, CONSTANTS)).into_owned();
    let reduced = precision.view((0, 0), (n, n)).into_owned()
        - &cross * constants.cholesky()?.solve(&cross.transpose());
    Some(SegmentGaussian {
        mean: problem.poses,
        precision_factor: reduced.cholesky()?.unpack(),
    })
}

impl<'a> Problem<'a> {
    fn new(
        driver: &'a SegmentDriver<'a>,
        start: &'a Particle,
        steps: &'a [Arc<WindowStep>],
    ) -> Self {
        let mut particle = start.clone();
        let mut poses = Vec::with_capacity(steps.len());
        for step in steps {
            driver.step(&mut particle, step, |particle, prior| {
                let matches = step.observation.prepare(particle);
                pose_posterior(driver.rig, prior, &matches, START_LINEARISATIONS).mean_pose(prior)
            });
            poses.push(particle.pose);
        }
        Self {
            driver,
            start,
            steps,
            poses,
            constants: start.metric.constants(),
            tracks: tracks(start, &particle, steps, driver.depth),
        }
    }

    fn node(&self, keyframe: u32) -> Option<Node> {
        let before = self.start.path.len();
        match (keyframe as usize).checked_sub(before) {
            Some(step) => self.poses.get(step).map(|pose| Node {
                camera: pose.place(self.driver.rig),
                unknown: Some((step, attitude_rates(pose))),
            }),
            None => self.start.path.get(keyframe as usize).map(|k| Node {
                camera: k.camera,
                unknown: None,
            }),
        }
    }

    /// Levenberg-Marquardt from the start path; the precision of poses and constants at the solution.
    fn solve(&mut self) -> Option<DMatrix<f64>> {
        let mut damping = 0.0;
        let mut normal = self.normal_equations()?;
        for _ in 0..STEPS {
            let mut damped = normal.precision.clone();
            for i in 0..damped.nrows() {
                damped[(i, i)] *= 1.0 + damping;
            }
            let step = damped.cholesky()?.solve(&normal.vector);
            if damping == 0.0 && 0.5 * step.dot(&normal.vector) < SETTLED {
                return Some(normal.precision);
            }
            let before = (self.poses.clone(), self.constants, self.landmark_means());
            self.apply(&step, &normal.eliminated);
            match self.normal_equations() {
                Some(next) if next.cost < normal.cost => {
                    normal = next;
                    damping = if damping > FIRST_DAMPING {
                        damping * 0.1
                    } else {
                        0.0
                    };
                }
                _ => {
                    let means;
                    (self.poses, self.constants, means) = before;
                    for (track, mean) in self.tracks.iter_mut().zip(means) {
                        track.mean = mean;
                    }
                    damping = (damping * 10.0).max(FIRST_DAMPING);
                }
            }
        }
        None
    }

    fn landmark_means(&self) -> Vec<Vector3<f64>> {
        self.tracks.iter().map(|t| t.mean).collect()
    }

    fn normal_equations(&self) -> Option<NormalEquations> {
        let n = POSE_DIM * self.steps.len();
        let mut precision = DMatrix::zeros(n + CONSTANTS, n + CONSTANTS);
        let mut vector = DVector::zeros(n + CONSTANTS);
        let mut cost = self.add_motion(&mut precision, &mut vector)?;
        let nodes: Vec<Node> = (0..self.steps.len())
            .map(|k| self.node((self.start.path.len() + k) as u32))
            .collect::<Option<_>>()?;
        let mut eliminated = Vec::with_capacity(self.tracks.len());
        for track in &self.tracks {
            let part = self.eliminate(track, &nodes, &mut precision, &mut vector);
            if let Some(part) = &part {
                cost += part.cost;
                let weighted: Vec<_> = part
                    .blocks
                    .iter()
                    .map(|(k, e)| (*k, e, e * part.inverse))
                    .collect();
                for (a, _, ea) in &weighted {
                    let mut rows = vector.fixed_rows_mut::<POSE_DIM>(POSE_DIM * a);
                    rows -= ea * part.vector;
                    for (b, eb, _) in &weighted {
                        let mut block = precision
                            .fixed_view_mut::<POSE_DIM, POSE_DIM>(POSE_DIM * a, POSE_DIM * b);
                        block -= ea * eb.transpose();
                    }
                }
            }
            eliminated.push(part);
        }
        Some(NormalEquations {
            precision,
            vector,
            eliminated,
            cost,
        })
    }

    /// Adds the factors of the motion and returns their cost.
    fn add_motion(&self, precision: &mut DMatrix<f64>, vector: &mut DVector<f64>) -> Option<f64> {
        let n = POSE_DIM * self.steps.len();
        let floor = Matrix3::identity() * LEAST_CONSTANT_VARIANCE;
        let information = (self.start.metric.constants_covariance() + floor)
            .cholesky()?
            .inverse();
        let mut corner = precision.fixed_view_mut::<CONSTANTS, CONSTANTS>(n, n);
        corner += information;
        let mut rows = vector.fixed_rows_mut::<CONSTANTS>(n);
        let off = self.start.metric.constants() - self.constants;
        rows += information * off;
        let mut cost = 0.5 * off.dot(&(information * off));
        let mut from = self.start.pose;
        for (k, (step, pose)) in self.steps.iter().zip(&self.poses).enumerate() {
            let prior = step.carrier.prior(
                &self.driver.rig.lever_m(),
                &Departure {
                    pose: from,
                    constants: self.constants,
                    constants_covariance: Matrix3::zeros(),
                },
                &step.observation.control,
            );
            let whiten = prior
                .factor
                .solve_lower_triangular(&PoseMatrix::identity())?;
            let residual: PoseStep = whiten * prior.mean.local(pose);
            cost += 0.5 * residual.norm_squared();
            let own = whiten;
            let before = -whiten * prior.by_departure(&from);
            let constants = -whiten * prior.gains;
            let at = POSE_DIM * k;
            add_block(precision, vector, &residual, &[(at, own)], n, &constants);
            if k > 0 {
                let other = at - POSE_DIM;
                let mut rows = vector.fixed_rows_mut::<POSE_DIM>(other);
                rows -= before.tr_mul(&residual);
                let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(other, other);
                block += before.tr_mul(&before);
                let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(other, at);
                block += before.tr_mul(&own);
                let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(at, other);
                block += own.tr_mul(&before);
                let cross = before.tr_mul(&constants);
                let mut block = precision.fixed_view_mut::<POSE_DIM, CONSTANTS>(other, n);
                block += cross;
                let mut block = precision.fixed_view_mut::<CONSTANTS, POSE_DIM>(n, other);
                block += cross.transpose();
            }
            from = *pose;
        }
        Some(cost)
    }

    /// Adds the sightings of a landmark and returns what its elimination needs; `None` when it is not seen from the poses.
    fn eliminate(
        &self,
        track: &Track,
        nodes: &[Node],
        precision: &mut DMatrix<f64>,
        vector: &mut DVector<f64>,
    ) -> Option<Elimination> {
        let anchor = match track.anchor {
            None => None,
            Some(keyframe) => Some(self.node(keyframe)?),
        };
        let geometry = anchor.map_or(LandmarkGeometry::Point, |a| {
            LandmarkGeometry::InverseDepth { anchor: a.camera }
        });
        let pinhole = self.driver.rig.pinhole();
        let ray = geometry.ray(&track.mean);
        let mut information = track.prior_information;
        let mut own = track.prior_vector - track.prior_information * track.mean;
        let mut blocks: BTreeMap<usize, SMatrix<f64, POSE_DIM, 3>> = BTreeMap::new();
        let mut cost = track
            .mean
            .dot(&(track.prior_information * track.mean * 0.5 - track.prior_vector));
        for sighting in &track.sightings {
            let node = &nodes[sighting.step];
            let Some(predicted) = ray.project(pinhole, &node.camera) else {
                cost += UNSEEN_COST;
                continue;
            };
            let by_landmark = geometry.parameter_jacobian(pinhole, &node.camera, &track.mean)?;
            let residual = sighting.pixel - predicted;
            let normalised = residual.norm() / sighting.variance_px2.sqrt();
            let weight = (HUBER_SIGMAS / normalised).min(1.0) / sighting.variance_px2;
            cost += if normalised > HUBER_SIGMAS {
                HUBER_SIGMAS * (normalised - 0.5 * HUBER_SIGMAS)
            } else {
                0.5 * normalised * normalised
            };
            let direction = ray.base + (ray.origin - node.camera.centre) * ray.rate;
            let q = node.camera.camera_from_world * direction;
            let by_direction = SMatrix::<f64, 2, 3>::new(
                pinhole.fx / q.z,
                0.0,
                -pinhole.fx * q.x / (q.z * q.z),
                0.0,
                pinhole.fy / q.z,
                -pinhole.fy * q.y / (q.z * q.z),
            ) * node.camera.camera_from_world;
            let mut poses: Vec<(usize, PoseJacobian)> = Vec::with_capacity(2);
            if let Some((k, rates)) = node.unknown {
                let mut j = PoseJacobian::zeros();
                j.fixed_view_mut::<2, 3>(0, 0)
                    .copy_from(&(by_direction * -ray.rate));
                for (column, rate) in rates.column_iter().enumerate() {
                    j.set_column(3 + column, &(by_direction * direction.cross(&rate)));
                }
                poses.push((k, j));
            }
            if let Some(Node {
                unknown: Some((a, rates)),
                ..
            }) = anchor
            {
                let mut j = PoseJacobian::zeros();
                j.fixed_view_mut::<2, 3>(0, 0)
                    .copy_from(&(by_direction * ray.rate));
                for (column, rate) in rates.column_iter().enumerate() {
                    j.set_column(3 + column, &(by_direction * rate.cross(&ray.base)));
                }
                if let Some(same) = poses.iter_mut().find(|(k, _)| *k == a) {
                    same.1 += j;
                } else {
                    poses.push((a, j));
                }
            }
            information += by_landmark.tr_mul(&by_landmark) * weight;
            own += by_landmark.tr_mul(&residual) * weight;
            for (k, j) in &poses {
                *blocks.entry(*k).or_insert_with(SMatrix::zeros) += j.tr_mul(&by_landmark) * weight;
                let mut rows = vector.fixed_rows_mut::<POSE_DIM>(POSE_DIM * k);
                rows += j.tr_mul(&residual) * weight;
                for (l, i) in &poses {
                    let mut block =
                        precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(POSE_DIM * k, POSE_DIM * l);
                    block += j.tr_mul(i) * weight;
                }
            }
        }
        let inverse = information.cholesky()?.inverse();
        Some(Elimination {
            blocks,
            inverse,
            vector: own,
            cost,
        })
    }

    fn apply(&mut self, step: &DVector<f64>, eliminated: &[Option<Elimination>]) {
        let n = POSE_DIM * self.steps.len();
        for (k, pose) in self.poses.iter_mut().enumerate() {
            *pose = pose.retract(&step.fixed_rows::<POSE_DIM>(POSE_DIM * k).into_owned());
        }
        self.constants += step.fixed_rows::<CONSTANTS>(n);
        for (track, part) in self.tracks.iter_mut().zip(eliminated) {
            let Some(part) = part else { continue };
            let mut rest = part.vector;
            for (k, block) in &part.blocks {
                rest -= block.tr_mul(&step.fixed_rows::<POSE_DIM>(POSE_DIM * k));
            }
            track.mean += part.inverse * rest;
        }
    }
}

fn add_block(
    precision: &mut DMatrix<f64>,
    vector: &mut DVector<f64>,
    residual: &PoseStep,
    own: &[(usize, PoseMatrix)],
    n: usize,
    constants: &SMatrix<f64, POSE_DIM, CONSTANTS>,
) {
    for (at, jacobian) in own {
        let mut rows = vector.fixed_rows_mut::<POSE_DIM>(*at);
        rows -= jacobian.tr_mul(residual);
        let mut block = precision.fixed_view_mut::<POSE_DIM, POSE_DIM>(*at, *at);
        block += jacobian.tr_mul(jacobian);
        let cross = jacobian.tr_mul(constants);
        let mut block = precision.fixed_view_mut::<POSE_DIM, CONSTANTS>(*at, n);
        block += cross;
        let mut block = precision.fixed_view_mut::<CONSTANTS, POSE_DIM>(n, *at);
        block += cross.transpose();
    }
    let mut rows = vector.fixed_rows_mut::<CONSTANTS>(n);
    rows -= constants.tr_mul(residual);
    let mut block = precision.fixed_view_mut::<CONSTANTS, CONSTANTS>(n, n);
    block += constants.tr_mul(constants);
}

/// Angular velocities, world axes, of heading, roll and pitch, as columns in the order of the pose tangent.
fn attitude_rates(pose: &CameraPose) -> Matrix3<f64> {
    let (sin, cos) = pose.phi.sin_cos();
    let (sin_pitch, cos_pitch) = pose.pitch.sin_cos();
    Matrix3::from_columns(&[
        Vector3::z(),
        Vector3::new(cos * cos_pitch, sin * cos_pitch, -sin_pitch),
        Vector3::new(-sin, cos, 0.0),
    ])
}

/// The landmarks that score in the window, with their Gaussians at its beginning or after their first sighting.
fn tracks(
    start: &Particle,
    end: &Particle,
    steps: &[Arc<WindowStep>],
    depth: InverseDepthPrior,
) -> Vec<Track> {
    let mut tracks: BTreeMap<u32, Track> = BTreeMap::new();
    for (k, step) in steps.iter().enumerate() {
        for m in &step.observation.matches {
            if m.scoring == Scoring::MapOnly {
                continue;
            }
            let track = match tracks.entry(m.id) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(vacant) => {
                    let Some(mut track) = Track::new(start.map.get(m.id), m.prototype, depth)
                    else {
                        continue;
                    };
                    if let Some(landmark) = end.map.get(m.id) {
                        track.mean = landmark.mean;
                    }
                    vacant.insert(track)
                }
            };
            track.sightings.push(TrackSighting {
                step: k,
                pixel: m.pixel,
                variance_px2: m.variance_px2,
            });
        }
    }
    tracks.into_values().collect()
}

impl Track {
    /// The landmark as the map at the beginning has it, or as its first sighting left it, without the prior of its depth;
    /// `None` when it is neither or its covariance is singular.
    fn new(
        known: Option<&Landmark>,
        prototype: Option<Landmark>,
        depth: InverseDepthPrior,
    ) -> Option<Self> {
        let landmark = known.copied().or(prototype)?;
        let mut prior_information = landmark.covariance.cholesky()?.inverse();
        let mut prior_vector = prior_information * landmark.mean;
        if landmark.anchor().is_some() {
            // Hundreds of landmarks that share a guess of the depth would set the scale.
            let (guess, weight) = if known.is_some() {
                (depth.mean, 1.0 / (depth.sigma * depth.sigma))
            } else {
                (landmark.mean.z, 1.0 / landmark.covariance[(2, 2)])
            };
            let taken = weight.min(prior_information[(2, 2)]) * (1.0 - LEFT_OF_DEPTH);
            prior_information[(2, 2)] -= taken;
            prior_vector.z -= taken * guess;
        }
        Some(Self {
            anchor: landmark.anchor(),
            prior_information,
            prior_vector,
            mean: landmark.mean,
            sightings: Vec::new(),
        })
    }
}
