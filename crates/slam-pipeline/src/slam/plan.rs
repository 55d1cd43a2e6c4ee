//! The plan of a frame: everything that can fail, computed from the unchanged state.

use mono_geometry::Se2;

use super::estimate::{between_keyframes, relative_motion};
use super::keyframe::{PlannedKeyframe, Seen};
use super::keyframe_policy::KeyframeCues;
use super::{
    FrameInput, FrameReport, KeypointFate, KeypointReport, PoseEstimate, Slam, SlamError, Stage,
    StageObserver,
};
use crate::frontend::associate::associate;
use crate::frontend::association::{Association, Pair};
use crate::frontend::frame::FrameFeatures;
use crate::odometry::Odometer;

/// The outcome of a frame, not yet part of the state.
pub(super) struct Plan {
    pub(super) odometer: Odometer,
    /// The report, complete but for what follows from the new state.
    pub(super) report: FrameReport,
    pub(super) step: PlannedStep,
}

/// The two kinds of frame.
pub(super) enum PlannedStep {
    /// Only the reported pose moves.
    Between {
        keyframe_from_body: Se2,
        estimate: PoseEstimate,
    },
    /// A filter step.
    Keyframe(Box<PlannedKeyframe>),
}

impl Slam {
    pub(super) fn plan(
        &self,
        input: &FrameInput<'_>,
        observer: &mut dyn StageObserver,
    ) -> Result<Plan, SlamError> {
        observer.begin(Stage::Association);
        let state = &self.state;
        let (keypoints, descriptors) = (
            input.features.keypoints.len(),
            input.features.descriptors.len(),
        );
        if keypoints != descriptors {
            return Err(SlamError::Features {
                frame: state.frame,
                keypoints,
                descriptors,
            });
        }
        let mut odometer = state.odometer;
        for interval in input.odometry {
            odometer.push(interval)?;
        }
        let control = odometer.control();
        let frame = FrameFeatures::new(input.features, &self.rig.camera);
        let reference = state.filter.set().particles()[state.filter.set().best()].clone();
        let prior = self
            .carrier
            .prior(&self.rig.lever_m(), &reference.departure(), &control);
        let association = associate(
            &self.rig,
            &frame,
            &state.catalogue,
            &reference,
            &prior,
            &self.association,
        );
        let keyframe = state.frame == 0 || self.keyframes.wants(self.keyframe_cues(&association));
        let mut report = FrameReport {
            estimate: state.last,
            keyframe,
            matches: association.inliers.len(),
            outliers: association.outliers.len(),
            new_landmarks: 0,
            landmarks: 0,
            n_eff: state.filter.set().effective_count(),
            unique_ancestors: 0,
            resampled: false,
            es_acceptance: None,
            nis: mean_nis(&association),
            keypoints: keypoint_reports(keypoints, &association),
            notes: Vec::new(),
        };
        if association.inliers.is_empty() && state.frame > 0 {
            report.notes.push("no match: odometry only".to_owned());
        }
        let seen = Seen {
            frame,
            reference,
            prior,
            control,
            association,
        };
        observer.begin(Stage::Proposal);
        let step = if keyframe {
            PlannedStep::Keyframe(Box::new(self.plan_keyframe(
                &seen,
                &mut report,
                observer,
            )?))
        } else {
            let posterior = &seen.association.posterior;
            let motion = relative_motion(&seen.reference, &seen.prior, posterior);
            PlannedStep::Between {
                keyframe_from_body: motion,
                estimate: between_keyframes(
                    &state.last,
                    &motion,
                    &posterior.pose_covariance(&seen.prior),
                    seen.reference.metric.scale(),
                ),
            }
        };
        Ok(Plan {
            odometer,
            report,
            step,
        })
    }

    fn keyframe_cues(&self, association: &Association) -> KeyframeCues {
        let state = &self.state;
        KeyframeCues {
            frames_since: state.frames_since_keyframe + 1,
            matches: association.inliers.len(),
            matches_at_keyframe: state.matches_at_keyframe,
            flow_px: association
                .inliers
                .iter()
                .filter_map(|p| {
                    let entry = state.catalogue.get(p.feature.id)?;
                    (entry.last.keyframe + 1 == state.keyframe)
                        .then(|| (p.feature.pixel - entry.last.pixel).norm())
                })
                .collect(),
        }
    }
}

fn mean_nis(association: &Association) -> Option<f64> {
    let n = association.inliers.len();
    (n > 0).then(|| association.inliers.iter().map(|p| p.nis).sum::<f64>() / (2 * n) as f64)
}

fn keypoint_reports(count: usize, association: &Association) -> Vec<KeypointReport> {
    let unused = KeypointReport {
        fate: KeypointFate::Unused,
        landmark: None,
        predicted: None,
    };
    let mut reports = vec![unused; count];
    let mut mark = |pairs: &[Pair], fate| {
        for p in pairs {
            reports[p.keypoint] = KeypointReport {
                fate,
                landmark: Some(p.feature.id),
                predicted: Some(p.predicted),
            };
        }
    };
    mark(&association.inliers, KeypointFate::Matched);
    mark(&association.outliers, KeypointFate::Outlier);
    reports
}
