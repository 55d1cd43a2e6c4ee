//! Simulated descriptors and the naive model, shared by tests, benches and examples.
#![expect(dead_code, reason = "each target uses a part")]

use feature_kdtree::{Descriptor, Neighbour, TwoNearest};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Descriptors of a scene that repeats itself: each is one of `clusters` patterns plus variation.
pub(crate) struct Scene {
    rng: ChaCha8Rng,
    centres: Vec<[f64; 128]>,
}

impl Scene {
    pub(crate) fn new(seed: u64, clusters: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let centres = (0..clusters)
            .map(|_| std::array::from_fn(|_| exponential(&mut rng)))
            .collect();
        Self { rng, centres }
    }

    /// A new entry: a pattern mixed with 60 % of its own gradient histogram, as SIFT would quantise it.
    pub(crate) fn entry(&mut self) -> Descriptor {
        let centre = self.rng.random_range(0..self.centres.len());
        let values =
            std::array::from_fn(|i| self.centres[centre][i] + 0.6 * exponential(&mut self.rng));
        quantise(values)
    }

    pub(crate) fn entries(&mut self, count: usize) -> Vec<Descriptor> {
        (0..count).map(|_| self.entry()).collect()
    }

    /// The entry seen again: noise of standard deviation `sigma` in each component.
    pub(crate) fn seen_again(&mut self, entry: &Descriptor, sigma: f64) -> Descriptor {
        std::array::from_fn(|i| {
            // Sum of 12 uniforms: variance one, no second distribution crate needed.
            let normal: f64 = (0..12).map(|_| self.rng.random::<f64>()).sum::<f64>() - 6.0;
            (f64::from(entry[i]) + sigma * normal)
                .round()
                .clamp(0.0, 255.0) as u8
        })
    }

    pub(crate) fn position(&mut self, count: usize) -> usize {
        self.rng.random_range(0..count)
    }
}

/// Gradient histograms are sparse and skewed: exponential components are close.
fn exponential(rng: &mut ChaCha8Rng) -> f64 {
    -(1.0 - rng.random::<f64>()).ln()
}

/// Normalise, clip at 0.2, normalise again, times 512: the last steps of SIFT.
fn quantise(mut values: [f64; 128]) -> Descriptor {
    for _ in 0..2 {
        let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
        values = values.map(|v| (v / norm).min(0.2));
    }
    let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    values.map(|v| (512.0 * v / norm).round().min(255.0) as u8)
}

pub(crate) fn uniform(rng: &mut ChaCha8Rng) -> Descriptor {
    std::array::from_fn(|_| rng.random())
}

/// The obviously right answer: sort everything.
pub(crate) fn naive_two_nearest(
    entries: &[(u32, Descriptor)],
    query: &Descriptor,
    accept: impl Fn(u32) -> bool,
) -> Option<TwoNearest> {
    let mut all: Vec<(u32, u32)> = entries
        .iter()
        .filter(|(id, _)| accept(*id))
        .map(|(id, descriptor)| {
            let difference = |i: usize| i64::from(descriptor[i]) - i64::from(query[i]);
            let distance: i64 = (0..128).map(|i| difference(i).pow(2)).sum();
            (distance as u32, *id)
        })
        .collect();
    all.sort_unstable();
    let neighbour = |&(distance_squared, id): &(u32, u32)| Neighbour {
        distance_squared,
        id,
    };
    Some(TwoNearest {
        first: all.first().map(neighbour)?,
        second: all.get(1).map(neighbour),
    })
}

/// Descriptors by the name of what is degenerate about them.
pub(crate) fn corpora() -> Vec<(&'static str, Vec<Descriptor>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut scene = Scene::new(12, 20);
    let few = scene.entries(3);
    let in_plane = |rng: &mut ChaCha8Rng, constant: u8| {
        let mut descriptor = [constant; 128];
        descriptor[3] = rng.random();
        descriptor[100] = rng.random();
        descriptor
    };
    let on_line = |step: u8| {
        let mut descriptor = [0; 128];
        descriptor[127] = step;
        descriptor
    };
    vec![
        ("random", (0..300).map(|_| uniform(&mut rng)).collect()),
        ("clustered", scene.entries(300)),
        ("duplicated", (0..300).map(|i| few[i % 3]).collect()),
        ("constant", vec![[17; 128]; 300]),
        ("plane", (0..300).map(|_| in_plane(&mut rng, 0)).collect()),
        (
            "plane at 255",
            (0..300).map(|_| in_plane(&mut rng, 255)).collect(),
        ),
        ("sorted line", (0..=255).map(on_line).collect()),
        (
            "two extremes",
            (0..200)
                .map(|i| [if i % 2 == 0 { 0 } else { 255 }; 128])
                .collect(),
        ),
        ("one entry", vec![[1; 128]]),
        ("two entries", vec![[1; 128], [2; 128]]),
    ]
}

pub(crate) fn queries_for(entries: &[Descriptor]) -> Vec<Descriptor> {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let mut scene = Scene::new(14, 4);
    let mut queries: Vec<Descriptor> = (0..10).map(|_| uniform(&mut rng)).collect();
    queries.extend([[0; 128], [255; 128], [17; 128]]);
    for _ in 0..20 {
        let entry = entries[rng.random_range(0..entries.len())];
        queries.push(entry);
        queries.push(scene.seen_again(&entry, 8.0));
    }
    queries
}
