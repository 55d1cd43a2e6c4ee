//! The exact scan on every level of instructions against sorting everything.
//!
//! Levels differ in time only, and so do one query and a batch.

use feature_kdtree::{Descriptor, DescriptorIndex, ExactScan, IndexError};
use proptest::prelude::*;
use simd_level::SimdLevel;

use crate::scene::Scene;
use crate::support::{
    Change, Expected, Frequencies, Numbered, batch, change, check_entries, check_exact, corpora,
    counted, counted_down, filled, queries_for,
};

fn scan_of(level: SimdLevel, entries: &[(u32, Descriptor)]) -> ExactScan {
    filled(ExactScan::with_level(level), entries)
}

#[test]
fn every_level_and_every_way_to_ask_agree_with_sorting() {
    for (name, entries) in corpora(300) {
        // Against the order of insertion and along it: ties cannot be right by accident.
        let down = counted_down(&entries);
        let up: Numbered = (0..).map(|i| 7 + 2 * i).zip(entries.clone()).collect();
        let queries = queries_for(&entries);
        for numbered in [down, up] {
            let odd = |id: u32| id % 4 == 1;
            let expected = Expected::new(&numbered, &queries, odd);
            for level in SimdLevel::available() {
                let scan = scan_of(level, &numbered);
                expected.assert_of(&scan, &format!("{name}, {level}"));
                let mut part = ExactScan::with_level(level);
                for (id, descriptor) in numbered.iter().filter(|(id, _)| odd(*id)) {
                    part.insert(*id, descriptor).unwrap();
                }
                assert_eq!(batch(&part, &queries), expected.accepted, "{name}, {level}");
            }
        }
    }
}

#[test]
fn batches_of_every_size_answer_as_single_queries() {
    let mut scene = Scene::new(51, 12);
    let numbered = counted(&scene.entries(333));
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
fn a_part_of_an_index_is_collected_by_its_ids() {
    let entries = Scene::new(52, 5).entries(40);
    let scan = scan_of(SimdLevel::best(), &counted(&entries));
    let whole: &dyn DescriptorIndex = &scan;
    // An id that is not there is passed over, and so is one that comes again.
    let part: ExactScan = [30, 2, 77, 2, 30, 9]
        .into_iter()
        .filter_map(|id| Some((id, whole.descriptor(id)?)))
        .collect();
    assert_eq!(part.len(), 3);
    for id in [30, 2, 9] {
        assert_eq!(part.descriptor(id), Some(entries[id as usize]));
    }
    assert_eq!((part.descriptor(77), part.descriptor(3)), (None, None));
}

#[test]
fn a_scan_collected_from_entries_answers_as_one_filled_entry_by_entry() {
    for (name, entries) in corpora(300) {
        let numbered = counted_down(&entries);
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
    let up = counted(&entries);
    let down: Numbered = up.iter().rev().copied().collect();
    let mut answers = Vec::new();
    for level in SimdLevel::available() {
        for numbered in [&up, &down] {
            let scan = scan_of(level, numbered);
            for threads in [1, 2, 5] {
                let run = || feature_kdtree::match_descriptors(&queries, &scan, 0.8).unwrap();
                answers.push(crate::support::on_threads(threads, run));
            }
        }
    }
    assert!(answers[0].len() > 200);
    assert!(answers.iter().all(|other| *other == answers[0]));
}

const OFTEN: Frequencies = Frequencies {
    ids: 120,
    coarse: 4,
    changes: [8, 3, 1],
    queries: 9,
};

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_sequence_of_changes_agrees_with_the_naive_model(
        changes in prop::collection::vec(change(OFTEN), 1..400),
    ) {
        let mut model = Numbered::new();
        let mut scans: Vec<ExactScan> =
            SimdLevel::available().map(ExactScan::with_level).collect();
        for change in &changes {
            let mut indexes: Vec<&mut dyn DescriptorIndex> = Vec::new();
            for scan in &mut scans {
                indexes.push(scan);
            }
            change.make(&mut model, &mut indexes)?;
            if let Change::Query(queries) = change {
                for scan in &scans {
                    check_exact(scan, &model, queries)?;
                }
            }
        }
        for scan in &scans {
            check_entries(scan, &model)?;
        }
    }
}
