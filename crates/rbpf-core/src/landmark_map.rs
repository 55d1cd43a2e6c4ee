//! A persistent map from dense integer ids to values, shared between particles.
//!
//! After a resampling the children of one particle hold the same map, except for what they update
//! later. [`CowMap`] is a radix trie of 16-way nodes behind reference counts: a clone copies one
//! pointer, and a write copies those nodes on the path from the root to its leaf that are shared.
//! Resampling N particles with M landmarks therefore costs N pointer copies and touches no landmark;
//! updating k landmarks costs O(k log16 M) at most.
//!
//! Ids should be dense, numbered from zero as landmarks are created: the memory follows the number of
//! values and of occupied leaves of 16 ids. Iteration is in the order of the ids. Nodes left empty by a removal are
//! dropped.
//!
//! A write to a shared leaf clones the values beside it, at most 15, so `T` should be plain data;
//! descriptors and pictures belong behind an `Arc` or outside the map.
//!
//! For sparse ids such as hashes use an ordered or hashed map, and where a single owner writes
//! everything use a `Vec`.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use crate::slots::{BITS, Slots, WIDTH};

/// Branch levels above the leaves, at most: eight levels of four bits are all of an id.
pub(crate) const HIGHEST: u32 = u32::BITS / BITS - 1;

/// A persistent map from `u32` ids to `T`; `clone` is O(1), and a write copies only what it touches.
///
/// ```
/// use rbpf_core::CowMap;
///
/// let mut map = CowMap::default();
/// map.insert(7, 1.5);
/// let copy = map.clone(); // shares everything
/// map.insert(7, 2.5); // copies one leaf
/// assert_eq!((copy.get(7), map.get(7)), (Some(&1.5), Some(&2.5)));
/// ```
pub struct CowMap<T> {
    pub(crate) root: Option<Arc<Node<T>>>,
    /// Branch levels above the leaves; ids below 16^(height + 1) have a place.
    pub(crate) height: u32,
    pub(crate) len: usize,
}

/// The part of one map that is physically the same memory as another's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SharedLeaves {
    /// Number of leaves of the first map that are also leaves of the second.
    pub shared: usize,
    /// Number of leaves of the first map.
    pub total: usize,
    /// Bytes of those nodes of the first map, leaves and branches, that the second does not hold.
    pub own_bytes: usize,
}

#[derive(Debug)]
pub(crate) enum Node<T> {
    Leaf(Slots<T>),
    Branch([Option<Arc<Self>>; WIDTH]),
}

impl<T> CowMap<T> {
    /// An empty map; allocates nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            root: None,
            height: 0,
            len: 0,
        }
    }

    /// Number of values. O(1).
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no value. O(1).
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The value of `id`. O(log16 of the largest id).
    #[must_use]
    pub fn get(&self, id: u32) -> Option<&T> {
        if !fits(id, self.height) {
            return None;
        }
        let mut node = self.root.as_deref()?;
        let mut level = self.height;
        loop {
            match node {
                Node::Leaf(slots) => return slots.get(slot(id, 0)),
                Node::Branch(children) => {
                    node = children[slot(id, level)].as_deref()?;
                    level -= 1;
                }
            }
        }
    }

    /// Whether `id` has a value.
    #[must_use]
    pub fn contains(&self, id: u32) -> bool {
        self.get(id).is_some()
    }

    /// Ids and values in increasing order of the ids. O(len) in all for dense ids.
    #[must_use]
    pub fn iter(&self) -> Iter<'_, T> {
        let stack = self
            .root
            .as_deref()
            .map(|node| (node, 0, 0))
            .into_iter()
            .collect();
        Iter {
            stack,
            remaining: self.len,
        }
    }

    /// Ids in increasing order.
    pub fn ids(&self) -> impl Iterator<Item = u32> + '_ {
        self.iter().map(|(id, _)| id)
    }

    /// The map with every value replaced by `value(id, old)`. Nodes that other maps share are made once for all maps that
    /// are given the same `shared`. O(values not made before).
    #[must_use]
    pub fn mapped(&self, shared: &mut MappedNodes<T>, mut value: impl FnMut(u32, &T) -> T) -> Self {
        Self {
            root: self
                .root
                .as_ref()
                .map(|root| shared.node(root, 0, &mut value)),
            height: self.height,
            len: self.len,
        }
    }

    /// Counts the leaves (16 ids each) that both maps hold at the same address, for tests and memory
    /// reports. O(leaves).
    #[must_use]
    pub fn shared_leaves_with(&self, other: &Self) -> SharedLeaves {
        let mut count = SharedLeaves {
            shared: 0,
            total: 0,
            own_bytes: 0,
        };
        let twin = if self.height == other.height {
            other.root.as_ref()
        } else {
            None
        };
        if let Some(root) = &self.root {
            count_shared(root, twin, false, &mut count);
        }
        count
    }
}

impl<T: Clone> CowMap<T> {
    /// Mutable access to the value of `id`. Nodes that are shared are copied on the way to it; an absent
    /// id copies nothing.
    #[must_use]
    pub fn get_mut(&mut self, id: u32) -> Option<&mut T> {
        if !self.contains(id) {
            return None;
        }
        let mut node = Arc::make_mut(self.root.as_mut()?);
        let mut level = self.height;
        loop {
            match node {
                Node::Leaf(slots) => return slots.get_mut(slot(id, 0)),
                Node::Branch(children) => {
                    node = Arc::make_mut(children[slot(id, level)].as_mut()?);
                    level -= 1;
                }
            }
        }
    }

    /// Sets the value of `id` and returns the one it had. O(log16 of the largest id).
    pub fn insert(&mut self, id: u32, value: T) -> Option<T> {
        while !fits(id, self.height) {
            if let Some(old_root) = self.root.take() {
                let mut children = no_children();
                children[0] = Some(old_root);
                self.root = Some(Arc::new(Node::Branch(children)));
            }
            self.height += 1;
        }
        let mut level = self.height;
        let mut place = &mut self.root;
        loop {
            let node = Arc::make_mut(place.get_or_insert_with(|| Arc::new(Node::empty(level))));
            match node {
                Node::Leaf(slots) => {
                    let old = slots.insert(slot(id, 0), value);
                    self.len += usize::from(old.is_none());
                    return old;
                }
                Node::Branch(children) => {
                    place = &mut children[slot(id, level)];
                    level -= 1;
                }
            }
        }
    }

    /// Takes the value of `id` out of the map; an absent id copies nothing. O(log16 of the largest id).
    pub fn remove(&mut self, id: u32) -> Option<T> {
        if !self.contains(id) {
            return None;
        }
        let removed = remove_below(&mut self.root, self.height, id);
        self.len -= usize::from(removed.is_some());
        if self.root.is_none() {
            self.height = 0;
        }
        removed
    }
}

/// The nodes that [`CowMap::mapped`] has made, by those they were made from.
///
/// Maps that share nodes and are mapped with one of these share the new nodes, too.
pub struct MappedNodes<T> {
    nodes: BTreeMap<*const Node<T>, Made<T>>,
}

/// The node it was made from, which is held so that its address stays its own, and the new one.
type Made<T> = (Arc<Node<T>>, Arc<Node<T>>);

impl<T> MappedNodes<T> {
    /// Nothing made yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            nodes: BTreeMap::new(),
        }
    }

    fn node(
        &mut self,
        node: &Arc<Node<T>>,
        prefix: u32,
        value: &mut impl FnMut(u32, &T) -> T,
    ) -> Arc<Node<T>> {
        if let Some((_, made)) = self.nodes.get(&Arc::as_ptr(node)) {
            return made.clone();
        }
        let id = |index: usize| (prefix << BITS) | index as u32;
        let made = Arc::new(match &**node {
            Node::Leaf(slots) => Node::Leaf(slots.mapped(|i, old| value(id(i), old))),
            Node::Branch(children) => Node::Branch(std::array::from_fn(|i| {
                children[i]
                    .as_ref()
                    .map(|child| self.node(child, id(i), value))
            })),
        });
        self.nodes
            .insert(Arc::as_ptr(node), (node.clone(), made.clone()));
        made
    }
}

impl<T> Default for MappedNodes<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T> fmt::Debug for MappedNodes<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MappedNodes")
            .field("nodes", &self.nodes.len())
            .finish()
    }
}

impl<T> Node<T> {
    fn empty(level: u32) -> Self {
        if level == 0 {
            Self::Leaf(Slots::EMPTY)
        } else {
            Self::Branch(no_children())
        }
    }

    /// Bytes on the heap, with the two reference counts before the node.
    pub(crate) const fn bytes(&self) -> usize {
        let values = match self {
            Self::Leaf(slots) => slots.heap_bytes(),
            Self::Branch(_) => 0,
        };
        size_of::<Self>() + 2 * size_of::<usize>() + values
    }

    fn is_empty(&self) -> bool {
        match self {
            Self::Leaf(slots) => slots.is_empty(),
            Self::Branch(children) => children.iter().all(Option::is_none),
        }
    }
}

impl<T: Clone> Clone for Node<T> {
    fn clone(&self) -> Self {
        match self {
            Self::Leaf(slots) => Self::Leaf(slots.clone()),
            Self::Branch(children) => Self::Branch(children.clone()),
        }
    }
}

fn no_children<T>() -> [Option<Arc<Node<T>>>; WIDTH] {
    std::array::from_fn(|_| None)
}

const fn slot(id: u32, level: u32) -> usize {
    (id >> (BITS * level)) as usize & (WIDTH - 1)
}

const fn fits(id: u32, height: u32) -> bool {
    (id as u64) >> (BITS * (height + 1)) == 0
}

fn remove_below<T: Clone>(place: &mut Option<Arc<Node<T>>>, level: u32, id: u32) -> Option<T> {
    let node = Arc::make_mut(place.as_mut()?);
    let removed = match node {
        Node::Leaf(slots) => slots.remove(slot(id, 0)),
        Node::Branch(children) => remove_below(&mut children[slot(id, level)], level - 1, id),
    };
    if node.is_empty() {
        *place = None;
    }
    removed
}

fn count_shared<T>(
    node: &Arc<Node<T>>,
    twin: Option<&Arc<Node<T>>>,
    inside_shared: bool,
    count: &mut SharedLeaves,
) {
    let shared = inside_shared || twin.is_some_and(|twin| Arc::ptr_eq(node, twin));
    if !shared {
        count.own_bytes += node.bytes();
    }
    match &**node {
        Node::Leaf(_) => {
            count.total += 1;
            count.shared += usize::from(shared);
        }
        Node::Branch(children) => {
            for (index, child) in children.iter().enumerate() {
                let twin_child = match twin.map(|twin| &**twin) {
                    Some(Node::Branch(others)) => others[index].as_ref(),
                    _ => None,
                };
                if let Some(child) = child {
                    count_shared(child, twin_child, shared, count);
                }
            }
        }
    }
}

/// Iterator over ids and values in increasing order of id.
pub struct Iter<'a, T> {
    /// Open nodes from the root down: node, next slot, id of the node's first place / 16.
    stack: Vec<(&'a Node<T>, usize, u32)>,
    remaining: usize,
}

impl<'a, T> Iterator for Iter<'a, T> {
    type Item = (u32, &'a T);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let (node, next, prefix) = self.stack.last_mut()?;
            let (node, index, prefix) = (*node, *next, *prefix);
            if index == WIDTH {
                self.stack.pop();
                continue;
            }
            if let Some((_, next, _)) = self.stack.last_mut() {
                *next += 1;
            }
            let number = (prefix << BITS) | index as u32;
            match node {
                Node::Leaf(slots) => {
                    if let Some(value) = slots.get(index) {
                        self.remaining -= 1;
                        return Some((number, value));
                    }
                }
                Node::Branch(children) => {
                    if let Some(child) = &children[index] {
                        self.stack.push((child, 0, number));
                    }
                }
            }
        }
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.remaining, Some(self.remaining))
    }
}

impl<T> ExactSizeIterator for Iter<'_, T> {}

impl<T> fmt::Debug for Iter<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Iter")
            .field("remaining", &self.remaining)
            .finish_non_exhaustive()
    }
}

impl<'a, T> IntoIterator for &'a CowMap<T> {
    type Item = (u32, &'a T);
    type IntoIter = Iter<'a, T>;

    fn into_iter(self) -> Iter<'a, T> {
        self.iter()
    }
}

impl<T: Clone> FromIterator<(u32, T)> for CowMap<T> {
    fn from_iter<I: IntoIterator<Item = (u32, T)>>(entries: I) -> Self {
        let mut map = Self::new();
        map.extend(entries);
        map
    }
}

impl<T: Clone> Extend<(u32, T)> for CowMap<T> {
    fn extend<I: IntoIterator<Item = (u32, T)>>(&mut self, entries: I) {
        for (id, value) in entries {
            self.insert(id, value);
        }
    }
}

// not derived: a derive would ask for T: Clone, and a clone copies no T
impl<T> Clone for CowMap<T> {
    fn clone(&self) -> Self {
        Self {
            root: self.root.clone(),
            height: self.height,
            len: self.len,
        }
    }
}

impl<T> Default for CowMap<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: PartialEq> PartialEq for CowMap<T> {
    fn eq(&self, other: &Self) -> bool {
        self.len == other.len && self.iter().eq(other.iter())
    }
}

impl<T: fmt::Debug> fmt::Debug for CowMap<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.iter()).finish()
    }
}
