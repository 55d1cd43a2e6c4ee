//! The exact scan on every level of instructions against sorting everything.
//!
//! What differs between the levels, and between one query and a batch, is only the time.

mod support;

use feature_kdtree::{
    Descriptor, DescriptorIndex, ExactScan, IndexError, TwoNearest, match_descriptors,
};
use proptest::prelude::*;
use simd_level::SimdLevel;
use support::{Scene, corpora, naive_two_nearest, queries_for};

type Numbered = Vec<(u32, Descriptor)>;

fn scan_of(level: SimdLevel, entries: &[(u32, Descriptor)]) -> ExactScan {
    let mut scan = ExactScan::with_level(level);
    for (id, descriptor) in entries {
        scan.insert(*id, descriptor).expect("ids are unique");
    }
    scan
}

fn batch(index: &impl DescriptorIndex, queries: &[Descriptor]) -> Vec<Option<TwoNearest>> {
    // What was found before must not matter.
    let mut found = vec![None; 3];
    index.two_nearest_batch(queries, &mut found);
    found
}

#[test]
fn every_level_and_every_way_to_ask_agree_with_sorting() {
    for (name, entries) in corpora() {
        // Against the order of insertion and along it: ties cannot be right by accident.
        let down: Numbered = (0..).map(|i| 10_000 - 3 * i).zip(entries.clone()).collect();
        let up: Numbered = (0..).map(|i| 7 + 2 * i).zip(entries.clone()).collect();
        let queries = queries_for(&entries);
        for numbered in [down, up] {
            let odd = |id: u32| id % 4 == 1;
            let expected: Vec<_> = queries
                .iter()
                .map(|query| naive_two_nearest(&numbered, query, |_| true))
                .collect();
            let expected_odd: Vec<_> = queries
                .iter()
                .map(|query| naive_two_nearest(&numbered, query, odd))
                .collect();
            for level in SimdLevel::available() {
                let scan = scan_of(level, &numbered);
                let label = format!("{name}, {level}");
                assert_eq!(batch(&scan, &queries), expected, "{label}");
                let single: Vec<_> = queries
                    .iter()
                    .map(|query| scan.two_nearest(query))
                    .collect();
                assert_eq!(single, expected, "{label}");
                let filtered: Vec<_> = queries
                    .iter()
                    .map(|query| scan.two_nearest_where(query, &odd))
                    .collect();
                assert_eq!(filtered, expected_odd, "{label}");
                let ids = numbered.iter().map(|(id, _)| *id).filter(|id| odd(*id));
                let part = ExactScan::gathered(&scan, ids);
                assert_eq!(batch(&part, &queries), expected_odd, "{label}");
            }
        }
    }
}

#[test]
fn batches_of_every_size_answer_as_single_queries() {
    let mut scene = Scene::new(51, 12);
    let numbered: Numbered = (0..).zip(scene.entries(333)).collect();
    let queries = scene.entries(1000);
    for level in SimdLevel::available() {
        let scan = scan_of(level, &numbered);
        let single: Vec<_> = queries
            .iter()
            .map(|query| scan.two_nearest(query))
            .collect();
        for size in (0..=50).chain([479, 480, 481, 1000]) {
            assert_eq!(batch(&scan, &queries[..size]), single[..size], "{size}");
        }
    }
    let empty = ExactScan::new();
    assert_eq!(batch(&empty, &queries[..5]), [None; 5]);
}

#[test]
fn gathering_passes_over_absent_and_repeated_ids() {
    let mut scene = Scene::new(52, 5);
    let entries = scene.entries(40);
    let scan = scan_of(
        SimdLevel::best(),
        &(0..).zip(entries.iter().copied()).collect::<Numbered>(),
    );
    let part = ExactScan::gathered(&scan, [30, 2, 77, 2, 30, 9]);
    assert_eq!(part.len(), 3);
    for id in [30, 2, 9] {
        assert_eq!(part.descriptor(id), Some(entries[id as usize]));
    }
    assert_eq!((part.descriptor(77), part.descriptor(3)), (None, None));
    let whole: &dyn DescriptorIndex = &scan;
    assert!(ExactScan::gathered(whole, []).is_empty());
}

#[test]
fn a_scan_collected_from_entries_answers_as_one_filled_entry_by_entry() {
    for (name, entries) in corpora() {
        let numbered: Numbered = (0..).map(|i| 10_000 - 3 * i).zip(entries.clone()).collect();
        let inserted = scan_of(SimdLevel::best(), &numbered);
        // References and values; an iterator that knows its length and one that does not.
        let of_references: ExactScan = numbered.iter().map(|(id, d)| (*id, d)).collect();
        let of_values: ExactScan = numbered.iter().copied().filter(|_| true).collect();
        let queries = queries_for(&entries);
        let expected = batch(&inserted, &queries);
        for collected in [of_references, of_values] {
            assert_eq!(collected.len(), entries.len(), "{name}");
            assert_eq!(batch(&collected, &queries), expected, "{name}");
            let (id, descriptor) = numbered[numbered.len() - 1];
            assert_eq!(collected.descriptor(id), Some(descriptor), "{name}");
        }
    }
    // Of two entries with one id the first counts.
    let mut scan: ExactScan = [(7, [1; 128]), (8, [2; 128]), (7, [3; 128])]
        .into_iter()
        .collect();
    assert_eq!((scan.len(), scan.descriptor(7)), (2, Some([1; 128])));
    assert!(scan.remove(7) && scan.insert(7, &[3; 128]).is_ok());
    assert!(
        std::iter::empty::<(u32, Descriptor)>()
            .collect::<ExactScan>()
            .is_empty()
    );
}

#[test]
fn a_removed_id_can_be_given_again() {
    for level in SimdLevel::available() {
        let mut scan = ExactScan::with_level(level);
        for id in 0..40 {
            scan.insert(id, &[id as u8; 128]).unwrap();
        }
        for id in [39, 0, 20, 15, 16] {
            assert!(scan.remove(id) && !scan.remove(id));
            assert_eq!(scan.descriptor(id), None);
            scan.insert(id, &[id as u8 + 100; 128]).unwrap();
            let error = scan.insert(id, &[0; 128]).unwrap_err();
            assert_eq!(error, IndexError::DuplicateId { id });
            let found = scan.two_nearest(&[id as u8 + 100; 128]).unwrap();
            assert_eq!((found.first.id, found.first.distance_squared), (id, 0));
        }
        assert_eq!(scan.len(), 40);
    }
}

#[cfg(feature = "parallel")]
#[test]
fn exact_matches_do_not_depend_on_threads_levels_or_order() {
    let mut scene = Scene::new(53, 40);
    let entries = scene.entries(2000);
    let queries: Vec<Descriptor> = (0..700)
        .map(|i| scene.seen_again(&entries[2 * i], 12.0))
        .collect();
    let up: Numbered = (0..).zip(entries.iter().copied()).collect();
    let down: Numbered = up.iter().rev().copied().collect();
    let mut answers = Vec::new();
    for level in SimdLevel::available() {
        for numbered in [&up, &down] {
            let scan = scan_of(level, numbered);
            for threads in [1, 2, 5] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                let matches = pool
                    .unwrap()
                    .install(|| match_descriptors(&queries, &scan, 0.8).unwrap());
                answers.push(matches);
            }
        }
    }
    assert!(answers[0].len() > 200);
    assert!(answers.iter().all(|other| *other == answers[0]));
}

#[derive(Debug, Clone)]
enum Change {
    Insert(u32, Descriptor),
    Remove(u32),
    Query(Vec<Descriptor>),
}

/// Few distinct values in few components, 0 and 255 among them: ties, duplicates, planes and extremes.
fn coarse_descriptor() -> impl Strategy<Value = Descriptor> {
    (0..4_u8, 0..2_u8, 0..3_u8, any::<bool>()).prop_map(|(a, b, c, wide)| {
        let mut descriptor = [if wide { 255 } else { 0 }; 128];
        descriptor[0] = 85 * a;
        descriptor[63] = 255 * b;
        descriptor[127] = 127 * c;
        descriptor
    })
}

fn change() -> impl Strategy<Value = Change> {
    let any_descriptor = prop_oneof![
        4 => coarse_descriptor(),
        1 => any::<[u8; 32]>().prop_map(|part| std::array::from_fn(|i| part[i % 32])),
    ]
    .boxed();
    let queries = prop::collection::vec(any_descriptor.clone(), 1..9);
    prop_oneof![
        8 => (0..120_u32, any_descriptor).prop_map(|(id, d)| Change::Insert(id, d)),
        3 => (0..120_u32).prop_map(Change::Remove),
        1 => queries.prop_map(Change::Query),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_sequence_of_changes_agrees_with_the_naive_model(
        changes in prop::collection::vec(change(), 1..400),
    ) {
        let mut model: Numbered = Vec::new();
        let mut scans: Vec<ExactScan> =
            SimdLevel::available().map(ExactScan::with_level).collect();
        for change in &changes {
            match change {
                Change::Insert(id, descriptor) => {
                    let present = model.iter().any(|(other, _)| other == id);
                    for scan in &mut scans {
                        prop_assert_eq!(scan.insert(*id, descriptor).is_err(), present);
                    }
                    if !present {
                        model.push((*id, *descriptor));
                    }
                }
                Change::Remove(id) => {
                    let present = model.iter().any(|(other, _)| other == id);
                    for scan in &mut scans {
                        prop_assert_eq!(scan.remove(*id), present);
                    }
                    model.retain(|(other, _)| other != id);
                }
                Change::Query(queries) => {
                    let accept = |id: u32| !id.is_multiple_of(3);
                    for scan in &scans {
                        let found = batch(scan, queries);
                        for (query, found) in queries.iter().zip(found) {
                            let expected = naive_two_nearest(&model, query, |_| true);
                            prop_assert_eq!(found, expected);
                            let expected = naive_two_nearest(&model, query, accept);
                            prop_assert_eq!(scan.two_nearest_where(query, &accept), expected);
                        }
                    }
                }
            }
            for scan in &scans {
                prop_assert_eq!(scan.len(), model.len());
            }
        }
        for (id, descriptor) in &model {
            for scan in &scans {
                prop_assert_eq!(scan.descriptor(*id), Some(*descriptor));
            }
        }
    }
}
