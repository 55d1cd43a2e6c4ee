//! One randomised k-d tree over descriptors, grown one entry at a time.
//!
//! A node splits its entries at the mean of one component, drawn at random from the few of highest variance
//! (Silpa-Anan and Hartley 2008), so that several trees over the same entries cut space differently. Entries
//! live in leaves; a leaf over its capacity splits.
//!
//! Degenerate data: a component is split only where two entries differ in it, at a byte strictly below its
//! maximum, so both sides receive an entry and splitting always ends. Entries that are all equal stay in one
//! leaf, however many they are. Invariant: a leaf over its capacity holds equal descriptors only, so whether it
//! must split is answered by one comparison with the newcomer.
//!
//! All walks are loops, never recursion: the depth is bounded by the data alone (at most 255 splits for each
//! component), not by the stack.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{DESCRIPTOR_LENGTH, Descriptor};

/// A split draws its component among this many of the highest variance (Muja and Lowe 2009 use five).
const SPLIT_CANDIDATES: usize = 5;

/// Mean and variance of a node are taken from at most this many of its entries.
const SPLIT_SAMPLE: usize = 128;

#[derive(Debug, Clone)]
pub(crate) enum Node {
    /// Entries with `descriptor[dimension] <= threshold` are on the left.
    Split {
        dimension: u8,
        threshold: u8,
        left: u32,
        right: u32,
    },
    Leaf {
        slots: Vec<u32>,
    },
}

#[derive(Debug, Clone)]
pub(crate) struct KdTree {
    nodes: Vec<Node>,
    leaf_capacity: usize,
    rng: ChaCha8Rng,
}

impl KdTree {
    pub(crate) const ROOT: u32 = 0;

    /// A tree over all descriptors given, slot = position. The stream makes this tree differ from its siblings.
    pub(crate) fn build(
        descriptors: &[Descriptor],
        leaf_capacity: usize,
        seed: u64,
        stream: u64,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        let slots = (0..descriptors.len() as u32).collect();
        let mut tree = Self {
            nodes: vec![Node::Leaf { slots }],
            leaf_capacity,
            rng,
        };
        tree.split_leaf(Self::ROOT, descriptors);
        tree
    }

    #[inline]
    pub(crate) fn node(&self, node: u32) -> &Node {
        &self.nodes[node as usize]
    }

    /// Adds the entry stored at `slot`.
    pub(crate) fn insert(&mut self, slot: u32, descriptors: &[Descriptor]) {
        let descriptor = &descriptors[slot as usize];
        let leaf_capacity = self.leaf_capacity;
        let (node, slots) = self.leaf_of(descriptor);
        let was_over_capacity = slots.len() > leaf_capacity;
        let stays_constant = was_over_capacity && descriptors[slots[0] as usize] == *descriptor;
        slots.push(slot);
        if !stays_constant {
            self.split_leaf(node, descriptors);
        }
    }

    /// Forgets the entry at `slot`, whose descriptor is given.
    pub(crate) fn remove(&mut self, slot: u32, descriptor: &Descriptor) {
        let (_, slots) = self.leaf_of(descriptor);
        slots.retain(|&other| other != slot);
    }

    /// The entry at slot `from` now lives at slot `to`; its descriptor is given.
    pub(crate) fn rename(&mut self, from: u32, to: u32, descriptor: &Descriptor) {
        let (_, slots) = self.leaf_of(descriptor);
        for slot in slots.iter_mut().filter(|slot| **slot == from) {
            *slot = to;
        }
    }

    pub(crate) fn memory_usage(&self) -> usize {
        let leaves: usize = self
            .nodes
            .iter()
            .map(|node| match node {
                Node::Split { .. } => 0,
                Node::Leaf { slots } => slots.capacity() * size_of::<u32>(),
            })
            .sum();
        self.nodes.capacity() * size_of::<Node>() + leaves
    }

    /// The leaf whose cell contains the descriptor.
    fn leaf_of(&mut self, descriptor: &Descriptor) -> (u32, &mut Vec<u32>) {
        let mut node = Self::ROOT;
        while let Node::Split {
            dimension,
            threshold,
            left,
            right,
        } = self.nodes[node as usize]
        {
            let goes_left = descriptor[usize::from(dimension)] <= threshold;
            node = if goes_left { left } else { right };
        }
        match &mut self.nodes[node as usize] {
            Node::Leaf { slots } => (node, slots),
            Node::Split { .. } => unreachable!("the walk above ends at a leaf"),
        }
    }

    /// Splits the leaf, and its parts in turn, until none is over capacity unless constant.
    fn split_leaf(&mut self, leaf: u32, descriptors: &[Descriptor]) {
        let mut pending = vec![leaf];
        while let Some(node) = pending.pop() {
            let Node::Leaf { slots } = &self.nodes[node as usize] else {
                continue;
            };
            if slots.len() <= self.leaf_capacity {
                continue;
            }
            let Some((dimension, threshold)) = choose_split(slots, descriptors, &mut self.rng)
            else {
                continue;
            };
            let (on_left, on_right): (Vec<u32>, Vec<u32>) = slots.iter().partition(|slot| {
                descriptors[**slot as usize][usize::from(dimension)] <= threshold
            });
            let left = self.nodes.len() as u32;
            let right = left + 1;
            self.nodes.push(Node::Leaf { slots: on_left });
            self.nodes.push(Node::Leaf { slots: on_right });
            self.nodes[node as usize] = Node::Split {
                dimension,
                threshold,
                left,
                right,
            };
            pending.push(right);
            pending.push(left);
        }
    }
}

/// Component and threshold of a split that leaves entries on both sides, or `None` when all entries are equal.
fn choose_split(
    slots: &[u32],
    descriptors: &[Descriptor],
    rng: &mut ChaCha8Rng,
) -> Option<(u8, u8)> {
    let sampled = slots.len().min(SPLIT_SAMPLE);
    let sample = (0..sampled).map(|k| &descriptors[slots[k * slots.len() / sampled] as usize]);
    draw_split(sample, rng).or_else(|| {
        // A constant sample says nothing about the rest: look for any entry that differs.
        let first = &descriptors[*slots.first()? as usize];
        let other = slots
            .iter()
            .map(|&slot| &descriptors[slot as usize])
            .find(|other| *other != first)?;
        draw_split([first, other].into_iter(), rng)
    })
}

/// Draws among the components of highest variance and cuts at the mean, rounded down: at least one value of the
/// sample is at most this, and, the component not being constant, at least one is above.
fn draw_split<'a>(
    sample: impl Iterator<Item = &'a Descriptor>,
    rng: &mut ChaCha8Rng,
) -> Option<(u8, u8)> {
    let mut sums = [0_u32; DESCRIPTOR_LENGTH];
    let mut squares = [0_u32; DESCRIPTOR_LENGTH];
    let mut count = 0_u32;
    for descriptor in sample {
        count += 1;
        for i in 0..DESCRIPTOR_LENGTH {
            let value = u32::from(descriptor[i]);
            sums[i] += value;
            squares[i] += value * value;
        }
    }
    // count^2 times the variance; at most 128 * 128 * 255^2 < 2^31.
    let spread = |i: usize| count * squares[i] - sums[i] * sums[i];
    let mut candidates: Vec<usize> = (0..DESCRIPTOR_LENGTH).filter(|&i| spread(i) > 0).collect();
    candidates.sort_by_key(|&i| (std::cmp::Reverse(spread(i)), i));
    candidates.truncate(SPLIT_CANDIDATES);
    if candidates.is_empty() {
        return None;
    }
    let dimension = candidates[rng.random_range(0..candidates.len() as u32) as usize];
    let mean_rounded_down = sums[dimension] / count;
    Some((dimension as u8, mean_rounded_down as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn largest_leaf(tree: &KdTree) -> usize {
        tree.nodes
            .iter()
            .map(|node| match node {
                Node::Split { .. } => 0,
                Node::Leaf { slots } => slots.len(),
            })
            .max()
            .unwrap()
    }

    fn leaf_count(tree: &KdTree) -> usize {
        let is_leaf = |node: &&Node| matches!(node, Node::Leaf { .. });
        tree.nodes.iter().filter(is_leaf).count()
    }

    #[test]
    fn equal_entries_share_a_leaf_until_one_differs() {
        let mut descriptors = vec![[9_u8; DESCRIPTOR_LENGTH]; 1000];
        let mut tree = KdTree::build(&descriptors, 4, 1, 0);
        assert_eq!(largest_leaf(&tree), 1000);
        // A sample of 128 out of 1001 may well miss the only one that differs.
        descriptors.push([9; DESCRIPTOR_LENGTH]);
        descriptors[1000][77] = 10;
        tree.insert(1000, &descriptors);
        assert_eq!(leaf_count(&tree), 2);
        assert_eq!(largest_leaf(&tree), 1000);
    }

    #[test]
    fn one_differing_component_is_enough_to_split() {
        let descriptors: Vec<Descriptor> = (0..=255_u8)
            .map(|value| {
                let mut descriptor = [0; DESCRIPTOR_LENGTH];
                descriptor[64] = value;
                descriptor
            })
            .collect();
        let tree = KdTree::build(&descriptors, 1, 7, 0);
        assert_eq!(leaf_count(&tree), 256);
        assert_eq!(largest_leaf(&tree), 1);
    }

    #[test]
    fn extreme_bytes_split() {
        let mut descriptors = vec![[255_u8; DESCRIPTOR_LENGTH], [254; DESCRIPTOR_LENGTH]];
        descriptors.push([0; DESCRIPTOR_LENGTH]);
        descriptors.push([1; DESCRIPTOR_LENGTH]);
        let tree = KdTree::build(&descriptors, 1, 7, 0);
        assert_eq!(leaf_count(&tree), 4);
    }
}
