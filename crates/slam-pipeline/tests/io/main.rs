//! Reading sequences, writing results, judging them: one test program, so that helpers are shared.

mod common;
mod evaluating;
mod output_writing;
mod reporting;
mod sequence_reading;
