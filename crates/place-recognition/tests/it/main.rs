//! Integration tests: simulated maps with a known truth, unusable input, and recorded corridors.

mod corridor;
mod degenerate;
mod index;
mod lens;
mod localise;
mod posters;

mod two_views;
mod world;
