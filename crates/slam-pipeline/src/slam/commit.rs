//! The commit of a planned frame: the state changes, and nothing can fail.

use mono_geometry::Se2;
use rbpf_core::unique_ancestors;

use super::keyframe::PlannedKeyframe;
use super::plan::{Plan, PlannedStep};
use super::{FrameAnchor, FrameReport, PoseEstimate, Slam};

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
                });
            }
            PlannedStep::Keyframe(keyframe) => {
                report.estimate = self.commit_keyframe(*keyframe, report.matches);
            }
        }
        report.landmarks = self.state.catalogue.mapped();
        report.unique_ancestors = unique_ancestors(self.state.filter.set().origins());
        self.state.frame += 1;
        report
    }

    fn commit_keyframe(&mut self, keyframe: PlannedKeyframe, matches: usize) -> PoseEstimate {
        let state = &mut self.state;
        state.filter = keyframe.filter;
        let started = keyframe.catalogue.new.len();
        state.catalogue.apply(keyframe.catalogue, keyframe.forest);
        let estimate = self.estimate(keyframe.support.as_ref(), &keyframe.control);
        let state = &mut self.state;
        state.last = estimate;
        state.path.push(FrameAnchor {
            keyframe: state.keyframe,
            keyframe_from_body: Se2::identity(),
        });
        state.keyframe += 1;
        // About half of the features that start here are found again, and the first keyframe has no others.
        state.matches_at_keyframe = matches.max(started / 2);
        state.adaptation = keyframe.adaptation;
        state.window = keyframe.window;
        state.odometer.reset();
        estimate
    }
}
