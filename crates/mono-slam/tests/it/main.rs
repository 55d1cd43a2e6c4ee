//! The program and its library from outside.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a helper that fails is a test that fails; a skipped test says so"
)]

mod batch_command;
mod calibration_files;
mod commands;
mod comparison;
mod contradictions;
mod edges;
mod faults;
mod fixtures;
mod going_on;
mod info_command;
mod map_commands;
mod recorded_board;
mod recorded_logs;
mod refinement;
mod smoothed_path;
mod trajectories;
mod without_odometry;
