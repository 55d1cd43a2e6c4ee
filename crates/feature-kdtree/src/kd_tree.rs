//! One randomised k-d tree over descriptors, grown and shrunk one entry at a time.
//!
//! A node splits its entries at the median of one component, drawn at random from the few of highest variance
//! (Silpa-Anan and Hartley 2008), so that several trees over the same entries cut space differently. Entries
//! live in the leaves, as rows that are scanned together; a leaf over its capacity splits, two neighbouring leaves
//! that removals have left half empty join.
//!
//! Degenerate cases: a component is split only where two entries differ in it, at a byte strictly below its maximum, so
//! that both sides receive an entry. Entries that are all equal stay in one leaf, however many they are; the next attempt
//! to split it waits until their number has doubled.
//!
//! All walks are loops, never recursion: the depth is bounded by the data alone (at most 255 splits for each component),
//! not by the stack. The forest keeps it near the logarithm of the number of leaves.

use std::cmp::Reverse;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::descriptor::{DESCRIPTOR_LENGTH, Descriptor};
use crate::rows::Rows;

/// The number of components of highest variance among which a split draws its own (Muja and Lowe 2009 use five).
const SPLIT_CANDIDATES: usize = 5;

/// The number of entries from which the median and variance of a node are taken at most.
const SPLIT_SAMPLE: usize = 128;

/// A node of a tree.
#[derive(Debug, Clone)]
pub(crate) enum Node {
    /// A split: entries with `descriptor[dimension] <= threshold` are on the left.
    Split {
        dimension: u8,
        threshold: u8,
        left: u32,
        right: u32,
    },
    /// A leaf, which holds entries.
    Leaf {
        rows: Rows,
        /// The leaf is split, where that is possible, when it holds more entries.
        split_above: usize,
    },
}

/// One randomised tree.
#[derive(Debug, Clone)]
pub(crate) struct KdTree {
    nodes: Vec<Node>,
    /// The numbers of nodes that are not in the tree any more.
    free: Vec<u32>,
    leaf_capacity: usize,
    rng: ChaCha8Rng,
}

impl KdTree {
    pub(crate) const ROOT: u32 = 0;

    /// An empty tree. The stream of random numbers makes it differ from its siblings.
    pub(crate) fn new(leaf_capacity: usize, seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self {
            nodes: vec![empty_leaf(leaf_capacity)],
            free: Vec::new(),
            leaf_capacity,
            rng,
        }
    }

    #[inline]
    pub(crate) fn node(&self, node: u32) -> &Node {
        &self.nodes[node as usize]
    }

    /// Adds an entry and returns the number of splits above its leaf.
    pub(crate) fn insert(&mut self, id: u32, descriptor: &Descriptor) -> usize {
        let path = self.path_to(descriptor);
        let leaf = path[path.len() - 1];
        if let Node::Leaf { rows, split_above } = &mut self.nodes[leaf as usize] {
            rows.push(id, descriptor);
            if rows.len() > *split_above {
                self.split_leaf(leaf);
            }
        }
        path.len() - 1
    }

    /// Whether the entry with this descriptor is in the tree.
    pub(crate) fn contains(&self, id: u32, descriptor: &Descriptor) -> bool {
        let path = self.path_to(descriptor);
        match self.node(path[path.len() - 1]) {
            Node::Leaf { rows, .. } => rows.ids().contains(&id),
            Node::Split { .. } => false,
        }
    }

    /// Removes the entry with this descriptor.
    pub(crate) fn remove(&mut self, id: u32, descriptor: &Descriptor) {
        let mut path = self.path_to(descriptor);
        if let Some(&leaf) = path.last()
            && let Node::Leaf { rows, .. } = &mut self.nodes[leaf as usize]
            && let Some(row) = rows.ids().iter().position(|&other| other == id)
        {
            rows.swap_remove(row);
        }
        path.pop();
        // A join may leave a leaf that joins in turn.
        while let Some(parent) = path.pop()
            && self.join_leaves(parent)
        {}
    }

    pub(crate) fn memory_usage(&self) -> usize {
        let leaves: usize = self
            .nodes
            .iter()
            .map(|node| match node {
                Node::Split { .. } => 0,
                Node::Leaf { rows, .. } => rows.memory_usage(),
            })
            .sum();
        self.nodes.capacity() * size_of::<Node>() + self.free.capacity() * size_of::<u32>() + leaves
    }

    /// The nodes from the root to the leaf whose cell contains the descriptor.
    fn path_to(&self, descriptor: &Descriptor) -> Vec<u32> {
        let mut path = vec![Self::ROOT];
        let mut node = Self::ROOT;
        while let &Node::Split {
            dimension,
            threshold,
            left,
            right,
        } = self.node(node)
        {
            let goes_left = descriptor[usize::from(dimension)] <= threshold;
            node = if goes_left { left } else { right };
            path.push(node);
        }
        path
    }

    /// Splits the leaf in two, or puts the next attempt off when all its entries are equal.
    fn split_leaf(&mut self, leaf: u32) {
        let Node::Leaf { rows, split_above } = &mut self.nodes[leaf as usize] else {
            return;
        };
        let descriptors: Vec<Descriptor> =
            (0..rows.len()).map(|row| rows.descriptor(row)).collect();
        let Some((dimension, threshold)) = choose_split(&descriptors, &mut self.rng) else {
            *split_above = 2 * rows.len();
            return;
        };
        let ids = rows.ids().to_vec();
        let mut halves = [Rows::default(), Rows::default()];
        for (&id, descriptor) in ids.iter().zip(&descriptors) {
            let on_right = descriptor[usize::from(dimension)] > threshold;
            halves[usize::from(on_right)].push(id, descriptor);
        }
        let [left, right] = halves.map(|rows| {
            // Most of many equal entries stay on one side: wait for more before the next attempt.
            let split_above = self.leaf_capacity.max(rows.len() + rows.len() / 8);
            self.add_node(Node::Leaf { rows, split_above })
        });
        self.nodes[leaf as usize] = Node::Split {
            dimension,
            threshold,
            left,
            right,
        };
    }

    /// Makes one leaf of two that together are at most half full; `false` where they are not.
    fn join_leaves(&mut self, parent: u32) -> bool {
        let &Node::Split { left, right, .. } = self.node(parent) else {
            return false;
        };
        let (Node::Leaf { rows: a, .. }, Node::Leaf { rows: b, .. }) =
            (self.node(left), self.node(right))
        else {
            return false;
        };
        if a.len() + b.len() > self.leaf_capacity / 2 {
            return false;
        }
        let mut rows = a.clone();
        for (row, &id) in b.ids().iter().enumerate() {
            rows.push(id, &b.descriptor(row));
        }
        self.nodes[parent as usize] = Node::Leaf {
            rows,
            split_above: self.leaf_capacity,
        };
        for child in [left, right] {
            self.nodes[child as usize] = empty_leaf(self.leaf_capacity);
            self.free.push(child);
        }
        true
    }

    fn add_node(&mut self, node: Node) -> u32 {
        if let Some(number) = self.free.pop() {
            self.nodes[number as usize] = node;
            return number;
        }
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }
}

fn empty_leaf(leaf_capacity: usize) -> Node {
    Node::Leaf {
        rows: Rows::default(),
        split_above: leaf_capacity,
    }
}

/// The component and the threshold of a split that leaves entries on both sides; `None` when all entries are equal.
fn choose_split(descriptors: &[Descriptor], rng: &mut ChaCha8Rng) -> Option<(u8, u8)> {
    let step = descriptors.len().div_ceil(SPLIT_SAMPLE);
    let sample: Vec<&Descriptor> = descriptors.iter().step_by(step.max(1)).collect();
    draw_split(&sample, rng).or_else(|| {
        // A sample of equal entries says nothing about the rest: look for any entry that differs.
        let first = descriptors.first()?;
        let other = descriptors.iter().find(|other| *other != first)?;
        draw_split(&[first, other], rng)
    })
}

/// Draws a component among those of highest variance and cuts it at the median of the sample, or at the largest value
/// below the maximum where the median is the maximum.
fn draw_split(sample: &[&Descriptor], rng: &mut ChaCha8Rng) -> Option<(u8, u8)> {
    let mut sums = [0_u32; DESCRIPTOR_LENGTH];
    let mut squares = [0_u32; DESCRIPTOR_LENGTH];
    for descriptor in sample {
        for i in 0..DESCRIPTOR_LENGTH {
            let value = u32::from(descriptor[i]);
            sums[i] += value;
            squares[i] += value * value;
        }
    }
    // count^2 times the variance; at most 128 * 128 * 255^2 < 2^31.
    let count = sample.len() as u32;
    let spread = |i: usize| count * squares[i] - sums[i] * sums[i];
    let mut candidates: Vec<usize> = (0..DESCRIPTOR_LENGTH).filter(|&i| spread(i) > 0).collect();
    candidates.sort_by_key(|&i| (Reverse(spread(i)), i));
    candidates.truncate(SPLIT_CANDIDATES);
    if candidates.is_empty() {
        return None;
    }
    let dimension = candidates[rng.random_range(0..candidates.len() as u32) as usize];
    let mut values: Vec<u8> = sample
        .iter()
        .map(|descriptor| descriptor[dimension])
        .collect();
    values.sort_unstable();
    let largest = values[values.len() - 1];
    let median = values[(values.len() - 1) / 2];
    let threshold = if median < largest {
        median
    } else {
        values[values.partition_point(|&value| value < largest) - 1]
    };
    Some((dimension as u8, threshold))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaves(tree: &KdTree) -> Vec<usize> {
        let mut sizes = Vec::new();
        let mut pending = vec![KdTree::ROOT];
        while let Some(node) = pending.pop() {
            match tree.node(node) {
                Node::Split { left, right, .. } => pending.extend([*left, *right]),
                Node::Leaf { rows, .. } => sizes.push(rows.len()),
            }
        }
        sizes.sort_unstable();
        sizes
    }

    fn tree_of(descriptors: &[Descriptor], leaf_capacity: usize) -> KdTree {
        let mut tree = KdTree::new(leaf_capacity, 7, 0);
        for (id, descriptor) in (0..).zip(descriptors) {
            tree.insert(id, descriptor);
        }
        tree
    }

    fn on_line(value: u8) -> Descriptor {
        let mut descriptor = [0; DESCRIPTOR_LENGTH];
        descriptor[64] = value;
        descriptor
    }

    #[test]
    fn equal_entries_share_a_leaf_and_are_told_from_one_that_differs() {
        let mut tree = tree_of(&[[9; DESCRIPTOR_LENGTH]; 1000], 4);
        assert_eq!(leaves(&tree), [1000]);
        let mut other = [9; DESCRIPTOR_LENGTH];
        other[77] = 10;
        // A sample of 128 may well miss the only one that differs; attempts come at 5, 11, 23, ... 767, 1535 entries.
        for id in 1000..1540 {
            tree.insert(id, if id == 1000 { &other } else { &[9; 128] });
        }
        assert_eq!(leaves(&tree), [1, 1539]);
    }

    #[test]
    fn one_differing_component_is_enough_to_split_and_sorted_insertion_to_the_last_leaf() {
        let line: Vec<Descriptor> = (0..=255).map(on_line).collect();
        let tree = tree_of(&line, 1);
        assert_eq!(leaves(&tree), [1; 256]);
    }

    #[test]
    fn extreme_bytes_split() {
        let bytes = [255_u8, 254, 0, 1];
        let tree = tree_of(&bytes.map(|byte| [byte; DESCRIPTOR_LENGTH]), 1);
        assert_eq!(leaves(&tree), [1; 4]);
    }

    #[test]
    fn leaves_join_as_entries_go_and_their_nodes_are_used_again() {
        let line: Vec<Descriptor> = (0..=255).map(on_line).collect();
        let mut tree = tree_of(&line, 4);
        let nodes = tree.nodes.len();
        for id in 0..254_u32 {
            tree.remove(id, &line[id as usize]);
        }
        assert_eq!(
            (
                leaves(&tree).iter().sum::<usize>(),
                leaves(&tree).len() <= 2
            ),
            (2, true)
        );
        for id in 0..254_u32 {
            tree.insert(id, &line[id as usize]);
        }
        assert!(tree.nodes.len() <= nodes + 16);
        assert_eq!(leaves(&tree).iter().sum::<usize>(), 256);
    }
}
