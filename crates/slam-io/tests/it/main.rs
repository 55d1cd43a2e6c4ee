//! Sequences and calibrations are read, results written and read back.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a helper that fails is a test that fails; a skipped test says so"
)]

mod calibrations;
mod calibrations_found;
mod calibrations_genuine;
mod common;
mod hostile;
mod odometry_reading;
mod output_writing;
mod recorded_logs;
mod sequence_images;
mod sequence_layouts;
mod sequence_reading;
mod standing_in;
