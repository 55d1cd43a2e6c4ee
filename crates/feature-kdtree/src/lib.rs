//! Nearest neighbours of 128-byte descriptors in a map that grows every frame, and the matching built on them.
//!
//! A camera that comes back to a place sees keypoints whose descriptors (SIFT, 128 bytes) are near those it saw before.
//! Whether two keypoints show the same point is decided by the two nearest descriptors of the map: a match is clearly
//! nearer than the second nearest. This crate keeps such a map, answers that question exactly or approximately, and
//! makes one-to-one matches of the answers.
//!
//! ```
//! use feature_kdtree::{AutoIndex, DescriptorIndex, match_descriptors};
//!
//! let mut map = AutoIndex::new();
//! map.insert(1, &[10; 128])?;
//! map.insert(2, &[90; 128])?;
//!
//! let seen_again = [12; 128];
//! let matches = match_descriptors(&[seen_again], &map, 0.7)?;
//! assert_eq!((matches[0].query, matches[0].id), (0, 1));
//! # Ok::<(), feature_kdtree::IndexError>(())
//! ```
//!
//! Use it for descriptors of 128 bytes that are compared by the Euclidean distance, in a set that changes while it is
//! searched. It is not for floating-point or binary descriptors, for other lengths, for more than two neighbours, or for
//! points in two or three dimensions, where an ordinary k-d tree is exact and fast.
//!
//! Three types to know:
//! * [`DescriptorIndex`] is the question: insert, remove, and find the two nearest of one query or of a batch.
//! * [`AutoIndex`] is the answer to start with: exact up to 4000 entries, approximate and fast beyond.
//! * [`ExactScan`] is the exact answer at any size, and the reference for [`InvertedLists`] and [`KdForest`], which are
//!   the approximate ones. Collected from a part of a map, it searches that part alone.
//!
//! [`match_descriptors`] matches queries to an index, [`match_mutual`] two frames to each other.
//!
//! # Inside
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
