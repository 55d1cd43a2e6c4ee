//! Unscented transform and unscented Kalman filter on manifolds, no_std.
