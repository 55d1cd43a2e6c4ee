//! The working memory of the detector.

use crate::orientation::Orientations;
use crate::points::{Sample, ScalePoint};
use crate::scale_space::ScaleSpace;

/// The working memory of [`Detector::detect`](crate::Detector::detect), used again from image to image.
///
/// After the first image of a size nothing is allocated, except when more keypoints turn up than ever before.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    pub(crate) scale_space: ScaleSpace,
    pub(crate) blocks: Vec<RowBlock>,
    pub(crate) points: Vec<OctavePoint>,
    pub(crate) orientations: Vec<Orientations>,
    pub(crate) oriented: Vec<OrientedPoint>,
}

impl Workspace {
    /// An empty workspace; the first image sizes it.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The memory held on the heap, bytes.
    #[must_use]
    pub fn memory_usage(&self) -> usize {
        self.scale_space.memory_usage()
            + self.blocks.capacity() * size_of::<RowBlock>()
            + self
                .blocks
                .iter()
                .map(RowBlock::memory_usage)
                .sum::<usize>()
            + self.points.capacity() * size_of::<OctavePoint>()
            + self.orientations.capacity() * size_of::<Orientations>()
            + self.oriented.capacity() * size_of::<OrientedPoint>()
    }
}

/// The working memory of one parallel task of the extremum search.
#[derive(Debug, Clone, Default)]
pub(crate) struct RowBlock {
    pub(crate) scratch: Vec<f32>,
    pub(crate) candidates: Vec<Sample>,
    pub(crate) points: Vec<ScalePoint>,
}

impl RowBlock {
    fn memory_usage(&self) -> usize {
        self.scratch.capacity() * size_of::<f32>()
            + self.candidates.capacity() * size_of::<Sample>()
            + self.points.capacity() * size_of::<ScalePoint>()
    }
}

/// A refined extremum and its octave.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OctavePoint {
    pub(crate) octave: usize,
    pub(crate) point: ScalePoint,
}

/// A point with one of its orientations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OrientedPoint {
    /// Index into the points.
    pub(crate) index: usize,
    /// The number of this orientation among those of the point.
    pub(crate) rank: usize,
    pub(crate) angle: f32,
    pub(crate) response: f32,
}
