//! The estimator and the association against closed forms, brute force and Monte Carlo.

#![expect(
    clippy::unwrap_used,
    reason = "a helper that cannot go on fails its test"
)]

mod common;
mod frontend;
mod landmark;
mod landmark_update;
mod likelihood;
mod mapping;
mod metric;
mod motion;
mod pose;
