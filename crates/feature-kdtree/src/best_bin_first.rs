//! Search of several trees at once, nearest cells first (Beis and Lowe 1997; Muja and Lowe 2009).
//!
//! Steps:
//! 1. Walk from each root to the leaf of the query; at each split put the other side on one common heap under
//!    the squared distance from the query to that side's cell.
//! 2. Take the nearest cell from the heap, walk on from there, until the bound on leaves is used up or the
//!    nearest cell is farther than the second nearest entry found.
//!
//! The distance to a cell is exact: it is the sum over components of the squared offset to the cell's side, and
//! a later split in the same component replaces the earlier offset instead of adding to it (Arya and Mount 1993).
//! Without a bound on leaves the search is therefore exact, and ties go to the lower id, because a cell exactly as far
//! as the second nearest is still visited.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use simd_level::SimdLevel;

use crate::index::BestTwo;
use crate::kd_tree::{KdTree, Node};
use crate::near_rows::{Collector, scan_near};
use crate::row_block::PreparedQuery;
use crate::{Descriptor, Neighbour};

/// The path to a cell has not turned away from the query yet.
const NO_TURN: u32 = u32::MAX;

/// A cell to visit. The order of the fields is the order of visits, which makes that order the same on every run.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Branch {
    cell_distance_squared: u32,
    tree: u32,
    node: u32,
    turn: u32,
}

/// A split at which the path to a cell left the side of the query, and the turn before it.
#[derive(Debug)]
struct Turn {
    dimension: u8,
    offset_squared: u32,
    previous: u32,
}

/// The result of a search, and whether the bound on leaves ended it.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) best: BestTwo,
    pub(crate) cut_short: bool,
}

/// Visits at most `max_leaves` non-empty leaves of all trees together.
pub(crate) fn search(
    level: SimdLevel,
    trees: &[KdTree],
    query: &Descriptor,
    max_leaves: usize,
    accept: impl Fn(u32) -> bool,
) -> Found {
    let prepared = PreparedQuery::new(query);
    let prepared = std::slice::from_ref(&prepared);
    let mut accepted = Accepted {
        accept,
        best: BestTwo::default(),
    };
    let mut turns: Vec<Turn> = Vec::new();
    let mut heap: BinaryHeap<Reverse<Branch>> = (0..trees.len() as u32)
        .map(|tree| {
            Reverse(Branch {
                cell_distance_squared: 0,
                tree,
                node: KdTree::ROOT,
                turn: NO_TURN,
            })
        })
        .collect();
    let mut leaves = 0;
    while let Some(Reverse(branch)) = heap.pop() {
        if branch.cell_distance_squared > accepted.best.worst_distance_squared() {
            break;
        }
        if leaves == max_leaves {
            return Found {
                best: accepted.best,
                cut_short: true,
            };
        }
        let tree = &trees[branch.tree as usize];
        let mut node = branch.node;
        let rows = loop {
            match tree.node(node) {
                Node::Leaf { rows, .. } => break rows,
                &Node::Split {
                    dimension,
                    threshold,
                    left,
                    right,
                } => {
                    let value = query[usize::from(dimension)];
                    let (near, far, offset) = if value <= threshold {
                        (left, right, u32::from(threshold - value) + 1)
                    } else {
                        (right, left, u32::from(value - threshold))
                    };
                    let offset_squared = offset * offset;
                    let replaced = offset_squared_in(&turns, branch.turn, dimension);
                    let far_distance_squared =
                        branch.cell_distance_squared - replaced + offset_squared;
                    if far_distance_squared <= accepted.best.worst_distance_squared() {
                        heap.push(Reverse(Branch {
                            cell_distance_squared: far_distance_squared,
                            tree: branch.tree,
                            node: far,
                            turn: turns.len() as u32,
                        }));
                        turns.push(Turn {
                            dimension,
                            offset_squared,
                            previous: branch.turn,
                        });
                    }
                    node = near;
                }
            }
        };
        if rows.len() == 0 {
            continue;
        }
        leaves += 1;
        scan_near(level, rows, prepared, &[0], &mut accepted);
    }
    Found {
        best: accepted.best,
        cut_short: false,
    }
}

/// The best two of the accepted entries.
struct Accepted<F> {
    accept: F,
    best: BestTwo,
}

impl<F: Fn(u32) -> bool> Collector for Accepted<F> {
    fn limit(&self, _: u32) -> u32 {
        self.best.worst_distance_squared()
    }

    fn take(&mut self, _: u32, distance_squared: u32, id: u32) {
        if distance_squared <= self.best.worst_distance_squared() && (self.accept)(id) {
            self.best.offer(Neighbour {
                distance_squared,
                id,
            });
        }
    }
}

/// The squared offset that the path already has in this component; zero when it never turned away in it.
fn offset_squared_in(turns: &[Turn], last: u32, dimension: u8) -> u32 {
    let mut turn = last;
    while turn != NO_TURN {
        let Turn {
            dimension: turned_in,
            offset_squared,
            previous,
        } = turns[turn as usize];
        if turned_in == dimension {
            return offset_squared;
        }
        turn = previous;
    }
    0
}
