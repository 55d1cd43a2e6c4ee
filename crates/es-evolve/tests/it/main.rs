//! Integration tests of the crate, one binary.

mod evolution_paths;
mod invariance;
mod optimise;
mod paper;
mod support;
#[cfg(feature = "parallel")]
mod threads;
mod wrong_forms;
