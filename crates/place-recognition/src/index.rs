//! The landmarks of a map by their descriptors, and the landmarks that a keypoint may show.
//!
//! The ratio test of matching keeps a keypoint whose nearest landmark is clearly nearer than the second. In a map with two
//! equal posters it keeps none of their keypoints, although every one of them is good evidence for one of two places.
//! Here such a keypoint names both landmarks, with a lower quality, and geometry decides.
//!
//! Degenerate: a map of one landmark has no second nearest; its ratio is taken as one, so the match is of low quality.
//! Of three or more equal posters a keypoint names two.

use feature_kdtree::{AutoIndex, Descriptor, DescriptorIndex as _, Neighbour};

use crate::error::{PlaceError, in_range};

/// When a landmark is a candidate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CandidateOptions {
    /// Ratio of the distances to the nearest and the second nearest, below which the nearest is the only candidate, 0 to 1.
    pub ratio: f64,
    /// Largest distance of the descriptors of a candidate (not squared; unrelated ones are about 500 apart).
    pub max_distance: f64,
}

impl Default for CandidateOptions {
    /// Ratio 0.8, distance 300.
    fn default() -> Self {
        Self {
            ratio: 0.8,
            max_distance: 300.0,
        }
    }
}

/// A landmark that a keypoint may show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Position of the keypoint among the descriptors asked for.
    pub keypoint: usize,
    /// Id of the landmark.
    pub landmark: u32,
    /// Squared distance of the descriptors.
    pub distance_squared: u32,
    /// How good the match is, 0 to 1: one minus the ratio of the distances where the ratio test is passed, and
    /// (1 - ratio asked for) (1 - distance / largest distance), which is lower, where it is not.
    pub quality: f64,
}

/// Landmarks by id, with the descriptor of each.
///
/// Search is exact below 4000 landmarks and approximate beyond (see [`feature_kdtree::AutoIndex`]). Deterministic: the
/// answers are a function of the sequence of changes. A clone copies all descriptors.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PlaceIndex {
    index: AutoIndex,
}

impl PlaceIndex {
    /// An empty index.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a landmark, or gives one that is present another descriptor.
    ///
    /// # Errors
    /// [`PlaceError::Index`] when the index is full.
    pub fn insert(&mut self, id: u32, descriptor: &Descriptor) -> Result<(), PlaceError> {
        self.index.remove(id);
        Ok(self.index.insert(id, descriptor)?)
    }

    /// Removes a landmark; `false` when it is not present.
    pub fn remove(&mut self, id: u32) -> bool {
        self.index.remove(id)
    }

    /// The descriptor of a landmark; `None` when it is not present.
    #[must_use]
    pub fn descriptor(&self, id: u32) -> Option<Descriptor> {
        self.index.descriptor(id)
    }

    /// Number of landmarks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.index.len()
    }

    /// Whether there is no landmark.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes on the heap.
    #[must_use]
    pub fn memory_usage(&self) -> usize {
        self.index.memory_usage()
    }

    /// Makes the answers a function of the present landmarks alone, for runs that must repeat from a saved state; costs as
    /// much as inserting all of them.
    ///
    /// # Errors
    /// None in practice: those of [`Self::insert`].
    pub fn rebuild(&mut self) -> Result<(), PlaceError> {
        Ok(self.index.rebuild()?)
    }

    /// The landmarks that each keypoint may show: at most two a keypoint, in the order of the keypoints, the nearer first.
    ///
    /// One search a keypoint, all in one batch on this thread.
    ///
    /// # Errors
    /// [`PlaceError::Option`] when the ratio is not in 0 to 1, or the distance is negative or not a number.
    pub fn candidates(
        &self,
        descriptors: &[Descriptor],
        options: &CandidateOptions,
    ) -> Result<Vec<Candidate>, PlaceError> {
        in_range("ratio", options.ratio, 0.0..=1.0, "0 to 1")?;
        in_range(
            "max_distance",
            options.max_distance,
            0.0..=f64::INFINITY,
            "at least 0",
        )?;
        let mut nearest = Vec::new();
        self.index.two_nearest_batch(descriptors, &mut nearest);
        let mut found = Vec::new();
        for (keypoint, nearest) in nearest.into_iter().enumerate() {
            let Some(two) = nearest else { continue };
            let distance = |n: &Neighbour| f64::from(n.distance_squared).sqrt();
            let mut add = |n: &Neighbour, quality: f64| {
                if distance(n) <= options.max_distance {
                    found.push(Candidate {
                        keypoint,
                        landmark: n.id,
                        distance_squared: n.distance_squared,
                        quality,
                    });
                }
            };
            let first = distance(&two.first);
            match &two.second {
                Some(second) if first < options.ratio * distance(second) => {
                    add(&two.first, 1.0 - first / distance(second));
                }
                second => {
                    let low = |n: &Neighbour| {
                        // 0 / 0 and infinity are both the best that an ambiguous match can be.
                        let share = if options.max_distance > 0.0 {
                            distance(n) / options.max_distance
                        } else {
                            0.0
                        };
                        (1.0 - options.ratio) * (1.0 - share)
                    };
                    add(&two.first, low(&two.first));
                    if let Some(second) = second {
                        add(second, low(second));
                    }
                }
            }
        }
        Ok(found)
    }
}
