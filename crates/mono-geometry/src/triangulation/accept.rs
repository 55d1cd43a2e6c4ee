//! The tests that a minimum of the reprojection error must pass to be believed.

use estimation_base::{chi_square_cdf, chi_square_quantile};

use super::observation::{
    Acceptance, Observation, Rejection, Triangulated, parallax_at, require_parallax,
};
use super::refine::Minimum;

/// The tests of step 5 on a minimum of the reprojection error.
pub(super) fn accept(
    observations: &[Observation],
    minimum: &Minimum,
    acceptance: &Acceptance,
) -> Result<Triangulated, Rejection> {
    let parallax_rad = require_parallax(parallax_at(observations, &minimum.point), acceptance)?;
    let degrees_of_freedom = 2 * observations.len() - 3;
    // The quantile is a bisection: for a point that passes, one value of the distribution decides.
    let probability = acceptance.chi_square_probability;
    let passed = chi_square_cdf(degrees_of_freedom as f64, minimum.chi_square) <= probability;
    if !passed {
        return Err(Rejection::ChiSquareTooLarge {
            chi_square: minimum.chi_square,
            threshold: chi_square_quantile(degrees_of_freedom as f64, probability).unwrap_or(0.0),
        });
    }
    Ok(Triangulated {
        point: minimum.point,
        covariance: minimum.covariance,
        parallax_rad,
        chi_square: minimum.chi_square,
        degrees_of_freedom,
        iterations: minimum.iterations,
    })
}
