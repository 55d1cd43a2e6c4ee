#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`DescriptorIndex`] is the question: insert, remove, find the two nearest of one query or of a batch. [`AutoIndex`] is the
//! answer to start with, [`ExactScan`] the exact one and the reference for [`InvertedLists`] and [`KdForest`].
//! [`match_descriptors`] matches queries to an index, [`match_mutual`] two frames to each other. [`LinearScan`] under a [`Metric`]
//! ([`SquaredEuclidean`], [`Hamming`]) is for all other descriptors.
//!
//! ## Inside
//!
//! The scan is `row_block` (the layout of sixteen rows), `simd` (the kernels), `rows` (storage), `row_scan` (the search of
//! many rows) and `near_rows` (the search of a short list). Inverted lists are `cells` (rows near a centroid), `two_means`
//! (the division of a cell) and `directory` (the nearest cells). The forest is `kd_tree` and `best_bin_first`.

mod auto_index;
mod best_bin_first;
mod cells;
mod descriptor;
mod directory;
mod error;
mod exact_scan;
mod id_map;
mod id_table;
mod index;
mod inverted_lists;
mod kd_forest;
mod kd_tree;
mod linear_scan;
mod matching;
mod metric;
mod near_rows;
mod row_block;
mod row_scan;
mod rows;
#[cfg_attr(
    target_arch = "x86_64",
    expect(
        unsafe_code,
        reason = "the instructions of the scan are chosen at run time"
    )
)]
mod simd;
mod smallest;
mod two_means;

pub use auto_index::AutoIndex;
pub use descriptor::{Descriptor, distance_squared, distance_squared_within};
pub use error::IndexError;
pub use exact_scan::ExactScan;
pub use index::{DescriptorIndex, Neighbour, TwoNearest};
pub use inverted_lists::{InvertedLists, InvertedListsParams};
pub use kd_forest::{KdForest, KdForestParams};
pub use linear_scan::{Found, LinearScan, Matched};
pub use matching::{Match, match_descriptors, match_mutual};
pub use metric::{Distance, Hamming, Metric, SquaredEuclidean};
pub use simd_level::SimdLevel;
