//! The local batch against a dense oracle without elimination, and the smoothed path against the mean of that oracle.

use crate::filter::pixel_noise::PixelNoise;
use std::sync::Arc;

use crate::filter::fixed_lag::FixedLag;
use crate::filter::landmark::{InverseDepthPrior, Landmark, Parametrisation};
use crate::filter::local_batch::segment_gaussian;
use crate::filter::mapping::Mapping;
use crate::filter::motion::{CONSTANTS, CarrierModel};
use crate::filter::observation::{FrameObservation, MatchedFeature, Scoring};
use crate::filter::particle::Particle;
use crate::filter::pose::{CameraPose, POSE_DIM, PoseStep};
use crate::filter::segment::{SegmentDriver, WindowStep, recent_poses};
use crate::method::LandmarkStart;
use crate::rig::Rig;
use estimation_base::Manifold;
use mono_geometry::inverse_depth::{LandmarkGeometry, first_sighting};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Vector2, Vector3};
use rbpf_core::MapUpdate as _;
use ukf::SigmaPoints;

use super::common::*;

const SIGMA_PX: f64 = 0.1;
pub(super) const STEPS: usize = 4;
const DEPTH: InverseDepthPrior = InverseDepthPrior {
    mean: 0.5,
    sigma: 0.05,
};
/// Information about an inverse depth that the local batch leaves, about infinity, as a share of that of the prior.
const LEFT_OF_DEPTH: f64 = 1e-3;

/// A start with its first keyframe and the keyframes of a drive past twelve points: four are known as points, four are
/// open depths anchored in the start, and four are first seen in the window. A lens has stretched the noise of most.
pub(super) struct Drive {
    pub(super) rig: Rig,
    pub(super) start: Particle,
    pub(super) steps: Vec<Arc<WindowStep>>,
    poses: Vec<CameraPose>,
    /// Parameters of the landmarks at the beginning, with the information about them that the batch uses.
    landmarks: Vec<(Landmark, Matrix3<f64>)>,
}

pub(super) fn carrier() -> CarrierModel {
    CarrierModel {
        tilt_sigma: 2e-4,
        slope_sigma: 2e-3,
        ..planar_carrier()
    }
}

pub(super) fn mapping(rig: &Rig) -> Mapping<'_> {
    Mapping {
        rig,
        points: SigmaPoints::default(),
        start: LandmarkStart::SecondSighting,
        frozen: false,
    }
}

fn observation(
    control: crate::odometry::Control,
    matches: Vec<MatchedFeature>,
) -> FrameObservation {
    FrameObservation {
        control,
        matches,
        initialised: Vec::new(),
        removed: Vec::new(),
    }
}

fn open_landmark(anchor: u32, pixel: &Vector2<f64>) -> (Landmark, Matrix3<f64>) {
    let (mean, covariance) = first_sighting(&PINHOLE, pixel, SIGMA_PX, DEPTH.mean, DEPTH.sigma);
    let mut information = covariance.try_inverse().unwrap();
    information[(2, 2)] *= LEFT_OF_DEPTH;
    let landmark = Landmark {
        parametrisation: Parametrisation::InverseDepth { anchor },
        mean,
        covariance,
    };
    (landmark, information)
}

pub(super) fn drive(seed: u64) -> Drive {
    let mut rng = rng(seed);
    let rig = rig();
    let mut start = particle(pose(0.0, 0.0, 0.2));
    let Ok(()) = mapping(&rig).update_map(
        &mut start,
        &observation(control([0.0; 3], [0.0; 3]), Vec::new()),
    );
    let u = control([0.1, 0.0, 0.01], [1e-3, 5e-4, 1e-3]);
    let mut poses = Vec::new();
    let mut now = particle(start.pose);
    for _ in 0..STEPS {
        let prior = carrier().prior(&rig.lever_m(), &now.departure(), &u);
        let step = prior.factor * PoseStep::from_fn(|_, _| normal(&mut rng));
        now.pose = prior.mean.retract(&step);
        poses.push(now.pose);
    }
    let anchor = start.pose.place(&rig);
    let truth: Vec<Vector3<f64>> = (0..12)
        .map(|_| {
            let seen = Vector3::new(
                uniform(&mut rng, -0.5, 0.5),
                uniform(&mut rng, -0.4, 0.4),
                uniform(&mut rng, 1.8, 2.2),
            );
            anchor.centre + anchor.camera_from_world.tr_mul(&seen)
        })
        .collect();
    // Within a standard deviation, so that no residual reaches the bend of Huber's function.
    let mut pixel = |pose: &CameraPose, x: &Vector3<f64>, root: &Matrix2<f64>| {
        let exact = LandmarkGeometry::Point
            .ray(x)
            .project(&PINHOLE, &pose.place(&rig))
            .unwrap();
        exact + root * Vector2::from_fn(|_, _| uniform(&mut rng, -1.0, 1.0))
    };
    let round = noise_root(SIGMA_PX, 0);
    let mut landmarks = Vec::new();
    for (id, x) in truth.iter().enumerate() {
        landmarks.push(match id {
            0..4 => {
                let variance = Matrix3::from_diagonal(&Vector3::new(1e-6, 4e-6, 1e-6));
                (point(*x, variance), variance.try_inverse().unwrap())
            }
            4..8 => open_landmark(0, &pixel(&start.pose, x, &round)),
            _ => open_landmark(1, &pixel(&poses[0], x, &round)),
        });
        if id < 8 {
            start.map.insert(id as u32, landmarks[id].0);
        }
    }
    let steps = (0..STEPS)
        .map(|k| {
            let first = if k == 0 { 8 } else { 12 };
            let matches = (0..first)
                .map(|id| (id, noise_root(SIGMA_PX, id as u32)))
                .map(|(id, root)| MatchedFeature {
                    id: id as u32,
                    pixel: pixel(&poses[k], &truth[id], &root),
                    noise: noise_of(&root),
                    scoring: Scoring::Full,
                    prototype: (k == 1 && id >= 8).then_some(landmarks[id].0),
                })
                .collect();
            Arc::new(WindowStep {
                observation: observation(u, matches),
                carrier: carrier(),
            })
        })
        .collect();
    Drive {
        rig,
        start,
        steps,
        poses,
        landmarks,
    }
}

impl Drive {
    /// Whitened residuals of poses (as tangents at the true ones) and landmark parameters, all in one vector.
    fn residuals(&self, unknowns: &DVector<f64>) -> DVector<f64> {
        let poses: Vec<CameraPose> = self
            .poses
            .iter()
            .enumerate()
            .map(|(k, p)| p.retract(&unknowns.fixed_rows::<6>(6 * k).into_owned()))
            .collect();
        let parameters =
            |id: usize| -> Vector3<f64> { unknowns.fixed_rows::<3>(6 * STEPS + 3 * id).into() };
        let mut residuals = Vec::new();
        let mut from = particle(self.start.pose);
        for (step, pose) in self.steps.iter().zip(&poses) {
            let prior = step.carrier.prior(
                &self.rig.lever_m(),
                &from.departure(),
                &step.observation.control,
            );
            let whitened = prior
                .factor
                .solve_lower_triangular(&prior.mean.local(pose))
                .unwrap();
            residuals.extend(whitened.iter());
            from.pose = *pose;
        }
        for (id, (landmark, information)) in self.landmarks.iter().enumerate() {
            let root = information.map(f64::sqrt);
            let mut mean = landmark.mean;
            if landmark.anchor().is_some() {
                mean.z = 0.0;
            }
            residuals.extend((root * (parameters(id) - mean)).iter());
        }
        for (step, pose) in self.steps.iter().zip(&poses) {
            for m in &step.observation.matches {
                let id = m.id as usize;
                let geometry = match self.landmarks[id].0.anchor() {
                    None => LandmarkGeometry::Point,
                    Some(0) => LandmarkGeometry::InverseDepth {
                        anchor: self.start.pose.place(&self.rig),
                    },
                    Some(_) => LandmarkGeometry::InverseDepth {
                        anchor: poses[0].place(&self.rig),
                    },
                };
                let seen = geometry
                    .ray(&parameters(id))
                    .project(&PINHOLE, &pose.place(&self.rig))
                    .unwrap();
                let root = noise_root(SIGMA_PX, m.id);
                residuals.extend((root.try_inverse().unwrap() * (seen - m.pixel)).iter());
            }
        }
        DVector::from_vec(residuals)
    }

    /// Mean (tangents at the true poses) and covariance of the stacked poses, by Gauss-Newton with difference quotients.
    fn oracle(&self) -> (DVector<f64>, DMatrix<f64>) {
        let n = 6 * STEPS + 3 * self.landmarks.len();
        let mut unknowns = DVector::zeros(n);
        for (id, (landmark, _)) in self.landmarks.iter().enumerate() {
            unknowns
                .fixed_rows_mut::<3>(6 * STEPS + 3 * id)
                .copy_from(&landmark.mean);
        }
        let mut information = DMatrix::zeros(n, n);
        for _ in 0..6 {
            let residuals = self.residuals(&unknowns);
            let mut jacobian = DMatrix::zeros(residuals.len(), n);
            for i in 0..n {
                let mut step = DVector::zeros(n);
                step[i] = 1e-6;
                let difference =
                    self.residuals(&(&unknowns + &step)) - self.residuals(&(&unknowns - &step));
                jacobian.set_column(i, &(difference / 2e-6));
            }
            information = jacobian.tr_mul(&jacobian);
            let step = information
                .clone()
                .cholesky()
                .unwrap()
                .solve(&jacobian.tr_mul(&residuals));
            unknowns -= step;
        }
        let covariance = information.try_inverse().unwrap();
        let n = 6 * STEPS;
        (
            unknowns.rows(0, n).into_owned(),
            covariance.view((0, 0), (n, n)).into_owned(),
        )
    }

    pub(super) fn driver<'a>(&'a self, mapping: &'a Mapping<'a>) -> SegmentDriver<'a> {
        SegmentDriver {
            rig: &self.rig,
            mapping,
            depth: DEPTH,
        }
    }

    /// Tangents of a path at the true poses.
    fn stacked(&self, path: &[CameraPose]) -> DVector<f64> {
        let mut stacked = DVector::zeros(6 * STEPS);
        for (k, (truth, pose)) in self.poses.iter().zip(path).enumerate() {
            stacked
                .fixed_rows_mut::<POSE_DIM>(6 * k)
                .copy_from(&truth.local(pose));
        }
        stacked
    }
}

/// The particle at the end of the drive, along the true poses.
pub(super) fn driven(drive: &Drive) -> Particle {
    drive
        .driver(&mapping(&drive.rig))
        .drive(&drive.start, &drive.steps, &drive.poses)
}

#[test]
fn val_the_local_batch_is_the_dense_solution() {
    for seed in 0..5 {
        let drive = drive(40 + seed);
        let mapping = mapping(&drive.rig);
        let gaussian = segment_gaussian(
            &drive.driver(&mapping),
            &drive.start,
            &driven(&drive),
            &drive.steps,
        )
        .unwrap();
        let (mean, covariance) = drive.oracle();
        let n = mean.len();
        let factor = gaussian.factor.view((CONSTANTS, CONSTANTS), (n, n));
        let got = (factor * factor.transpose()).try_inverse().unwrap();
        let difference = drive.stacked(&gaussian.mean) - &mean;
        for i in 0..mean.len() {
            let sigma = covariance[(i, i)].sqrt();
            assert!(
                difference[i].abs() < 0.02 * sigma,
                "seed {seed}, unknown {i}: {} of {sigma}",
                difference[i]
            );
            for j in 0..mean.len() {
                let scale = sigma * covariance[(j, j)].sqrt();
                let error = (got[(i, j)] - covariance[(i, j)]).abs() / scale;
                assert!(error < 0.01, "seed {seed}, {i} {j}: {error}");
            }
        }
    }
}

/// Every pose of the window takes the mean given all its images, the first as much as the last: later images reach back.
#[test]
fn particles_take_the_posterior_mean_of_the_whole_window() {
    let drive = drive(50);
    let mapping = mapping(&drive.rig);
    let (origin, end) = (drive.start.snapshot(), driven(&drive));
    let mut particles: Vec<Particle> = (0..4)
        .map(|_| Particle {
            origin: Some(origin.clone()),
            ..end.clone()
        })
        .collect();
    let smoother = FixedLag {
        driver: drive.driver(&mapping),
        steps: &drive.steps,
        leaving: 0,
    };
    let smoothed = smoother.smooth(&mut particles, &[0.25_f64.ln(); 4]);
    assert!(smoothed.log_increments.iter().all(|i| i.abs() < 1e-9));
    assert_eq!(smoothed.unsettled, 0);
    let (mean, covariance) = drive.oracle();
    for p in &particles {
        assert_eq!(p.pose, p.path.last().unwrap().pose);
        let off = drive.stacked(&recent_poses(p, STEPS)) - &mean;
        for i in 0..mean.len() {
            let sigma = covariance[(i, i)].sqrt();
            assert!(off[i].abs() < 0.02 * sigma, "{i}: {} of {sigma}", off[i]);
        }
        assert!(p.map.get(11).is_some(), "landmarks of the window");
    }
}

#[test]
fn a_family_shares_the_mean_of_its_weights() {
    let drive = drive(51);
    let mapping = mapping(&drive.rig);
    let (one, other) = (drive.start.snapshot(), drive.start.snapshot());
    let mut particles: Vec<Particle> = [Some(&one), Some(&one), Some(&other), None]
        .into_iter()
        .map(|origin| {
            let mut p = driven(&drive);
            p.origin = origin.cloned();
            p
        })
        .collect();
    let weights = [0.1, 0.3, 0.4, 0.2_f64];
    let smoother = FixedLag {
        driver: drive.driver(&mapping),
        steps: &drive.steps,
        leaving: 0,
    };
    let smoothed = smoother.smooth(&mut particles, &weights.map(f64::ln));
    let after: Vec<f64> = weights
        .iter()
        .zip(&smoothed.log_increments)
        .map(|(w, i)| w * i.exp())
        .collect();
    for (got, expected) in after.iter().zip([0.2, 0.2, 0.4, 0.2]) {
        assert!((got - expected).abs() < 1e-12, "{after:?}");
    }
    // A particle without an earlier state keeps its path.
    assert_eq!(particles[3].pose, drive.poses[STEPS - 1]);
    assert_eq!(particles[0].pose, particles[1].pose);
    assert_ne!(particles[0].pose, drive.poses[STEPS - 1]);
}

#[test]
fn a_window_without_a_solution_is_counted_and_leaves_its_particles() {
    let drive = drive(52);
    let mapping = mapping(&drive.rig);
    let mut steps = drive.steps.clone();
    Arc::make_mut(&mut steps[1]).observation.matches[0].pixel.x = f64::NAN;
    let mut particle = driven(&drive);
    particle.origin = Some(drive.start.snapshot());
    let mut particles = [particle.clone(), particle];
    let smoother = FixedLag {
        driver: drive.driver(&mapping),
        steps: &steps,
        leaving: 0,
    };
    let smoothed = smoother.smooth(&mut particles, &[0.5_f64.ln(); 2]);
    assert_eq!(smoothed.unsettled, 1);
    assert_eq!(smoothed.log_increments, [0.0; 2]);
    for p in &particles {
        assert_eq!(p.pose, drive.poses[STEPS - 1]);
    }
}

/// The map of a smoothed path against the map that the landmark filters make along the same path, which knows nothing of the batch.
#[test]
fn val_the_map_of_a_smoothed_path_is_that_of_a_drive_along_it() {
    let drive = drive(53);
    let mapping = mapping(&drive.rig);
    let mut particle = driven(&drive);
    let origin = drive.start.snapshot();
    particle.origin = Some(origin.clone());
    let mut particles = [particle];
    let smoother = FixedLag {
        driver: drive.driver(&mapping),
        steps: &drive.steps,
        leaving: 0,
    };
    let smoothed = smoother.smooth(&mut particles, &[0.0]);
    assert_eq!(smoothed.unsettled, 0);
    let [found] = particles;
    let poses = recent_poses(&found, STEPS);
    assert_ne!(poses, drive.poses);
    let expected = smoother.driver.drive(&origin, &drive.steps, &poses);
    assert_eq!(found.path.len(), expected.path.len());
    assert_eq!(found.pose, expected.pose);
    assert_eq!(found.metric, expected.metric);
    for id in 0..12 {
        let (got, expected) = (found.map.get(id).unwrap(), expected.map.get(id).unwrap());
        assert_eq!(got.parametrisation, expected.parametrisation);
        for axis in 0..3 {
            let sigma = expected.covariance[(axis, axis)].sqrt();
            let off = (got.mean[axis] - expected.mean[axis]) / sigma;
            assert!(off.abs() < 0.1, "landmark {id}, axis {axis}: {off} sigmas");
            let ratio = got.covariance[(axis, axis)].sqrt() / sigma;
            assert!(
                (ratio - 1.0).abs() < 0.02,
                "landmark {id}, axis {axis}: {ratio}"
            );
        }
    }
}

/// The state at which the next window begins lies on the mean path, and a family has one; without a solution, on the path of the
/// likeliest of the family.
#[test]
fn origins_move_on_along_the_mean() {
    let drive = drive(54);
    let mapping = mapping(&drive.rig);
    let origin = drive.start.snapshot();
    let family = || {
        [0.2, 0.8].map(|stretch| {
            let mut poses = drive.poses.clone();
            poses[0].centre.x += 1e-3 * stretch;
            let driver = drive.driver(&mapping);
            Particle {
                origin: Some(origin.clone()),
                ..driver.drive(&drive.start, &drive.steps, &poses)
            }
        })
    };
    let mut blind = drive.steps.clone();
    for step in &mut blind {
        Arc::make_mut(step).observation.matches.clear();
    }
    for steps in [&drive.steps, &blind] {
        let before = family();
        let mut particles = before.clone();
        let smoother = FixedLag {
            driver: drive.driver(&mapping),
            steps,
            leaving: 2,
        };
        let log_weights = [0.4_f64.ln(), 0.6_f64.ln()];
        let smoothed = smoother.smooth(&mut particles, &log_weights);
        assert_eq!(smoothed.unsettled, 0);
        let [first, second] = particles.map(|p| (p.origin.clone().unwrap(), p));
        assert!(Arc::ptr_eq(&first.0, &second.0));
        let on = if smoothed.covariance.is_some() {
            &first.1
        } else {
            &before[1]
        };
        assert_eq!(first.0.path.len(), 3);
        for k in 0..3 {
            let (found, expected) = (first.0.path.get(k), on.path.get(k));
            assert_eq!(found.map(|f| f.pose), expected.map(|e| e.pose));
        }
    }
}

/// Wheels that tell little and a guess whose path is too short by a third and bent: the images want all of it back in one step.
/// Landmarks that follow such a step to first order only are then off their valley, the cost rises although the poses are better,
/// and the iteration creeps.
#[test]
fn regress_a_window_that_starts_far_off_settles() {
    let mut rng = rng(55);
    let rig = rig();
    let mapping = mapping(&rig);
    let start_pose = pose(0.0, 0.0, 0.2);
    let mut start = particle(start_pose);
    let Ok(()) = mapping.update_map(
        &mut start,
        &observation(control([0.0; 3], [0.0; 3]), Vec::new()),
    );
    let u = control([0.1, 0.0, 0.0], [3e-2, 5e-4, 3e-2]);
    let along = |stretch: f64, bend: f64| -> Vec<CameraPose> {
        (1..=8)
            .map(|k| {
                let (k, mut pose) = (f64::from(k), start_pose);
                pose.centre.x += 0.1 * stretch * k * start_pose.phi.cos();
                pose.centre.y += 0.1 * stretch * k * start_pose.phi.sin();
                pose.phi += bend * k;
                pose
            })
            .collect()
    };
    let truth = along(1.0, 0.0);
    let anchor = start_pose.place(&rig);
    let points: Vec<Vector3<f64>> = (0..80)
        .map(|_| {
            let seen = Vector3::new(
                uniform(&mut rng, -0.6, 0.6),
                uniform(&mut rng, -0.4, 0.4),
                uniform(&mut rng, 1.5, 4.0),
            );
            anchor.centre + anchor.camera_from_world.tr_mul(&seen)
        })
        .collect();
    let seen = |pose: &CameraPose, x: &Vector3<f64>| {
        LandmarkGeometry::Point
            .ray(x)
            .project(&PINHOLE, &pose.place(&rig))
            .unwrap()
    };
    let steps: Vec<Arc<WindowStep>> = truth
        .iter()
        .enumerate()
        .map(|(k, pose)| {
            let matches = points
                .iter()
                .enumerate()
                .map(|(id, x)| MatchedFeature {
                    id: id as u32,
                    pixel: seen(pose, x),
                    noise: PixelNoise::round(SIGMA_PX),
                    scoring: Scoring::Full,
                    prototype: (k == 0).then(|| open_landmark(0, &seen(&start_pose, x)).0),
                })
                .collect();
            Arc::new(WindowStep {
                observation: observation(u, matches),
                carrier: carrier(),
            })
        })
        .collect();
    let driver = SegmentDriver {
        rig: &rig,
        mapping: &mapping,
        depth: DEPTH,
    };
    let guess = driver.drive(&start, &steps, &along(0.67, 0.02));
    let gaussian = segment_gaussian(&driver, &start, &guess, &steps).unwrap();
    for (k, (got, truth)) in gaussian.mean.iter().zip(&truth).enumerate() {
        // The shape of the path is seen; its length is that of the wheels, 3 cm a step.
        assert!((got.phi - truth.phi).abs() < 1e-3, "{got:?}");
        let off = got.centre - truth.centre;
        let (sin, cos) = truth.phi.sin_cos();
        assert!((cos * off.y - sin * off.x).abs() < 1e-3, "{got:?}");
        let length_sigma = 0.03 * ((k + 1) as f64).sqrt();
        assert!((cos * off.x + sin * off.y).abs() < length_sigma, "{got:?}");
    }
}

/// Where residuals lie at the bend of Huber's function, steps about the solution promise a little and keep none of it; one such
/// window in twelve was taken for one without a solution.
#[test]
fn regress_a_window_with_wrong_matches_settles() {
    for seed in 0..200 {
        let drive = drive(1000 + seed);
        let mut rng = rng(seed);
        let mut steps = drive.steps.clone();
        for step in &mut steps {
            for m in &mut Arc::make_mut(step).observation.matches {
                let turn = uniform(&mut rng, -3.0, 3.0);
                let far = uniform(&mut rng, 0.0, 60.0) * SIGMA_PX;
                m.pixel += Vector2::new(turn.cos(), turn.sin()) * far;
            }
        }
        let settled = segment_gaussian(
            &drive.driver(&mapping(&drive.rig)),
            &drive.start,
            &driven(&drive),
            &steps,
        );
        assert!(settled.is_some(), "seed {seed}");
    }
}
