//! Monocular landmark SLAM for wheeled robots.

pub mod evaluation;
pub mod output;
pub mod record;
pub mod report;
pub mod sequence;
