//! The memory of maps and paths that share nodes: every node counts once, whoever holds it.

use std::collections::HashSet;
use std::sync::Arc;

use crate::history::PersistentPath;
use crate::landmark_map::{CowMap, Node};

/// Counts the bytes of maps and paths of one kind.
#[derive(Debug)]
pub struct SharedBytes<T> {
    seen: HashSet<*const Node<T>>,
    bytes: usize,
}

impl<T> Default for SharedBytes<T> {
    fn default() -> Self {
        Self {
            seen: HashSet::new(),
            bytes: 0,
        }
    }
}

impl<T> SharedBytes<T> {
    /// Counts the nodes of `map` that were not counted yet. O(new nodes), and one look at every node above them. The map must
    /// stay as it is until the count is read.
    pub fn add(&mut self, map: &CowMap<T>) {
        if let Some(root) = &map.root {
            self.add_node(root);
        }
    }

    /// Counts the nodes of `path` that were not counted yet.
    pub fn add_path(&mut self, path: &PersistentPath<T>) {
        self.add(&path.entries);
    }

    /// Bytes on the heap of all that was added; what the values themselves hold there is not among them.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.bytes
    }

    /// The recursion is as deep as a map is high, at most eight.
    fn add_node(&mut self, node: &Arc<Node<T>>) {
        if !self.seen.insert(Arc::as_ptr(node)) {
            return;
        }
        self.bytes += node.bytes();
        if let Node::Branch(children) = &**node {
            for child in children.iter().flatten() {
                self.add_node(child);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_nodes_count_once() {
        let mut first = CowMap::new();
        for id in 0..1000_u32 {
            first.insert(id, u64::from(id));
        }
        let mut second = first.clone();
        let bytes = |maps: &[&CowMap<u64>]| {
            let mut count = SharedBytes::default();
            maps.iter().for_each(|map| count.add(map));
            count.bytes()
        };
        let one = bytes(&[&first]);
        let node = size_of::<Node<u64>>() + 2 * size_of::<usize>();
        // 63 leaves of 16 ids, four branches above them and the root, and room for a thousand values that grew one by one.
        assert_eq!(one, 68 * node + 1000 * size_of::<u64>());
        assert_eq!(bytes(&[&first, &second, &first]), one);
        // A write copies a leaf and what is above it.
        second.insert(500, 0);
        let leaf = 16 * size_of::<u64>();
        assert_eq!(bytes(&[&first, &second]), one + 3 * node + leaf);
        assert_eq!(
            bytes(&[&first, &second]) - one,
            second.shared_leaves_with(&first).own_bytes
        );
        let mut path = PersistentPath::new();
        path.push(7_u64);
        let mut count = SharedBytes::default();
        count.add_path(&path);
        assert_eq!(count.bytes(), node + size_of::<u64>());
    }
}
