//! The index to take when the size of the map is not known beforehand: exact while that is fast, approximate beyond.
//!
//! Up to some thousand entries a scan is exact and as fast as anything; beyond, inverted lists win by a factor that
//! grows with the map. [`AutoIndex`] starts as the one and becomes the other. [`AutoIndex::kind`] says which it is,
//! [`AutoIndex::fixed`] settles it for good.
//!
//! Steps of the change, spread over many insertions so that no frame pays for it:
//! 1. At [`AutoIndex::MOVES_AT`] entries it begins to enter the old ones into lists, two for each change; new ones
//!    go to both. The scan goes on to answer.
//! 2. When all are in the lists, after half as many changes again, the lists answer and the scan is dropped.
//! 3. When removals leave fewer than [`AutoIndex::RETURNS_BELOW`], it is a scan again, at once: the copy of so few
//!    entries takes 0.1 ms. The gap between the two sizes keeps a map of constant size from changing to and fro.
//!
//! Degenerate cases are those of the two indexes.

use crate::inverted_lists::{InvertedLists, InvertedListsParams};
use crate::{
    Descriptor, DescriptorIndex, ExactScan, IndexError, KdForest, KdForestParams, TwoNearest,
};

/// Old entries entered into the lists for each change while the change of kind lasts.
const MOVES_A_CHANGE: usize = 2;

/// A kind of index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum IndexKind {
    /// [`ExactScan`].
    ExactScan,
    /// [`InvertedLists`] with default parameters.
    InvertedLists,
    /// [`KdForest`] with default parameters; never chosen by size.
    KdForest,
}

/// An exact scan that becomes inverted lists as the map grows.
///
/// Deterministic: its kind and its answers are a function of the sequence of changes.
#[derive(Debug, Clone)]
pub struct AutoIndex {
    state: State,
    fixed: bool,
}

#[derive(Debug, Clone)]
enum State {
    Scan(ExactScan),
    /// The scan answers, the lists fill.
    Moving(Box<Moving>),
    Lists(Box<InvertedLists>),
    Forest(Box<KdForest>),
}

#[derive(Debug, Clone)]
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
    /// Entries at which a scan begins to become lists.
    pub const MOVES_AT: usize = 4000;
    /// Entries below which lists become a scan.
    pub const RETURNS_BELOW: usize = 2000;

    /// An empty index whose kind follows its size.
    #[must_use]
    pub fn new() -> Self {
        Self {
            state: State::Scan(ExactScan::new()),
            fixed: false,
        }
    }

    /// An empty index of one kind for good.
    ///
    /// # Errors
    /// None with the default parameters it takes; the signature is that of the indexes it makes.
    pub fn fixed(kind: IndexKind) -> Result<Self, IndexError> {
        Ok(Self {
            state: match kind {
                IndexKind::ExactScan => State::Scan(ExactScan::new()),
                IndexKind::InvertedLists => State::Lists(Box::new(empty_lists()?)),
                IndexKind::KdForest => {
                    State::Forest(Box::new(KdForest::new(KdForestParams::default())?))
                }
            },
            fixed: true,
        })
    }

    /// What answers now.
    #[must_use]
    pub fn kind(&self) -> IndexKind {
        match &self.state {
            State::Scan(_) | State::Moving(_) => IndexKind::ExactScan,
            State::Lists(_) => IndexKind::InvertedLists,
            State::Forest(_) => IndexKind::KdForest,
        }
    }

    /// Whether the kind was given rather than chosen.
    #[must_use]
    pub fn is_fixed(&self) -> bool {
        self.fixed
    }

    /// Becomes a function of the present entries alone, its kind included unless that is fixed.
    ///
    /// Two indexes with equal entries answer equally after it, and go on doing so under equal changes, whatever
    /// their histories were: for runs that must repeat from a saved state. The price of inserting all entries.
    ///
    /// # Errors
    /// None in practice: those of inserting the present entries into an empty index.
    pub fn rebuild(&mut self) -> Result<(), IndexError> {
        match &mut self.state {
            // Exact answers are a function of the entries as they are.
            State::Scan(_) if self.fixed => {}
            State::Lists(lists) if self.fixed => lists.rebuild(),
            State::Forest(forest) => forest.rebuild(),
            State::Scan(_) | State::Moving(_) | State::Lists(_) => {
                let mut entries = self.entries();
                entries.sort_unstable_by_key(|&(id, _)| id);
                self.state = State::Scan(ExactScan::new());
                for (id, descriptor) in &entries {
                    self.insert(*id, descriptor)?;
                }
            }
        }
        Ok(())
    }

    fn entries(&self) -> Vec<(u32, Descriptor)> {
        match &self.state {
            State::Scan(scan) => scan.entries(),
            State::Moving(moving) => moving.scan.entries(),
            State::Lists(lists) => lists.entries(),
            State::Forest(_) => Vec::new(),
        }
    }

    fn answering(&self) -> &(dyn DescriptorIndex + Sync) {
        match &self.state {
            State::Scan(scan) => scan,
            State::Moving(moving) => &moving.scan,
            State::Lists(lists) => lists.as_ref(),
            State::Forest(forest) => forest.as_ref(),
        }
    }

    /// Begins, continues or ends a change of kind after a change of the entries.
    fn follow_size(&mut self) -> Result<(), IndexError> {
        if self.fixed {
            return Ok(());
        }
        match &mut self.state {
            State::Scan(scan) if scan.len() >= Self::MOVES_AT => {
                let mut waiting: Vec<u32> = scan.ids().to_vec();
                waiting.reverse();
                self.state = State::Moving(Box::new(Moving {
                    scan: std::mem::take(scan),
                    lists: empty_lists()?,
                    waiting,
                }));
            }
            State::Moving(moving) if moving.scan.len() < Self::RETURNS_BELOW => {
                self.state = State::Scan(std::mem::take(&mut moving.scan));
            }
            State::Moving(moving) => {
                moving.advance()?;
                if moving.waiting.is_empty() {
                    let lists = std::mem::replace(&mut moving.lists, empty_lists()?);
                    self.state = State::Lists(Box::new(lists));
                }
            }
            State::Lists(lists) if lists.len() < Self::RETURNS_BELOW => {
                let mut scan = ExactScan::new();
                for (id, descriptor) in lists.entries() {
                    scan.insert(id, &descriptor)?;
                }
                self.state = State::Scan(scan);
            }
            State::Scan(_) | State::Lists(_) | State::Forest(_) => {}
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
            // Removed meanwhile, or removed and inserted anew, which entered it already.
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
        match &mut self.state {
            State::Scan(scan) => scan.insert(id, descriptor)?,
            State::Moving(moving) => {
                moving.scan.insert(id, descriptor)?;
                moving.lists.insert(id, descriptor)?;
            }
            State::Lists(lists) => lists.insert(id, descriptor)?,
            State::Forest(forest) => forest.insert(id, descriptor)?,
        }
        self.follow_size()
    }

    fn remove(&mut self, id: u32) -> bool {
        let removed = match &mut self.state {
            State::Scan(scan) => scan.remove(id),
            State::Moving(moving) => {
                moving.lists.remove(id);
                moving.scan.remove(id)
            }
            State::Lists(lists) => lists.remove(id),
            State::Forest(forest) => forest.remove(id),
        };
        if removed {
            // Its errors are those of insertions, which do not arise: every id moved is present once.
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

    fn len(&self) -> usize {
        self.answering().len()
    }

    fn memory_usage(&self) -> usize {
        let filling = match &self.state {
            State::Moving(moving) => {
                moving.lists.memory_usage() + moving.waiting.capacity() * size_of::<u32>()
            }
            State::Scan(_) | State::Lists(_) | State::Forest(_) => 0,
        };
        self.answering().memory_usage() + filling
    }
}
