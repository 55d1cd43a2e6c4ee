//! The scan of any kind of descriptor, and the k nearest, the radius search and the entries of every index, against sorting
//! everything.

use feature_kdtree::{
    AutoIndex, Descriptor, DescriptorIndex, ExactScan, Hamming, IndexError, InvertedLists,
    InvertedListsParams, KdForest, KdForestParams, LinearScan, Metric, Neighbour, SquaredEuclidean,
    distance_squared,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use simd_level::SimdLevel;

use crate::scene::Scene;

/// Ids that are neither consecutive nor ascending.
fn id_of(position: usize) -> u32 {
    (position as u32).wrapping_mul(0x9e37_79b1)
}

/// Compares the scan with sorting by the `naive` distance, on all levels, before and after removals.
fn check<D: Copy, M: Metric<D>>(
    entries: &[D],
    queries: &[D],
    naive: impl Fn(&D, &D) -> f64,
    radius: M::Distance,
) where
    M::Distance: PartialEq,
{
    for level in SimdLevel::available() {
        let mut scan = LinearScan::<D, M>::with_level(level);
        for (position, entry) in entries.iter().enumerate() {
            scan.insert(id_of(position), entry).unwrap();
        }
        for removed in [0, entries.len() / 7] {
            for position in 0..removed {
                assert!(scan.remove(id_of(5 * position)) && !scan.remove(id_of(5 * position)));
            }
            let left: Vec<(u32, D)> = scan.iter().map(|(id, entry)| (id, *entry)).collect();
            assert_eq!(left.len(), entries.len() - removed);
            for query in queries {
                let mut expected: Vec<(f64, u32)> = left
                    .iter()
                    .map(|(id, entry)| (naive(query, entry), *id))
                    .collect();
                expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
                for k in [0, 1, 2, 33, 5000] {
                    let found = scan.nearest(query, k).unwrap();
                    let found: Vec<(f64, u32)> = found
                        .iter()
                        .map(|one| (one.distance.into(), one.id))
                        .collect();
                    assert_eq!(found, expected[..k.min(expected.len())], "{level}, {k}");
                }
                let limit: f64 = radius.into();
                let near = expected.partition_point(|(distance, _)| *distance <= limit);
                let found = scan.within(query, radius).unwrap();
                let found: Vec<(f64, u32)> = found
                    .iter()
                    .map(|one| (one.distance.into(), one.id))
                    .collect();
                assert_eq!(found, expected[..near], "{level}");
            }
        }
    }
}

fn bytes<const N: usize>(count: usize, seed: u64) -> Vec<[u8; N]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| std::array::from_fn(|_| rng.random()))
        .collect()
}

fn euclidean_of_bytes<const N: usize>(a: &[u8; N], b: &[u8; N]) -> f64 {
    let squares = a
        .iter()
        .zip(b)
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    squares.sum()
}

#[test]
fn bytes_of_any_length_agree_with_sorting() {
    fn length<const N: usize>() {
        check::<_, SquaredEuclidean>(
            &bytes::<N>(1500, 1),
            &bytes::<N>(5, 2),
            euclidean_of_bytes,
            9000 * N as u32,
        );
    }
    length::<1>();
    length::<31>();
    length::<64>();
    length::<130>();
}

#[test]
fn binary_descriptors_agree_with_sorting() {
    fn length<const N: usize>() {
        let bits = |a: &[u8; N], b: &[u8; N]| {
            let differ = a
                .iter()
                .zip(b)
                .map(|(a, b)| f64::from((a ^ b).count_ones()));
            differ.sum::<f64>()
        };
        check::<_, Hamming>(
            &bytes::<N>(1500, 3),
            &bytes::<N>(5, 4),
            bits,
            4 * N as u32 - 3,
        );
    }
    length::<7>();
    length::<32>();
    length::<64>();
}

/// Components that are small integers: the sums are exact in any order, so that the oracle is.
#[test]
fn floats_agree_with_sorting() {
    fn length<const N: usize>() {
        let of_bytes = |d: [u8; N]| d.map(|value| f32::from(value % 32) - 16.0);
        let floats = |count, seed| -> Vec<[f32; N]> {
            bytes::<N>(count, seed).into_iter().map(of_bytes).collect()
        };
        let naive = |a: &[f32; N], b: &[f32; N]| {
            let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2));
            squares.sum::<f64>()
        };
        check::<_, SquaredEuclidean>(&floats(1500, 5), &floats(5, 6), naive, 160.0 * N as f32);
    }
    length::<3>();
    length::<64>();
    length::<100>();
}

#[test]
fn floats_round_alike_on_every_level() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut draw = || -> [f32; 77] { std::array::from_fn(|_| rng.random_range(-1.0..1.0)) };
    let (query, rows) = (draw(), [draw(), draw(), draw()]);
    let of_level = |level| {
        let mut out = Vec::new();
        SquaredEuclidean::distances(level, &query, &rows, &mut out);
        out
    };
    let portable = of_level(SimdLevel::Portable);
    for level in SimdLevel::available() {
        assert_eq!(of_level(level), portable, "{level}");
    }
}

#[test]
fn floats_that_are_not_finite_are_refused_with_their_place() {
    let mut scan = LinearScan::<[f32; 4], SquaredEuclidean>::new();
    let error = scan.insert(1, &[0.0, 0.0, f32::NAN, 0.0]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "component 2 of the descriptor is NaN, a finite number required"
    );
    scan.insert(1, &[0.0; 4]).unwrap();
    assert_eq!(
        scan.insert(1, &[1.0; 4]),
        Err(IndexError::DuplicateId { id: 1 })
    );
    assert!(scan.nearest(&[f32::INFINITY; 4], 1).is_err());
    assert_eq!((scan.len(), scan.get(1)), (1, Some(&[0.0; 4])));
}

/// The ratio is one of distances for squares and for bits; ties and single entries match nothing.
#[test]
fn the_ratio_test_knows_whether_distances_are_squared() {
    let mut bits = LinearScan::<[u8; 4], Hamming>::new();
    bits.insert(1, &[0b111, 0, 0, 0]).unwrap();
    assert_eq!(bits.matches(&[[0; 4]], 1.0).unwrap(), []);
    bits.insert(2, &[0b1111, 0, 0, 0]).unwrap();
    assert_eq!(bits.matches(&[[0; 4]], 0.74).unwrap(), []);
    let found = bits.matches(&[[0; 4]], 0.76).unwrap();
    assert_eq!(
        (found[0].id, found[0].distance, found[0].ratio),
        (1, 3, 0.75)
    );
    assert_eq!(
        bits.matches(&[[0b0111_1111, 0, 0, 0]], 1.0).unwrap()[0].id,
        2
    );

    let mut squares = LinearScan::<[u8; 4], SquaredEuclidean>::new();
    squares.insert(1, &[3, 0, 0, 0]).unwrap();
    squares.insert(2, &[0, 4, 0, 0]).unwrap();
    squares.insert(3, &[0, 0, 9, 0]).unwrap();
    assert_eq!(squares.matches(&[[0; 4]], 0.74).unwrap(), []);
    // Two queries want entry 1: the nearer one keeps it.
    let found = squares.matches(&[[0; 4], [2, 0, 0, 0]], 0.76).unwrap();
    assert_eq!(found.len(), 1);
    assert_eq!((found[0].query, found[0].id, found[0].distance), (1, 1, 1));
    assert!(matches!(
        squares.matches(&[[0; 4]], 1.5),
        Err(IndexError::Ratio { .. })
    ));
}

/// SIFT's 128 bytes have the same answers from the general scan and from the one with kernels of its own.
#[test]
fn both_scans_agree_on_sift_descriptors() {
    let mut scene = Scene::new(11, 60);
    let entries = scene.entries(3000);
    let queries: Vec<Descriptor> = (0..20)
        .map(|i| scene.seen_again(&entries[i * 31], 10.0))
        .collect();
    let mut general = LinearScan::<Descriptor, SquaredEuclidean>::new();
    let mut scan = ExactScan::new();
    for (position, entry) in entries.iter().enumerate() {
        general.insert(id_of(position), entry).unwrap();
        scan.insert(id_of(position), entry).unwrap();
    }
    for query in &queries {
        for k in [0, 1, 7, 300] {
            let expected: Vec<Neighbour> = general
                .nearest(query, k)
                .unwrap()
                .iter()
                .map(|one| Neighbour {
                    distance_squared: one.distance,
                    id: one.id,
                })
                .collect();
            assert_eq!(scan.nearest(query, k), expected);
        }
        let radius = general.nearest(query, 40).unwrap()[39].distance;
        let expected: Vec<u32> = general
            .within(query, radius)
            .unwrap()
            .iter()
            .map(|one| one.id)
            .collect();
        let found: Vec<u32> = scan
            .within(query, radius)
            .iter()
            .map(|one| one.id)
            .collect();
        assert!(found.len() >= 40 && found == expected);
    }
}

/// Exact settings of the approximate indexes give the exact neighbours; default ones most of them, and never a wrong
/// distance or an entry twice.
#[test]
fn every_index_finds_the_k_nearest_and_lists_its_entries() {
    let mut scene = Scene::new(12, 200);
    let entries = scene.entries(5000);
    let queries: Vec<Descriptor> = (0..20)
        .map(|i| scene.seen_again(&entries[i * 31], 10.0))
        .collect();
    let exhaustive = InvertedListsParams {
        probes: Some(usize::MAX),
        ..InvertedListsParams::default()
    };
    let forest = KdForestParams {
        max_leaves: usize::MAX,
        ..KdForestParams::default()
    };
    let mut indexes: Vec<(&str, bool, Box<dyn DescriptorIndex>)> = vec![
        ("scan", true, Box::new(ExactScan::new())),
        (
            "all lists",
            true,
            Box::new(InvertedLists::new(exhaustive).unwrap()),
        ),
        (
            "whole forest",
            true,
            Box::new(KdForest::new(forest).unwrap()),
        ),
        ("auto", false, Box::new(AutoIndex::new())),
        (
            "forest",
            false,
            Box::new(KdForest::new(KdForestParams::default()).unwrap()),
        ),
    ];
    for (name, exact, index) in &mut indexes {
        for (position, entry) in entries.iter().enumerate() {
            index.insert(id_of(position), entry).unwrap();
        }
        let listed = index.entries();
        assert!(
            listed.is_sorted_by_key(|(id, _)| *id) && listed.len() == 5000,
            "{name}"
        );
        assert!(
            listed
                .iter()
                .all(|(id, entry)| index.descriptor(*id) == Some(*entry))
        );
        let (mut right, mut all) = (0, 0);
        for query in &queries {
            let mut expected: Vec<Neighbour> = listed
                .iter()
                .map(|(id, entry)| Neighbour {
                    distance_squared: distance_squared(query, entry),
                    id: *id,
                })
                .collect();
            expected.sort_unstable();
            let found = index.nearest(query, 9);
            assert!(found.len() == 9 && found.is_sorted(), "{name}");
            assert!(found.windows(2).all(|pair| pair[0].id != pair[1].id));
            assert!(
                found.iter().all(|one| expected.binary_search(one).is_ok()),
                "{name}"
            );
            right += found.iter().filter(|one| **one <= expected[8]).count();
            all += 9;
            let radius = expected[12].distance_squared;
            let within = index.within(query, radius);
            assert!(within.is_sorted() && within.iter().all(|one| one.distance_squared <= radius));
            if *exact {
                let near = expected.partition_point(|one| one.distance_squared <= radius);
                assert_eq!(found, expected[..9], "{name}");
                assert_eq!(within, expected[..near], "{name}");
            }
        }
        assert!(right * 10 >= all * 8, "{name}: {right} of {all}");
    }
    assert_eq!(ExactScan::new().nearest(&queries[0], 3), []);
    assert_eq!(AutoIndex::new().within(&queries[0], u32::MAX), []);
}
