//! The commit of a planned frame: the state changes, and nothing can fail.

use mono_geometry::Se2;
use rbpf_core::unique_ancestors;

use super::keyframe::PlannedKeyframe;
use super::plan::{Plan, PlannedStep};
use super::{FrameAnchor, FrameReport, PoseEstimate, Slam, State, Tracking};
use crate::frontend::catalogue::{CatalogueUpdate, Stage};

impl Slam {
    pub(super) fn commit(&mut self, plan: Plan) -> FrameReport {
        let mut report = plan.report;
        self.state.odometer = plan.odometer;
        match plan.step {
            PlannedStep::Between {
                keyframe_from_body,
                estimate,
            } => {
                report.estimate = estimate;
                self.state.path.push(FrameAnchor {
                    keyframe: self.state.keyframe - 1,
                    keyframe_from_body,
                    lost: false,
                });
            }
            PlannedStep::Lost {
                keyframe_from_body,
                estimate,
                lost,
            } => {
                report.estimate = estimate;
                self.state.lost = Some(lost);
                self.state.path.push(FrameAnchor {
                    keyframe: self.state.keyframe - 1,
                    keyframe_from_body,
                    lost: true,
                });
            }
            PlannedStep::Keyframe(keyframe) => {
                report.estimate = self.commit_keyframe(*keyframe, &report);
            }
        }
        report.landmarks = self.state.catalogue.mapped();
        report.unique_ancestors = unique_ancestors(self.state.filter.set().origins());
        self.state.frame += 1;
        report
    }

    fn commit_keyframe(&mut self, keyframe: PlannedKeyframe, report: &FrameReport) -> PoseEstimate {
        let found = report.tracking == Tracking::Relocalised;
        let state = &mut self.state;
        state.filter = keyframe.filter;
        state.last = keyframe.last;
        state.lost = keyframe.lost;
        if let Some(drift) = keyframe.drift {
            state.drift = drift;
        }
        let started = keyframe.catalogue.new.len();
        self.remember_places(&keyframe.catalogue);
        let state = &mut self.state;
        state.catalogue.apply(keyframe.catalogue, keyframe.forest);
        let set = state.filter.set();
        state.catalogue.follow(&set.particles()[set.best()].map);
        let estimate = self.estimate(
            keyframe.support.as_ref(),
            &keyframe.control,
            keyframe.settled.as_ref(),
        );
        let state = &mut self.state;
        state.last = estimate;
        if found {
            state.anchor_lost_frames();
        }
        state.path.push(FrameAnchor {
            keyframe: state.keyframe,
            keyframe_from_body: Se2::identity(),
            lost: false,
        });
        state.keyframe += 1;
        // About half of the features that start here are found again, and the first keyframe has no others.
        state.matches_at_keyframe = report.matches.max(started / 2);
        state.explored = keyframe.explored;
        state.adaptation = keyframe.adaptation;
        state.window = keyframe.window;
        state.odometer.reset();
        estimate
    }

    /// The looks of landmarks that enter the map, change or leave it.
    fn remember_places(&mut self, update: &CatalogueUpdate) {
        if !self.policies.recovers {
            return;
        }
        let state = &mut self.state;
        for id in &update.removed {
            state.places.remove(*id);
        }
        for seen in &update.seen {
            let Some(entry) = state.catalogue.get(seen.id) else {
                continue;
            };
            let promoted = update.promoted.contains(&seen.id);
            if promoted || (entry.stage == Stage::Mapped && entry.looks_different(&seen.descriptor))
            {
                // A full index cannot take another; the landmark is then not found by its looks.
                let _ = state.places.insert(seen.id, &seen.descriptor);
            }
        }
    }
}

impl State {
    /// The frames through which the robot was lost hang on the keyframe that now follows: odometry leads from them to it.
    fn anchor_lost_frames(&mut self) {
        let now = self.odometer.control().increment;
        for frame in self.path.iter_mut().rev().take_while(|f| f.lost) {
            frame.keyframe = self.keyframe;
            frame.keyframe_from_body = now.between(&frame.keyframe_from_body);
        }
    }
}
