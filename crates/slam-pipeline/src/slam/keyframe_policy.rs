//! The decision which frames are filter steps.
//!
//! The frames between keyframes only refine the pose that is reported: their baseline is too short to tell depth, and
//! tiny steps hurt the filter.

use crate::config::KeyframesSection;

/// Thresholds of the decision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct KeyframePolicy {
    /// Median image motion since the last keyframe that makes a filter step, pixels.
    pub(crate) min_flow_px: f64,
    /// Share of the last keyframe's matches below which a filter step is made.
    pub(crate) min_overlap: f64,
    /// Largest number of frames between filter steps.
    pub(crate) max_gap: u32,
}

/// The facts of a frame that the decision looks at.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct KeyframeCues {
    /// Frames since the last keyframe, this one included.
    pub(crate) frames_since: u32,
    /// Accepted matches.
    pub(crate) matches: usize,
    /// Accepted matches of the last keyframe.
    pub(crate) matches_at_keyframe: usize,
    /// Image motion since the last keyframe of each match that was seen there, pixels.
    pub(crate) flow_px: Vec<f64>,
}

impl From<&KeyframesSection> for KeyframePolicy {
    fn from(section: &KeyframesSection) -> Self {
        Self {
            min_flow_px: section.min_flow_px,
            min_overlap: section.min_overlap,
            max_gap: section.max_gap,
        }
    }
}

impl KeyframePolicy {
    /// Whether the frame is a filter step: it moved far enough, it saw too little of the last step, or too many frames
    /// have passed. A frame whose image motion cannot be measured is one, too.
    pub(crate) fn wants(&self, mut cues: KeyframeCues) -> bool {
        if cues.frames_since >= self.max_gap
            || (cues.matches as f64) < self.min_overlap * cues.matches_at_keyframe as f64
            || cues.flow_px.is_empty()
        {
            return true;
        }
        let middle = cues.flow_px.len() / 2;
        let (_, median, _) = cues.flow_px.select_nth_unstable_by(middle, f64::total_cmp);
        *median >= self.min_flow_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POLICY: KeyframePolicy = KeyframePolicy {
        min_flow_px: 8.0,
        min_overlap: 0.5,
        max_gap: 20,
    };

    fn quiet() -> KeyframeCues {
        KeyframeCues {
            frames_since: 3,
            matches: 80,
            matches_at_keyframe: 100,
            flow_px: vec![1.0, 2.0, 50.0],
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
                flow_px: vec![1.0, 8.0, 9.0],
                ..quiet()
            },
            KeyframeCues {
                matches: 49,
                ..quiet()
            },
            KeyframeCues {
                frames_since: 20,
                ..quiet()
            },
            KeyframeCues {
                flow_px: Vec::new(),
                ..quiet()
            },
        ] {
            assert!(POLICY.wants(cues.clone()), "{cues:?}");
        }
    }
}
