//! Zhang's calibration on simulated targets with known truth: exactness, consistency, degenerate views, warnings.

mod closed_form;
mod covariance;
mod degenerate;
mod recovery;
mod scene;
