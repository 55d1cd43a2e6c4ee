//! The promises of the renderer as a whole: exact truth, and the same bytes from the same specification.

#![expect(
    clippy::unwrap_used,
    reason = "a helper that fails is a test that fails"
)]

mod board;
mod happenings;
mod scene;
