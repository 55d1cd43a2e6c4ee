//! The path of a particle: an append-only sequence that shares its past.
//!
//! Particles that descend from one ancestor have the same path up to it. [`PersistentPath`] keeps
//! its entries in the chunks of a [`CowMap`], so a clone is O(1), an append copies at most one
//! chunk of 16 entries and the nodes above it, and the common past is stored once
//! however many particles carry it.

use crate::landmark_map::{CowMap, MappedNodes};
use std::fmt;

/// An append-only sequence that shares its past with its clones; `clone` is O(1).
///
/// ```
/// use rbpf_core::PersistentPath;
///
/// let mut path = PersistentPath::default();
/// path.push("start");
/// let (mut left, mut right) = (path.clone(), path);
/// left.push("left");
/// right.push("right");
/// assert_eq!(left.iter().collect::<Vec<_>>(), [&"start", &"left"]);
/// assert_eq!(right.last(), Some(&"right"));
/// ```
pub struct PersistentPath<T> {
    pub(crate) entries: CowMap<T>,
}

impl<T> PersistentPath<T> {
    /// An empty path; allocates nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            entries: CowMap::new(),
        }
    }

    /// Number of entries. O(1).
    #[must_use]
    pub const fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is no entry. O(1).
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The entry of index `index`, from 0 in order of appending. O(log16 n).
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&T> {
        self.entries.get(u32::try_from(index).ok()?)
    }

    /// The latest entry. O(log16 n).
    #[must_use]
    pub fn last(&self) -> Option<&T> {
        self.get(self.len().checked_sub(1)?)
    }

    /// The path with every entry replaced by `entry(index, old)`; see [`CowMap::mapped`].
    #[must_use]
    pub fn mapped(&self, shared: &mut MappedNodes<T>, entry: impl FnMut(u32, &T) -> T) -> Self {
        Self {
            entries: self.entries.mapped(shared, entry),
        }
    }

    /// The entries from the first to the latest. O(n) in all.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &T> + '_ {
        self.entries.iter().map(|(_, entry)| entry)
    }
}

impl<T: Clone> PersistentPath<T> {
    /// Appends an entry. O(log16 n); at most one shared chunk is copied.
    ///
    /// # Panics
    /// After 2^32 entries.
    pub fn push(&mut self, entry: T) {
        let index = u32::try_from(self.len()).expect("a path has at most 2^32 entries");
        self.entries.insert(index, entry);
    }

    /// The latest entry, to be changed in place, as when a rejuvenated pose replaces the one proposed.
    #[must_use]
    pub fn last_mut(&mut self) -> Option<&mut T> {
        let index = u32::try_from(self.len().checked_sub(1)?).ok()?;
        self.entries.get_mut(index)
    }
}

impl<T> Clone for PersistentPath<T> {
    fn clone(&self) -> Self {
        Self {
            entries: self.entries.clone(),
        }
    }
}

impl<T> Default for PersistentPath<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: PartialEq> PartialEq for PersistentPath<T> {
    fn eq(&self, other: &Self) -> bool {
        self.entries == other.entries
    }
}

impl<T: fmt::Debug> fmt::Debug for PersistentPath<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl<T: Clone> Extend<T> for PersistentPath<T> {
    fn extend<I: IntoIterator<Item = T>>(&mut self, entries: I) {
        for entry in entries {
            self.push(entry);
        }
    }
}

impl<T: Clone> FromIterator<T> for PersistentPath<T> {
    fn from_iter<I: IntoIterator<Item = T>>(entries: I) -> Self {
        let mut path = Self::new();
        path.extend(entries);
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_common_past_is_stored_once() {
        let mut left: PersistentPath<u32> = (0..100).collect();
        let mut right = left.clone();
        left.extend(100..200);
        right.extend([7, 8]);
        *right.last_mut().unwrap() = 9;
        assert_eq!(left.get(100), Some(&100));
        assert_eq!((right.get(100), right.last()), (Some(&7), Some(&9)));
        // entries 0..96 fill six chunks; the seventh is each path's own
        let shared = right.entries.shared_leaves_with(&left.entries);
        assert_eq!((shared.shared, shared.total), (6, 7));
    }

    #[test]
    fn paths_mapped_together_share_what_they_shared() {
        let mut left: PersistentPath<u32> = (0..300).collect();
        let mut right = left.clone();
        left.push(7);
        right.push(8);
        let mut shared = MappedNodes::new();
        let mut calls = 0;
        let mut double = |index: u32, value: &u32| {
            calls += 1;
            value * 2 + index % 2
        };
        let a = left.mapped(&mut shared, &mut double);
        let b = right.mapped(&mut shared, &mut double);
        assert!(
            a.iter()
                .copied()
                .eq(left.iter().enumerate().map(|(i, v)| v * 2 + i as u32 % 2))
        );
        assert_eq!(b.last(), Some(&16));
        // 300 entries in 19 chunks of 16, the last of them each path's own with 12 + 1 entries
        let count = a.entries.shared_leaves_with(&b.entries);
        assert_eq!((count.shared, count.total), (18, 19));
        assert_eq!(calls, 18 * 16 + 2 * 13);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn equals_vectors(past in 0..300_u32, left in 0..40_u32, right in 0..40_u32) {
            let shared: PersistentPath<u32> = (0..past).collect();
            let (mut a, mut b) = (shared.clone(), shared.clone());
            a.extend(1000..1000 + left);
            b.extend(2000..2000 + right);
            let expected: Vec<u32> = (0..past).chain(1000..1000 + left).collect();
            prop_assert!(a.iter().eq(&expected));
            for index in 0..=expected.len() {
                prop_assert_eq!(a.get(index), expected.get(index));
            }
            let expected: Vec<u32> = (0..past).chain(2000..2000 + right).collect();
            prop_assert!(b.iter().eq(&expected));
            prop_assert_eq!(b.last(), expected.last());
            prop_assert_eq!(shared.len(), past as usize);
        }
    }
}
