//! The threshold `--max-ate` that several commands share.

use crate::failure::Failure;

/// A threshold in metres: finite and positive.
pub(crate) fn metres(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a positive number of metres".into()),
    }
}

/// Fails when an absolute trajectory error is above the threshold given.
pub(crate) fn check_ate(rmse_m: f64, max_ate_m: Option<f64>) -> Result<(), Failure> {
    match max_ate_m {
        Some(max_ate_m) if rmse_m > max_ate_m => Err(Failure::Threshold(format!(
            "the absolute trajectory error is {rmse_m:.6} m RMSE, --max-ate allows {max_ate_m} m"
        ))),
        _ => Ok(()),
    }
}
