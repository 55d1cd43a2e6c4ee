//! Checkerboards: found or refused with a reason, measured as well as they claim, calibrated within their covariance.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a helper that fails is a test that fails; a skipped test says so"
)]

mod accuracy;
mod chain;
mod common;
mod detection;
mod real;
