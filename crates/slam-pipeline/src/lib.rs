//! Monocular landmark SLAM for wheeled robots.

pub mod config;
pub mod filter;
pub mod frontend;
pub mod odometry;
pub mod record;
pub mod slam;
pub mod stopwatch;
