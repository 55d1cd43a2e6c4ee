//! Models from data: the part of robust estimation that knows the problem.

/// Fits models to few data, and optionally to many.
pub trait Solver {
    /// One measurement, for example a match of two pixels.
    type Datum;
    /// The model that is estimated.
    type Model;

    /// Number of data in a minimal sample, at least 1.
    fn sample_size(&self) -> usize;

    /// Appends every model that fits the data with the indices of `sample` ([`Self::sample_size`] of them, all
    /// different). Appends nothing for a degenerate sample.
    fn fit(&self, data: &[Self::Datum], sample: &[usize], models: &mut Vec<Self::Model>);

    /// A better model from all its inliers (at least a sample of them), for local optimisation; `None` if there is none.
    ///
    /// `model` is where they come from, a start for iterative methods. The default has nothing to offer.
    fn refit(
        &self,
        _data: &[Self::Datum],
        _inliers: &[usize],
        _model: &Self::Model,
    ) -> Option<Self::Model> {
        None
    }
}
