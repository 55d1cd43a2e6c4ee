//! Degenerate corpora, the naive model, and random changes of an index that are checked against it.

use feature_kdtree::{Descriptor, DescriptorIndex, Neighbour, TwoNearest};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scene::Scene;

/// Descriptors under ids.
pub(crate) type Numbered = Vec<(u32, Descriptor)>;

/// The index with all entries inserted.
pub(crate) fn filled<I: DescriptorIndex>(mut index: I, entries: &[(u32, Descriptor)]) -> I {
    for (id, descriptor) in entries {
        index.insert(*id, descriptor).expect("ids are unique");
    }
    index
}

/// Ids counted up in the order of the entries.
pub(crate) fn counted(entries: &[Descriptor]) -> Numbered {
    (0..).zip(entries.iter().copied()).collect()
}

/// Ids counted down in the order of the entries, so that ties cannot be right by accident.
pub(crate) fn counted_down(entries: &[Descriptor]) -> Numbered {
    let ids = (0..).map(|i| 10_000 - 3 * i);
    ids.zip(entries.iter().copied()).collect()
}

/// The answers to a batch of queries.
pub(crate) fn batch(
    index: &(impl DescriptorIndex + ?Sized),
    queries: &[Descriptor],
) -> Vec<Option<TwoNearest>> {
    // Entries of an earlier batch must not matter.
    let mut found = vec![None; 3];
    index.two_nearest_batch(queries, &mut found);
    found
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

/// The answers of the model to some queries, over all entries and over those that `accept` takes.
pub(crate) struct Expected {
    queries: Vec<Descriptor>,
    accept: fn(u32) -> bool,
    all: Vec<Option<TwoNearest>>,
    pub(crate) accepted: Vec<Option<TwoNearest>>,
}

impl Expected {
    pub(crate) fn new(
        entries: &[(u32, Descriptor)],
        queries: &[Descriptor],
        accept: fn(u32) -> bool,
    ) -> Self {
        let answers = |accept: fn(u32) -> bool| {
            let answer = |query| naive_two_nearest(entries, query, accept);
            queries.iter().map(answer).collect()
        };
        Self {
            queries: queries.to_vec(),
            accept,
            all: answers(|_| true),
            accepted: answers(accept),
        }
    }

    /// Asserts that an exact index gives these answers in a batch, one by one and with the filter.
    pub(crate) fn assert_of(&self, index: &dyn DescriptorIndex, label: &str) {
        assert_eq!(batch(index, &self.queries), self.all, "batch, {label}");
        let answers = self.all.iter().zip(&self.accepted);
        for (query, (all, accepted)) in self.queries.iter().zip(answers) {
            assert_eq!(index.two_nearest(query), *all, "{label}");
            let found = index.two_nearest_where(query, &self.accept);
            assert_eq!(found, *accepted, "where, {label}");
        }
    }
}

/// Runs on a pool of so many threads.
#[cfg(feature = "parallel")]
pub(crate) fn on_threads<R: Send>(threads: usize, run: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.unwrap().install(run)
}

fn uniform(rng: &mut ChaCha8Rng) -> Descriptor {
    std::array::from_fn(|_| rng.random())
}

/// Corpora of some `size` descriptors with the name of what is degenerate about each.
pub(crate) fn corpora(size: usize) -> Vec<(&'static str, Vec<Descriptor>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut scene = Scene::new(12, size / 15);
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
    let extreme = |i: usize| [if i.is_multiple_of(2) { 0 } else { 255 }; 128];
    vec![
        ("random", (0..size).map(|_| uniform(&mut rng)).collect()),
        ("clustered", scene.entries(size)),
        ("duplicated", (0..size).map(|i| few[i % 3]).collect()),
        ("constant", vec![[17; 128]; size]),
        ("plane", (0..size).map(|_| in_plane(&mut rng, 0)).collect()),
        (
            "plane at 255",
            (0..size).map(|_| in_plane(&mut rng, 255)).collect(),
        ),
        ("sorted line", (0..=255).map(on_line).collect()),
        ("two extremes", (0..size).map(extreme).collect()),
        ("one entry", vec![[1; 128]]),
        ("two entries", vec![[1; 128], [2; 128]]),
    ]
}

/// Queries far from all entries, equal to some and near some.
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

/// A change of an index, or questions to it.
#[derive(Debug, Clone)]
pub(crate) enum Change {
    Insert(u32, Descriptor),
    Remove(u32),
    Query(Vec<Descriptor>),
}

impl Change {
    /// Makes the change in the model and in every index, and checks that they agree on whether it can be made.
    pub(crate) fn make(
        &self,
        model: &mut Numbered,
        indexes: &mut [&mut dyn DescriptorIndex],
    ) -> Result<(), TestCaseError> {
        let present = |id: u32| model.iter().any(|(other, _)| *other == id);
        match self {
            Self::Insert(id, descriptor) => {
                let present = present(*id);
                for index in &mut *indexes {
                    prop_assert_eq!(index.insert(*id, descriptor).is_err(), present);
                }
                if !present {
                    model.push((*id, *descriptor));
                }
            }
            Self::Remove(id) => {
                let present = present(*id);
                for index in &mut *indexes {
                    prop_assert_eq!(index.remove(*id), present);
                }
                model.retain(|(other, _)| other != id);
            }
            Self::Query(_) => {}
        }
        for index in indexes {
            prop_assert_eq!(index.len(), model.len());
        }
        Ok(())
    }
}

/// Checks that an exact index answers each query as the model does, with a filter and without.
pub(crate) fn check_exact(
    index: &dyn DescriptorIndex,
    model: &[(u32, Descriptor)],
    queries: &[Descriptor],
) -> Result<(), TestCaseError> {
    let accept = |id: u32| !id.is_multiple_of(3);
    for (query, found) in queries.iter().zip(batch(index, queries)) {
        let expected = naive_two_nearest(model, query, |_| true);
        prop_assert_eq!(found, expected);
        prop_assert_eq!(index.two_nearest(query), expected);
        let expected = naive_two_nearest(model, query, accept);
        prop_assert_eq!(index.two_nearest_where(query, &accept), expected);
    }
    Ok(())
}

/// Checks that the index holds the entries of the model.
pub(crate) fn check_entries(
    index: &dyn DescriptorIndex,
    model: &[(u32, Descriptor)],
) -> Result<(), TestCaseError> {
    for (id, descriptor) in model {
        prop_assert_eq!(index.descriptor(*id), Some(*descriptor));
    }
    Ok(())
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

/// How often each kind of change and of descriptor turns up.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frequencies {
    /// Ids are below this.
    pub(crate) ids: u32,
    /// Coarse descriptors for one that is not.
    pub(crate) coarse: u32,
    /// Insertions, removals and queries.
    pub(crate) changes: [u32; 3],
    /// Descriptors asked for at once are fewer than this.
    pub(crate) queries: usize,
}

pub(crate) fn change(often: Frequencies) -> impl Strategy<Value = Change> {
    let descriptor = prop_oneof![
        often.coarse => coarse_descriptor(),
        1 => any::<[u8; 32]>().prop_map(|part| std::array::from_fn(|i| part[i % 32])),
    ]
    .boxed();
    let [insert, remove, query] = often.changes;
    prop_oneof![
        insert => (0..often.ids, descriptor.clone()).prop_map(|(id, d)| Change::Insert(id, d)),
        remove => (0..often.ids).prop_map(Change::Remove),
        query => prop::collection::vec(descriptor, 1..often.queries).prop_map(Change::Query),
    ]
}
