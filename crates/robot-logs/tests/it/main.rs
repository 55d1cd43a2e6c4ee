//! Logs that the tests write, logs of the formats' own libraries, genuine ones, and none of them whole.

#![expect(
    clippy::unwrap_used,
    reason = "a helper that fails is a test that fails"
)]

mod containers;
mod genuine;
mod kept;
mod untrusted;
mod writer;
