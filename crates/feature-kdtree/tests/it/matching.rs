//! The rules of matching: ratio on squared distances, one to one, mutual, any number of threads.

use feature_kdtree::{
    Descriptor, DescriptorIndex, ExactScan, IndexError, KdForest, KdForestParams, Match,
    match_descriptors, match_mutual,
};

use crate::scene::Scene;
use crate::support::{counted, naive_two_nearest};

/// At squared distance `value^2` from zero.
fn along_first_axis(value: u8) -> Descriptor {
    let mut descriptor = [0; 128];
    descriptor[0] = value;
    descriptor
}

fn index_of(entries: &[Descriptor]) -> ExactScan {
    (0..).zip(entries).collect()
}

#[test]
fn the_ratio_is_squared_before_it_meets_squared_distances() {
    // d1 / d2 = 75 / 100: above 0.7, though d1^2 / d2^2 = 0.5625 is below it.
    let index = index_of(&[along_first_axis(75), along_first_axis(100)]);
    let zero = [[0; 128]];
    assert_eq!(match_descriptors(&zero, &index, 0.7).unwrap(), []);
    // The other way round: 60 / 100 is below 0.7 but not below 0.7^2, which a root forgotten elsewhere would ask.
    let index = index_of(&[along_first_axis(60), along_first_axis(100)]);
    let expected = Match {
        query: 0,
        id: 0,
        distance_squared: 3600,
        ratio: 0.6,
    };
    assert_eq!(match_descriptors(&zero, &index, 0.7).unwrap(), [expected]);
    // The same holds for two frames.
    let frame = [along_first_axis(75), along_first_axis(100)];
    assert_eq!(match_mutual(&zero, &frame, 0.7).unwrap(), []);
    let frame = [along_first_axis(60), along_first_axis(100)];
    assert_eq!(match_mutual(&zero, &frame, 0.7).unwrap(), [expected]);
}

#[test]
fn the_ratio_test_is_strict_and_ties_match_nothing() {
    let zero = [[0; 128]];
    // 50 / 100 is not below 0.5.
    let index = index_of(&[along_first_axis(50), along_first_axis(100)]);
    assert_eq!(match_descriptors(&zero, &index, 0.5).unwrap(), []);
    assert_eq!(match_descriptors(&zero, &index, 0.501).unwrap().len(), 1);
    // Two entries equal to the query: 0 / 0.
    let index = index_of(&[[0; 128], [0; 128]]);
    assert_eq!(match_descriptors(&zero, &index, 1.0).unwrap(), []);
    // An equal entry and any other: ratio zero.
    let index = index_of(&[[0; 128], along_first_axis(1)]);
    assert_eq!(match_descriptors(&zero, &index, 0.7).unwrap()[0].ratio, 0.0);
    assert_eq!(match_descriptors(&zero, &index, 0.0).unwrap(), []);
}

#[test]
fn a_single_entry_passes_no_ratio_test() {
    let zero = [[0; 128]];
    assert_eq!(match_descriptors(&zero, &index_of(&zero), 1.0).unwrap(), []);
    assert_eq!(match_mutual(&zero, &zero, 1.0).unwrap(), []);
    assert_eq!(match_descriptors(&zero, &index_of(&[]), 1.0).unwrap(), []);
    assert_eq!(match_descriptors(&[], &index_of(&zero), 1.0).unwrap(), []);
}

#[test]
fn each_entry_keeps_its_nearest_query_and_ties_the_lower() {
    let index = index_of(&[along_first_axis(100), along_first_axis(250)]);
    let queries = [90, 98, 240, 102, 110].map(along_first_axis);
    let matches = match_descriptors(&queries, &index, 0.7).unwrap();
    let pairs: Vec<(u32, u32, u32)> = matches
        .iter()
        .map(|found| (found.query, found.id, found.distance_squared))
        .collect();
    assert_eq!(pairs, [(1, 0, 4), (2, 1, 100)]);
}

#[test]
fn mutual_matching_drops_what_the_way_back_denies() {
    let a = [100, 104].map(along_first_axis);
    let b = [103, 200].map(along_first_axis);
    // Both of `a` prefer b[0]; b[0] prefers a[1].
    let matches = match_mutual(&a, &b, 0.7).unwrap();
    assert_eq!(matches.len(), 1);
    assert_eq!((matches[0].query, matches[0].id), (1, 0));
}

#[test]
fn a_ratio_out_of_range_is_an_error() {
    for ratio in [-0.1, 1.000_1, f32::INFINITY, f32::NAN] {
        assert!(matches!(
            match_descriptors(&[], &index_of(&[]), ratio),
            Err(IndexError::Ratio { .. })
        ));
        assert!(match_mutual(&[], &[], ratio).is_err());
    }
    let error = match_mutual(&[], &[], 1.5).unwrap_err();
    assert_eq!(error.to_string(), "ratio 1.5 given, 0 to 1 required");
}

/// The definition, written out: Eq. 21 on distances, then the best query of each entry.
fn naive_matches(queries: &[Descriptor], entries: &[Descriptor], ratio: f64) -> Vec<(u32, u32)> {
    let numbered = counted(entries);
    let candidates: Vec<(u32, u32, u32)> = (0..)
        .zip(queries)
        .filter_map(|(query, descriptor)| {
            let found = naive_two_nearest(&numbered, descriptor, |_| true)?;
            let root = |value: u32| f64::from(value).sqrt();
            let first = root(found.first.distance_squared);
            let second = root(found.second?.distance_squared);
            (first / second < ratio).then_some((
                query,
                found.first.id,
                found.first.distance_squared,
            ))
        })
        .collect();
    candidates
        .iter()
        .filter(|(query, id, distance)| {
            candidates
                .iter()
                .filter(|other| other.1 == *id)
                .all(|other| (*distance, *query) <= (other.2, other.0))
        })
        .map(|&(query, id, _)| (query, id))
        .collect()
}

#[test]
fn matches_agree_with_the_definition() {
    for seed in 0..4 {
        let mut scene = Scene::new(seed, 30);
        let entries = scene.entries(400);
        // Some entries are seen twice, some queries are new.
        let mut queries: Vec<Descriptor> = (0..150)
            .map(|i| scene.seen_again(&entries[i / 2], 12.0))
            .collect();
        queries.extend(scene.entries(50));
        let matches = match_descriptors(&queries, &index_of(&entries), 0.8).unwrap();
        let pairs: Vec<(u32, u32)> = matches.iter().map(|m| (m.query, m.id)).collect();
        assert_eq!(pairs, naive_matches(&queries, &entries, f64::from(0.8_f32)));
        assert!(pairs.len() > 50, "the data must leave something to match");
    }
}

#[cfg(feature = "parallel")]
#[test]
fn matches_do_not_depend_on_the_number_of_threads() {
    let mut scene = Scene::new(9, 60);
    let entries = scene.entries(3000);
    let queries: Vec<Descriptor> = (0..400)
        .map(|i| scene.seen_again(&entries[7 * i], 12.0))
        .collect();
    let forest = KdForest::new(KdForestParams::default()).unwrap();
    let forest = crate::support::filled(forest, &counted(&entries));
    let run = |threads: usize| {
        crate::support::on_threads(threads, || {
            (
                match_descriptors(&queries, &forest, 0.8).unwrap(),
                match_mutual(&queries, &entries, 0.8).unwrap(),
            )
        })
    };
    let alone = run(1);
    assert!(alone.0.len() > 100 && alone.1.len() > 100);
    assert_eq!(run(3), alone);
    assert_eq!(run(8), alone);
}

#[test]
fn the_forest_serves_as_a_trait_object() {
    let forest = KdForest::new(KdForestParams::default()).unwrap();
    let index: &(dyn DescriptorIndex + Sync) = &forest;
    assert_eq!(match_descriptors(&[[0; 128]], index, 0.7).unwrap(), []);
}
