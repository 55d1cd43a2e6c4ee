//! The indexes and matchers through their public interface, against a model that sorts everything.

#![expect(clippy::unwrap_used, reason = "a failed step fails the test")]

mod exact_scan;
mod inverted_lists;
mod linear_scan;
mod matching;
mod oracle;
mod recall;
mod scene;
mod support;
