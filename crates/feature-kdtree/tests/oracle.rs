//! Every index against sorting everything, on the data that breaks trees.

mod support;

use feature_kdtree::{
    Descriptor, DescriptorIndex, ExactScan, IndexError, KdForest, KdForestParams,
};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::{Scene, corpora, naive_two_nearest, queries_for};

fn exact_forest(leaf_capacity: usize) -> KdForest {
    KdForest::new(KdForestParams {
        trees: 2,
        leaf_capacity,
        max_leaves: usize::MAX,
        seed: 5,
    })
    .expect("parameters are in range")
}

#[test]
fn exact_indexes_agree_with_sorting_on_every_corpus() {
    for (name, entries) in corpora() {
        // Ids run against the order of insertion, so ties cannot be right by accident.
        let numbered: Vec<(u32, Descriptor)> = (0..entries.len())
            .map(|i| (10_000 - 3 * i as u32, entries[i]))
            .collect();
        let mut scan = ExactScan::new();
        let mut forest = exact_forest(4);
        for (id, descriptor) in &numbered {
            scan.insert(*id, descriptor).unwrap();
            forest.insert(*id, descriptor).unwrap();
        }
        for query in queries_for(&entries) {
            let expected = naive_two_nearest(&numbered, &query, |_| true);
            assert_eq!(scan.two_nearest(&query), expected, "scan, {name}");
            assert_eq!(forest.two_nearest(&query), expected, "forest, {name}");
            let odd = |id: u32| id % 2 == 1;
            let expected = naive_two_nearest(&numbered, &query, odd);
            assert_eq!(
                scan.two_nearest_where(&query, &odd),
                expected,
                "scan where, {name}"
            );
            assert_eq!(
                forest.two_nearest_where(&query, &odd),
                expected,
                "forest where, {name}"
            );
        }
    }
}

#[test]
fn exact_answers_do_not_depend_on_the_order_of_insertion() {
    for (name, entries) in corpora() {
        let count = entries.len();
        // 7919 is prime and larger than any corpus: a permutation.
        let shuffled: Vec<usize> = (0..count).map(|i| i * 7919 % count).collect();
        let (mut scan, mut scan_shuffled) = (ExactScan::new(), ExactScan::new());
        let (mut forest, mut forest_shuffled) = (exact_forest(3), exact_forest(3));
        for i in 0..count {
            scan.insert(i as u32, &entries[i]).unwrap();
            forest.insert(i as u32, &entries[i]).unwrap();
        }
        for &i in &shuffled {
            scan_shuffled.insert(i as u32, &entries[i]).unwrap();
            forest_shuffled.insert(i as u32, &entries[i]).unwrap();
        }
        for query in queries_for(&entries) {
            let expected = scan.two_nearest(&query);
            assert_eq!(scan_shuffled.two_nearest(&query), expected, "{name}");
            assert_eq!(forest.two_nearest(&query), expected, "{name}");
            assert_eq!(forest_shuffled.two_nearest(&query), expected, "{name}");
        }
    }
}

#[test]
fn distances_on_a_plane_agree_with_kiddo() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let mut oracle: kiddo::KdTree<f64, 3> = kiddo::KdTree::new();
    let mut forest = exact_forest(8);
    // One point for each cell of a 60 x 60 grid: distinct, and all on the wall x = 40.
    for i in 0..3600_u32 {
        let point = [40_u8, (i % 60 * 4) as u8, (i / 60 * 4) as u8];
        oracle.add(&point.map(f64::from), u64::from(i));
        let mut descriptor = [0; 128];
        descriptor[..3].copy_from_slice(&point);
        forest.insert(i, &descriptor).unwrap();
    }
    for _ in 0..300 {
        let point: [u8; 3] = rng.random();
        let mut query = [0; 128];
        query[..3].copy_from_slice(&point);
        let expected = oracle.nearest_n::<kiddo::SquaredEuclidean>(&point.map(f64::from), 2);
        let found = forest.two_nearest(&query).unwrap();
        assert_eq!(
            f64::from(found.first.distance_squared),
            expected[0].distance
        );
        assert_eq!(
            f64::from(found.second.unwrap().distance_squared),
            expected[1].distance
        );
    }
}

#[test]
fn a_bounded_search_still_reports_two_when_two_are_accepted() {
    let mut scene = Scene::new(31, 30);
    let entries = scene.entries(2000);
    let mut forest = KdForest::new(KdForestParams {
        max_leaves: 1,
        ..KdForestParams::default()
    })
    .unwrap();
    let numbered: Vec<(u32, Descriptor)> = (0..).zip(entries.iter().copied()).collect();
    for (id, descriptor) in &numbered {
        forest.insert(*id, descriptor).unwrap();
    }
    for query in entries.iter().take(50) {
        let rare = |id: u32| id % 997 == 1;
        let found = forest.two_nearest_where(query, &rare).unwrap();
        assert!(rare(found.first.id) && rare(found.second.unwrap().id));
        assert_ne!(found.first.id, found.second.unwrap().id);
        let only = |id: u32| id == 1999;
        assert_eq!(
            forest.two_nearest_where(query, &only),
            naive_two_nearest(&numbered, query, only)
        );
        assert_eq!(forest.two_nearest_where(query, &|_| false), None);
    }
}

#[test]
fn rebuilding_forgets_the_history() {
    let mut scene = Scene::new(41, 40);
    let entries = scene.entries(1500);
    let params = KdForestParams {
        max_leaves: 2,
        ..KdForestParams::default()
    };
    let mut with_history = KdForest::new(params).unwrap();
    for i in (0..1500_u32).rev() {
        with_history.insert(i, &entries[i as usize]).unwrap();
    }
    for i in 1000..1500 {
        assert!(with_history.remove(i));
    }
    let mut fresh = KdForest::new(params).unwrap();
    for i in 0..1000_u32 {
        fresh.insert(i, &entries[i as usize]).unwrap();
    }
    with_history.rebuild();
    fresh.rebuild();
    let queries: Vec<Descriptor> = (0..300)
        .map(|i| scene.seen_again(&entries[i], 14.0))
        .collect();
    let answers = |forest: &KdForest| -> Vec<_> {
        queries
            .iter()
            .map(|query| forest.two_nearest(query))
            .collect()
    };
    assert_eq!(answers(&with_history), answers(&fresh));
    // ... and equal changes from there on keep the two equal.
    for i in 1000..1300_u32 {
        with_history.insert(i, &entries[i as usize]).unwrap();
        fresh.insert(i, &entries[i as usize]).unwrap();
    }
    assert_eq!(answers(&with_history), answers(&fresh));
}

#[test]
fn errors_carry_the_numbers_and_change_nothing() {
    let params = |trees, leaf_capacity, max_leaves| KdForestParams {
        trees,
        leaf_capacity,
        max_leaves,
        seed: 0,
    };
    for (bad, name) in [
        (params(0, 1, 1), "trees"),
        (params(1, 0, 1), "leaf_capacity"),
        (params(1, 1, 0), "max_leaves"),
    ] {
        let error = KdForest::new(bad).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("{name} must be at least 1, given 0")
        );
    }
    let error = KdForest::new(params(65, 1, 1)).unwrap_err();
    assert_eq!(error.to_string(), "trees must be at most 64, given 65");

    let mut forest = exact_forest(2);
    let mut scan = ExactScan::new();
    let indexes: [&mut dyn DescriptorIndex; 2] = [&mut forest, &mut scan];
    for index in indexes {
        assert!(index.is_empty() && index.two_nearest(&[0; 128]).is_none());
        assert!(!index.remove(7));
        index.insert(7, &[1; 128]).unwrap();
        assert_eq!(
            index.insert(7, &[2; 128]),
            Err(IndexError::DuplicateId { id: 7 })
        );
        assert_eq!(index.len(), 1);
        assert!(index.memory_usage() >= 128);
        let found = index.two_nearest(&[1; 128]).unwrap();
        assert_eq!((found.first.distance_squared, found.second), (0, None));
        assert!(index.remove(7) && index.is_empty());
        index.insert(7, &[2; 128]).unwrap();
        assert_eq!(
            index.two_nearest(&[1; 128]).unwrap().first.distance_squared,
            128
        );
    }
}

#[derive(Debug, Clone)]
enum Change {
    Insert(u32, Descriptor),
    Remove(u32),
    Query(Descriptor),
}

/// Few distinct values in few components: many ties, duplicates and planes.
fn coarse_descriptor() -> impl Strategy<Value = Descriptor> {
    (0..4_u8, 0..4_u8, 0..3_u8, any::<bool>()).prop_map(|(a, b, c, wide)| {
        let mut descriptor = [if wide { 200 } else { 0 }; 128];
        descriptor[0] = 60 * a;
        descriptor[63] = 60 * b;
        descriptor[127] = 100 * c;
        descriptor
    })
}

fn change() -> impl Strategy<Value = Change> {
    let any_descriptor = prop_oneof![
        4 => coarse_descriptor(),
        1 => any::<[u8; 32]>().prop_map(|part| std::array::from_fn(|i| part[i % 32])),
    ]
    .boxed();
    prop_oneof![
        6 => (0..200_u32, any_descriptor.clone()).prop_map(|(id, d)| Change::Insert(id, d)),
        3 => (0..200_u32).prop_map(Change::Remove),
        2 => any_descriptor.prop_map(Change::Query),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_sequence_of_changes_agrees_with_the_naive_model(
        changes in prop::collection::vec(change(), 1..400),
        leaf_capacity in 1..6_usize,
    ) {
        let mut model: Vec<(u32, Descriptor)> = Vec::new();
        let mut scan = ExactScan::new();
        let mut forest = exact_forest(leaf_capacity);
        for change in &changes {
            match change {
                Change::Insert(id, descriptor) => {
                    let present = model.iter().any(|(other, _)| other == id);
                    prop_assert_eq!(scan.insert(*id, descriptor).is_err(), present);
                    prop_assert_eq!(forest.insert(*id, descriptor).is_err(), present);
                    if !present {
                        model.push((*id, *descriptor));
                    }
                }
                Change::Remove(id) => {
                    let present = model.iter().any(|(other, _)| other == id);
                    prop_assert_eq!(scan.remove(*id), present);
                    prop_assert_eq!(forest.remove(*id), present);
                    model.retain(|(other, _)| other != id);
                }
                Change::Query(query) => {
                    let expected = naive_two_nearest(&model, query, |_| true);
                    prop_assert_eq!(scan.two_nearest(query), expected);
                    prop_assert_eq!(forest.two_nearest(query), expected);
                    let accept = |id: u32| !id.is_multiple_of(3);
                    let expected = naive_two_nearest(&model, query, accept);
                    prop_assert_eq!(forest.two_nearest_where(query, &accept), expected);
                }
            }
            prop_assert_eq!(scan.len(), model.len());
            prop_assert_eq!(forest.len(), model.len());
        }
    }
}
