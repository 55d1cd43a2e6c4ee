//! The points that pass from stage to stage: samples of the pyramid and refined extrema.

/// A sample of the differences of one octave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Sample {
    pub(crate) level: usize,
    pub(crate) y: usize,
    pub(crate) x: usize,
}

/// A refined extremum in the coordinates of its octave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScalePoint {
    /// The sample on which the fit settled; different candidates may settle on the same one.
    pub(crate) sample: Sample,
    /// The column in octave pixels.
    pub(crate) x: f32,
    /// The row in octave pixels.
    pub(crate) y: f32,
    /// The level within the octave, fractional.
    pub(crate) level: f32,
    /// The contrast, `|D(x^)|`.
    pub(crate) response: f32,
}

/// Largest offsets of a refined extremum from its sample that are accepted, per axis, samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OffsetLimits {
    /// A fit within this offset has settled.
    pub(crate) settled: f32,
    /// A fit that can move no further is kept within this offset.
    pub(crate) last: f32,
}
