//! The difference of two maps, found by the memory that they share.
//!
//! Maps that descend from one another hold the same nodes wherever nothing was written since, and a node is never written
//! while two maps hold it. So whatever lies below a common node is equal without a look at it, and two versions of a large
//! map are compared in the time of their difference, whoever changed them and how.

use std::sync::Arc;

use crate::landmark_map::{CowMap, Node};
use crate::slots::{BITS, Slots, WIDTH};

/// A node, and the branch levels at and below it above the leaves.
type Side<'a, T> = Option<(&'a Arc<Node<T>>, u32)>;

impl<T> CowMap<T> {
    /// Whether both maps are the same memory, and therefore equal; maps that are equal otherwise may not be. O(1).
    #[must_use]
    pub fn is_same_memory(&self, other: &Self) -> bool {
        match (&self.root, &other.root) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        }
    }

    /// Tells `visit` the id, the value in `before` and the value in this map of every value that may differ between them, in
    /// increasing order of the ids: all values in leaves that the maps do not share. O(leaves that differ).
    pub fn changes_since<'a>(
        &'a self,
        before: &'a Self,
        visit: &mut impl FnMut(u32, Option<&'a T>, Option<&'a T>),
    ) {
        let side = |map: &'a Self| map.root.as_ref().map(|root| (root, map.height));
        compare(
            side(self),
            side(before),
            self.height.max(before.height),
            0,
            visit,
        );
    }
}

/// Compares what two maps hold below one place of level `level`. A node of a lower level stands at the first of the places
/// below it.
fn compare<'a, T>(
    now: Side<'a, T>,
    before: Side<'a, T>,
    level: u32,
    prefix: u32,
    visit: &mut impl FnMut(u32, Option<&'a T>, Option<&'a T>),
) {
    let same = match (now, before) {
        (Some((a, high_a)), Some((b, high_b))) => high_a == high_b && Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    };
    if same {
        return;
    }
    if level == 0 {
        let [now, before] = [now, before].map(|side| match side {
            Some((node, _)) => match &**node {
                Node::Leaf(slots) => Some(slots),
                Node::Branch(_) => None,
            },
            None => None,
        });
        for index in 0..WIDTH {
            let value = |slots: Option<&'a Slots<T>>| slots?.get(index);
            let (old, new) = (value(before), value(now));
            if old.is_some() || new.is_some() {
                visit((prefix << BITS) | index as u32, old, new);
            }
        }
        return;
    }
    for index in 0..WIDTH {
        compare(
            child(now, level, index),
            child(before, level, index),
            level - 1,
            (prefix << BITS) | index as u32,
            visit,
        );
    }
}

/// The part of a side below the `index`-th place of level `level - 1`.
fn child<T>(side: Side<'_, T>, level: u32, index: usize) -> Side<'_, T> {
    let (node, height) = side?;
    if height < level {
        return (index == 0).then_some((node, height));
    }
    match &**node {
        Node::Branch(children) => children[index].as_ref().map(|child| (child, level - 1)),
        Node::Leaf(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn changes(now: &CowMap<u32>, before: &CowMap<u32>) -> BTreeMap<u32, [Option<u32>; 2]> {
        let (mut found, mut last) = (BTreeMap::new(), None);
        now.changes_since(before, &mut |id, old, new| {
            assert!(last < Some(id), "in order");
            last = Some(id);
            found.insert(id, [old.copied(), new.copied()]);
        });
        found
    }

    #[test]
    fn only_leaves_that_were_written_are_looked_at() {
        let mut map = CowMap::new();
        for id in 0..5000 {
            map.insert(id, id);
        }
        let before = map.clone();
        assert!(map.is_same_memory(&before));
        assert!(changes(&map, &before).is_empty());
        map.insert(1234, 7);
        map.remove(4000);
        assert!(!map.is_same_memory(&before));
        let found = changes(&map, &before);
        assert_eq!(found.len(), 32);
        assert_eq!(found[&1234], [Some(1234), Some(7)]);
        assert_eq!(found[&4000], [Some(4000), None]);
        assert_eq!(found[&1235], [Some(1235), Some(1235)]);
    }

    #[test]
    fn maps_of_different_heights_are_compared_place_by_place() {
        let mut low = CowMap::new();
        low.insert(3, 30);
        low.insert(20, 200);
        let mut high = low.clone();
        high.insert(70_000, 1);
        assert_eq!(changes(&high, &low), [(70_000, [None, Some(1)])].into());
        assert_eq!(changes(&low, &high), [(70_000, [Some(1), None])].into());
        let empty = CowMap::new();
        assert_eq!(changes(&high, &empty).len(), 3);
        assert_eq!(changes(&empty, &high).len(), 3);
        assert!(empty.is_same_memory(&CowMap::new()) && !empty.is_same_memory(&low));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn the_changes_make_one_map_of_the_other(
            first in prop::collection::vec((0_u32..9000, 0_u32..5), 0..200),
            later in prop::collection::vec((0_u32..9000, 0_u32..5, any::<bool>()), 0..60),
        ) {
            let mut before: CowMap<u32> = CowMap::new();
            for (id, value) in first {
                before.insert(id, value);
            }
            let mut now = before.clone();
            for (id, value, stays) in later {
                if stays {
                    now.insert(id, value);
                } else {
                    now.remove(id);
                }
            }
            let mut made: BTreeMap<u32, u32> = before.iter().map(|(id, v)| (id, *v)).collect();
            for (id, [old, new]) in changes(&now, &before) {
                prop_assert_eq!(before.get(id).copied(), old);
                match new {
                    Some(new) => { made.insert(id, new); }
                    None => { made.remove(&id); }
                }
            }
            prop_assert!(made.into_iter().eq(now.iter().map(|(id, v)| (id, *v))));
        }
    }
}
