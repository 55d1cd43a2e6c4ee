//! A robot that is lost: the images show nothing of the map where it is expected.
//!
//! A *blind* frame shows next to no keypoints (darkness, a covered lens): odometry carries on. A frame that shows something
//! *else* than the map (a robot that was lifted and set down, one that woke up in a known map) is searched for in the whole
//! map. While lost, nothing is mapped and no filter step is made; the reported covariance grows with that of the odometry,
//! and where the robot was moved, as fast as one can be carried. A robot that is not found in some frames maps on from
//! where odometry puts it, and stays lost until an old place ties it to the map again.

use mono_geometry::Se2;
use nalgebra::{Matrix3, Vector3};

use super::estimate::{between_keyframes, relative_motion};
use super::ground::Ground;
use super::keyframe::Seen;
use super::lost::Lost;
use super::place::Place;
use super::{PoseEstimate, Slam, SlamError, State};
use crate::filter::linearised::PosePosterior;
use crate::frontend::association::Association;
use crate::frontend::frame::FrameFeatures;
use crate::frontend::missed::expected;
use crate::known_map::{KnownMap, MapUse};
use crate::odometry::Control;

/// Fewer keypoints than this, of which fewer than that are matched, are no sight.
const LEAST_KEYPOINTS: usize = 20;
const LEAST_MATCHES: usize = 6;
/// Fewer landmarks than this in view are no expectation.
const LEAST_EXPECTED: usize = 30;
/// Share of the expected landmarks below which the frame shows something else.
const ELSEWHERE_SHARE: f64 = 0.05;
/// Frames with sight that are searched for before the robot maps on.
const SEARCHED: u32 = 10;
/// How fast a robot is carried, m/s and rad/s.
const CARRIED_MPS: f64 = 0.5;
const CARRIED_RADPS: f64 = 0.5;

/// The content of a frame against what is expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sight {
    /// It is as expected, or nothing is expected.
    Map,
    /// Next to nothing.
    Blind,
    /// Something else than the map.
    Elsewhere,
}

impl State {
    /// Begins in a known map.
    pub(super) fn begin_lost(&mut self, map: &KnownMap) {
        let count = map.keyframes.len() as f64;
        let places = || {
            map.keyframes
                .iter()
                .map(|k| Vector3::new(k.body.x, k.body.y, 0.0))
        };
        let mean = places().sum::<Vector3<f64>>() / count;
        let mut covariance: Matrix3<f64> = places()
            .map(|p| (p - mean) * (p - mean).transpose())
            .sum::<Matrix3<f64>>()
            / count;
        // Anywhere within a metre or so of where the map was made, in any direction.
        covariance[(0, 0)] += 1.0;
        covariance[(1, 1)] += 1.0;
        covariance[(2, 2)] = core::f64::consts::PI.powi(2) / 3.0;
        let estimate = PoseEstimate {
            pose: Se2::new(mean.x, mean.y, 0.0),
            covariance,
        };
        self.last = estimate;
        self.lost = Some(Lost {
            elsewhere: true,
            searched: 0,
            since_s: 0.0,
            mapping: false,
            awake: Some(estimate),
        });
    }
}

impl Slam {
    /// The content of a frame of so many keypoints.
    pub(super) fn sight(&self, association: &Association<'_>, keypoints: usize) -> Sight {
        if !self.policies.recovers || self.state.places.is_empty() {
            return Sight::Map;
        }
        if keypoints < LEAST_KEYPOINTS && association.inliers.len() < LEAST_MATCHES {
            return Sight::Blind;
        }
        if self.state.lost.is_some_and(|l| l.awake.is_some()) {
            return Sight::Elsewhere;
        }
        let expected = expected(association);
        let least = ELSEWHERE_SHARE * expected.landmarks as f64;
        if expected.landmarks >= LEAST_EXPECTED && (expected.found as f64) < least {
            Sight::Elsewhere
        } else {
            Sight::Map
        }
    }

    /// The state of being lost after a frame that was not found.
    pub(super) fn still_lost(&self, sight: Sight, control: &Control) -> Lost {
        let before = self.state.lost.unwrap_or(Lost {
            elsewhere: false,
            searched: 0,
            since_s: control.dt_s,
            mapping: false,
            awake: None,
        });
        match sight {
            Sight::Elsewhere => Lost {
                searched: before.searched + 1,
                elsewhere: true,
                since_s: if before.elsewhere {
                    before.since_s
                } else {
                    control.dt_s
                },
                ..before
            },
            Sight::Map | Sight::Blind => before,
        }
    }

    /// Whether a robot that was searched for so often maps on from where odometry puts it.
    pub(super) fn maps_on(&self, lost: &Lost) -> bool {
        lost.searched > SEARCHED && lost.awake.is_none() && self.usage == MapUse::Extend
    }

    /// The motion of a robot that may have been carried.
    pub(super) fn carried(&self, lost: &Lost, control: &Control) -> Control {
        let s = (control.dt_s - lost.since_s).max(0.0);
        let (side, turn) = (CARRIED_MPS * s, CARRIED_RADPS * s);
        Control {
            covariance: control.covariance
                + Matrix3::from_diagonal(&Vector3::new(side * side, side * side, turn * turn)),
            ..*control
        }
    }

    /// The estimate of a lost frame and its motion since the last keyframe, by odometry.
    pub(super) fn dead_reckoned(&self, lost: &Lost, seen: &Seen<'_>) -> (Se2, PoseEstimate) {
        let posterior = PosePosterior::prior();
        let motion = relative_motion(&seen.reference, &seen.prior, &posterior);
        if let Some(awake) = lost.awake {
            return (motion, awake);
        }
        let mut estimate = between_keyframes(
            &self.state.last,
            &motion,
            &posterior.pose_covariance(&seen.prior),
            seen.reference.metric.scale(),
        );
        if lost.elsewhere {
            estimate.covariance +=
                self.carried(lost, &seen.control).covariance - seen.control.covariance;
        }
        (motion, estimate)
    }

    /// The one place of the map that a lost frame shows; `None` when there is none, or more than one that cannot be told
    /// apart.
    pub(super) fn found_again<'a>(
        &'a self,
        frame: &FrameFeatures<'_>,
        ground: &Ground,
    ) -> Option<Place<'a>> {
        let mut places = self.places(frame, ground.reference(), None);
        places.sort_by_key(|p| core::cmp::Reverse(p.found));
        let second = places.get(1).map_or(0, |p| p.found);
        let first = places.into_iter().next()?;
        // Twice the matches: surroundings that look alike are left to the next frames.
        (first.found >= 2 * second).then_some(first)
    }

    /// The ground with all particles set down in `place`, their differences forgotten.
    pub(super) fn set_down(&self, ground: &Ground, place: &Place<'_>) -> Result<Ground, SlamError> {
        let mut ground = ground.clone();
        self.forget_weights(&mut ground.filter)?;
        for particle in ground.filter.particles_mut() {
            *particle = place.reference.clone();
        }
        ground.window = self.window_from_here(&mut ground.filter);
        ground.last.pose = place.reference.metric.body(place.reference.pose.phi);
        Ok(ground)
    }
}
