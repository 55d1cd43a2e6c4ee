//! Mishaps of a drive: a robot that is carried away, a lens that sees nothing, a shutter that is slow, a passer-by.
//!
//! All are off for the paper's experiments. Frames are frames of the specification, half a second each; at another frame
//! rate the images at these times are meant.

use serde::{Deserialize, Serialize};

/// Frames from `from` up to and without `to`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameSpan {
    /// First frame.
    pub from: usize,
    /// First frame that no longer belongs to it.
    pub to: usize,
}

/// The robot is lifted just before a frame and set down further along its course; its wheels do not notice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Kidnap {
    /// First frame at the new place.
    pub frame: usize,
    /// Metres, as the crow flies, from the old place to the new one.
    pub metres: f64,
}

/// Everything that happens to the robot or to its camera.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Mishaps {
    /// The robot is carried away.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kidnap: Option<Kidnap>,
    /// No light reaches the sensor: read noise about zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark: Option<FrameSpan>,
    /// Something covers the lens: one dim tone with the noise of that tone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blocked: Option<FrameSpan>,
    /// Time the shutter is open about the time of an image, seconds; what moves meanwhile is smeared.
    #[serde(skip_serializing_if = "is_zero")]
    pub shutter_s: f64,
    /// A person-sized block walks between the robot and the walls.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub walker: bool,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl FrameSpan {
    /// Whether the time of an image, in frames, lies in the span.
    pub(crate) fn holds(self, frames: f64) -> bool {
        (self.from as f64..self.to as f64).contains(&frames)
    }
}

impl Mishaps {
    /// The mishaps, a sentence each.
    pub(crate) fn told(&self) -> Vec<String> {
        let mut told = Vec::new();
        if let Some(Kidnap { frame, metres }) = self.kidnap {
            told.push(format!(
                "just before frame {frame} the robot is lifted and set down {metres} m away; the odometry does not know"
            ));
        }
        for (span, what) in [
            (self.dark, "no light reaches the sensor"),
            (self.blocked, "the lens is covered"),
        ] {
            if let Some(FrameSpan { from, to }) = span {
                told.push(format!("from frame {from} until before frame {to} {what}"));
            }
        }
        if self.shutter_s > 0.0 {
            told.push(format!(
                "the shutter is open for {} s about the time of each image",
                self.shutter_s
            ));
        }
        if self.walker {
            told.push("a person-sized block walks between the robot and the walls".into());
        }
        told
    }
}
