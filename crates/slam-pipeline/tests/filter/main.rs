//! The estimator and the association against closed forms, brute force and Monte Carlo.

mod common;
mod frontend;
mod landmark;
mod landmark_update;
mod likelihood;
mod mapping;
mod metric;
mod motion;
mod pose;
