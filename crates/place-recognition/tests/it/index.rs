//! Candidates of keypoints.

use place_recognition::{CandidateOptions, PlaceError, PlaceIndex};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn options(ratio: f64, max_distance: f64) -> CandidateOptions {
    CandidateOptions {
        ratio,
        max_distance,
    }
}

#[test]
fn a_clear_neighbour_is_the_only_candidate_and_an_unclear_one_brings_the_second() {
    let mut index = PlaceIndex::new();
    index.insert(5, &[10; 128]).unwrap();
    index.insert(9, &[12; 128]).unwrap();
    index.insert(2, &[90; 128]).unwrap();
    // Of 90, 10 and 12 are far; the third query is halfway between 10 and 12.
    let found = index
        .candidates(&[[89; 128], [200; 128], [11; 128]], &options(0.8, 300.0))
        .unwrap();
    let who: Vec<(usize, u32)> = found.iter().map(|c| (c.keypoint, c.landmark)).collect();
    assert_eq!(who, [(0, 2), (2, 5), (2, 9)]);
    assert_eq!(found[0].distance_squared, 128);
    assert!((found[0].quality - (1.0 - 1.0 / 77.0)).abs() < 1e-12);
    assert!(found[1].quality < 0.2 && found[1].quality > 0.0);
    assert!(found[1].quality < found[0].quality);
}

#[test]
fn qualities_of_unclear_candidates_are_below_those_of_clear_ones() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut index = PlaceIndex::new();
    let mut random = || std::array::from_fn::<u8, 128, _>(|_| rng.random_range(0..60));
    for id in 0..500 {
        index.insert(id, &random()).unwrap();
    }
    let queries: Vec<[u8; 128]> = (0..200).map(|_| random()).collect();
    let asked = options(0.95, 1e9);
    let found = index.candidates(&queries, &asked).unwrap();
    let count = |keypoint: usize| found.iter().filter(|c| c.keypoint == keypoint).count();
    for c in &found {
        let clear = count(c.keypoint) == 1;
        assert_eq!(c.quality > 0.05, clear, "{c:?}");
        assert!((0.0..=1.0).contains(&c.quality));
    }
}

#[test]
fn a_landmark_changes_its_descriptor_and_clones_go_their_own_way() {
    let mut index = PlaceIndex::new();
    assert!(index.is_empty());
    index.insert(1, &[10; 128]).unwrap();
    index.insert(1, &[50; 128]).unwrap();
    assert_eq!(index.len(), 1);
    assert_eq!(index.descriptor(1), Some([50; 128]));
    let mut other = index.clone();
    assert!(other.remove(1) && !other.remove(1));
    assert_eq!((other.len(), index.len()), (0, 1));
    index.rebuild().unwrap();
    // Alone it passes no ratio test, but it is a candidate.
    let found = index
        .candidates(&[[50; 128]], &options(0.8, 300.0))
        .unwrap();
    assert_eq!(found.len(), 1);
    assert!((found[0].quality - 0.2).abs() < 1e-12);
}

#[test]
fn errors_carry_the_numbers() {
    let index = PlaceIndex::new();
    assert_eq!(
        index.candidates(&[[0; 128]], &options(0.8, 1.0)),
        Ok(vec![])
    );
    let error = index.candidates(&[], &options(1.5, 1.0)).unwrap_err();
    assert_eq!(error.to_string(), "ratio is 1.5, required: 0 to 1");
    for bad in [
        options(f64::NAN, 1.0),
        options(0.8, f64::NAN),
        options(0.8, -1.0),
    ] {
        assert!(matches!(
            index.candidates(&[], &bad),
            Err(PlaceError::Option { .. })
        ));
    }
}
