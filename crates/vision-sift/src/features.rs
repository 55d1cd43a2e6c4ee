//! The result of a detection: keypoints and their descriptors.

use crate::constants::DESCRIPTOR_LENGTH;

/// A position, scale and orientation that is found again in another picture of the same place.
///
/// A point of the scale space with several orientations gives one keypoint for each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keypoint {
    /// The column in input pixels; 0 is the centre of the leftmost pixel.
    pub x: f32,
    /// The row in input pixels; 0 is the centre of the topmost pixel.
    pub y: f32,
    /// The scale in input pixels: the standard deviation of the Gaussian at which the keypoint was found.
    pub sigma: f32,
    /// The orientation in radians, `[0, 2 pi)`, from the x axis towards the y axis (clockwise as seen).
    pub angle: f32,
    /// The contrast: `|D|` at the refined extremum, for grey values in `[0, 1]`.
    pub response: f32,
}

/// The keypoints of a picture and their descriptors, index by index.
///
/// Two descriptors are compared by the Euclidean distance; it is about 500 between unrelated ones.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Features {
    /// The keypoints, octave by octave from fine to coarse, in an octave by level, row and column.
    pub keypoints: Vec<Keypoint>,
    /// The descriptor of each keypoint: `descriptors[i]` belongs to `keypoints[i]`.
    pub descriptors: Vec<[u8; DESCRIPTOR_LENGTH]>,
}
