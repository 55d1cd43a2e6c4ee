//! Where the robot stands at a frame: by the map it follows, by an old place, or by odometry because it is lost.

use super::ground::Ground;
use super::keyframe::Seen;
use super::lost::Lost;
use super::recovery::{Search, Sight};
use super::revisit::Revisited;
use super::{Slam, SlamError, Tracking};
use crate::frontend::frame::FrameFeatures;
use crate::odometry::Control;

/// A frame with the state that it is judged from.
pub(super) struct Standing<'a> {
    pub(super) ground: Ground,
    pub(super) seen: Seen<'a>,
    pub(super) tracking: Tracking,
    /// Set while nothing of the map is seen where it is expected.
    pub(super) lost: Option<Lost>,
    /// Whether the frame is a filter step.
    pub(super) keyframe: bool,
    /// Whether an old place has moved the path.
    pub(super) revisit: bool,
}

impl Slam {
    /// Where the robot stands after `control`.
    pub(super) fn standing<'a>(
        &'a self,
        frame: &'a FrameFeatures<'a>,
        control: &Control,
    ) -> Result<Standing<'a>, SlamError> {
        let ground = self.ground();
        let seen = self.seen(frame, ground.reference(), control);
        let sight = self.sight(&seen.association, frame.ideal.len());
        let mut standing = Standing {
            ground,
            seen,
            tracking: Tracking::Tracking,
            lost: None,
            keyframe: false,
            revisit: false,
        };
        match sight {
            Sight::Map => self.follow(&mut standing),
            Sight::Blind | Sight::Elsewhere => self.search(frame, sight, &mut standing)?,
        }
        standing.keyframe = self.is_keyframe(&standing);
        let moves = standing.keyframe && standing.tracking != Tracking::Relocalised;
        if moves && self.state.keyframe > 0 {
            self.come_back(frame, &mut standing)?;
        }
        Ok(standing)
    }

    /// The map is seen: a robot that was lost stands where odometry puts it, unless it was moved and has mapped on.
    fn follow(&self, standing: &mut Standing<'_>) {
        if let Some(before) = self.state.lost.clone().filter(|l| l.mapping) {
            standing.lost = Some(before);
            standing.tracking = Tracking::Lost;
        }
    }

    /// The map is not seen: the robot is set down where the frame shows it, or stays lost.
    fn search<'a>(
        &'a self,
        frame: &'a FrameFeatures<'a>,
        sight: Sight,
        standing: &mut Standing<'a>,
    ) -> Result<(), SlamError> {
        let mut lost = self.still_lost(sight, &standing.seen.control);
        if sight == Sight::Elsewhere {
            match self.found_again(frame, &standing.ground, &standing.seen.control) {
                Search::Found(place) => {
                    standing.ground = self.set_down(&standing.ground, &place)?;
                    standing.seen = place.seen(frame);
                    standing.tracking = Tracking::Relocalised;
                    return Ok(());
                }
                Search::Open(places) => lost.places = places,
            }
        }
        if !lost.mapping && self.maps_on(&lost) {
            lost.mapping = true;
            lost.places.clear();
            let carried = self.carried(&lost, &standing.seen.control);
            standing.seen = self.seen(frame, standing.ground.reference(), &carried);
        }
        standing.lost = Some(lost);
        standing.tracking = Tracking::Lost;
        Ok(())
    }

    fn is_keyframe(&self, standing: &Standing<'_>) -> bool {
        let state = &self.state;
        if standing.lost.as_ref().is_some_and(|l| !l.mapping) {
            return false;
        }
        let mapping = |lost: &Option<Lost>| lost.as_ref().map(|l| l.mapping);
        let changed = mapping(&standing.lost) != mapping(&state.lost);
        if state.keyframe == 0 || changed {
            return true;
        }
        let seen = &standing.seen;
        // A frame that shows nothing at all tells nothing and starts nothing: it is not worth a place in every path. The
        // odometer carries the motion and its noise on to the next frame that shows something.
        if seen.association.inliers.is_empty() && seen.frame.features.keypoints.is_empty() {
            return false;
        }
        self.keyframes.wants(self.keyframe_cues(
            standing.ground.reference(),
            &seen.control,
            &seen.association,
        ))
    }

    /// Moves the path where an old place shows that it has drifted.
    fn come_back<'a>(
        &'a self,
        frame: &'a FrameFeatures<'a>,
        standing: &mut Standing<'a>,
    ) -> Result<(), SlamError> {
        let Some(revisited) = self.revisit(frame, &standing.seen, &standing.ground)? else {
            return Ok(());
        };
        let Revisited {
            ground,
            moved: true,
        } = revisited
        else {
            standing.ground = revisited.ground;
            return Ok(());
        };
        let after = self.seen(frame, ground.reference(), &standing.seen.control);
        // A path that is right explains about what the one before explained, or more.
        if 5 * after.association.inliers.len() < 4 * standing.seen.association.inliers.len() {
            return Ok(());
        }
        standing.ground = ground;
        standing.seen = after;
        standing.revisit = true;
        if standing.lost.take().is_some() {
            standing.tracking = Tracking::Relocalised;
        }
        Ok(())
    }
}
