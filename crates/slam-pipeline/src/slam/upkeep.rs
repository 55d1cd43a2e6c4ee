//! Landmarks around a filter step: belief, first sightings, two-view starts,
//! and which matches weigh the particles.

use std::collections::BTreeSet;

use nalgebra::Vector2;

use super::{FrameOutcome, Slam, SlamError};
use crate::filter::drift::Support;
use crate::filter::landmark::Landmark;
use crate::filter::motion::MotionPrior;
use crate::filter::observation::{Initialisation, MatchedFeature, Prepared, Scoring};
use crate::filter::particle::Particle;
use crate::frontend::association::Association;
use crate::frontend::catalogue::{Sighting, Stage};
use crate::frontend::frame::FrameFeatures;
use crate::record::KeypointFate;

/// Below this share of the landmarks in view found, a frame counts as blind.
const BLIND_SHARE: f64 = 0.2;

impl Slam {
    /// What the pose of this keyframe leans on, in the reference particle.
    pub(super) fn support(
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
                Some((
                    landmark.anchor()?,
                    association.in_view.get(&m.id)?.measured(m),
                ))
            })
            .collect();
        // Without matches the odometry alone carries the error on.
        if anchored.is_empty() {
            return None;
        }
        Support::new(
            &self.proposal.likelihood.lens,
            &self.proposal.likelihood.body_from_camera,
            prior,
            &association.posterior,
            reference.metric.mean.x,
            &anchored,
        )
    }

    /// Landmarks predicted in view but not found lose belief; returns those to remove.
    pub(super) fn update_belief(&mut self, association: &Association) -> Vec<u32> {
        let found: BTreeSet<u32> = association
            .inliers
            .iter()
            .chain(&association.outliers)
            .map(|p| p.feature.id)
            .collect();
        let mapped = association
            .in_view
            .keys()
            .filter(|id| {
                self.catalogue
                    .get(**id)
                    .is_some_and(|e| e.stage == Stage::Mapped)
            })
            .count();
        let mut removed = Vec::new();
        // A frame that finds next to nothing (lens cap, black image, a jump of the
        // robot) tells of the frame, not of the landmarks.
        if (found.len() as f64) < BLIND_SHARE * mapped as f64 {
            return removed;
        }
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
    pub(super) fn ready_for_two_views(&self, association: &Association) -> Vec<Initialisation> {
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
                    ) >= min_parallax)
                    .then_some(Initialisation {
                        id: pair.feature.id,
                        first: (entry.first.keyframe, entry.first.pixel),
                        second: pair.feature.pixel,
                        sigma_px: self.association.sigma_px,
                    })
            })
            .collect()
    }

    pub(super) fn start_features(
        &mut self,
        frame: &FrameFeatures<'_>,
        association: &Association,
        outcome: &mut FrameOutcome,
    ) -> Result<(), SlamError> {
        let depth_px = &self.proposal.likelihood.lens;
        // Gaussian over inverse depth whose two-sigma interval is (0, 1 / min depth).
        let rho = 0.5 / self.config.mapping.min_depth_m;
        let rho = (rho, 0.5 * rho);
        let taken: BTreeSet<usize> = association
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
            let Some(pixel) = frame.ideal[k] else {
                continue;
            };
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
}

/// Leaves at most `limit` matches scoring, well spread: one in turn from each
/// cell of an 8 x 6 grid, those with closed depth first.
pub(super) fn spread_scoring(
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
        let cell =
            |v: f64, size: f64, n: usize| ((v / size * n as f64).max(0.0) as usize).min(n - 1);
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
