//! `CowMap` against `BTreeMap`, with clones that diverge, and the memory it shares.

use proptest::prelude::*;
use rbpf_core::CowMap;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

#[derive(Clone, Debug)]
enum Step {
    Insert(usize, u32, i64),
    Remove(usize, u32),
    Change(usize, u32, i64),
    CloneOver(usize, usize),
}

fn ids() -> impl Strategy<Value = u32> {
    // around the borders of a leaf, of the levels, and of the type
    prop_oneof![
        6 => 0..40_u32,
        2 => 250..262_u32,
        1 => 4094..4098_u32,
        1 => Just(u32::MAX),
        1 => Just(1 << 20),
    ]
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let which = 0..3_usize;
    let step = prop_oneof![
        4 => (which.clone(), ids(), any::<i64>()).prop_map(|(m, id, v)| Step::Insert(m, id, v)),
        3 => (which.clone(), ids()).prop_map(|(m, id)| Step::Remove(m, id)),
        2 => (which.clone(), ids(), any::<i64>()).prop_map(|(m, id, v)| Step::Change(m, id, v)),
        1 => (which.clone(), which).prop_map(|(to, from)| Step::CloneOver(to, from)),
    ];
    prop::collection::vec(step, 0..120)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn three_diverging_clones_equal_three_ordered_maps(steps in steps()) {
        let mut maps: [CowMap<i64>; 3] = Default::default();
        let mut oracles: [BTreeMap<u32, i64>; 3] = Default::default();
        for step in steps {
            match step {
                Step::Insert(m, id, value) => {
                    prop_assert_eq!(maps[m].insert(id, value), oracles[m].insert(id, value));
                }
                Step::Remove(m, id) => {
                    prop_assert_eq!(maps[m].remove(id), oracles[m].remove(&id));
                }
                Step::Change(m, id, value) => {
                    let place = oracles[m].get_mut(&id);
                    prop_assert_eq!(maps[m].get_mut(id).is_some(), place.is_some());
                    if let (Some(a), Some(b)) = (maps[m].get_mut(id), place) {
                        *a = value;
                        *b = value;
                    }
                }
                Step::CloneOver(to, from) => {
                    maps[to] = maps[from].clone();
                    oracles[to] = oracles[from].clone();
                }
            }
            for (map, oracle) in maps.iter().zip(&oracles) {
                prop_assert_eq!(map.len(), oracle.len());
                prop_assert_eq!(map.iter().len(), oracle.len());
                prop_assert!(map.iter().eq(oracle.iter().map(|(id, value)| (*id, value))));
                for id in [0, 15, 16, 255, 256, 4096, u32::MAX] {
                    prop_assert_eq!(map.get(id), oracle.get(&id));
                }
            }
        }
    }
}

#[test]
fn a_write_leaves_the_other_leaves_shared() {
    let map: CowMap<u64> = (0..1000).map(|id| (id, u64::from(id))).collect();
    let mut copy = map.clone();
    let leaves = 1000_usize.div_ceil(16);
    let shared = copy.shared_leaves_with(&map);
    assert_eq!((shared.shared, shared.total), (leaves, leaves));
    assert_eq!(shared.own_bytes, 0);

    *copy.get_mut(500).unwrap() = 0;
    *copy.get_mut(501).unwrap() = 0;
    let shared = copy.shared_leaves_with(&map);
    assert_eq!((shared.shared, shared.total), (leaves - 1, leaves));
    // 63 leaves, 4 branches, the root and a thousand values beside nothing; one of each here and sixteen values
    let all = copy.shared_leaves_with(&CowMap::new()).own_bytes;
    let value = size_of::<u64>();
    assert_eq!(
        (shared.own_bytes - 16 * value) * 68,
        (all - 1000 * value) * 3
    );
    assert!(std::ptr::eq(copy.get(0).unwrap(), map.get(0).unwrap()));
    assert!(!std::ptr::eq(copy.get(500).unwrap(), map.get(500).unwrap()));
    assert_eq!(map.get(500), Some(&500));

    // an absent id must not copy anything
    let mut copy = map.clone();
    assert!(copy.get_mut(1007).is_none() && copy.remove(5000).is_none());
    assert_eq!(copy.shared_leaves_with(&map).shared, leaves);
}

#[test]
fn an_emptied_map_holds_no_nodes() {
    let mut map: CowMap<u8> = [(3, 1), (70_000, 2)].into_iter().collect();
    assert_eq!(map.remove(70_000), Some(2));
    assert_eq!(map.remove(3), Some(1));
    assert!(map.is_empty());
    assert_eq!(map.shared_leaves_with(&map.clone()).total, 0);
    assert_eq!(map, CowMap::new());
}

static CLONES: AtomicUsize = AtomicUsize::new(0);

#[derive(Debug)]
struct Counted;

impl Clone for Counted {
    fn clone(&self) -> Self {
        CLONES.fetch_add(1, Ordering::Relaxed);
        Self
    }
}

/// The cost contract: copying maps copies no landmark, one write copies one leaf at most, and a
/// map with a single owner is changed in place.
#[test]
fn clones_of_values_are_counted() {
    let mut map: CowMap<Counted> = (0..4096).map(|id| (id, Counted)).collect();
    assert_eq!(CLONES.load(Ordering::Relaxed), 0);
    let particles = vec![map.clone(); 100];
    assert_eq!(CLONES.load(Ordering::Relaxed), 0);
    assert!(map.get_mut(77).is_some());
    assert_eq!(CLONES.load(Ordering::Relaxed), 16);
    drop(particles);
    for id in 0..4096 {
        assert!(map.get_mut(id).is_some());
    }
    assert_eq!(CLONES.load(Ordering::Relaxed), 16);
}
