//! Reading sequences, writing results, judging them: one test program, so that helpers are shared.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a helper that fails is a test that fails; a skipped test says so"
)]

mod calibrations;
mod common;
mod output_writing;
mod reporting;
mod sequence_reading;
