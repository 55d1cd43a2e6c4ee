//! Inverted lists: exact when they look at all lists, always two when two are accepted, bounded whatever comes.

use feature_kdtree::{
    Descriptor, DescriptorIndex, ExactScan, IndexError, InvertedLists, InvertedListsParams,
};
use proptest::prelude::*;
use simd_level::SimdLevel;

use crate::scene::Scene;
use crate::support::{
    Change, Expected, Frequencies, Numbered, change, check_entries, check_exact, corpora, counted,
    counted_down, filled, naive_two_nearest, queries_for,
};

fn lists(list_capacity: usize, probes: Option<usize>) -> InvertedLists {
    InvertedLists::new(InvertedListsParams {
        list_capacity,
        probes,
    })
    .expect("parameters are in range")
}

#[test]
fn all_lists_together_are_exact_on_every_corpus_and_level() {
    for (name, entries) in corpora(2000) {
        let numbered = counted_down(&entries);
        let queries = queries_for(&entries);
        let expected = Expected::new(&numbered, &queries, |id| id % 2 == 1);
        for level in SimdLevel::available() {
            let params = InvertedListsParams {
                list_capacity: 24,
                probes: Some(usize::MAX),
            };
            let index = filled(InvertedLists::with_level(params, level).unwrap(), &numbered);
            expected.assert_of(&index, &format!("{name}, {level}"));
        }
    }
}

#[test]
fn few_probes_give_the_same_on_every_level_one_by_one_and_in_batches_of_any_size() {
    let mut scene = Scene::new(21, 200);
    let entries = scene.entries(6000);
    let queries: Vec<Descriptor> = (0..700)
        .map(|i| scene.seen_again(&entries[8 * i], 14.0))
        .collect();
    let params = InvertedListsParams {
        list_capacity: 40,
        probes: Some(3),
    };
    let mut of_levels = SimdLevel::available().map(|level| {
        let index = filled(
            InvertedLists::with_level(params, level).unwrap(),
            &counted(&entries),
        );
        let mut found = Vec::new();
        index.two_nearest_batch(&queries, &mut found);
        let alone: Vec<_> = queries.iter().map(|q| index.two_nearest(q)).collect();
        assert_eq!(alone, found);
        let mut portion = Vec::new();
        for start in [0, 1, 300] {
            index.two_nearest_batch(&queries[start..start + 9], &mut portion);
            assert_eq!(portion, found[start..start + 9]);
        }
        found
    });
    let first = of_levels.next().unwrap();
    assert!(of_levels.all(|found| found == first));
}

#[test]
fn the_nearest_is_found_as_often_as_the_readme_says() {
    // Share p of n queries: below p - 4 sqrt(p (1 - p) / n) once in 3e4 times.
    const CLAIM: f64 = 0.97;
    const QUERIES: usize = 1000;
    let slack = 4.0 * (CLAIM * (1.0 - CLAIM) / QUERIES as f64).sqrt();
    for entries in [3000, 10_000] {
        let mut scene = Scene::new(77, entries / 25);
        let descriptors = scene.entries(entries);
        let index = filled(lists(128, None), &counted(&descriptors));
        assert!(
            index.probes() < index.list_count() / 2,
            "the bound must bind for the test to say anything"
        );
        let scan = filled(ExactScan::new(), &counted(&descriptors));
        let queries: Vec<Descriptor> = (0..QUERIES)
            .map(|_| {
                let entry = scene.position(entries);
                scene.seen_again(&descriptors[entry], 10.0)
            })
            .collect();
        let (mut found, mut truth) = (Vec::new(), Vec::new());
        index.two_nearest_batch(&queries, &mut found);
        scan.two_nearest_batch(&queries, &mut truth);
        let same = found.iter().zip(&truth);
        let same = same.filter(|(f, t)| f.unwrap().first == t.unwrap().first);
        let recall = same.count() as f64 / QUERIES as f64;
        println!("{entries} entries: nearest {recall:.3}");
        assert!(recall >= CLAIM - slack, "{recall} of {entries}");
    }
}

#[test]
fn more_probes_find_more() {
    let mut scene = Scene::new(5, 100);
    let entries = scene.entries(4000);
    let mut index = filled(lists(32, Some(1)), &counted(&entries));
    let queries: Vec<Descriptor> = (0..500)
        .map(|i| scene.seen_again(&entries[8 * i], 16.0))
        .collect();
    let mut right = Vec::new();
    for probes in [1, 4, 16, usize::MAX] {
        index.set_probes(Some(probes)).unwrap();
        assert_eq!(index.probes(), probes);
        let mut found = Vec::new();
        index.two_nearest_batch(&queries, &mut found);
        let both_exact = queries.iter().zip(&found).filter(|(query, found)| {
            let numbered: Vec<(u32, Descriptor)> = (0..).zip(entries.iter().copied()).collect();
            **found == naive_two_nearest(&numbered, query, |_| true)
        });
        right.push(both_exact.count());
    }
    assert!(right[0] < right[1] && right[1] < right[2], "{right:?}");
    assert_eq!(right[3], queries.len());
}

#[test]
fn equal_descriptors_far_beyond_a_list_are_kept_found_and_removed() {
    let mut index = lists(64, Some(2));
    let mut scene = Scene::new(6, 10);
    let others = scene.entries(300);
    for id in 0..10_000 {
        index.insert(id, &[9; 128]).unwrap();
    }
    for (id, descriptor) in (10_000..).zip(&others) {
        index.insert(id, descriptor).unwrap();
    }
    // The equal ones share a list: at most one list for every eighth of a capacity of the others, and theirs.
    assert!(
        index.list_count() <= 1 + others.len() / 8,
        "{}",
        index.list_count()
    );
    let found = index.two_nearest(&[9; 128]).unwrap();
    assert_eq!((found.first.id, found.second.unwrap().id), (0, 1));
    for id in 0..9_998 {
        assert!(index.remove(id));
    }
    let found = index.two_nearest(&[9; 128]).unwrap();
    assert_eq!((found.first.id, found.second.unwrap().id), (9_998, 9_999));
    assert_eq!(index.len(), 302);
}

#[test]
fn lists_stay_near_their_capacity_when_the_stream_drifts() {
    // The scene changes all the time, as before a moving camera: every pattern is there for 500 entries and gone.
    let mut index = lists(32, None);
    let mut id = 0;
    for seed in 0..40 {
        for descriptor in Scene::new(seed, 10).entries(500) {
            index.insert(id, &descriptor).unwrap();
            id += 1;
        }
    }
    let mean = index.len() as f64 / index.list_count() as f64;
    // Halves of a division hold between an eighth and seven eighths, full lists the capacity and what waits in line.
    assert!((32.0 / 8.0..=32.0).contains(&mean), "{mean}");
    for oldest in 0..19_000 {
        assert!(index.remove(oldest));
    }
    // Only the newest thousand is left: nearly empty lists were dissolved.
    let mean = index.len() as f64 / index.list_count() as f64;
    assert!(mean >= 32.0 / 8.0, "{mean}");
    let mut fresh = lists(32, None);
    for id in 19_000..20_000 {
        fresh.insert(id, &index.descriptor(id).unwrap()).unwrap();
    }
    assert!(index.memory_usage() < 3 * fresh.memory_usage());
}

#[test]
fn memory_is_rows_and_ids_with_a_third_on_top() {
    let entries = Scene::new(8, 400).entries(20_000);
    let index = filled(lists(128, None), &counted(&entries));
    let least = entries.len() * (128 + 4 + 4);
    let used = index.memory_usage();
    assert!(
        used > least && used < least + least / 3,
        "{used} of {least}"
    );
}

#[test]
fn rebuilding_forgets_the_history() {
    let mut scene = Scene::new(41, 40);
    let entries = scene.entries(3000);
    let mut with_history = lists(32, Some(2));
    for i in (0..3000_u32).rev() {
        with_history.insert(i, &entries[i as usize]).unwrap();
    }
    for i in 2000..3000 {
        assert!(with_history.remove(i));
    }
    let mut fresh = filled(lists(32, Some(2)), &counted(&entries[..2000]));
    let queries: Vec<Descriptor> = (0..400)
        .map(|i| scene.seen_again(&entries[5 * i], 16.0))
        .collect();
    let answers = |index: &InvertedLists| -> Vec<_> {
        let mut found = Vec::new();
        index.two_nearest_batch(&queries, &mut found);
        found
    };
    assert_ne!(
        answers(&with_history),
        answers(&fresh),
        "or nothing is shown"
    );
    with_history.rebuild();
    fresh.rebuild();
    assert_eq!(answers(&with_history), answers(&fresh));
    for i in 2000..2500_u32 {
        with_history.insert(i, &entries[i as usize]).unwrap();
        fresh.insert(i, &entries[i as usize]).unwrap();
    }
    assert_eq!(answers(&with_history), answers(&fresh));
}

#[test]
fn a_rare_filter_still_gets_two() {
    let mut scene = Scene::new(31, 30);
    let entries = scene.entries(4000);
    let index = filled(lists(32, Some(1)), &counted(&entries));
    let numbered = counted(&entries);
    for query in entries.iter().take(50) {
        let rare = |id: u32| id % 1997 == 1;
        let found = index.two_nearest_where(query, &rare).unwrap();
        assert!(rare(found.first.id) && rare(found.second.unwrap().id));
        assert_ne!(found.first.id, found.second.unwrap().id);
        let only = |id: u32| id == 3999;
        assert_eq!(
            index.two_nearest_where(query, &only),
            naive_two_nearest(&numbered, query, only)
        );
        assert_eq!(index.two_nearest_where(query, &|_| false), None);
    }
}

#[cfg(feature = "parallel")]
#[test]
fn matches_do_not_depend_on_the_number_of_threads() {
    let mut scene = Scene::new(9, 60);
    let entries = scene.entries(5000);
    let queries: Vec<Descriptor> = (0..600)
        .map(|i| scene.seen_again(&entries[8 * i], 12.0))
        .collect();
    let index = filled(lists(32, Some(3)), &counted(&entries));
    let run = |threads: usize| {
        let run = || feature_kdtree::match_descriptors(&queries, &index, 0.8).unwrap();
        crate::support::on_threads(threads, run)
    };
    let alone = run(1);
    assert!(alone.len() > 100);
    assert_eq!(run(3), alone);
    assert_eq!(run(8), alone);
}

#[test]
fn errors_carry_the_numbers_and_change_nothing() {
    let too_small = |list_capacity, probes| {
        let params = InvertedListsParams {
            list_capacity,
            probes,
        };
        InvertedLists::new(params).unwrap_err().to_string()
    };
    assert_eq!(
        too_small(1, None),
        "list_capacity must be at least 2, given 1"
    );
    assert_eq!(too_small(2, Some(0)), "probes must be at least 1, given 0");
    let mut index = lists(2, None);
    assert!(index.set_probes(Some(0)).is_err());
    assert_eq!(index.probes(), lists(2, None).probes());
    assert!(index.is_empty() && index.two_nearest(&[0; 128]).is_none());
    assert!(!index.remove(7));
    index.insert(7, &[1; 128]).unwrap();
    let again = index.insert(7, &[2; 128]);
    assert_eq!(again, Err(IndexError::DuplicateId { id: 7 }));
    assert_eq!((index.len(), index.descriptor(7)), (1, Some([1; 128])));
    let found = index.two_nearest(&[1; 128]).unwrap();
    assert_eq!((found.first.distance_squared, found.second), (0, None));
    assert!(index.remove(7) && index.is_empty());
    index.insert(7, &[2; 128]).unwrap();
    assert_eq!(index.descriptor(7), Some([2; 128]));
}

const OFTEN: Frequencies = Frequencies {
    ids: 300,
    coarse: 1,
    changes: [6, 3, 1],
    queries: 2,
};

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_sequence_of_changes_agrees_with_the_naive_model(
        changes in prop::collection::vec(change(OFTEN), 1..900),
        list_capacity in 2..10_usize,
    ) {
        let mut model = Numbered::new();
        let mut exact = lists(list_capacity, Some(usize::MAX));
        let mut bounded = lists(list_capacity, Some(1));
        for change in &changes {
            change.make(&mut model, &mut [&mut exact, &mut bounded])?;
            let Change::Query(queries) = change else {
                continue;
            };
            check_exact(&exact, &model, queries)?;
            for query in queries {
                // A bounded search may miss an entry, but never claims one that is not there.
                let expected = naive_two_nearest(&model, query, |_| true);
                let found = bounded.two_nearest(query);
                prop_assert_eq!(found.is_some(), expected.is_some());
                if let (Some(found), Some(expected)) = (found, expected) {
                    prop_assert!(found.first >= expected.first);
                    prop_assert_eq!(found.second.is_some(), expected.second.is_some());
                    prop_assert!(model.iter().any(|(id, _)| *id == found.first.id));
                }
            }
        }
        check_entries(&exact, &model)?;
        check_entries(&bounded, &model)?;
    }
}
