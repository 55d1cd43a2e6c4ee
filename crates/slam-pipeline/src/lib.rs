//! Monocular landmark SLAM for wheeled robots.

pub mod record;
pub mod sequence;
