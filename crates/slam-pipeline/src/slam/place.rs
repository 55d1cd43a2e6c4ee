//! Where in the map a frame was taken, by appearance and geometry alone.
//!
//! Keypoints without a match name the landmarks that look like them ([`place_recognition::PlaceIndex`]); poses that enough
//! of these agree on are candidates. A pose is believed when the map, associated anew from there, is found: most of the
//! landmarks that should be in view there are. Two equal posters in different surroundings are told apart by this.

use nalgebra::{Matrix3, Vector3};
use place_recognition::{CandidateOptions, PointMatch, PoseOptions, poses_where};

use super::Slam;
use super::feature_budget::strongest_unused;
use super::keyframe::Seen;
use super::map_exchange::pose_of_camera;
use crate::filter::metric_path::MetricPath;
use crate::filter::motion::MotionPrior;
use crate::filter::particle::Particle;
use crate::filter::pose::CameraPose;
use crate::frontend::association::Association;
use crate::frontend::frame::FrameFeatures;
use crate::frontend::missed::expected;
use crate::odometry::Control;
use mono_geometry::{PlacedCamera, Se2, Se3};

/// Keypoints that are searched in the whole map.
const QUERIES: usize = 300;
/// Smallest number of matches of a believed place.
const LEAST_MATCHES: usize = 20;
/// Smallest share of the landmarks that should be in view of a believed place that are found.
const LEAST_SHARE: f64 = 0.25;
/// How far the body may lean at a candidate, radians.
const LARGEST_LEAN: f64 = 0.35;
/// Standard deviations of the prior under which the map is associated anew: far wider than any pose that enough points agree
/// on, so that what they said does not count twice.
const PRIOR_M: f64 = 0.05;
const PRIOR_RAD: f64 = 0.03;

/// A frame in a place of the map.
pub(super) struct Place<'a> {
    /// The reference particle set down there.
    pub(super) reference: Particle,
    /// Its motion, of which nothing is known.
    pub(super) control: Control,
    pub(super) prior: MotionPrior,
    pub(super) association: Association<'a>,
    /// Number of the landmarks that should be in view there and are found.
    pub(super) found: usize,
}

impl<'a> Place<'a> {
    /// The pose that the found landmarks say.
    pub(super) fn pose(&self) -> CameraPose {
        self.association.posterior.mean_pose(&self.prior)
    }

    /// The frame as it is seen from there.
    pub(super) fn seen(self, frame: &'a FrameFeatures<'a>) -> Seen<'a> {
        Seen {
            frame,
            reference: self.reference,
            prior: self.prior,
            control: self.control,
            association: self.association,
            doubted: false,
        }
    }
}

impl Slam {
    /// The place of the map that `frame` shows best; `None` when there is none to be believed.
    ///
    /// With `seen`, the frame as it is associated now, only keypoints without a match are asked, and only about dormant
    /// landmarks.
    pub(super) fn place<'a>(
        &'a self,
        frame: &FrameFeatures<'_>,
        reference: &Particle,
        seen: Option<&Association<'_>>,
    ) -> Option<Place<'a>> {
        self.places(frame, reference, seen)
            .into_iter()
            .max_by_key(|p| p.association.inliers.len())
    }

    /// All places of the map that `frame` may show.
    pub(super) fn places<'a>(
        &'a self,
        frame: &FrameFeatures<'_>,
        reference: &Particle,
        seen: Option<&Association<'_>>,
    ) -> Vec<Place<'a>> {
        let matches = self.point_matches(frame, reference, seen);
        let body_from_camera = *self.rig.body_from_camera();
        let upright = |world_from_camera: &Se3| {
            let world_from_body =
                world_from_camera.rotation.matrix() * body_from_camera.transpose();
            world_from_body[(2, 2)] > LARGEST_LEAN.cos()
        };
        let options = PoseOptions {
            seed: self.config.filter.seed ^ self.state.frame as u64,
            ..PoseOptions::default()
        };
        // Only options out of their range are refused, here and in the search for candidates.
        poses_where(self.rig.pinhole(), &matches, &options, &upright)
            .unwrap_or_default()
            .iter()
            .filter_map(|hypothesis| {
                let camera = PlacedCamera::new(&hypothesis.world_from_camera);
                let mut pose = pose_of_camera(&camera, &self.rig);
                if self.config.carrier.slope_sigma == 0.0 {
                    // On a plane the height is not found again but known.
                    pose.centre.z = reference.pose.centre.z;
                }
                self.associated_at(frame, reference, pose)
            })
            .collect()
    }

    /// The landmarks that the keypoints may show, in the world and unit of `reference`.
    fn point_matches(
        &self,
        frame: &FrameFeatures<'_>,
        reference: &Particle,
        seen: Option<&Association<'_>>,
    ) -> Vec<PointMatch> {
        let keypoints = strongest_unused(frame, seen, QUERIES);
        let descriptors: Vec<_> = keypoints
            .iter()
            .map(|k| frame.features.descriptors[*k])
            .collect();
        self.state
            .places
            .candidates(&descriptors, &CandidateOptions::default())
            .unwrap_or_default()
            .into_iter()
            .filter_map(|candidate| {
                let k = keypoints[candidate.keypoint];
                let entry = self.state.catalogue.get(candidate.landmark)?;
                if seen.is_some() && !self.is_dormant(entry) {
                    return None;
                }
                let landmark = reference.map.get(candidate.landmark)?;
                let geometry = reference.geometry(landmark)?;
                let point = landmark.point(&geometry)?;
                Some(PointMatch {
                    keypoint: k,
                    landmark: candidate.landmark,
                    point_in_world: point.position,
                    point_covariance: point.covariance,
                    seen_from: geometry.anchor()?.centre,
                    pixel_ideal: frame.ideal[k]?,
                    sigma_px: self.association.gate_sigma_px(),
                    shape: frame.shape[k],
                    quality: candidate.quality,
                })
            })
            .collect()
    }

    /// The frame as it is associated from `pose`, near which the robot may stand; `None` when too little of the map is found
    /// there.
    pub(super) fn associated_at<'a>(
        &'a self,
        frame: &FrameFeatures<'_>,
        reference: &Particle,
        pose: CameraPose,
    ) -> Option<Place<'a>> {
        let world = MetricPath::new(reference, self.rig.lever_m(), &self.tied());
        let body = world.body_anywhere(&pose);
        let mut reference = reference.clone();
        reference.stand_at(pose, &body);
        let control = self.unknown_motion();
        let (prior, association) = self.look(frame, &reference, &control);
        let expected = expected(&association);
        let least = LEAST_SHARE * expected.landmarks as f64;
        if expected.found < LEAST_MATCHES || (expected.found as f64) < least {
            return None;
        }
        Some(Place {
            found: expected.found,
            reference,
            control,
            prior,
            association,
        })
    }

    /// No motion, known as well as the pose of a place before the map is associated anew; lean and height as free as those of
    /// any floor.
    fn unknown_motion(&self) -> Control {
        let carrier = &self.config.carrier;
        Control {
            increment: Se2::identity(),
            covariance: Matrix3::from_diagonal(&Vector3::new(
                PRIOR_M * PRIOR_M,
                PRIOR_M * PRIOR_M,
                PRIOR_RAD * PRIOR_RAD,
            )),
            turn_bias_gain: Vector3::zeros(),
            dt_s: 10.0 * carrier.tilt_time_s,
            distance_m: if carrier.slope_sigma > 0.0 {
                PRIOR_M / carrier.slope_sigma
            } else {
                0.0
            },
        }
    }
}
