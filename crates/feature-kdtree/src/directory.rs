//! The two ways of finding the nearest centroids: looking at all of them, and looking at the nearest cells of them.

use simd_level::SimdLevel;

use crate::Descriptor;
use crate::cells::{Cells, Directory, Visit};
use crate::near_rows::{Collector, scan_near};
use crate::row_block::PreparedQuery;
use crate::rows::Rows;
use crate::smallest::Smallest;

/// Cells of centroids that are searched for the home of one new row.
const HOME_PROBES: usize = 6;
/// Cells of centroids that are searched for the nearest centroids of a query, at least.
const LEAST_PROBES: usize = 12;
/// One more cell of centroids is searched for each so many centroids wanted.
const WANTED_PER_PROBE: usize = 4;

/// A directory that looks at all centroids: exact, O(cells).
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Flat {
    #[cfg_attr(feature = "serde", serde(skip, default = "SimdLevel::best"))]
    level: SimdLevel,
    centroids: Rows,
}

impl Flat {
    pub(crate) fn new(level: SimdLevel) -> Self {
        Self {
            level,
            centroids: Rows::default(),
        }
    }

    fn position(&self, cell: u32) -> Option<usize> {
        self.centroids.ids().iter().position(|&other| other == cell)
    }
}

impl Directory for Flat {
    fn set(&mut self, cell: u32, centroid: &Descriptor) {
        self.remove(cell);
        self.centroids.push(cell, centroid);
    }

    fn remove(&mut self, cell: u32) {
        if let Some(position) = self.position(cell) {
            self.centroids.swap_remove(position);
        }
    }

    #[cfg(feature = "serde")]
    fn known_cells(&self) -> usize {
        self.centroids.len()
    }

    fn centroid(&self, cell: u32) -> Option<Descriptor> {
        Some(self.centroids.descriptor(self.position(cell)?))
    }

    fn nearest(&self, queries: &[PreparedQuery], count: usize) -> Vec<Visit> {
        let mut smallest = Smallest::new(count, queries.len());
        let members: Vec<u32> = (0..queries.len() as u32).collect();
        scan_near(
            self.level,
            &self.centroids,
            queries,
            &members,
            &mut smallest,
        );
        smallest.visits()
    }

    fn nearest_one(&self, query: &PreparedQuery) -> Option<u32> {
        let mut nearest = Nearest::default();
        let query = std::slice::from_ref(query);
        scan_near(self.level, &self.centroids, query, &[0], &mut nearest);
        nearest.number()
    }

    fn memory_usage(&self) -> usize {
        self.centroids.memory_usage()
    }
}

/// A directory that looks at the centroids in the cells nearest to the query, and at no others.
impl Directory for Cells<Flat> {
    fn set(&mut self, cell: u32, centroid: &Descriptor) {
        Cells::remove(self, cell);
        self.insert(cell, centroid);
    }

    fn remove(&mut self, cell: u32) {
        Cells::remove(self, cell);
    }

    #[cfg(feature = "serde")]
    fn known_cells(&self) -> usize {
        self.len()
    }

    fn centroid(&self, cell: u32) -> Option<Descriptor> {
        self.get(cell)
    }

    fn nearest(&self, queries: &[PreparedQuery], count: usize) -> Vec<Visit> {
        let mut smallest = Smallest::new(count, queries.len());
        let probes = LEAST_PROBES + count / WANTED_PER_PROBE;
        self.scan_nearest(queries, probes, |rows, members| {
            scan_near(self.level(), rows, queries, members, &mut smallest);
        });
        smallest.visits()
    }

    fn nearest_one(&self, query: &PreparedQuery) -> Option<u32> {
        let mut nearest = Nearest::default();
        let query = std::slice::from_ref(query);
        self.scan_nearest(query, HOME_PROBES, |rows, members| {
            scan_near(self.level(), rows, query, members, &mut nearest);
        });
        nearest.number()
    }

    fn memory_usage(&self) -> usize {
        Cells::memory_usage(self)
    }
}

/// The key (distance over number) of the nearest so far.
#[derive(Debug, Default)]
struct Nearest(Option<u64>);

impl Nearest {
    fn number(self) -> Option<u32> {
        self.0.map(|key| key as u32)
    }
}

impl Collector for Nearest {
    fn limit(&self, _: u32) -> u32 {
        self.0.map_or(u32::MAX, |key| (key >> 32) as u32)
    }

    fn take(&mut self, _: u32, distance_squared: u32, number: u32) {
        let key = u64::from(distance_squared) << 32 | u64::from(number);
        self.0 = Some(self.0.map_or(key, |nearest| nearest.min(key)));
    }
}
