//! Every index against sorting everything, on the data that breaks trees.

use feature_kdtree::{
    Descriptor, DescriptorIndex, ExactScan, IndexError, KdForest, KdForestParams,
};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scene::Scene;
use crate::support::{
    Change, Expected, Frequencies, Numbered, change, check_entries, check_exact, corpora, counted,
    counted_down, filled, naive_two_nearest, queries_for,
};

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
    for (name, entries) in corpora(300) {
        let numbered = counted_down(&entries);
        let scan = filled(ExactScan::new(), &numbered);
        let forest = filled(exact_forest(4), &numbered);
        let expected = Expected::new(&numbered, &queries_for(&entries), |id| id % 2 == 1);
        expected.assert_of(&scan, &format!("scan, {name}"));
        expected.assert_of(&forest, &format!("forest, {name}"));
    }
}

#[test]
fn exact_answers_do_not_depend_on_the_order_of_insertion() {
    for (name, entries) in corpora(300) {
        let count = entries.len();
        // 7919 is prime and larger than any corpus: a permutation.
        let numbered = counted(&entries);
        let shuffled: Numbered = (0..count).map(|i| numbered[i * 7919 % count]).collect();
        let scan = filled(ExactScan::new(), &numbered);
        let scan_shuffled = filled(ExactScan::new(), &shuffled);
        let forest = filled(exact_forest(3), &numbered);
        let forest_shuffled = filled(exact_forest(3), &shuffled);
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
    let params = KdForestParams {
        max_leaves: 1,
        ..KdForestParams::default()
    };
    let numbered = counted(&entries);
    let forest = filled(KdForest::new(params).unwrap(), &numbered);
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

const OFTEN: Frequencies = Frequencies {
    ids: 200,
    coarse: 4,
    changes: [6, 3, 2],
    queries: 2,
};

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_sequence_of_changes_agrees_with_the_naive_model(
        changes in prop::collection::vec(change(OFTEN), 1..400),
        leaf_capacity in 1..6_usize,
    ) {
        let mut model = Numbered::new();
        let mut scan = ExactScan::new();
        let mut forest = exact_forest(leaf_capacity);
        for change in &changes {
            change.make(&mut model, &mut [&mut scan, &mut forest])?;
            if let Change::Query(queries) = change {
                check_exact(&scan, &model, queries)?;
                check_exact(&forest, &model, queries)?;
            }
        }
        check_entries(&scan, &model)?;
        check_entries(&forest, &model)?;
    }
}
