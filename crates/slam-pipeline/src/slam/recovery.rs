//! A robot that is lost: the images show nothing of the map where it is expected.
//!
//! A *blind* frame shows next to no keypoints (darkness, a covered lens): odometry carries on. A frame that shows something
//! *else* than the map (a robot that was lifted and set down, one that woke up in a known map) is searched for in the whole
//! map. While lost, nothing is mapped and no filter step is made; the reported covariance grows with that of the odometry,
//! and where the robot was moved, as fast as one can be carried. A robot that is not found in some frames maps on from
//! where odometry puts it, and stays lost until an old place ties it to the map again.

use estimation_base::wrap;
use mono_geometry::Se2;
use nalgebra::{Matrix3, Vector3};

use super::estimate::{between_keyframes, relative_motion};
use super::ground::Ground;
use super::keyframe::Seen;
use super::lost::{Hypothesis, Lost};
use super::place::Place;
use super::{PoseEstimate, Slam, SlamError, State};
use crate::filter::linearised::PosePosterior;
use crate::filter::metric_path::MetricPath;
use crate::filter::motion::CarrierModel;
use crate::filter::particle::Particle;
use crate::filter::pose::CameraPose;
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

/// Places are told apart when the landmarks found differ by so many standard deviations of their number (Poisson); more than
/// chance asks for, because the landmarks of one image are not independent.
const TOLD_APART: f64 = 6.0;
/// Places that are kept until they can be told apart.
const MOST_PLACES: usize = 8;
/// Poses nearer to each other than this are one place.
const SAME_M: f64 = 0.15;
const SAME_RAD: f64 = 0.1;
/// Standard deviations of a place that is one of several.
const PLACE_M: f64 = 0.05;
const PLACE_RAD: f64 = 0.03;

/// The outcome of a search of the map.
pub(super) enum Search<'a> {
    /// The one place that the frame shows.
    Found(Box<Place<'a>>),
    /// Places that cannot be told apart, or none.
    Open(Vec<Hypothesis>),
}

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
            places: Vec::new(),
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
        if self.state.lost.as_ref().is_some_and(|l| l.awake.is_some()) {
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
        let before = self.state.lost.clone().unwrap_or(Lost {
            elsewhere: false,
            searched: 0,
            since_s: control.dt_s,
            mapping: false,
            awake: None,
            places: Vec::new(),
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
        let (motion, mut estimate) = self.driven(seen);
        if let Some(mixture) = mixture(&lost.places) {
            return (motion, mixture);
        }
        if let Some(awake) = lost.awake {
            return (motion, awake);
        }
        if lost.elsewhere {
            estimate.covariance +=
                self.carried(lost, &seen.control).covariance - seen.control.covariance;
        }
        (motion, estimate)
    }

    /// The motion since the last keyframe that odometry tells, and the estimate there.
    ///
    /// Odometry counts metres: the unit of the particle, which is open, is no part of its error.
    pub(super) fn driven(&self, seen: &Seen<'_>) -> (Se2, PoseEstimate) {
        let posterior = PosePosterior::prior();
        let motion = relative_motion(&seen.reference, &seen.prior, &posterior);
        let mut departure = seen.reference.departure();
        departure.constants_covariance.row_mut(0).fill(0.0);
        departure.constants_covariance.column_mut(0).fill(0.0);
        let carrier = CarrierModel {
            scale_drift: 0.0,
            ..self.carrier()
        };
        let in_metres = carrier.prior(&self.rig.lever_m(), &departure, &seen.control);
        let estimate = between_keyframes(
            &self.state.last,
            &motion,
            &posterior.pose_covariance(&in_metres),
            seen.reference.metric.scale(),
        );
        (motion, estimate)
    }

    /// The place of the map that a lost frame shows, or several that cannot be told apart yet.
    ///
    /// Places that earlier frames left open move on with the odometry, and each is associated by itself. Only when none of
    /// them is left the whole map is searched.
    pub(super) fn found_again<'a>(
        &'a self,
        frame: &FrameFeatures<'_>,
        ground: &Ground,
        control: &Control,
    ) -> Search<'a> {
        let reference = ground.reference();
        let open = self.state.lost.iter().flat_map(|lost| &lost.places);
        let mut places: Vec<(usize, Place<'a>)> = open
            .filter_map(|before| {
                let pose = self.moved_on(before, reference, control);
                let place = self.associated_at(frame, reference, pose)?;
                Some((before.found + place.found, place))
            })
            .collect();
        if places.is_empty() {
            let anywhere = self.places(frame, reference, None);
            places = anywhere.into_iter().map(|p| (p.found, p)).collect();
        }
        places.sort_by_key(|(found, _)| core::cmp::Reverse(*found));
        let world = MetricPath::new(reference, self.rig.lever_m(), &self.tied());
        let mut kept: Vec<(Hypothesis, Place<'a>)> = Vec::new();
        for (found, place) in places {
            let pose = place.pose();
            let body = world.body_anywhere(&pose);
            let is_open = kept.first().is_none_or(|(best, _)| {
                let (more, less) = (best.found as f64, found as f64);
                more - less < TOLD_APART * (more + less).sqrt()
            });
            let is_new = kept.iter().all(|(other, _)| {
                let between = other.body.between(&body);
                between.x.hypot(between.y) > SAME_M || between.phi.abs() > SAME_RAD
            });
            if is_open && is_new && kept.len() < MOST_PLACES {
                let driven = control.increment;
                let hypothesis = Hypothesis {
                    pose,
                    body,
                    driven,
                    found,
                };
                kept.push((hypothesis, place));
            }
        }
        if kept.len() > 1 {
            return Search::Open(kept.into_iter().map(|(hypothesis, _)| hypothesis).collect());
        }
        match kept.pop() {
            Some((_, place)) => Search::Found(Box::new(place)),
            None => Search::Open(Vec::new()),
        }
    }

    /// The pose of a hypothesis after the motion since its last frame.
    fn moved_on(&self, before: &Hypothesis, reference: &Particle, control: &Control) -> CameraPose {
        let mut particle = reference.clone();
        particle.stand_at(before.pose, &before.body);
        let since = Control {
            increment: before.driven.between(&control.increment),
            ..*control
        };
        self.carrier()
            .prior(&self.rig.lever_m(), &particle.departure(), &since)
            .mean
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

/// Mean and covariance of a robot that stands in one of `places`, weighted by what was found there; `None` without any.
fn mixture(places: &[Hypothesis]) -> Option<PoseEstimate> {
    let best = places.first()?.body;
    let total: usize = places.iter().map(|p| p.found).sum();
    let apart = |p: &Hypothesis| {
        Vector3::new(
            p.body.x - best.x,
            p.body.y - best.y,
            wrap(p.body.phi - best.phi),
        )
    };
    let share = |p: &Hypothesis| p.found as f64 / total.max(1) as f64;
    let mean: Vector3<f64> = places.iter().map(|p| apart(p) * share(p)).sum();
    let spread: Matrix3<f64> = places
        .iter()
        .map(|p| (apart(p) - mean) * (apart(p) - mean).transpose() * share(p))
        .sum();
    let own = Vector3::new(PLACE_M * PLACE_M, PLACE_M * PLACE_M, PLACE_RAD * PLACE_RAD);
    Some(PoseEstimate {
        pose: Se2::new(best.x + mean.x, best.y + mean.y, wrap(best.phi + mean.z)),
        covariance: spread + Matrix3::from_diagonal(&own),
    })
}
