//! Integration tests of the crate, one binary.

mod angles;
mod chi_square;
mod cholesky;
mod planar;
mod rotations;

use proptest::test_runner::Config;

fn config(cases: u32) -> Config {
    Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    }
}
