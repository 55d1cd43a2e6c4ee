//! The plan of a frame: everything that can fail, computed from the unchanged state.

use mono_geometry::{Pinhole, PlacedCamera, Se2};
use nalgebra::Vector3;

use super::estimate::{between_keyframes, relative_motion};
use super::keyframe::{PlannedKeyframe, Seen};
use super::keyframe_policy::KeyframeCues;
use super::lost::Lost;
use super::standing::Standing;
use super::{
    FrameInput, FrameReport, KeypointFate, KeypointReport, PoseEstimate, Slam, SlamError, Stage,
    StageObserver,
};
use crate::filter::motion::MotionPrior;
use crate::filter::particle::Particle;
use crate::frontend::associate::associate;
use crate::frontend::association::{Association, Pair};
use crate::frontend::catalogue::Catalogue;
use crate::frontend::frame::FrameFeatures;
use crate::method::CarrierFreedom;
use crate::odometry::{Control, Odometer};

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
    /// Nothing of the map is seen, and odometry moves the reported pose.
    Lost {
        keyframe_from_body: Se2,
        estimate: PoseEstimate,
        lost: Lost,
    },
    /// A filter step.
    Keyframe(Box<PlannedKeyframe>),
}

/// The odometry is doubted when matches fall below the last keyframe's divided by this, and that many times as many are found
/// without it.
const DOUBT_GAIN: usize = 2;
/// Matches at the last keyframe from which the fall of their number says something.
const LEAST_EXPECTED: usize = 40;

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
        let frame = FrameFeatures::new(input.features, &self.rig.camera);
        let Standing {
            ground,
            seen,
            tracking,
            lost,
            keyframe,
            revisit,
        } = self.standing(&frame, &odometer.control())?;
        let doubted = seen.doubted;
        let association = &seen.association;
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
            nis: mean_nis(association),
            odometry_doubted: doubted,
            tracking,
            revisit,
            keypoints: keypoint_reports(keypoints, association),
            notes: Vec::new(),
        };
        if association.inliers.is_empty() && state.frame > 0 {
            report.notes.push("no match: odometry only".to_owned());
        }
        if doubted {
            report
                .notes
                .push("odometry in doubt: the matches lie beside it".to_owned());
        }
        observer.begin(Stage::Proposal);
        let step = match lost {
            Some(lost) if !lost.mapping => {
                if !lost.places.is_empty() {
                    let count = lost.places.len();
                    report
                        .notes
                        .push(format!("{count} places of the map look alike"));
                }
                let (keyframe_from_body, estimate) = self.dead_reckoned(&lost, &seen);
                PlannedStep::Lost {
                    keyframe_from_body,
                    estimate,
                    lost,
                }
            }
            lost if keyframe => PlannedStep::Keyframe(Box::new(self.plan_keyframe(
                &seen,
                ground,
                lost,
                &mut report,
                observer,
            )?)),
            _ if seen.association.inliers.is_empty() => {
                let (keyframe_from_body, estimate) = self.driven(&seen);
                PlannedStep::Between {
                    keyframe_from_body,
                    estimate,
                }
            }
            _ => {
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
            }
        };
        Ok(Plan {
            odometer,
            report,
            step,
        })
    }

    /// The frame seen from `reference` after `control`, or, where nearly nothing is seen so and much otherwise, after a motion
    /// that is known less well.
    pub(super) fn seen<'a>(
        &'a self,
        frame: &'a FrameFeatures<'a>,
        reference: &Particle,
        control: &Control,
    ) -> Seen<'a> {
        let (prior, association) = self.look(frame, reference, control);
        let mut seen = Seen {
            frame,
            reference: reference.clone(),
            prior,
            control: *control,
            association,
            doubted: false,
        };
        if seen.association.inliers.len() < self.expected_matches() {
            let wide = control.doubted();
            let (prior, association) = self.look(frame, reference, &wide);
            let least = seen.association.inliers.len().max(LEAST_EXPECTED / 4);
            if association.inliers.len() > DOUBT_GAIN * least {
                seen = Seen {
                    prior,
                    control: wide,
                    association,
                    doubted: true,
                    ..seen
                };
            }
        }
        seen
    }

    /// The frame seen from `reference` after `control`.
    pub(super) fn look(
        &self,
        frame: &FrameFeatures<'_>,
        reference: &Particle,
        control: &Control,
    ) -> (MotionPrior, Association<'_>) {
        let prior = self
            .carrier()
            .prior(&self.rig.lever_m(), &reference.departure(), control);
        let association = associate(
            &self.rig,
            frame,
            &self.state.catalogue,
            reference,
            &prior,
            &self.association,
        );
        (prior, association)
    }

    /// Fewer matches than this are a reason to doubt the odometry; 0 where few were to be expected.
    fn expected_matches(&self) -> usize {
        let before = self.state.matches_at_keyframe;
        if before < LEAST_EXPECTED || self.policies.carrier == CarrierFreedom::Planar {
            return 0;
        }
        before / DOUBT_GAIN
    }

    pub(super) fn keyframe_cues(
        &self,
        reference: &Particle,
        control: &Control,
        association: &Association<'_>,
    ) -> KeyframeCues {
        let state = &self.state;
        KeyframeCues {
            since_s: control.dt_s,
            matches: association.inliers.len(),
            matches_at_keyframe: state.matches_at_keyframe,
            parallax_px: reference.path.last().map_or_else(Vec::new, |last| {
                parallax_px(
                    &state.catalogue,
                    state.keyframe,
                    association,
                    &last.camera,
                    self.rig.pinhole(),
                )
            }),
        }
    }
}

/// Image motion since the last keyframe, seen by the camera `last`, of every match that was seen there, with the rotation
/// taken out; pixels.
fn parallax_px(
    catalogue: &Catalogue,
    next_keyframe: u32,
    association: &Association<'_>,
    last: &PlacedCamera,
    pinhole: &Pinhole,
) -> Vec<f64> {
    let now_from_last = association.camera.camera_from_world * last.camera_from_world.transpose();
    association
        .inliers
        .iter()
        .filter_map(|pair| {
            let entry = catalogue.get(pair.feature.id)?;
            let then = pinhole.normalize(&entry.last.pixel);
            let turned = now_from_last * Vector3::new(then.x, then.y, 1.0);
            (entry.last.keyframe + 1 == next_keyframe && turned.z > 0.0).then(|| {
                let without_motion = pinhole.pixel(&(turned.xy() / turned.z));
                (pair.feature.pixel - without_motion).norm()
            })
        })
        .collect()
}

fn mean_nis(association: &Association<'_>) -> Option<f64> {
    let n = association.inliers.len();
    (n > 0).then(|| association.inliers.iter().map(|p| p.nis).sum::<f64>() / (2 * n) as f64)
}

fn keypoint_reports(count: usize, association: &Association<'_>) -> Vec<KeypointReport> {
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
