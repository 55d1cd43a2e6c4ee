//! Pairs of frames spread over a run, for the question whether odometry and images fit.

use feature_kdtree::match_mutual;
use mono_geometry::Camera;
use motion_consistency::FramePair;
use nalgebra::Vector2;
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
#[derive(Debug, Clone)]
pub struct PairCollector {
    spacing: usize,
    gap: usize,
    next: usize,
    earlier: Option<Earlier>,
    pairs: Vec<FramePair>,
}

#[derive(Debug, Clone)]
struct Earlier {
    index: usize,
    time_s: f64,
    strongest: Strongest,
}

/// The strongest keypoints of a frame that the lens model reaches.
#[derive(Debug, Clone)]
struct Strongest {
    ideal: Vec<Vector2<f64>>,
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
