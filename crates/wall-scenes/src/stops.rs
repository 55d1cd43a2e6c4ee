//! When the robot drives, stands still, or turns on the spot.
//!
//! After every so many frames of driving it stops for a number of frames: to stand, or to turn once around to the left,
//! after which it heads where it headed before. Where both are due, it stands first. The course is that of a robot that
//! never stops; only its times differ.

use serde::{Deserialize, Serialize};

/// A stop that comes again and again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stop {
    /// Frames of driving from one stop to the next.
    pub every: usize,
    /// Frames that it lasts.
    pub frames: usize,
}

/// The doings of the robot during a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Doing {
    /// It follows its course.
    Drive,
    /// It stands.
    Stand,
    /// It turns on the spot, a full turn in this many frames.
    Spin(usize),
}

/// The stops of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Stops {
    /// Standing still.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pause: Option<Stop>,
    /// Turning once around on the spot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spin: Option<Stop>,
}

impl Stops {
    /// Frames that the stops add to `driven` frames of driving.
    pub(crate) fn added(&self, driven: usize) -> usize {
        let of = |stop: Option<Stop>| {
            stop.map_or(0, |s| (driven / s.every.max(1)).saturating_mul(s.frames))
        };
        of(self.pause).saturating_add(of(self.spin))
    }

    /// The doing of the robot in each of `frames` frames.
    pub(crate) fn plan(&self, frames: usize) -> Vec<Doing> {
        let mut doings = Vec::with_capacity(frames);
        let mut driven = 0_usize;
        while doings.len() < frames {
            doings.push(Doing::Drive);
            driven += 1;
            let due = |stop: &Stop| driven.is_multiple_of(stop.every.max(1));
            if let Some(pause) = self.pause.filter(due) {
                doings.extend(std::iter::repeat_n(Doing::Stand, pause.frames));
            }
            if let Some(spin) = self.spin.filter(due) {
                doings.extend(std::iter::repeat_n(Doing::Spin(spin.frames), spin.frames));
            }
        }
        doings.truncate(frames);
        doings
    }

    /// Frames of driving among `frames` frames.
    pub(crate) fn driven(&self, frames: usize) -> usize {
        if *self == Self::default() {
            return frames;
        }
        let drives = |doing: &&Doing| **doing == Doing::Drive;
        self.plan(frames).iter().filter(drives).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_come_after_the_stated_frames_of_driving_and_add_their_own() {
        let stops = Stops {
            pause: Some(Stop {
                every: 3,
                frames: 2,
            }),
            spin: Some(Stop {
                every: 6,
                frames: 4,
            }),
        };
        let total = 7 + stops.added(7);
        assert_eq!(total, 7 + 2 * 2 + 4);
        let text: String = stops
            .plan(total)
            .iter()
            .map(|doing| match doing {
                Doing::Drive => 'd',
                Doing::Stand => 's',
                Doing::Spin(_) => 't',
            })
            .collect();
        assert_eq!(text, "dddssdddssttttd");
        assert_eq!(stops.driven(total), 7);
        assert_eq!(Stops::default().driven(9), 9);
    }
}
