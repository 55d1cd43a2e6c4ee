//! Integration tests of the public interface, one binary.

mod bearing_landmark;
mod filter;
mod kld;
mod landmark_map;
mod weights;
