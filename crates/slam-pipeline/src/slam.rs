//! The frame loop: features and odometry in, pose and map out.
//!
//! Every frame is associated with the map in the best particle. A frame that
//! moved far enough, saw too little of the last step, or waited too long is a
//! *keyframe*: a filter step of all particles in the order propose, weight,
//! resample, evolve, update the map, start landmarks. The frames between only
//! refine the pose that is reported: their baseline is too short to tell depth.
//! What is reported is in `estimate`, what happens to landmarks around a
//! filter step in `upkeep`.

mod estimate;
mod upkeep;

use mono_geometry::{Camera, Se2};
use nalgebra::{Matrix3, Vector2, Vector3};
use rbpf_core::{
    FilterConfig, ParticleFilter, ParticleSet, RejuvenationSchedule, Resampler, Streams,
    unique_ancestors,
};
use thiserror::Error;
use ukf::SigmaPoints;
use vision_sift::Features;

use crate::config::{Method, ValidConfig};
use crate::filter::drift::Drift;
use crate::filter::evolution::{Evolution, Operators};
use crate::filter::landmark::Lens;
use crate::filter::landmark_update::LandmarkUpdate;
use crate::filter::likelihood::Likelihood;
use crate::filter::mapping::Mapping;
use crate::filter::motion::{CarrierModel, Control, MotionPrior};
use crate::filter::observation::{FrameObservation, Initialisation};
use crate::filter::particle::{MetricState, Particle};
use crate::filter::pose::CameraPose;
use crate::filter::proposal::{PoseProposal, ProposalKind};
use crate::frontend::association::{Association, AssociationParams, Pair, associate};
use crate::frontend::catalogue::{Catalogue, Sighting};
use crate::frontend::frame::FrameFeatures;
use crate::odometry::{Odometer, OdometryInterval};
use crate::record::{KeypointFate, PlanarPose};
use crate::stopwatch::{Clock, Lap};
use estimate::relative_motion;
use upkeep::spread_scoring;

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
    position_in_body: Vector3<f64>,
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
            odometer: Odometer::new(&config.odometry, method == Method::Paper),
            drift: Drift::default(),
            camera,
            position_in_body: *position_in_body,
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
            self.report_between(
                &reference,
                &prior,
                &association.posterior,
                motion,
                &mut outcome,
            );
            outcome.laps_ms[1] = lap.lap_ms();
        }
        if association.inliers.is_empty() && self.frame > 0 {
            outcome.notes.push("no match: odometry only".to_owned());
        }
        outcome.landmarks = self.catalogue.mapped();
        outcome.unique_ancestors = unique_ancestors(self.filter.set().origins());
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
                .step(
                    self.frame as u64,
                    &observation,
                    &self.proposal,
                    &timed,
                    &self.mapping,
                )
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
        let (pose, covariance) = self.estimate(support.as_ref(), &control);
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
}

fn filter_error(frame: usize, e: impl std::error::Error + Send + Sync + 'static) -> SlamError {
    SlamError::Filter {
        frame,
        source: Box::new(e),
    }
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
