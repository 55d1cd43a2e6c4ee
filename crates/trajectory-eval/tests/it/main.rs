//! Errors of trajectories against the figures of evo and against closed forms.

#![expect(
    clippy::unwrap_used,
    reason = "a helper that fails is a test that fails"
)]

mod errors;
