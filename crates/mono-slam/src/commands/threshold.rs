//! Numbers on the command line, and the threshold `--max-ate` that several commands share.

use crate::failure::Failure;

/// A threshold in metres: finite and positive.
pub(crate) fn metres(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a positive number of metres".into()),
    }
}

/// A number of seconds of either sign.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("expected a number of seconds".into()),
    }
}

/// A positive number of seconds.
pub(crate) fn positive_seconds(text: &str) -> Result<f64, String> {
    match seconds(text) {
        Ok(value) if value > 0.0 => Ok(value),
        _ => Err("expected a positive number of seconds".into()),
    }
}

/// A whole number of at least zero.
pub(crate) fn whole<T: std::str::FromStr>(text: &str) -> Result<T, String> {
    text.parse()
        .map_err(|_out_of_range| "expected a whole number of at least 0".to_owned())
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
