//! Integration tests of the public interface, one binary.

mod filter;
mod kld;
mod landmark_map;
mod weights;
