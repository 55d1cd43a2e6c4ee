//! Pairs of frames spread over a run, for the question whether odometry and images fit.

use feature_kdtree::match_mutual;
use mono_geometry::Camera;
use motion_consistency::FramePair;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use vision_sift::Features;

/// Pairs that a run collects, at most; in shorter runs every pair begins where the one before it ends.
const MAX_PAIRS: usize = 2000;
/// Keypoints of a frame that take part: the strongest.
const KEYPOINTS: usize = 300;
/// Ratio test between the frames of a pair.
const RATIO: f32 = 0.8;
/// Image motion that a pair should show, pixels.
const MIN_DISPLACEMENT_PX: f64 = 8.0;
/// Matches below which the frames of a pair are too far apart.
const MIN_MATCHES: usize = 30;
/// Frames between the two of a pair, at most.
const MAX_GAP: usize = 64;

/// Collects [`FramePair`]s while the frames of a run pass by.
///
/// The distance of the two frames follows the image motion, so that a camera of 5 Hz and one of 200 Hz give alike pairs.
/// It keeps the keypoints of one frame. Time a pair: two exact searches of 300
/// descriptors in 300.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PairCollector {
    spacing: usize,
    gap: usize,
    next: usize,
    earlier: Option<Earlier>,
    #[serde(with = "stored_pairs")]
    pairs: Vec<FramePair>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Earlier {
    index: usize,
    time_s: f64,
    strongest: Strongest,
}

/// The strongest keypoints of a frame that the lens model reaches.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Strongest {
    ideal: Vec<Vector2<f64>>,
    #[serde(with = "stored_descriptors")]
    descriptors: Vec<[u8; 128]>,
}

impl PairCollector {
    /// A collector for a run of `frames` frames.
    #[must_use]
    pub fn new(frames: usize) -> Self {
        Self {
            spacing: frames.div_ceil(MAX_PAIRS).max(1),
            gap: 1,
            next: 0,
            earlier: None,
            pairs: Vec::new(),
        }
    }

    /// Takes note of frame `index`.
    pub fn observe(&mut self, index: usize, time_s: f64, features: &Features, camera: &Camera) {
        let mut strongest = None;
        if let Some(earlier) = &self.earlier {
            if index < earlier.index + self.gap {
                return;
            }
            let later = Strongest::of(features, camera);
            let pair = FramePair {
                from_s: earlier.time_s,
                to_s: time_s,
                matches: earlier.strongest.matches(&later),
            };
            self.next = self.next.max(earlier.index + self.spacing);
            self.earlier = None;
            if pair.matches.len() < MIN_MATCHES {
                self.gap = (self.gap / 2).max(1);
            } else if pair
                .median_displacement_px()
                .is_some_and(|px| px < MIN_DISPLACEMENT_PX)
            {
                self.gap = (self.gap * 2).min(MAX_GAP);
            }
            self.pairs.push(pair);
            strongest = Some(later);
        }
        if self.earlier.is_none() && index >= self.next {
            self.earlier = Some(Earlier {
                index,
                time_s,
                strongest: strongest.unwrap_or_else(|| Strongest::of(features, camera)),
            });
        }
    }

    /// Whether it is as a run leaves it: to be asked of one that was read from a file.
    pub(crate) fn is_whole(&self) -> bool {
        let earlier = self.earlier.as_ref();
        self.gap >= 1
            && self.gap <= MAX_GAP
            && earlier.is_none_or(|e| e.strongest.ideal.len() == e.strongest.descriptors.len())
    }

    /// The pairs so far.
    #[must_use]
    pub fn pairs(&self) -> &[FramePair] {
        &self.pairs
    }
}

impl Strongest {
    fn of(features: &Features, camera: &Camera) -> Self {
        let mut order: Vec<usize> =
            (0..features.keypoints.len().min(features.descriptors.len())).collect();
        order.sort_by(|&a, &b| {
            let response = |i: usize| features.keypoints[i].response;
            response(b).total_cmp(&response(a)).then(a.cmp(&b))
        });
        let mut strongest = Self {
            ideal: Vec::new(),
            descriptors: Vec::new(),
        };
        for i in order {
            if strongest.ideal.len() == KEYPOINTS {
                break;
            }
            let k = &features.keypoints[i];
            let raw = Vector2::new(f64::from(k.x), f64::from(k.y));
            if let Ok(ideal) = camera.undistort_pixel(&raw) {
                strongest.ideal.push(ideal);
                strongest.descriptors.push(features.descriptors[i]);
            }
        }
        strongest
    }

    fn matches(&self, later: &Self) -> Vec<[Vector2<f64>; 2]> {
        // The ratio and the counts are within what the matcher takes.
        match_mutual(&self.descriptors, &later.descriptors, RATIO)
            .unwrap_or_default()
            .iter()
            .map(|m| [self.ideal[m.query as usize], later.ideal[m.id as usize]])
            .collect()
    }
}

/// Pairs as triples: times, matches.
mod stored_pairs {
    use motion_consistency::FramePair;
    use nalgebra::Vector2;
    use serde::{Deserialize, Deserializer, Serializer};

    type Triple = (f64, f64, Vec<[Vector2<f64>; 2]>);

    pub(super) fn serialize<S: Serializer>(
        pairs: &[FramePair],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(pairs.iter().map(|p| (p.from_s, p.to_s, &p.matches)))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<FramePair>, D::Error> {
        let triples = Vec::<Triple>::deserialize(deserializer)?;
        Ok(triples
            .into_iter()
            .map(|(from_s, to_s, matches)| FramePair {
                from_s,
                to_s,
                matches,
            })
            .collect())
    }
}

/// Descriptors as bytes, one after the other.
mod stored_descriptors {
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(
        descriptors: &[[u8; 128]],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(descriptors.as_flattened())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<[u8; 128]>, D::Error> {
        let bytes = <&[u8]>::deserialize(deserializer)?;
        match bytes.as_chunks() {
            (whole, []) => Ok(whole.to_vec()),
            _ => Err(D::Error::invalid_length(
                bytes.len(),
                &"128 bytes a descriptor",
            )),
        }
    }
}
