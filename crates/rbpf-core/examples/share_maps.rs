//! What a resampling of 100 particles costs, shared maps against plain vectors, without and with ten
//! landmarks updated in each copy. Prints CSV: time in microseconds (median of all repeats) and the bytes the 100 new maps hold
//! beside the old one. The ten landmarks lie in ten leaves whatever the size of the map; releasing the copies is not timed.
//!
//! `cargo run --release -p rbpf-core --example share_maps`

use nalgebra::{Matrix2, Vector2};
use rbpf_core::{CowMap, Gaussian, Landmark};
use std::alloc::{GlobalAlloc, Layout, System};
use std::hint::black_box;
use std::time::Instant;

const PARTICLES: usize = 100;
/// Landmarks 97 k: no two in a leaf of 16, all below 1000.
const UPDATED: std::ops::Range<u32> = 0..10;
