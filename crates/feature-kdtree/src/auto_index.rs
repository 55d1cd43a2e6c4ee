//! The index to take when the size of the map is not known beforehand: exact while that is fast, approximate beyond.
//!
//! Up to some thousand entries a scan is exact and as fast as anything; beyond, inverted lists win by a factor that
//! grows with the map. [`AutoIndex`] starts as the one and becomes the other.
//!
//! Steps of the change, spread over many insertions so that no frame pays for it:
//! 1. From [`MOVES_AT`] entries on, each change enters two of the old entries into lists; new entries go to both. The
//!    scan goes on answering.
//! 2. When all entries are in the lists, after half as many changes again, the lists answer and the scan is dropped.
//! 3. When removals leave fewer than [`RETURNS_BELOW`], the index becomes a scan again at once: to copy so few entries
//!    takes 0.1 ms. The gap between the two sizes keeps a map of constant size from changing to and fro.
//!
//! Degenerate cases are those of the two indexes.

use crate::inverted_lists::{InvertedLists, InvertedListsParams};
use crate::{Descriptor, DescriptorIndex, ExactScan, IndexError, Neighbour, TwoNearest};

/// Entries at which a scan begins to become lists.
const MOVES_AT: usize = 4000;
/// Entries below which lists become a scan.
const RETURNS_BELOW: usize = 2000;
/// Entries of the scan that enter the lists with each change while the scan becomes lists.
const MOVES_A_CHANGE: usize = 2;

/// An exact scan that becomes inverted lists as the map grows.
///
/// It is exact below 4000 entries and approximate, as [`InvertedLists`] with default parameters, beyond. Deterministic:
/// the answers are a function of the sequence of changes.
///
/// ```
/// use feature_kdtree::{AutoIndex, DescriptorIndex};
///
/// let mut map = AutoIndex::new();
/// map.insert(7, &[10; 128])?;
/// map.insert(8, &[90; 128])?;
/// let nearest = map.two_nearest(&[11; 128]).expect("the map is not empty");
/// assert_eq!((nearest.first.id, nearest.first.distance_squared), (7, 128));
/// # Ok::<(), feature_kdtree::IndexError>(())
/// ```
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AutoIndex(State);

#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum State {
    Scan(ExactScan),
    /// The scan answers while the lists fill.
    Moving(Box<Moving>),
    Lists(Box<InvertedLists>),
}

#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Moving {
    scan: ExactScan,
    lists: InvertedLists,
    /// Ids to enter, the next one last.
    waiting: Vec<u32>,
}

impl Default for AutoIndex {
    fn default() -> Self {
        Self::new()
    }
}

impl AutoIndex {
    /// An empty index.
    #[must_use]
    pub fn new() -> Self {
        Self(State::Scan(ExactScan::new()))
    }

    /// Makes the index a function of the present entries alone.
    ///
    /// Two indexes with equal entries answer equally after it, and go on doing so under equal changes, whatever
    /// their histories were: for runs that must repeat from a saved state. It costs as much as inserting all entries.
    ///
    /// # Errors
    /// None in practice: those of inserting the present entries into an empty index.
    pub fn rebuild(&mut self) -> Result<(), IndexError> {
        let entries = match &self.0 {
            State::Scan(scan) => scan.entries(),
            State::Moving(moving) => moving.scan.entries(),
            State::Lists(lists) => lists.entries(),
        };
        *self = Self::new();
        for (id, descriptor) in &entries {
            self.insert(*id, descriptor)?;
        }
        Ok(())
    }

    /// The index that answers now.
    fn answering(&self) -> &(dyn DescriptorIndex + Sync) {
        match &self.0 {
            State::Scan(scan) => scan,
            State::Moving(moving) => &moving.scan,
            State::Lists(lists) => lists.as_ref(),
        }
    }

    /// Begins, continues or ends the change between scan and lists after a change of the entries.
    fn follow_size(&mut self) -> Result<(), IndexError> {
        match &mut self.0 {
            State::Scan(scan) if scan.len() >= MOVES_AT => {
                let mut waiting: Vec<u32> = scan.ids().to_vec();
                waiting.reverse();
                self.0 = State::Moving(Box::new(Moving {
                    scan: std::mem::take(scan),
                    lists: empty_lists()?,
                    waiting,
                }));
            }
            State::Moving(moving) if moving.scan.len() < RETURNS_BELOW => {
                self.0 = State::Scan(std::mem::take(&mut moving.scan));
            }
            State::Moving(moving) => {
                moving.advance()?;
                if moving.waiting.is_empty() {
                    let lists = std::mem::replace(&mut moving.lists, empty_lists()?);
                    self.0 = State::Lists(Box::new(lists));
                }
            }
            State::Lists(lists) if lists.len() < RETURNS_BELOW => {
                self.0 = State::Scan(lists.unordered_entries().into_iter().collect());
            }
            State::Scan(_) | State::Lists(_) => {}
        }
        Ok(())
    }
}

impl Moving {
    /// Enters the next waiting entries that are still there.
    fn advance(&mut self) -> Result<(), IndexError> {
        for _ in 0..MOVES_A_CHANGE {
            let Some(id) = self.waiting.pop() else {
                break;
            };
            // An id removed meanwhile is passed over, and so is one inserted anew, which is in the lists already.
            if self.lists.descriptor(id).is_none()
                && let Some(descriptor) = self.scan.descriptor(id)
            {
                self.lists.insert(id, &descriptor)?;
            }
        }
        Ok(())
    }
}

fn empty_lists() -> Result<InvertedLists, IndexError> {
    InvertedLists::new(InvertedListsParams::default())
}

impl DescriptorIndex for AutoIndex {
    fn insert(&mut self, id: u32, descriptor: &Descriptor) -> Result<(), IndexError> {
        match &mut self.0 {
            State::Scan(scan) => scan.insert(id, descriptor)?,
            State::Moving(moving) => {
                moving.scan.insert(id, descriptor)?;
                moving.lists.insert(id, descriptor)?;
            }
            State::Lists(lists) => lists.insert(id, descriptor)?,
        }
        self.follow_size()
    }

    fn remove(&mut self, id: u32) -> bool {
        let removed = match &mut self.0 {
            State::Scan(scan) => scan.remove(id),
            State::Moving(moving) => {
                moving.lists.remove(id);
                moving.scan.remove(id)
            }
            State::Lists(lists) => lists.remove(id),
        };
        if removed {
            // The errors are those of insertions, and every id that moves is present once.
            let _ = self.follow_size();
        }
        removed
    }

    fn descriptor(&self, id: u32) -> Option<Descriptor> {
        self.answering().descriptor(id)
    }

    fn two_nearest(&self, query: &Descriptor) -> Option<TwoNearest> {
        self.answering().two_nearest(query)
    }

    fn two_nearest_where(
        &self,
        query: &Descriptor,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<TwoNearest> {
        self.answering().two_nearest_where(query, accept)
    }

    fn two_nearest_batch(&self, queries: &[Descriptor], found: &mut Vec<Option<TwoNearest>>) {
        self.answering().two_nearest_batch(queries, found);
    }

    fn nearest(&self, query: &Descriptor, k: usize) -> Vec<Neighbour> {
        self.answering().nearest(query, k)
    }

    fn within(&self, query: &Descriptor, radius_squared: u32) -> Vec<Neighbour> {
        self.answering().within(query, radius_squared)
    }

    fn entries(&self) -> Vec<(u32, Descriptor)> {
        self.answering().entries()
    }

    fn len(&self) -> usize {
        self.answering().len()
    }

    fn memory_usage(&self) -> usize {
        let filling = match &self.0 {
            State::Moving(moving) => {
                moving.lists.memory_usage() + moving.waiting.capacity() * size_of::<u32>()
            }
            State::Scan(_) | State::Lists(_) => 0,
        };
        self.answering().memory_usage() + filling
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn name_of(index: &AutoIndex) -> &'static str {
        match index.0 {
            State::Scan(_) => "scan",
            State::Moving(_) => "moving",
            State::Lists(_) => "lists",
        }
    }

    fn random(rng: &mut ChaCha8Rng) -> Descriptor {
        std::array::from_fn(|_| rng.random())
    }

    #[test]
    fn a_scan_becomes_lists_and_a_scan_again_without_losing_an_entry() {
        let mut rng = ChaCha8Rng::seed_from_u64(17);
        let entries: Vec<Descriptor> = (0..6500).map(|_| random(&mut rng)).collect();
        let mut index = AutoIndex::new();
        let mut answered_by = vec![name_of(&index)];
        let mut note = |index: &AutoIndex| {
            if answered_by.last() != Some(&name_of(index)) {
                answered_by.push(name_of(index));
            }
        };
        for (id, descriptor) in (0..).zip(&entries) {
            index.insert(id, descriptor).unwrap();
            // Removals and new insertions in the middle of the move.
            if id > 4000 && id.is_multiple_of(50) {
                assert!(index.remove(id - 3000) && !index.remove(id - 3000));
                index.insert(id - 3000, descriptor).unwrap();
            }
            note(&index);
        }
        let present = |id: u32| match id {
            // Replaced above by the descriptor of 3000 later.
            1001..3500 if id.is_multiple_of(50) => entries[id as usize + 3000],
            _ => entries[id as usize],
        };
        assert_eq!(index.len(), entries.len());
        for id in 0..entries.len() as u32 {
            assert_eq!(index.descriptor(id), Some(present(id)), "{id}");
        }
        for id in 0..5000 {
            assert!(index.remove(id));
            note(&index);
        }
        assert_eq!(answered_by, ["scan", "moving", "lists", "scan"]);
        for id in 5000..entries.len() as u32 {
            let nearest = index.two_nearest(&present(id)).unwrap();
            assert_eq!((nearest.first.id, nearest.first.distance_squared), (id, 0));
        }
    }

    #[test]
    fn rebuilding_forgets_the_history() {
        let mut rng = ChaCha8Rng::seed_from_u64(19);
        let entries: Vec<Descriptor> = (0..7000).map(|_| random(&mut rng)).collect();
        let (mut forwards, mut backwards) = (AutoIndex::new(), AutoIndex::new());
        for (id, descriptor) in (0..).zip(&entries) {
            forwards.insert(id, descriptor).unwrap();
        }
        for (id, descriptor) in (0..7000).zip(&entries).rev() {
            backwards.insert(id, descriptor).unwrap();
        }
        let queries: Vec<Descriptor> = (0..200).map(|_| random(&mut rng)).collect();
        let answers = |index: &AutoIndex| {
            let mut found = Vec::new();
            index.two_nearest_batch(&queries, &mut found);
            found
        };
        assert_ne!(
            answers(&forwards),
            answers(&backwards),
            "or nothing is shown"
        );
        forwards.rebuild().unwrap();
        backwards.rebuild().unwrap();
        assert_eq!(name_of(&forwards), "lists");
        assert_eq!(answers(&forwards), answers(&backwards));
    }

    /// Stored as a scan, on the move and as lists, and after removals that have left lists waiting to be divided: the restored
    /// index answers as the stored one, and goes on as it does under the same changes.
    #[cfg(feature = "serde")]
    #[test]
    fn a_stored_index_goes_on_as_if_it_had_never_been_stored() {
        let mut rng = ChaCha8Rng::seed_from_u64(18);
        let entries: Vec<Descriptor> = (0..7000).map(|_| random(&mut rng)).collect();
        let mut index = AutoIndex::new();
        let mut seen = std::collections::BTreeSet::new();
        for (id, descriptor) in (0..).zip(&entries) {
            index.insert(id, descriptor).unwrap();
            if id % 7 == 3 {
                index.remove(id / 2);
            }
            if ![200, 4300, 5200, 6100, 6600].contains(&id) {
                continue;
            }
            seen.insert(name_of(&index));
            let bytes = postcard::to_allocvec(&index).unwrap();
            let mut restored: AutoIndex = postcard::from_bytes(&bytes).unwrap();
            assert!(postcard::to_allocvec(&restored).unwrap() == bytes, "{id}");
            let mut original = index.clone();
            for next in 0..300 {
                for one in [&mut original, &mut restored] {
                    one.insert(100_000 + next, &entries[next as usize]).unwrap();
                    one.remove(id.saturating_sub(3 * next));
                }
                let query = random(&mut rng);
                assert_eq!(original.two_nearest(&query), restored.two_nearest(&query));
            }
        }
        assert!(seen.contains("scan") && seen.contains("lists"), "{seen:?}");
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_damaged_stored_index_is_refused_or_answers() {
        let mut rng = ChaCha8Rng::seed_from_u64(19);
        let mut lists = InvertedLists::new(InvertedListsParams {
            list_capacity: 8,
            probes: None,
        })
        .unwrap();
        for id in 0..200 {
            lists.insert(id, &random(&mut rng)).unwrap();
        }
        let bytes = postcard::to_allocvec(&AutoIndex(State::Lists(Box::new(lists)))).unwrap();
        let mut refused = 0;
        for position in (0..bytes.len()).step_by(5) {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0x41;
            match postcard::from_bytes::<AutoIndex>(&damaged) {
                Err(_) => refused += 1,
                Ok(mut index) => {
                    let _ = index.two_nearest(&[7; 128]);
                    let _ = index.insert(7777, &[9; 128]);
                    index.remove(3);
                }
            }
        }
        assert!(refused > 20, "{refused}");
    }
}
