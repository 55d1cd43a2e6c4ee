//! Recall of the bounded forest against the scan on descriptors of a repetitive scene.
//!
//! The bound is that of a binomial proportion: with a claimed recall p and n queries the measured share lies above
//! p - 4 sqrt(p (1 - p) / n) but for a chance of 3e-5. The claim is the README's.

use feature_kdtree::{Descriptor, DescriptorIndex, ExactScan, KdForest, KdForestParams};

use crate::scene::Scene;
use crate::support::{counted, filled};

const QUERIES: usize = 1000;
const CLAIMED_RECALL: f64 = 0.99;

struct Recall {
    nearest: f64,
    both: f64,
}

#[expect(clippy::print_stdout, reason = "the recall is what this file reports")]
fn measure(entries: usize, noise: f64, params: KdForestParams) -> Recall {
    let mut scene = Scene::new(77, entries / 25);
    let descriptors = scene.entries(entries);
    let numbered = counted(&descriptors);
    let forest = filled(KdForest::new(params).unwrap(), &numbered);
    let scan = filled(ExactScan::new(), &numbered);
    let mut nearest = 0.0;
    let mut both = 0.0;
    for _ in 0..QUERIES {
        let entry = scene.position(entries);
        let query: Descriptor = scene.seen_again(&descriptors[entry], noise);
        let found = forest.two_nearest(&query).expect("the index is not empty");
        let truth = scan.two_nearest(&query).expect("the index is not empty");
        nearest += f64::from(u8::from(found.first == truth.first)) / QUERIES as f64;
        both += f64::from(u8::from(found == truth)) / QUERIES as f64;
    }
    println!("{entries} entries, noise {noise}: nearest {nearest:.3}, both {both:.3}");
    Recall { nearest, both }
}

#[test]
fn the_nearest_is_found_as_often_as_claimed() {
    let slack = 4.0 * (CLAIMED_RECALL * (1.0 - CLAIMED_RECALL) / QUERIES as f64).sqrt();
    for entries in [1500, 10_000] {
        let recall = measure(entries, 10.0, KdForestParams::default());
        assert!(
            recall.nearest >= CLAIMED_RECALL - slack,
            "recall {} of {entries}, claimed {CLAIMED_RECALL}",
            recall.nearest
        );
    }
}

#[test]
fn more_leaves_find_more_and_all_leaves_find_all() {
    let with = |max_leaves| {
        let params = KdForestParams {
            max_leaves,
            ..KdForestParams::default()
        };
        measure(3000, 14.0, params)
    };
    let (few, many, all) = (with(4), with(32), with(usize::MAX));
    assert!(
        few.nearest < many.nearest,
        "the bound must bind for the test to say anything"
    );
    assert!(many.nearest <= 1.0 + 1e-9 && few.both <= few.nearest + 1e-9);
    // Sums of QUERIES equal terms: exact up to QUERIES roundings.
    assert!((all.both - 1.0).abs() < QUERIES as f64 * f64::EPSILON);
}
