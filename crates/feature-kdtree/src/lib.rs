//! Nearest neighbours of 128-byte descriptors in a map that grows every frame, and the matching built on them.
//!
//! Reading order: [`Descriptor`] and its distance, [`DescriptorIndex`] as the question every index answers,
//! [`ExactScan`], [`InvertedLists`] and [`KdForest`] as the answers and [`AutoIndex`] as the choice among them,
//! [`match_descriptors`] and [`match_mutual`] on top. Inside, the scan is `row_block` (the arithmetic), `simd` (the
//! instructions), `rows` (storage and search of many rows) and `near_rows` (search of a short list); the lists are `cells`
//! (rows near a centroid), `two_means` (their division) and `directory` (which cell is nearest); the forest is `kd_tree`
//! and `best_bin_first`.

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
mod matching;
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
pub use descriptor::{Descriptor, distance_squared};
pub use error::IndexError;
pub use exact_scan::ExactScan;
pub use index::{DescriptorIndex, Neighbour, TwoNearest};
pub use inverted_lists::{InvertedLists, InvertedListsParams};
pub use kd_forest::{KdForest, KdForestParams};
pub use matching::{Match, match_descriptors, match_mutual};

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
