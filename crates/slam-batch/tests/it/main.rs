//! The batch through its public interface, on simulated drives.

#![expect(
    clippy::unwrap_used,
    reason = "a helper that cannot go on fails its test"
)]

mod recovery;
mod refused;
mod simulation;
mod whole_run;
