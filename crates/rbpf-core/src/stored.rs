//! Maps and paths taken apart into their nodes and put together again, with all that they share.
//!
//! The maps of a particle set are one structure: a node that a hundred particles hold exists once. Written out particle by
//! particle it would be a hundred nodes, on disk and in memory after reading. [`NodeTable`] lists every node once, whoever
//! holds it, and [`SharedNodes`] rebuilds maps that share them as before. With the feature `serde` the lists can be
//! serialized.
//!
//! The lists may come from a damaged file: nothing in them is believed before it is checked.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::error::RbpfError;
use crate::history::PersistentPath;
use crate::landmark_map::{CowMap, HIGHEST, Node};
use crate::slots::{Slots, WIDTH};

/// A node of a map: the values of its slots, or the numbers of its children in the list.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum StoredNode<T> {
    Leaf(Vec<(u8, T)>),
    Branch(Vec<(u8, u32)>),
}

/// The nodes of several maps, every one once, children before their parents.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StoredNodes<T> {
    nodes: Vec<StoredNode<T>>,
}

/// A map or path as the number of its root among [`StoredNodes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StoredMap {
    root: Option<u32>,
}

/// Collects the nodes of maps that stay as they are meanwhile.
#[derive(Debug)]
pub struct NodeTable<'a, T> {
    nodes: Vec<StoredNode<T>>,
    numbers: BTreeMap<*const Node<T>, u32>,
    maps: std::marker::PhantomData<&'a CowMap<T>>,
}

impl<T> Default for NodeTable<'_, T> {
    fn default() -> Self {
        Self {
            nodes: Vec::new(),
            numbers: BTreeMap::new(),
            maps: std::marker::PhantomData,
        }
    }
}

impl<'a, T: Clone> NodeTable<'a, T> {
    /// Adds those nodes of `map` that are not there yet. O(new nodes), and one lookup for every node above them.
    pub fn put(&mut self, map: &'a CowMap<T>) -> StoredMap {
        StoredMap {
            root: map.root.as_ref().map(|root| self.put_node(root)),
        }
    }

    /// Adds those nodes of `path` that are not there yet.
    pub fn put_path(&mut self, path: &'a PersistentPath<T>) -> StoredMap {
        self.put(&path.entries)
    }

    /// The list of all nodes.
    #[must_use]
    pub fn into_nodes(self) -> StoredNodes<T> {
        StoredNodes { nodes: self.nodes }
    }

    /// The number of a node; the recursion is as deep as a map is high, at most eight.
    fn put_node(&mut self, node: &'a Arc<Node<T>>) -> u32 {
        if let Some(number) = self.numbers.get(&Arc::as_ptr(node)) {
            return *number;
        }
        let stored = match &**node {
            Node::Leaf(slots) => StoredNode::Leaf(
                slots
                    .iter()
                    .map(|(slot, value)| (slot as u8, value.clone()))
                    .collect(),
            ),
            Node::Branch(children) => StoredNode::Branch(
                children
                    .iter()
                    .enumerate()
                    .filter_map(|(slot, child)| Some((slot as u8, self.put_node(child.as_ref()?))))
                    .collect(),
            ),
        };
        // A node takes more than a hundred bytes, so 2^32 of them do not fit into a memory.
        let number = self.nodes.len() as u32;
        self.nodes.push(stored);
        self.numbers.insert(Arc::as_ptr(node), number);
        number
    }
}

/// Nodes to build maps from.
#[derive(Debug, Clone)]
pub struct SharedNodes<T> {
    nodes: Vec<Rebuilt<T>>,
}

#[derive(Debug, Clone)]
struct Rebuilt<T> {
    node: Arc<Node<T>>,
    /// Levels of branches below it, a leaf included.
    height: u32,
    /// Values below it.
    len: u64,
}

impl<T> StoredNodes<T> {
    /// The nodes as they were, each of them once.
    ///
    /// # Errors
    /// [`RbpfError::Stored`] for a list that no maps give.
    pub fn rebuild(self) -> Result<SharedNodes<T>, RbpfError> {
        let mut rebuilt: Vec<Rebuilt<T>> = Vec::with_capacity(self.nodes.len());
        let mut values_so_far: u64 = 0;
        for stored in self.nodes {
            let next = match stored {
                StoredNode::Leaf(values) => {
                    let mut slots = Slots::EMPTY;
                    let len = values.len() as u64;
                    values_so_far += len;
                    fill(values, |slot, value| {
                        slots.insert(slot, value);
                    })?;
                    Rebuilt {
                        node: Arc::new(Node::Leaf(slots)),
                        height: 0,
                        len,
                    }
                }
                StoredNode::Branch(children) => branch(&rebuilt, &children)?,
            };
            // A node that is its parent's child many times over, and so on upwards, would be a map without end.
            if next.len > values_so_far {
                return Err(RbpfError::Stored(
                    "a map has no more values than the list of nodes",
                ));
            }
            rebuilt.push(next);
        }
        Ok(SharedNodes { nodes: rebuilt })
    }
}

fn branch<T>(earlier: &[Rebuilt<T>], children: &[(u8, u32)]) -> Result<Rebuilt<T>, RbpfError> {
    let mut height = None;
    let mut len: u64 = 0;
    let mut own = Vec::with_capacity(children.len().min(WIDTH));
    for &(slot, number) in children {
        let child = earlier
            .get(number as usize)
            .ok_or(RbpfError::Stored("a child comes before its parent"))?;
        if *height.get_or_insert(child.height) != child.height {
            return Err(RbpfError::Stored("the children of a node are equally high"));
        }
        len = len.saturating_add(child.len);
        own.push((slot, child.node.clone()));
    }
    let mut slots = std::array::from_fn(|_| None);
    fill(own, |slot, child| slots[slot] = Some(child))?;
    match height {
        Some(below) if below < HIGHEST => Ok(Rebuilt {
            node: Arc::new(Node::Branch(slots)),
            height: below + 1,
            len,
        }),
        _ => Err(RbpfError::Stored("a map of 32-bit ids has eight levels")),
    }
}

/// Puts values into their slots: at least one, in rising order.
fn fill<V>(values: Vec<(u8, V)>, mut put: impl FnMut(usize, V)) -> Result<(), RbpfError> {
    if values.is_empty() {
        return Err(RbpfError::Stored("no node is empty"));
    }
    let mut least = 0;
    for (slot, value) in values {
        let place = usize::from(slot);
        if place >= WIDTH || slot < least {
            return Err(RbpfError::Stored("the slots of a node rise from 0 to 15"));
        }
        put(place, value);
        least = slot + 1;
    }
    Ok(())
}

impl<T> SharedNodes<T> {
    /// A map, sharing its nodes with the others of this list.
    ///
    /// # Errors
    /// [`RbpfError::Stored`] for a root that is not in the list.
    pub fn map(&self, stored: StoredMap) -> Result<CowMap<T>, RbpfError> {
        let Some(number) = stored.root else {
            return Ok(CowMap::new());
        };
        let root = self
            .nodes
            .get(number as usize)
            .ok_or(RbpfError::Stored("the root of a map is in the list"))?;
        Ok(CowMap {
            root: Some(root.node.clone()),
            height: root.height,
            // At most 2^32 values, for the height is limited and every slot is one id.
            len: root.len as usize,
        })
    }

    /// A path, sharing its entries with the others of this list. O(length).
    ///
    /// # Errors
    /// [`RbpfError::Stored`] for a root that is not in the list, or entries with holes between them.
    pub fn path(&self, stored: StoredMap) -> Result<PersistentPath<T>, RbpfError> {
        let entries = self.map(stored)?;
        // No entry is in two places of one path, so a list of few nodes stands for no long path.
        let most = WIDTH * self.nodes.len();
        if entries.len() <= most && entries.ids().eq(0..entries.len() as u32) {
            Ok(PersistentPath { entries })
        } else {
            Err(RbpfError::Stored("a path has no holes"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maps() -> (CowMap<u32>, CowMap<u32>, PersistentPath<u32>) {
        let first: CowMap<u32> = (0..5000).map(|id| (id, 3 * id)).collect();
        let mut second = first.clone();
        second.insert(70, 0);
        assert!(second.remove(4999).is_some());
        (first, second, (0..40).collect())
    }

    #[test]
    fn maps_come_back_with_all_that_they_share() {
        let (first, second, path) = maps();
        let empty = CowMap::new();
        let mut table = NodeTable::default();
        let stored = [table.put(&first), table.put(&second), table.put(&empty)];
        let stored_path = table.put_path(&path);
        let nodes = table.into_nodes();
        // 313 leaves, 20, 2 and 1 branches; two ways of a leaf and three branches are the second map's own, and
        // 40 entries of the path are three leaves and a branch.
        assert_eq!(nodes.nodes.len(), 336 + 7 + 4);
        let shared = nodes.rebuild().unwrap();
        let [one, other, none] = stored.map(|s| shared.map(s).unwrap());
        assert_eq!((&one, &other), (&first, &second));
        assert_eq!((one.len(), other.len(), none.len()), (5000, 4999, 0));
        assert_eq!(
            one.shared_leaves_with(&other),
            first.shared_leaves_with(&second)
        );
        assert!(shared.path(stored_path).unwrap().iter().eq(path.iter()));
        // A copy goes its own way.
        let mut grown = other;
        grown.insert(1_000_000, 1);
        assert_eq!((grown.len(), grown.get(4998)), (5000, Some(&14_994)));
    }

    #[test]
    fn lists_that_no_map_gives_are_refused() {
        let leaf = |slot| StoredNode::Leaf(vec![(slot, 7)]);
        let refused = |nodes: Vec<StoredNode<u32>>| match (StoredNodes { nodes }).rebuild() {
            Err(RbpfError::Stored(rule)) => rule,
            other => panic!("{other:?}"),
        };
        assert_eq!(
            refused(vec![leaf(16)]),
            "the slots of a node rise from 0 to 15"
        );
        assert_eq!(
            refused(vec![StoredNode::Leaf(vec![(3, 1), (3, 2)])]),
            "the slots of a node rise from 0 to 15"
        );
        assert_eq!(
            refused(vec![StoredNode::Leaf(Vec::new())]),
            "no node is empty"
        );
        assert_eq!(
            refused(vec![leaf(0), StoredNode::Branch(vec![(0, 1)])]),
            "a child comes before its parent"
        );
        assert_eq!(
            refused(vec![
                leaf(0),
                StoredNode::Branch(vec![(0, 0)]),
                StoredNode::Branch(vec![(0, 0), (1, 1)])
            ]),
            "the children of a node are equally high"
        );
        let tower = std::iter::once(leaf(0))
            .chain((0..8).map(|below| StoredNode::Branch(vec![(0, below)])))
            .collect();
        assert_eq!(refused(tower), "a map of 32-bit ids has eight levels");
        let shared = StoredNodes {
            nodes: vec![leaf(1)],
        };
        let shared = shared.rebuild().unwrap();
        assert!(shared.map(StoredMap { root: Some(1) }).is_err());
        // Its only entry would be the second one.
        assert!(shared.path(StoredMap { root: Some(0) }).is_err());
    }

    /// A node that holds one child sixteen times over eight levels was a map of 2^32 values, which nobody walks to its end.
    #[test]
    fn regress_a_short_list_stood_for_a_map_without_end() {
        let mut nodes = vec![StoredNode::Leaf(
            (0..16).map(|slot| (slot, 1_u32)).collect(),
        )];
        for below in 0..7 {
            nodes.push(StoredNode::Branch(
                (0..16).map(|slot| (slot, below)).collect(),
            ));
        }
        assert_eq!(
            StoredNodes { nodes }.rebuild().map(|_| ()),
            Err(RbpfError::Stored(
                "a map has no more values than the list of nodes"
            ))
        );
    }
}
