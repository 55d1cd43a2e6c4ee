//! How badly a datum fits a model: squared residuals in standard deviations, truncated.

/// Scores models; `D` is the type of a datum, `M` of a model.
pub trait Scorer<D, M> {
    /// Squared residual divided by its variance: chi-square distributed for an inlier. NaN counts as infinite.
    fn squared_residual(&self, model: &M, datum: &D) -> f64;

    /// Largest squared residual of an inlier, in variances: a chi-square quantile.
    fn threshold(&self) -> f64;

    /// Cost of a squared residual, not negative. By default MSAC's: the square itself, truncated at the threshold.
    fn cost(&self, squared_residual: f64) -> f64 {
        // Written so that NaN costs the threshold.
        if squared_residual < self.threshold() {
            squared_residual
        } else {
            self.threshold()
        }
    }
}

/// The truncated quadratic over the squared residuals of a closure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Msac<F> {
    squared_residual: F,
    threshold: f64,
}

impl<F> Msac<F> {
    /// A scorer from `squared_residual(model, datum)`, in variances, and the chi-square quantile that bounds an inlier
    /// (see [`estimation_base::chi_square_quantile`]; 95 % of one degree of freedom: 3.84, of two: 5.99).
    #[must_use]
    pub fn new(squared_residual: F, threshold: f64) -> Self {
        Self {
            squared_residual,
            threshold,
        }
    }
}

impl<D, M, F: Fn(&M, &D) -> f64> Scorer<D, M> for Msac<F> {
    fn squared_residual(&self, model: &M, datum: &D) -> f64 {
        (self.squared_residual)(model, datum)
    }

    fn threshold(&self) -> f64 {
        self.threshold
    }
}
