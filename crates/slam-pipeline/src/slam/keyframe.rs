//! The plan of a keyframe: one filter step of all particles and the changes of the catalogue that come with it.

use feature_kdtree::KdForest;
use nalgebra::{Vector2, Vector3};
use rbpf_core::{MapUpdate as _, ParticleFilter, StepStage};

use super::feature_budget::strongest_unused;
use super::fixed_lag::Settled;
use super::ground::Ground;
use super::lost::Lost;
use super::scoring_budget::spread_scoring;
use super::window::Window;
use super::{
    FrameReport, KeypointFate, PoseEstimate, Slam, SlamError, Stage, StageObserver, filter_error,
};
use crate::filter::adaptation::Adaptation;
use crate::filter::drift::{Drift, Support};
use crate::filter::evolution::PoseEvolution;
use crate::filter::landmark::{InverseDepthPrior, Landmark};
use crate::filter::mapping::Mapping;
use crate::filter::motion::MotionPrior;
use crate::filter::observation::{
    FrameObservation, Initialisation, MatchedFeature, Prepared, Scoring, Sighting,
};
use crate::filter::particle::Particle;
use crate::filter::pixel_noise::PixelNoise;
use crate::filter::proposal::PoseProposal;
use crate::frontend::association::Association;
use crate::frontend::catalogue::{self, CatalogueUpdate, NewFeature, SeenAgain};
use crate::frontend::frame::FrameFeatures;
use crate::frontend::lens_noise::noise_at;
use crate::frontend::missed::missed_landmarks;
use crate::known_map::MapUse;
use crate::method::LandmarkStart;
use crate::odometry::Control;

/// The new state after a filter step.
pub(super) struct PlannedKeyframe {
    pub(super) filter: ParticleFilter<Particle>,
    pub(super) catalogue: CatalogueUpdate,
    pub(super) forest: Option<KdForest>,
    pub(super) support: Option<Support>,
    pub(super) control: Control,
    pub(super) adaptation: Adaptation,
    pub(super) window: Window,
    /// The window, where it was solved again.
    pub(super) settled: Option<Settled>,
    /// Estimate at the keyframe before, corrected.
    pub(super) last: PoseEstimate,
    /// The joint covariance of the errors, where an old place has changed it.
    pub(super) drift: Option<Drift>,
    /// Share of the scoring matches whose landmarks were not first seen long before.
    pub(super) explored: f64,
    /// Whether the robot is still lost, and maps on.
    pub(super) lost: Option<Lost>,
}

/// A frame as the reference particle sees it.
pub(super) struct Seen<'a> {
    pub(super) frame: &'a FrameFeatures<'a>,
    pub(super) reference: Particle,
    pub(super) prior: MotionPrior,
    pub(super) control: Control,
    pub(super) association: Association<'a>,
    /// Whether the odometry was taken for that of slipping wheels.
    pub(super) doubted: bool,
}

impl Slam {
    pub(super) fn plan_keyframe(
        &self,
        seen: &Seen<'_>,
        ground: Ground,
        lost: Option<Lost>,
        report: &mut FrameReport,
        observer: &mut dyn StageObserver,
    ) -> Result<PlannedKeyframe, SlamError> {
        let state = &self.state;
        let frozen = self.usage == MapUse::Localise;
        let missed = if frozen {
            Vec::new()
        } else {
            missed_landmarks(&seen.association, |entry| self.is_old(entry))
        };
        let mut removed: Vec<u32> = missed
            .iter()
            .copied()
            .filter(|id| {
                state
                    .catalogue
                    .get(*id)
                    .is_some_and(|e| e.existence.missed().is_gone())
            })
            .collect();
        if !frozen {
            removed.extend(self.over_budget(&seen.association.in_view));
        }
        let mut matches: Vec<_> = seen.association.inliers.iter().map(|p| p.feature).collect();
        spread_scoring(
            &mut matches,
            self.config.association.max_scored as usize,
            &self.rig.image_size_px(),
        );
        let support = self.support(seen, &matches);
        let explored = self.explored(&matches);
        let initialised = self.ready_for_two_views(&seen.association);
        let promoted = self.promoted(&matches, &initialised);
        report.new_landmarks = promoted.len();
        let observation = FrameObservation {
            control: seen.control,
            matches,
            initialised,
            removed,
        };
        let Ground {
            filter,
            window,
            last,
            drift,
        } = ground;
        let (filter, window, settled) =
            self.filter_step(filter, window, &observation, report, observer)?;
        let update = CatalogueUpdate {
            missed,
            promoted,
            removed: observation.removed.clone(),
            seen: self.seen_again(seen),
            new: if frozen {
                Vec::new()
            } else {
                self.new_features(seen, report)
            },
            forget_before: state
                .keyframe
                .saturating_sub(self.config.mapping.tentative_keyframes - 1),
        };
        Ok(PlannedKeyframe {
            filter,
            forest: state.catalogue.forest_after(&update)?,
            catalogue: update,
            support,
            explored,
            control: seen.control,
            window,
            settled,
            last,
            drift,
            lost,
            adaptation: self
                .state
                .adaptation
                .after(&seen.prior, &seen.association.posterior),
        })
    }

    /// The filter after this keyframe. The first frame has no motion: it only starts the path.
    fn filter_step(
        &self,
        mut filter: ParticleFilter<Particle>,
        window: Window,
        observation: &FrameObservation,
        report: &mut FrameReport,
        observer: &mut dyn StageObserver,
    ) -> Result<(ParticleFilter<Particle>, Window, Option<Settled>), SlamError> {
        let mapping = Mapping {
            rig: &self.rig,
            frozen: self.usage == MapUse::Localise,
            points: self.policies.landmark_points,
            start: self.policies.landmark_start,
        };
        if self.state.keyframe == 0 {
            observer.begin(Stage::Mapping);
            for particle in filter.particles_mut() {
                let Ok(()) = mapping.update_map(particle, observation);
            }
            let window = self.window_from_here(&mut filter);
            return Ok((filter, window, None));
        }
        let proposal = PoseProposal {
            rig: &self.rig,
            carrier: &self.carrier(),
            likelihood: &self.likelihood,
            kind: self.policies.proposal,
            weight: self.policies.weight,
        };
        let evolution = PoseEvolution {
            rig: &self.rig,
            operators: self.policies.evolution,
            steps: self.config.filter.evolution_steps as usize,
            likelihood: &self.likelihood,
        };
        if !self.policies.carries_weights {
            self.forget_weights(&mut filter)?;
        }
        let step = filter
            .step_observed(
                self.state.frame as u64,
                observation,
                &proposal,
                &evolution,
                &mapping,
                &mut |stage| match stage {
                    StepStage::Proposal => {}
                    StepStage::Rejuvenation => observer.begin(Stage::Evolution),
                    StepStage::MapUpdate => observer.begin(Stage::Mapping),
                },
            )
            .map_err(|e| filter_error(self.state.frame, e))?;
        report.n_eff = step.n_eff;
        report.resampled = step.resampled();
        report.es_acceptance = step.rejuvenation.acceptance();
        let (window, settled) = self.smooth(&mut filter, window, observation, &mapping, report)?;
        Ok((filter, window, settled))
    }

    /// Gives all particles that have a weight the same one.
    pub(super) fn forget_weights(
        &self,
        filter: &mut ParticleFilter<Particle>,
    ) -> Result<(), SlamError> {
        let forgotten: Vec<f64> = filter
            .set()
            .log_weights()
            .iter()
            .map(|w| if w.is_finite() { -w } else { 0.0 })
            .collect();
        filter
            .reweight(&forgotten)
            .map(|_| ())
            .map_err(|e| filter_error(self.state.frame, e))
    }

    /// The information behind the pose of this keyframe in the reference particle; `None` without matches, where
    /// odometry alone carries the error on.
    fn support(&self, seen: &Seen<'_>, matches: &[MatchedFeature]) -> Option<Support> {
        let anchored: Vec<(u32, Prepared)> = matches
            .iter()
            .filter_map(|m| {
                let landmark = seen.reference.map.get(m.id).or(m.prototype.as_ref())?;
                Some((
                    landmark.anchor()?,
                    seen.association.in_view.get(m.id)?.measured(m),
                ))
            })
            .collect();
        if anchored.is_empty() {
            return None;
        }
        Support::new(
            &self.rig,
            &seen.prior,
            &seen.association.posterior,
            seen.reference.metric.scale(),
            &anchored,
        )
    }

    /// The share of the scoring matches whose landmarks were not first seen long before; one without matches.
    fn explored(&self, matches: &[MatchedFeature]) -> f64 {
        let (mut old, mut all) = (0_usize, 0_usize);
        for m in matches {
            if m.scoring != Scoring::MapOnly {
                all += 1;
                old += usize::from(
                    self.state
                        .catalogue
                        .get(m.id)
                        .is_some_and(|entry| self.is_old(entry)),
                );
            }
        }
        1.0 - old as f64 / all.max(1) as f64
    }

    /// Tentative features matched now whose two views have parallax enough in the reference particle.
    fn ready_for_two_views(&self, association: &Association<'_>) -> Vec<Initialisation> {
        let LandmarkStart::TwoViews { min_parallax } = self.policies.landmark_start else {
            return Vec::new();
        };
        association
            .inliers
            .iter()
            .filter_map(|pair| {
                let entry = self.state.catalogue.get(pair.feature.id)?;
                let predicted = association.in_view.get(pair.feature.id)?;
                (entry.stage == catalogue::Stage::Tentative
                    && predicted.parallax(
                        &pair.feature.pixel,
                        self.rig.pinhole(),
                        &association.camera,
                    ) >= min_parallax)
                    .then_some(Initialisation {
                        id: pair.feature.id,
                        first: entry.first,
                        second: pair.feature.pixel,
                        noise: [self.noise_at(&entry.first.pixel), pair.feature.noise],
                    })
            })
            .collect()
    }

    /// Tentative features that become landmarks of every map with this keyframe.
    fn promoted(&self, matches: &[MatchedFeature], initialised: &[Initialisation]) -> Vec<u32> {
        let starts = |id: u32| match self.policies.landmark_start {
            LandmarkStart::SecondSighting => true,
            LandmarkStart::TwoViews { .. } => initialised.iter().any(|i| i.id == id),
        };
        matches
            .iter()
            .filter(|m| m.prototype.is_some() && starts(m.id))
            .map(|m| m.id)
            .collect()
    }

    fn seen_again(&self, seen: &Seen<'_>) -> Vec<SeenAgain> {
        seen.association
            .inliers
            .iter()
            .map(|pair| SeenAgain {
                id: pair.feature.id,
                descriptor: seen.frame.features.descriptors[pair.keypoint],
                sighting: self.sighting(pair.feature.pixel),
                direction: seen
                    .association
                    .in_view
                    .get(pair.feature.id)
                    .map_or_else(Vector3::zeros, |p| p.direction),
            })
            .collect()
    }

    fn new_features(&self, seen: &Seen<'_>, report: &mut FrameReport) -> Vec<NewFeature> {
        let depth = InverseDepthPrior::beyond(self.config.mapping.min_depth_m);
        let limit = self.config.mapping.max_new as usize;
        let sigma_px = self.association.sigma_px;
        let mut identities = self.state.catalogue.next_identities();
        let mut new = Vec::new();
        for k in strongest_unused(seen.frame, Some(&seen.association), limit) {
            let Some(pixel) = seen.frame.ideal[k] else {
                continue;
            };
            new.push(NewFeature {
                descriptor: seen.frame.features.descriptors[k],
                prototype: Landmark::from_first_sighting(
                    self.rig.pinhole(),
                    self.state.keyframe,
                    &pixel,
                    &seen.frame.noise(k, sigma_px),
                    depth,
                ),
                sighting: self.sighting(pixel),
            });
            report.keypoints[k].fate = KeypointFate::New;
            report.keypoints[k].landmark = identities.next();
        }
        new
    }

    /// The noise of a keypoint with this ideal pixel.
    fn noise_at(&self, pixel_ideal: &Vector2<f64>) -> PixelNoise {
        let sigma_px = self.association.sigma_px;
        PixelNoise::of(noise_at(&self.rig.camera, pixel_ideal) * (sigma_px * sigma_px))
    }

    fn sighting(&self, pixel: Vector2<f64>) -> Sighting {
        Sighting {
            keyframe: self.state.keyframe,
            pixel,
        }
    }
}
