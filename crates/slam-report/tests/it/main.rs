//! The page of a run from outside.

#![expect(
    clippy::unwrap_used,
    reason = "a helper that fails is a test that fails"
)]

mod reporting;
/// The small run that `slam-io` writes in its own tests.
#[path = "../../../slam-io/tests/it/common/run.rs"]
mod run;
