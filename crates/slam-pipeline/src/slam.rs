//! The frame loop: features and odometry in, pose and map out.
//!
//! Every frame is associated with the map in the best particle. A frame that
//! moved far enough, saw too little of the last step, or waited too long is a
//! *keyframe*: a filter step of all particles in the order propose, weight,
//! resample, evolve, update the map, start landmarks. The frames between only
//! refine the pose that is reported: their baseline is too short to tell depth.

use mono_geometry::{Camera, Se2};
use nalgebra::{Matrix3, Vector2, Vector3};
use rbpf_core::{
    FilterConfig, ParticleFilter, ParticleSet, RejuvenationSchedule, Resampler, Streams,
};
use thiserror::Error;
use ukf::SigmaPoints;
use vision_sift::Features;

use crate::config::{Method, ValidConfig};
use crate::filter::drift::{Drift, Support};
use crate::filter::evolution::{Evolution, Operators};
use crate::filter::landmark::{Landmark, Lens};
use crate::filter::landmark_update::LandmarkUpdate;
use crate::filter::likelihood::Likelihood;
use crate::filter::linearised::PosePosterior;
use crate::filter::mapping::Mapping;
use crate::filter::motion::{CarrierModel, Control, MotionPrior};
use crate::filter::observation::{
    FrameObservation, Initialisation, MatchedFeature, Prepared, Scoring,
};
use crate::filter::particle::{MetricState, Particle};
use crate::filter::pose::CameraPose;
use crate::filter::proposal::{PoseProposal, ProposalKind};
use crate::frontend::association::{Association, AssociationParams, Pair, associate};
use crate::frontend::catalogue::{Catalogue, Sighting, Stage};
use crate::frontend::frame::FrameFeatures;
use crate::odometry::{Odometer, OdometryInterval};
use crate::record::{KeypointFate, LandmarkRecord, PlanarPose};
use crate::stopwatch::{Clock, Lap};

/// Why a frame could not be processed.
#[derive(Debug, Error)]
pub enum SlamError {
    /// The particle filter refused a step.
    #[error("frame {frame}: {source}")]
    Filter {
        /// Frame index.
        frame: usize,
        /// What the filter said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The descriptor index refused an operation.
    #[error(transparent)]
    Index(#[from] feature_kdtree::IndexError),
    /// Odometry that is not a number.
    #[error(transparent)]
    Odometry(#[from] mono_geometry::GeometryError),
}

/// One frame, detected.
#[derive(Debug)]
pub struct FrameInput<'a> {
    /// Keypoints and descriptors.
    pub features: &'a Features,
    /// Odometry since the previous frame.
    pub odometry: &'a [OdometryInterval],
}

/// What became of a frame.
#[derive(Debug, Clone)]
pub struct FrameOutcome {
    /// Filtered body pose, metres and radians.
    pub pose: PlanarPose,
    /// Its covariance over (x, y, phi).
    pub covariance: Matrix3<f64>,
    /// Whether it was a filter step.
    pub keyframe: bool,
    /// Accepted matches.
    pub matches: usize,
    /// Rejected matches.
    pub outliers: usize,
    /// Landmarks that entered the map.
    pub new_landmarks: usize,
    /// Landmarks in the map.
    pub landmarks: usize,
    /// Effective number of particles before resampling.
    pub n_eff: f64,
    /// Distinct origins among the particles.
    pub unique_ancestors: usize,
    /// Whether the step resampled.
    pub resampled: bool,
    /// Share of evolution moves accepted.
    pub es_acceptance: Option<f64>,
    /// Mean normalised innovation squared per degree of freedom.
    pub nis: Option<f64>,
    /// Fate of each keypoint, with the predicted ideal pixel of its landmark.
    pub fates: Vec<(KeypointFate, Option<Vector2<f64>>)>,
    /// What went not as usual.
    pub notes: Vec<String>,
    /// Milliseconds: association, proposal, evolution, mapping.
    pub laps_ms: [f64; 4],
}

/// The SLAM system.
pub struct Slam {
    camera: Camera,
    config: ValidConfig,
    proposal: PoseProposal,
    evolution: Evolution,
    mapping: Mapping,
    association: AssociationParams,
    filter: ParticleFilter<Particle>,
    catalogue: Catalogue,
    odometer: Odometer,
    drift: Drift,
    frame: usize,
    keyframe: u32,
    matches_at_keyframe: usize,
    frames_since_keyframe: u32,
    last_outcome: (PlanarPose, Matrix3<f64>),
    /// Body motion of each frame since its keyframe: (keyframe, motion).
    relative: Vec<(u32, Se2)>,
}

impl core::fmt::Debug for Slam {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Slam")
            .field("frame", &self.frame)
            .field("keyframe", &self.keyframe)
            .field("landmarks", &self.catalogue.mapped())
            .finish_non_exhaustive()
    }
}

impl Slam {
    /// A system at the origin with an empty map.
    ///
    /// `body_from_camera` is the mount's rotation, `position_in_body` its
    /// position in metres.
    ///
    /// # Errors
    /// [`SlamError::Filter`] for a filter that cannot be built.
    pub fn new(
        camera: Camera,
        body_from_camera: &Matrix3<f64>,
        position_in_body: &Vector3<f64>,
        config: &ValidConfig,
    ) -> Result<Self, SlamError> {
        let pinhole = *camera.pinhole();
        let method = config.filter.method;
        let exact = method == Method::Novel;
        let lens = Lens {
            focal: Vector2::new(pinhole.fx, pinhole.fy),
            centre: Vector2::new(pinhole.cx, pinhole.cy),
        };
        let image_size = Vector2::new(pinhole.width as f64, pinhole.height as f64);
        let likelihood = Likelihood {
            lens,
            body_from_camera: *body_from_camera,
            outlier_share: config.association.outlier_share,
            image_area_px2: image_size.x * image_size.y,
            as_printed: method == Method::Paper,
        };
        let lever_m = Vector2::new(position_in_body.x, position_in_body.y);
        // The nuisance states and the marginalised scale belong to the exact filter.
        let on = |v: f64| if exact { v } else { 0.0 };
        let carrier = CarrierModel {
            lever_m,
            tilt_sigma: on(config.carrier.tilt_sigma),
            tilt_time_s: config.carrier.tilt_time_s,
            slope_sigma: on(config.carrier.slope_sigma),
            scale_drift: on(config.carrier.scale_drift),
            scale_sigma: on(config.carrier.scale_sigma),
        };
        let start = Particle::new(
            CameraPose {
                centre: *position_in_body,
                phi: 0.0,
                roll: 0.0,
                pitch: 0.0,
            },
            MetricState::new(carrier.scale_sigma),
        );
        let set = ParticleSet::new(vec![start; config.filter.particles as usize])
            .map_err(|e| filter_error(0, e))?;
        let filter = ParticleFilter::new(
            set,
            Streams::new(config.filter.seed),
            FilterConfig {
                resampler: Resampler::Systematic,
                // The conventional filter of the comparison resamples every step.
                resampling_threshold: if method == Method::Conventional {
                    1.0
                } else {
                    config.filter.resampling_threshold
                },
                rejuvenation: RejuvenationSchedule::AfterResampling,
            },
        )
        .map_err(|e| filter_error(0, e))?;
        Ok(Self {
            proposal: PoseProposal {
                carrier,
                likelihood,
                kind: if method == Method::Conventional {
                    ProposalKind::Motion
                } else {
                    ProposalKind::Unscented {
                        iterations: config.filter.iterations as usize,
                    }
                },
                likelihood_only: method != Method::Novel,
            },
            evolution: Evolution {
                operators: match method {
                    Method::Novel => Operators::Exact,
                    Method::Paper => Operators::Paper,
                    Method::Conventional => Operators::Off,
                },
                steps: config.filter.evolution_steps as usize,
                likelihood,
            },
            mapping: Mapping {
                body_from_camera: *body_from_camera,
                update: LandmarkUpdate {
                    lens,
                    points: if method == Method::Paper {
                        SigmaPoints::paper()
                    } else {
                        SigmaPoints::default()
                    },
                },
                delayed: (!exact).then_some(config.mapping.min_parallax),
            },
            association: AssociationParams {
                ratio: config.association.ratio,
                gate: config.association.gate,
                guided_distance_squared: (config.association.guided_distance
                    * config.association.guided_distance)
                    as u32,
                guided_ratio: config.association.guided_ratio,
                open_depth: config.mapping.open_depth,
                sigma_px: config.features.sigma_px,
                iterations: config.filter.iterations as usize,
                image_size,
            },
            catalogue: Catalogue::new()?,
            odometer: Odometer::new(&config.odometry),
            drift: Drift::default(),
            camera,
            config: config.clone(),
            filter,
            frame: 0,
            keyframe: 0,
            matches_at_keyframe: 0,
            frames_since_keyframe: 0,
            last_outcome: (
                PlanarPose {
                    x: 0.0,
                    y: 0.0,
                    phi: 0.0,
                },
                Matrix3::zeros(),
            ),
            relative: Vec::new(),
        })
    }

    /// Processes the next frame.
    ///
    /// # Errors
    /// [`SlamError`]; the system must not be used after it.
    pub fn step(
        &mut self,
        input: &FrameInput<'_>,
        clock: &Clock<'_>,
    ) -> Result<FrameOutcome, SlamError> {
        let mut lap = Lap::start(clock);
        for interval in input.odometry {
            self.odometer.push(interval)?;
        }
        let frame = FrameFeatures::new(input.features, &self.camera);
        let control = self.odometer.control();
        let reference = self.filter.set().particles()[self.filter.set().best()].clone();
        let prior = self.proposal.carrier.prior(&reference, &control);
        let association = associate(
            &frame,
            &self.catalogue,
            &reference,
            &prior,
            &self.proposal.likelihood,
            &self.association,
        );
        self.frames_since_keyframe += 1;
        let keyframe = self.frame == 0 || self.is_keyframe(&association);
        let mut outcome = FrameOutcome {
            pose: self.last_outcome.0,
            covariance: self.last_outcome.1,
            keyframe,
            matches: association.inliers.len(),
            outliers: association.outliers.len(),
            new_landmarks: 0,
            landmarks: 0,
            n_eff: self.filter.set().effective_count(),
            unique_ancestors: 0,
            resampled: false,
            es_acceptance: None,
            nis: mean_nis(&association),
            fates: fates(input.features.keypoints.len(), &association),
            notes: Vec::new(),
            laps_ms: [lap.lap_ms(), 0.0, 0.0, 0.0],
        };
        if keyframe {
            self.filter_step(
                &frame,
                &association,
                &reference,
                &prior,
                control,
                &mut outcome,
                &mut lap,
                clock,
            )?;
        } else {
            let motion = relative_motion(&reference, &prior, &association.posterior);
            self.relative.push((self.keyframe - 1, motion));
            self.report_between(&reference, &prior, &association.posterior, motion, &mut outcome);
            outcome.laps_ms[1] = lap.lap_ms();
        }
        if association.inliers.is_empty() && self.frame > 0 {
            outcome.notes.push("no match: odometry only".to_owned());
        }
        outcome.landmarks = self.catalogue.mapped();
        let mut origins = self.filter.set().origins().to_vec();
        origins.dedup();
        outcome.unique_ancestors = origins.len();
        self.frame += 1;
        Ok(outcome)
    }

    fn is_keyframe(&self, association: &Association) -> bool {
        let settings = &self.config.keyframes;
        if self.frames_since_keyframe >= settings.max_gap
            || (association.inliers.len() as f64)
                < settings.min_overlap * self.matches_at_keyframe as f64
        {
            return true;
        }
        let mut flow: Vec<f64> = association
            .inliers
            .iter()
            .filter_map(|p| {
                let entry = self.catalogue.get(p.feature.id)?;
                (entry.last.keyframe + 1 == self.keyframe)
                    .then(|| (p.feature.pixel - entry.last.pixel).norm())
            })
            .collect();
        if flow.is_empty() {
            return true;
        }
        let middle = flow.len() / 2;
        *flow.select_nth_unstable_by(middle, f64::total_cmp).1 >= settings.min_flow_px
    }

    fn filter_step(
        &mut self,
        frame: &FrameFeatures<'_>,
        association: &Association,
        reference: &Particle,
        prior: &MotionPrior,
        control: Control,
        outcome: &mut FrameOutcome,
        lap: &mut Lap<'_>,
        clock: &Clock<'_>,
    ) -> Result<(), SlamError> {
        let removed = self.update_belief(association);
        let mut matches: Vec<_> = association.inliers.iter().map(|p| p.feature).collect();
        spread_scoring(
            &mut matches,
            self.config.association.max_scored as usize,
            &self.association.image_size,
        );
        let support = self.support(reference, prior, association, &matches);
        let initialised = self.ready_for_two_views(association);
        for m in &matches {
            let promoted = self.mapping.delayed.is_none()
                || initialised.iter().any(|i: &Initialisation| i.id == m.id);
            if m.prototype.is_some() && promoted {
                self.catalogue.promote(m.id);
                outcome.new_landmarks += 1;
            }
        }
        let observation = FrameObservation {
            control,
            matches,
            initialised,
            removed,
        };
        if self.frame > 0 {
            let timed = self.evolution.timed(clock);
            let report = self
                .filter
                .step(self.frame as u64, &observation, &self.proposal, &timed, &self.mapping)
                .map_err(|e| filter_error(self.frame, e))?;
            outcome.n_eff = report.n_eff;
            outcome.resampled = report.resampled();
            outcome.es_acceptance = report.rejuvenation.acceptance();
            outcome.laps_ms[1..].copy_from_slice(&timed.split(lap));
        } else {
            use rbpf_core::MapUpdate;
            for particle in self.filter.particles_mut() {
                let Ok(()) = self.mapping.update_map(particle, &observation);
            }
        }
        for id in &observation.removed {
            self.catalogue.remove(*id);
        }
        for pair in &association.inliers {
            let direction = association
                .in_view
                .get(&pair.feature.id)
                .map_or_else(Vector3::zeros, |p| p.direction);
            self.catalogue.record_sighting(
                pair.feature.id,
                &frame.features.descriptors[pair.keypoint],
                Sighting {
                    keyframe: self.keyframe,
                    pixel: pair.feature.pixel,
                },
                direction,
            )?;
        }
        self.start_features(frame, association, outcome)?;
        self.catalogue.forget_tentative_before(
            self.keyframe
                .saturating_sub(self.config.mapping.tentative_keyframes - 1),
        );
        let (pose, mut covariance) = self.estimate();
        let drift = self.drift.push(
            Vector2::new(pose.x, pose.y),
            support.as_ref(),
            &control.covariance,
        );
        if self.mapping.delayed.is_none() {
            covariance += drift;
        }
        outcome.pose = pose;
        outcome.covariance = covariance;
        self.last_outcome = (pose, covariance);
        self.relative.push((self.keyframe, Se2::identity()));
        self.keyframe += 1;
        self.matches_at_keyframe = association.inliers.len();
        self.frames_since_keyframe = 0;
        self.odometer.reset();
        outcome.laps_ms[3] += lap.lap_ms();
        Ok(())
    }

    /// What the pose of this keyframe leans on, in the reference particle.
    fn support(
        &self,
        reference: &Particle,
        prior: &MotionPrior,
        association: &Association,
        matches: &[MatchedFeature],
    ) -> Option<Support> {
        let anchored: Vec<(u32, Prepared)> = matches
            .iter()
            .filter_map(|m| {
                let landmark = reference.map.get(m.id).or(m.prototype.as_ref())?;
                Some((landmark.anchor()?, association.in_view.get(&m.id)?.measured(m)))
            })
            .collect();
        Support::new(
            &self.proposal.likelihood.lens,
            &self.proposal.likelihood.body_from_camera,
            prior,
            &association.posterior,
            &anchored,
        )
    }

    /// Landmarks predicted in view but not found lose belief; returns those to remove.
    fn update_belief(&mut self, association: &Association) -> Vec<u32> {
        let found: std::collections::BTreeSet<u32> = association
            .inliers
            .iter()
            .chain(&association.outliers)
            .map(|p| p.feature.id)
            .collect();
        let mut removed = Vec::new();
        for (&id, predicted) in &association.in_view {
            if found.contains(&id) {
                continue;
            }
            let comparable = self.catalogue.get(id).is_some_and(|e| {
                e.stage == Stage::Mapped
                    // Beyond twenty degrees SIFT is not expected to find it again.
                    && e.last_direction.dot(&predicted.direction) > 20f64.to_radians().cos()
            });
            if comparable && self.catalogue.record_miss(id) {
                removed.push(id);
            }
        }
        removed
    }

    /// Tentative features matched now whose two views have parallax enough in
    /// the reference particle (delayed methods).
    fn ready_for_two_views(&self, association: &Association) -> Vec<Initialisation> {
        let Some(min_parallax) = self.mapping.delayed else {
            return Vec::new();
        };
        association
            .inliers
            .iter()
            .filter_map(|pair| {
                let entry = self.catalogue.get(pair.feature.id)?;
                let predicted = association.in_view.get(&pair.feature.id)?;
                (entry.stage == Stage::Tentative
                    && predicted.parallax(
                        &pair.feature.pixel,
                        &self.proposal.likelihood.lens,
                        &association.camera,
                    )
                        >= min_parallax)
                    .then_some(Initialisation {
                        id: pair.feature.id,
                        first: (entry.first.keyframe, entry.first.pixel),
                        second: pair.feature.pixel,
                        sigma_px: self.association.sigma_px,
                    })
            })
            .collect()
    }

    fn start_features(
        &mut self,
        frame: &FrameFeatures<'_>,
        association: &Association,
        outcome: &mut FrameOutcome,
    ) -> Result<(), SlamError> {
        let depth_px = &self.proposal.likelihood.lens;
        // Gaussian over inverse depth whose two-sigma interval is (0, 1 / min depth).
        let rho = 0.5 / self.config.mapping.min_depth_m;
        let rho = (rho, 0.5 * rho);
        let taken: std::collections::BTreeSet<usize> = association
            .inliers
            .iter()
            .chain(&association.outliers)
            .map(|p| p.keypoint)
            .collect();
        let mut candidates: Vec<usize> = (0..frame.features.keypoints.len())
            .filter(|k| !taken.contains(k) && frame.ideal[*k].is_some())
            .collect();
        candidates.sort_by(|a, b| {
            let response = |k: usize| frame.features.keypoints[k].response.abs();
            response(*b).total_cmp(&response(*a)).then(a.cmp(b))
        });
        candidates.truncate(self.config.mapping.max_new as usize);
        for k in candidates {
            let Some(pixel) = frame.ideal[k] else { continue };
            let prototype = Landmark::from_first_sighting(
                depth_px,
                self.keyframe,
                &pixel,
                self.association.sigma_px,
                rho,
            );
            self.catalogue.add(
                &frame.features.descriptors[k],
                prototype,
                Sighting {
                    keyframe: self.keyframe,
                    pixel,
                },
            )?;
            outcome.fates[k].0 = KeypointFate::New;
        }
        Ok(())
    }

    /// Weighted mean and covariance of the body pose over the particles, plus
    /// what each particle leaves open and the constant scale error of the wheels.
    fn estimate(&self) -> (PlanarPose, Matrix3<f64>) {
        let set = self.filter.set();
        let weights = set.weights();
        let first = set.particles()[0].pose.phi;
        let mut mean = Vector3::zeros();
        for (w, p) in weights.iter().zip(set.particles()) {
            let turn = mono_geometry::angle::wrap(p.pose.phi - first);
            mean += Vector3::new(p.metric.mean.y, p.metric.mean.z, turn) * *w;
        }
        let mut covariance = Matrix3::zeros();
        for (w, p) in weights.iter().zip(set.particles()) {
            let turn = mono_geometry::angle::wrap(p.pose.phi - first);
            let d = Vector3::new(p.metric.mean.y, p.metric.mean.z, turn) - mean;
            covariance += d * d.transpose() * *w;
            for i in 0..2 {
                for j in 0..2 {
                    covariance[(i, j)] += w * p.metric.covariance[(i + 1, j + 1)];
                }
            }
        }
        let bias = self.config.odometry.scale_bias;
        let along = Vector3::new(mean.x, mean.y, 0.0) * bias;
        covariance += along * along.transpose();
        (
            PlanarPose {
                x: mean.x,
                y: mean.y,
                phi: mono_geometry::angle::wrap(first + mean.z),
            },
            covariance,
        )
    }

    fn report_between(
        &self,
        reference: &Particle,
        prior: &MotionPrior,
        posterior: &PosePosterior,
        motion: Se2,
        outcome: &mut FrameOutcome,
    ) {
        let (pose, covariance) = self.last_outcome;
        let at = Se2::new(pose.x, pose.y, pose.phi);
        let now = at.compose(&motion);
        let (dx, dy) = (now.x - at.x, now.y - at.y);
        let transition = Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0);
        let step = posterior.pose_covariance(prior);
        let s = reference.metric.mean.x;
        let scale = Vector3::new(s, s, 1.0);
        let mut added = Matrix3::zeros();
        for (i, gi) in [0, 1, 3].into_iter().enumerate() {
            for (j, gj) in [0, 1, 3].into_iter().enumerate() {
                added[(i, j)] = step[(gi, gj)] * scale[i] * scale[j];
            }
        }
        outcome.pose = PlanarPose {
            x: now.x,
            y: now.y,
            phi: now.phi,
        };
        outcome.covariance = transition * covariance * transition.transpose() + added;
    }

    /// The whole path of the best particle, one body pose per frame.
    #[must_use]
    pub fn smoothed_path(&self) -> Vec<PlanarPose> {
        let set = self.filter.set();
        let best = &set.particles()[set.best()];
        self.relative
            .iter()
            .filter_map(|(keyframe, motion)| {
                let body = best.path.get(*keyframe as usize)?.body;
                let pose = Se2::new(body.x, body.y, body.phi).compose(motion);
                Some(PlanarPose {
                    x: pose.x,
                    y: pose.y,
                    phi: pose.phi,
                })
            })
            .collect()
    }

    /// The map of the best particle in metres, in id order; landmarks whose
    /// depth is not positive are left out.
    #[must_use]
    pub fn landmarks(&self) -> Vec<LandmarkRecord> {
        let set = self.filter.set();
        let best = &set.particles()[set.best()];
        self.catalogue
            .iter()
            .filter(|(_, e)| e.stage == Stage::Mapped)
            .filter_map(|(id, entry)| {
                let landmark = best.map.get(id)?;
                let (position, covariance) =
                    best.metric_point(landmark, &self.proposal.carrier.lever_m)?;
                Some(LandmarkRecord {
                    id,
                    position,
                    covariance,
                    observations: entry.observations,
                    descriptor: Some(entry.descriptor.clone()),
                })
            })
            .collect()
    }
}

fn filter_error(frame: usize, e: impl std::error::Error + Send + Sync + 'static) -> SlamError {
    SlamError::Filter {
        frame,
        source: Box::new(e),
    }
}

/// Metric body motion of the reference particle since its keyframe.
fn relative_motion(reference: &Particle, prior: &MotionPrior, posterior: &PosePosterior) -> Se2 {
    let pose = posterior.mean_pose(prior);
    let body = reference.metric.condition_on_pose(prior, &pose).body(pose.phi);
    let from = reference.metric.body(reference.pose.phi);
    Se2::new(from.x, from.y, from.phi).between(&Se2::new(body.x, body.y, body.phi))
}

fn mean_nis(association: &Association) -> Option<f64> {
    let n = association.inliers.len();
    (n > 0).then(|| association.inliers.iter().map(|p| p.nis).sum::<f64>() / (2 * n) as f64)
}

fn fates(count: usize, association: &Association) -> Vec<(KeypointFate, Option<Vector2<f64>>)> {
    let mut fates = vec![(KeypointFate::Unused, None); count];
    let mut mark = |pairs: &[Pair], fate| {
        for p in pairs {
            fates[p.keypoint] = (fate, Some(p.predicted));
        }
    };
    mark(&association.inliers, KeypointFate::Matched);
    mark(&association.outliers, KeypointFate::Outlier);
    fates
}

/// Leaves at most `limit` matches scoring, well spread: one in turn from each
/// cell of an 8 x 6 grid, those with closed depth first.
fn spread_scoring(
    matches: &mut [MatchedFeature],
    limit: usize,
    image_size: &Vector2<f64>,
) {
    if matches.len() <= limit {
        return;
    }
    const COLUMNS: usize = 8;
    const ROWS: usize = 6;
    let mut cells: Vec<Vec<usize>> = vec![Vec::new(); COLUMNS * ROWS];
    let mut order: Vec<usize> = (0..matches.len()).collect();
    order.sort_by_key(|&i| (matches[i].scoring != Scoring::Full, i));
    for i in order {
        let p = matches[i].pixel;
        let cell = |v: f64, size: f64, n: usize| ((v / size * n as f64).max(0.0) as usize).min(n - 1);
        cells[cell(p.y, image_size.y, ROWS) * COLUMNS + cell(p.x, image_size.x, COLUMNS)].push(i);
    }
    let mut kept = vec![false; matches.len()];
    let (mut count, mut depth) = (0, 0);
    while count < limit {
        for cell in &cells {
            if let Some(&i) = cell.get(depth)
                && count < limit
            {
                kept[i] = true;
                count += 1;
            }
        }
        depth += 1;
    }
    for (m, kept) in matches.iter_mut().zip(kept) {
        if !kept {
            m.scoring = Scoring::MapOnly;
        }
    }
}
