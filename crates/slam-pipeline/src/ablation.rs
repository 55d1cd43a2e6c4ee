//! Parts of the exact filter that a study may take away, one at a time.

/// A part of the exact filter that is taken away to see what it is worth.
///
/// For studies: [`Slam::ablated`](crate::Slam::ablated) builds such a filter. A robot has no use for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ablation {
    /// No evolution moves after resampling.
    NoEvolution,
    /// Poses are drawn from the odometry prior instead of the unscented posterior.
    NoUnscented,
    /// Every keyframe resamples.
    ResampleAlways,
    /// A landmark waits for two views with parallax.
    DelayedStarts,
    /// The weight is the likelihood alone.
    LikelihoodOnly,
    /// The weight of a keyframe forgets those before it.
    WeightsNotCarried,
    /// Poses are drawn from one extended Kalman update, as in FastSLAM 2.0.
    FirstOrderProposal,
}
