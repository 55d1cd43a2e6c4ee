//! The estimator against closed forms, brute force and Monte Carlo.

pub(crate) mod common;
mod fixed_lag;
mod landmark;
mod landmark_update;
mod lens;
mod likelihood;
mod mapping;
mod metric;
mod motion;
mod pose;
mod revisit;
mod window_covariance;
