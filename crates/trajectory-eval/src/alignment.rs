//! The motions that may be removed from an estimate before it is compared, and the map that removes them.

use std::fmt;

use nalgebra::Isometry3;

/// The motion that is removed from the estimate before errors are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alignment {
    /// Nothing: both trajectories share a frame.
    None,
    /// One rotation about the vertical through the first matched position of the reference.
    ///
    /// It frees the first heading of the reference and nothing else: for references that are exact in the shape of the
    /// path but start in a direction of their own.
    Heading,
    /// Rotation about z and translation in the plane.
    Se2,
    /// Rotation about z, translation in the plane and scale: for planar paths whose unit of length is arbitrary.
    ///
    /// It is determined by a straight path, too, and never turns a path over, as a rotation in space could.
    Sim2,
    /// Rotation and translation.
    Se3,
    /// Rotation, translation and scale.
    Sim3,
}

impl fmt::Display for Alignment {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Alignment::None => "none",
            Alignment::Heading => "heading",
            Alignment::Se2 => "se2",
            Alignment::Sim2 => "sim2",
            Alignment::Se3 => "se3",
            Alignment::Sim3 => "sim3",
        })
    }
}

/// `x -> scale * R x + t`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Scale; one unless the alignment was [`Alignment::Sim2`] or [`Alignment::Sim3`].
    pub scale: f64,
    /// Rotation and translation, applied after the scale.
    pub reference_from_estimate: Isometry3<f64>,
}

impl Similarity {
    /// The aligned pose: its position scaled, then moved; its rotation turned.
    pub fn apply(&self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let mut scaled = *pose;
        scaled.translation.vector *= self.scale;
        self.reference_from_estimate * scaled
    }
}
