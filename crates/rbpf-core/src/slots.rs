//! Up to sixteen values by slot, in memory that follows their number.
//!
//! Landmarks that live long are few among the ids that were given out, so most leaves of an old map hold one or two. A leaf
//! with a place for each of sixteen took sixteen times their memory, and a write to one copied as much.

/// Bits of an id that a node takes.
pub(crate) const BITS: u32 = 4;
/// Number of slots of a node.
pub(crate) const WIDTH: usize = 1 << BITS;

/// Values in increasing order of their slots.
#[derive(Debug, Clone)]
pub(crate) struct Slots<T> {
    /// Bit s is set when slot s has a value.
    occupied: u16,
    values: Vec<T>,
}

const _: () = assert!(u16::BITS as usize == WIDTH);

impl<T> Slots<T> {
    pub(crate) const EMPTY: Self = Self {
        occupied: 0,
        values: Vec::new(),
    };

    pub(crate) const fn is_empty(&self) -> bool {
        self.occupied == 0
    }

    pub(crate) fn get(&self, slot: usize) -> Option<&T> {
        self.holds(slot).then(|| &self.values[self.place(slot)])
    }

    pub(crate) fn get_mut(&mut self, slot: usize) -> Option<&mut T> {
        let place = self.place(slot);
        self.holds(slot).then(|| &mut self.values[place])
    }

    /// Sets the value of `slot`, below [`WIDTH`], and returns the one it had.
    pub(crate) fn insert(&mut self, slot: usize, value: T) -> Option<T> {
        let place = self.place(slot);
        if self.holds(slot) {
            return Some(core::mem::replace(&mut self.values[place], value));
        }
        // A leaf is copied more often than it grows.
        self.values.reserve_exact(1);
        self.values.insert(place, value);
        self.occupied |= 1 << slot;
        None
    }

    /// Takes the value of `slot` out.
    pub(crate) fn remove(&mut self, slot: usize) -> Option<T> {
        if !self.holds(slot) {
            return None;
        }
        let place = self.place(slot);
        self.occupied &= !(1 << slot);
        Some(self.values.remove(place))
    }

    /// Slots and values in increasing order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, &T)> {
        (0..WIDTH)
            .filter(|slot| self.holds(*slot))
            .zip(&self.values)
    }

    /// The same slots with other values.
    pub(crate) fn mapped(&self, mut value: impl FnMut(usize, &T) -> T) -> Self {
        Self {
            occupied: self.occupied,
            values: self.iter().map(|(slot, old)| value(slot, old)).collect(),
        }
    }

    /// Bytes on the heap.
    pub(crate) const fn heap_bytes(&self) -> usize {
        self.values.capacity() * size_of::<T>()
    }

    const fn holds(&self, slot: usize) -> bool {
        self.occupied >> slot & 1 == 1
    }

    /// Number of values before `slot`.
    const fn place(&self, slot: usize) -> usize {
        (self.occupied & ((1 << slot) - 1)).count_ones() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        /// Any sequence of changes leaves what it leaves in an ordered map.
        #[test]
        fn slots_are_an_ordered_map_of_sixteen(changes in prop::collection::vec((0..WIDTH, prop::option::of(0..9_u8)), 0..80)) {
            let (mut slots, mut oracle) = (Slots::EMPTY, BTreeMap::new());
            for (slot, change) in changes {
                let (found, expected) = match change {
                    Some(value) => (slots.insert(slot, value), oracle.insert(slot, value)),
                    None => (slots.remove(slot), oracle.remove(&slot)),
                };
                prop_assert_eq!(found, expected);
                prop_assert_eq!(slots.get(slot), oracle.get(&slot));
                prop_assert_eq!(slots.get_mut(slot).copied(), oracle.get(&slot).copied());
                prop_assert!(slots.iter().eq(oracle.iter().map(|(s, v)| (*s, v))));
                prop_assert_eq!(slots.is_empty(), oracle.is_empty());
                let doubled = slots.mapped(|_, v| 2 * v);
                prop_assert!(doubled.iter().map(|(s, v)| (s, v / 2)).eq(oracle.iter().map(|(s, v)| (*s, *v))));
            }
        }
    }

    #[test]
    fn regress_a_leaf_of_one_value_takes_the_memory_of_one() {
        let mut slots = Slots::EMPTY;
        slots.insert(15, [0_u8; 100]);
        assert_eq!(slots.clone().heap_bytes(), 100);
    }
}
