//! The decision which frames are filter steps.
//!
//! The frames between keyframes only refine the pose that is reported: their baseline is too short to tell depth, and
//! tiny steps hurt the filter. The measure is parallax, the image motion that is left once the rotation is taken out:
//! turning tells no depth. Nothing depends on the frame rate.

use crate::config::KeyframesSection;

/// Thresholds of the decision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct KeyframePolicy {
    /// Median parallax since the last keyframe that makes a filter step, pixels.
    pub(crate) min_parallax_px: f64,
    /// Share of the last keyframe's matches below which a filter step is made.
    pub(crate) min_overlap: f64,
    /// Longest time between filter steps, seconds.
    pub(crate) max_gap_s: f64,
}

/// The facts of a frame that the decision looks at.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct KeyframeCues {
    /// Time since the last keyframe, seconds.
    pub(crate) since_s: f64,
    /// Accepted matches.
    pub(crate) matches: usize,
    /// Accepted matches of the last keyframe.
    pub(crate) matches_at_keyframe: usize,
    /// Parallax since the last keyframe of each match that was seen there, pixels.
    pub(crate) parallax_px: Vec<f64>,
}

impl From<&KeyframesSection> for KeyframePolicy {
    fn from(section: &KeyframesSection) -> Self {
        Self {
            min_parallax_px: section.min_parallax_px,
            min_overlap: section.min_overlap,
            max_gap_s: section.max_gap_s,
        }
    }
}

impl KeyframePolicy {
    /// Whether the frame is a filter step: it moved far enough, it saw too little of the last step, or too much time
    /// has passed. A frame whose parallax cannot be measured is one, too.
    pub(crate) fn wants(&self, mut cues: KeyframeCues) -> bool {
        if cues.since_s >= self.max_gap_s
            || (cues.matches as f64) < self.min_overlap * cues.matches_at_keyframe as f64
            || cues.parallax_px.is_empty()
        {
            return true;
        }
        let middle = cues.parallax_px.len() / 2;
        let (_, median, _) = cues
            .parallax_px
            .select_nth_unstable_by(middle, f64::total_cmp);
        *median >= self.min_parallax_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POLICY: KeyframePolicy = KeyframePolicy {
        min_parallax_px: 8.0,
        min_overlap: 0.5,
        max_gap_s: 10.0,
    };

    fn quiet() -> KeyframeCues {
        KeyframeCues {
            since_s: 3.0,
            matches: 80,
            matches_at_keyframe: 100,
            parallax_px: vec![1.0, 2.0, 50.0],
        }
    }

    #[test]
    fn an_ordinary_frame_is_none() {
        assert!(!POLICY.wants(quiet()));
    }

    #[test]
    fn motion_overlap_time_and_blindness_make_one() {
        for cues in [
            KeyframeCues {
                parallax_px: vec![1.0, 8.0, 9.0],
                ..quiet()
            },
            KeyframeCues {
                matches: 49,
                ..quiet()
            },
            KeyframeCues {
                since_s: 10.0,
                ..quiet()
            },
            KeyframeCues {
                parallax_px: Vec::new(),
                ..quiet()
            },
        ] {
            assert!(POLICY.wants(cues.clone()), "{cues:?}");
        }
    }
}
