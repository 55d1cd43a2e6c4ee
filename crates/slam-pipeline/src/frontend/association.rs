//! The association of a frame: which keypoint shows which landmark.

use mono_geometry::PlacedCamera;
use nalgebra::Vector2;

use super::gate::Gate;
use super::prediction::InView;
use crate::filter::linearised::PosePosterior;
use crate::filter::observation::MatchedFeature;
use crate::method::DescriptorSearch;

/// Settings of the association.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AssociationParams {
    /// Where descriptors are searched.
    pub(crate) search: DescriptorSearch,
    /// Ratio of Eq. 21.
    pub(crate) ratio: f32,
    /// Gate of an innovation.
    pub(crate) gate: Gate,
    /// Largest squared descriptor distance that the guided search accepts.
    pub(crate) guided_distance_squared: u32,
    /// Ratio of the guided search, within the gate.
    pub(crate) guided_ratio: f32,
    /// A depth is open while sigma_rho / rho exceeds this.
    pub(crate) open_depth: f64,
    /// Noise of the smallest keypoints, standard deviation, pixels.
    pub(crate) sigma_px: f64,
    /// Linearisations of the consensus.
    pub(crate) iterations: usize,
}

/// Gates and consensus allow this many times the noise of a keypoint: a keypoint that an estimate must not believe
/// that much may still be one of the landmark. With gates as narrow as the noise landmarks are lost and started again.
const GATE_FACTOR: f64 = 2.0;

impl AssociationParams {
    /// The noise of a keypoint in gates and consensus, standard deviation, pixels.
    #[must_use]
    pub(crate) fn gate_sigma_px(&self) -> f64 {
        GATE_FACTOR * self.sigma_px
    }
}

/// A keypoint matched to a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pair {
    /// Index of the keypoint.
    pub(crate) keypoint: usize,
    /// The match as the filter sees it.
    pub(crate) feature: MatchedFeature,
    /// Where the landmark was predicted, ideal pixel.
    pub(crate) predicted: Vector2<f64>,
    /// d^T S^-1 d against the prediction.
    pub(crate) nis: f64,
}

/// Outcome of the association of a frame.
#[derive(Debug)]
pub(crate) struct Association<'a> {
    /// Accepted matches in order of landmark id.
    pub(crate) inliers: Vec<Pair>,
    /// Matches the consensus rejected.
    pub(crate) outliers: Vec<Pair>,
    /// Landmarks predicted in view.
    pub(crate) in_view: InView<'a>,
    /// Camera of the reference particle given the inliers.
    pub(crate) camera: PlacedCamera,
    /// Pose of the reference particle given the inliers.
    pub(crate) posterior: PosePosterior,
}
