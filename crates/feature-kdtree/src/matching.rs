//! From nearest neighbours to matches: the ratio test, agreement both ways, and matches that are one to one.
//!
//! The ratio test (paper, Eq. 21; Lowe 2004) keeps a query whose nearest entry is clearly nearer than the second
//! nearest: d1 / d2 < lambda. The distances here are squared, so the test is d1^2 < lambda^2 d2^2; comparing
//! squared distances with lambda itself would act as the ratio sqrt(lambda), 0.84 where 0.7 was asked for.
//!
//! Degenerate cases: one entry alone has no second nearest and matches nothing. Two equally near entries,
//! d1 = d2, match nothing at any ratio up to 1, d1 = d2 = 0 included: a tie identifies neither.

use crate::{Descriptor, DescriptorIndex, ExactScan, IndexError, TwoNearest};

/// A query and the entry it is matched with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// The position among the queries.
    pub query: u32,
    /// The id of the entry or, of two frames, the position in the second.
    pub id: u32,
    /// The squared distance of the two descriptors.
    pub distance_squared: u32,
    /// The distance to the nearest over that to the second nearest, not squared; below the ratio asked for.
    pub ratio: f32,
}

/// Matches queries to the index by the ratio test, each entry to at most one query.
///
/// `ratio` is lambda of Eq. 21 (the paper: 0.7), in 0..=1. Of several queries whose nearest entry is the same, the one at
/// the smallest distance keeps it, ties going to the lower position. Matches come in the order of the queries
/// and do not depend on the number of threads. Cost: one search for each query, in batches, and O(m log m) for m matches.
///
/// # Errors
/// [`IndexError::Ratio`] when the ratio is not in 0..=1; [`IndexError::TooMany`] beyond `u32::MAX` queries.
///
/// ```
/// use feature_kdtree::{AutoIndex, DescriptorIndex, match_descriptors};
///
/// let look = |seed: usize| -> [u8; 128] { std::array::from_fn(|i| ((seed * 37 + 1) * (i + 3) * 71 % 251) as u8) };
/// let mut map = AutoIndex::new();
/// for landmark in 0..50_u32 {
///     map.insert(landmark, &look(landmark as usize))?;
/// }
/// // Landmark 7 seen again with a little noise, and something that is not in the map.
/// let mut again = look(7);
/// again[0] ^= 3;
/// let matches = match_descriptors(&[again, [128; 128]], &map, 0.7)?;
/// assert_eq!(matches.len(), 1);
/// assert_eq!((matches[0].query, matches[0].id), (0, 7));
/// # Ok::<(), feature_kdtree::IndexError>(())
/// ```
pub fn match_descriptors(
    queries: &[Descriptor],
    index: &(impl DescriptorIndex + Sync + ?Sized),
    ratio: f32,
) -> Result<Vec<Match>, IndexError> {
    check_ratio(ratio)?;
    check_count(queries)?;
    let mut matches = ratio_matches(queries, index, ratio);
    keep_nearest_query(&mut matches);
    Ok(matches)
}

/// Matches two frames: the ratio test from `a` to `b`, and `a[i]` must be the nearest to `b[j]` in turn.
///
/// In a match `query` is the position in `a` and `id` the position in `b`. Ties of the way back go to the lower
/// position. Matches come in the order of `a`, are one to one, and do not depend on the number of threads. Exact
/// search both ways: O(|a| |b|).
///
/// # Errors
/// [`IndexError::Ratio`] when the ratio is not in 0..=1; [`IndexError::TooMany`] beyond `u32::MAX` descriptors.
///
/// ```
/// use feature_kdtree::match_mutual;
///
/// let look = |seed: usize| -> [u8; 128] { std::array::from_fn(|i| ((seed * 37 + 1) * (i + 3) * 71 % 251) as u8) };
/// let first: Vec<[u8; 128]> = (0..20).map(look).collect();
/// // The second frame shows the same from the tenth on, the other way round.
/// let second: Vec<[u8; 128]> = (10..30).rev().map(look).collect();
/// let pairs: Vec<(u32, u32)> = match_mutual(&first, &second, 0.7)?.iter().map(|m| (m.query, m.id)).collect();
/// assert_eq!(pairs, (10..20).map(|i| (i, 29 - i)).collect::<Vec<_>>());
/// # Ok::<(), feature_kdtree::IndexError>(())
/// ```
pub fn match_mutual(
    a: &[Descriptor],
    b: &[Descriptor],
    ratio: f32,
) -> Result<Vec<Match>, IndexError> {
    check_ratio(ratio)?;
    check_count(a)?;
    check_count(b)?;
    let forward = ratio_matches(a, &by_position(b), ratio);
    let matched: Vec<Descriptor> = forward.iter().map(|found| b[found.id as usize]).collect();
    let back = two_nearest_in_blocks(&matched, &by_position(a));
    Ok(forward
        .into_iter()
        .zip(back)
        .filter(|(found, back)| back.is_some_and(|back| back.first.id == found.query))
        .map(|(found, _)| found)
        .collect())
}

/// An index of descriptors under their positions.
fn by_position(descriptors: &[Descriptor]) -> ExactScan {
    (0_u32..).zip(descriptors).collect()
}

/// The pairs that pass the ratio test, in the order of the queries; an entry may be matched more than once.
fn ratio_matches(
    queries: &[Descriptor],
    index: &(impl DescriptorIndex + Sync + ?Sized),
    ratio: f32,
) -> Vec<Match> {
    (0_u32..)
        .zip(two_nearest_in_blocks(queries, index))
        .filter_map(|(query, nearest)| passes_ratio(query, nearest?, ratio))
        .collect()
}

/// The ratio test (Eq. 21) on squared distances. The second distance of a pair that passes is never zero.
fn passes_ratio(query: u32, nearest: TwoNearest, ratio: f32) -> Option<Match> {
    let first = nearest.first;
    let second = nearest.second?;
    let ratio_squared = f64::from(ratio) * f64::from(ratio);
    let passes =
        f64::from(first.distance_squared) < ratio_squared * f64::from(second.distance_squared);
    passes.then(|| Match {
        query,
        id: first.id,
        distance_squared: first.distance_squared,
        ratio: (f64::from(first.distance_squared) / f64::from(second.distance_squared)).sqrt()
            as f32,
    })
}

/// Leaves each id its nearest query, the lower one of two at equal distance, and restores the order of the queries.
fn keep_nearest_query(matches: &mut Vec<Match>) {
    matches.sort_unstable_by_key(|found| (found.id, found.distance_squared, found.query));
    matches.dedup_by_key(|found| found.id);
    matches.sort_unstable_by_key(|found| found.query);
}

fn check_ratio(ratio: f32) -> Result<(), IndexError> {
    if (0.0..=1.0).contains(&ratio) {
        Ok(())
    } else {
        Err(IndexError::Ratio { given: ratio })
    }
}

fn check_count(descriptors: &[Descriptor]) -> Result<(), IndexError> {
    match u32::try_from(descriptors.len()) {
        Ok(_) => Ok(()),
        Err(_) => Err(IndexError::TooMany {
            given: descriptors.len(),
            most: u32::MAX as usize,
        }),
    }
}

/// The two nearest of every query, in blocks on several threads. The blocks do not change the answers.
#[cfg(feature = "parallel")]
fn two_nearest_in_blocks(
    queries: &[Descriptor],
    index: &(impl DescriptorIndex + Sync + ?Sized),
) -> Vec<Option<TwoNearest>> {
    use rayon::prelude::*;
    // A batch of 48 costs 5 % more a query than one of 480 (1500 entries, AVX-512); two blocks a thread even out.
    let block = queries
        .len()
        .div_ceil(2 * rayon::current_num_threads())
        .clamp(48, 480);
    let blocks: Vec<Vec<Option<TwoNearest>>> = queries
        .par_chunks(block)
        .map(|block| {
            let mut found = Vec::new();
            index.two_nearest_batch(block, &mut found);
            found
        })
        .collect();
    blocks.concat()
}

#[cfg(not(feature = "parallel"))]
fn two_nearest_in_blocks(
    queries: &[Descriptor],
    index: &(impl DescriptorIndex + Sync + ?Sized),
) -> Vec<Option<TwoNearest>> {
    let mut found = Vec::new();
    index.two_nearest_batch(queries, &mut found);
    found
}
