//! Rendered checkerboards: found or refused with a reason, measured as well as they claim, calibrated within their
//! covariance.

#![expect(
    clippy::unwrap_used,
    reason = "a helper that fails is a test that fails"
)]

mod accuracy;
mod common;
mod covariance;
mod detection;
