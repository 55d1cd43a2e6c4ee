//! Monocular landmark SLAM for wheeled robots.

pub mod record;
