//! Rows kept in cells, each near the centroid of its cell, while rows come and go.
//!
//! The nearest rows of a query lie mostly in the cells whose centroids are nearest, so a search scans those alone
//! (inverted lists: Sivic and Zisserman 2003; Jégou, Douze and Schmid 2011). No training set is ever needed:
//!
//! 1. A row goes to the cell of the nearest centroid the directory finds.
//! 2. A cell over its capacity is divided in two ([`crate::two_means`]). There is at most one division in
//!    [`CHANGES_PER_DIVISION`] changes; further cells wait in line. The two halves of a cell fill up only after half a
//!    capacity of changes, so the line stays short, and no change pays for more than one division.
//! 3. After a division the rows of the neighbouring cells that are nearer to a new centroid move over (Xu et al.,
//!    SPFresh, 2023). Without this step rows stay behind borders that have moved, and fewer neighbours are found.
//! 4. A cell that removals leave with less than an eighth of the capacity is dissolved: its rows go to their
//!    nearest cells.
//!
//! A [`Directory`] finds the nearest centroid: either it looks at all centroids, or it keeps them in cells again. Two
//! storeys make the cost of finding a cell O(n^(1/3)) with cells of constant size.
//!
//! Degenerate cases: rows that cannot be divided stay together over capacity; the next attempt waits until their
//! number has doubled. An uneven division of many equal rows waits for an eighth more. The work of an insertion is
//! therefore constant in the mean, whatever the data are. A removal or look-up by id goes through the ids of one
//! cell, hence through all rows that are equal to the one asked for.
//!
//! Everything is a function of the sequence of changes: no randomness, no hash order.

use std::collections::VecDeque;

use simd_level::SimdLevel;

use crate::Descriptor;
use crate::id_table::IdTable;
use crate::row_block::PreparedQuery;
use crate::row_scan;
use crate::rows::Rows;
use crate::simd::prefetch;
use crate::two_means::divide;

/// At most one division in this many changes.
const CHANGES_PER_DIVISION: u32 = 24;
/// The number of cells around a divided one whose rows may move over.
const NEIGHBOURS: usize = 8;
/// A cell that removals leave with less than this share of the capacity is dissolved.
const DISSOLVE_SHARE: usize = 8;

/// Finds the cells whose centroids are nearest.
pub(crate) trait Directory {
    /// Adds the centroid of a new cell, or gives an old one another centroid.
    fn set(&mut self, cell: u32, centroid: &Descriptor);

    /// Removes a cell.
    fn remove(&mut self, cell: u32);

    /// The number of cells that it knows.
    #[cfg(feature = "serde")]
    fn known_cells(&self) -> usize;

    /// The centroid of a cell.
    fn centroid(&self, cell: u32) -> Option<Descriptor>;

    /// The `count` cells nearest to each query; the directory may miss some.
    fn nearest(&self, queries: &[PreparedQuery], count: usize) -> Vec<Visit>;

    /// The cell nearest to the query, or one nearly as near; `None` only when there is no cell.
    fn nearest_one(&self, query: &PreparedQuery) -> Option<u32>;

    /// The memory held on the heap, bytes.
    fn memory_usage(&self) -> usize;
}

/// A cell to be searched for a query.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Visit {
    pub(crate) cell: u32,
    /// The position of the query in the batch.
    pub(crate) query: u32,
}

#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Cell {
    rows: Rows,
    /// The cell is divided when it holds more rows.
    divide_above: usize,
    /// Whether the cell waits in line for its division.
    in_line: bool,
}

/// Rows in cells, and the directory of the cells.
#[derive(Debug, Clone)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        into = "StoredCells<D>",
        try_from = "StoredCells<D>",
        bound(
            serialize = "D: Clone + serde::Serialize",
            deserialize = "D: Directory + serde::Deserialize<'de>"
        )
    )
)]
pub(crate) struct Cells<D> {
    level: SimdLevel,
    capacity: usize,
    directory: D,
    cells: Vec<Cell>,
    /// The cell of each id.
    homes: IdTable,
    line: VecDeque<u32>,
    changes_since_division: u32,
}

/// Cells as they are stored: what follows from the rest is left out.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
struct StoredCells<D> {
    capacity: usize,
    directory: D,
    cells: Vec<Cell>,
    line: VecDeque<u32>,
    changes_since_division: u32,
}

#[cfg(feature = "serde")]
impl<D> From<Cells<D>> for StoredCells<D> {
    fn from(cells: Cells<D>) -> Self {
        Self {
            capacity: cells.capacity,
            directory: cells.directory,
            cells: cells.cells,
            line: cells.line,
            changes_since_division: cells.changes_since_division,
        }
    }
}

#[cfg(feature = "serde")]
impl<D: Directory> TryFrom<StoredCells<D>> for Cells<D> {
    type Error = crate::IndexError;

    fn try_from(stored: StoredCells<D>) -> Result<Self, crate::IndexError> {
        let rule = |holds: bool, rule| match holds {
            true => Ok(()),
            false => Err(crate::IndexError::Stored(rule)),
        };
        let count = stored.cells.len();
        rule(stored.capacity >= 2, "a cell has room for two")?;
        rule(
            stored.line.iter().all(|cell| (*cell as usize) < count),
            "only cells wait for a division",
        )?;
        rule(
            stored.directory.known_cells() == count
                && (0..count).all(|cell| stored.directory.centroid(cell as u32).is_some()),
            "the directory has every cell once",
        )?;
        let mut homes = IdTable::default();
        for (cell, rows) in stored.cells.iter().enumerate() {
            for id in rows.rows.ids() {
                rule(homes.get(*id).is_none(), "every id is in one cell")?;
                homes.set(*id, cell as u32);
            }
        }
        Ok(Self {
            level: SimdLevel::best(),
            capacity: stored.capacity,
            directory: stored.directory,
            cells: stored.cells,
            homes,
            line: stored.line,
            changes_since_division: stored.changes_since_division,
        })
    }
}

impl<D: Directory> Cells<D> {
    pub(crate) fn new(level: SimdLevel, capacity: usize, directory: D) -> Self {
        Self {
            level,
            capacity,
            directory,
            cells: Vec::new(),
            homes: IdTable::default(),
            line: VecDeque::new(),
            changes_since_division: CHANGES_PER_DIVISION,
        }
    }

    /// The number of rows.
    pub(crate) fn len(&self) -> usize {
        self.homes.len()
    }

    pub(crate) fn level(&self) -> SimdLevel {
        self.level
    }

    pub(crate) fn cell_count(&self) -> usize {
        self.cells.len()
    }

    /// All rows, cell by cell.
    pub(crate) fn entries(&self) -> Vec<(u32, Descriptor)> {
        let of_cell = |cell: &Cell| {
            let rows = cell.rows.clone();
            (0..rows.len()).map(move |row| (rows.ids()[row], rows.descriptor(row)))
        };
        self.cells.iter().flat_map(of_cell).collect()
    }

    fn rows(&self, cell: u32) -> &Rows {
        &self.cells[cell as usize].rows
    }

    pub(crate) fn contains(&self, id: u32) -> bool {
        self.homes.get(id).is_some()
    }

    pub(crate) fn get(&self, id: u32) -> Option<Descriptor> {
        let rows = self.rows(self.homes.get(id)?);
        Some(rows.descriptor(rows.position(id)?))
    }

    /// Adds a row under an id that is not present.
    pub(crate) fn insert(&mut self, id: u32, descriptor: &Descriptor) {
        let nearest = self.directory.nearest_one(&PreparedQuery::new(descriptor));
        let cell = nearest.unwrap_or_else(|| self.add_cell(descriptor));
        self.push(cell, id, descriptor);
        self.change();
    }

    /// Removes a row; `false` when the id is not present.
    pub(crate) fn remove(&mut self, id: u32) -> bool {
        let Some(cell) = self.homes.remove(id) else {
            return false;
        };
        let rows = &mut self.cells[cell as usize].rows;
        if let Some(row) = rows.position(id) {
            rows.swap_remove(row);
        }
        let left = rows.len();
        if left == 0 || (left < self.capacity / DISSOLVE_SHARE && self.cells.len() > 1) {
            self.dissolve(cell);
        }
        self.change();
        true
    }

    /// Calls `scan` once for each cell that is among the `probes` nearest of some query, with the positions of
    /// those queries, ascending. When `probes` is at least the number of cells, every query visits every cell.
    pub(crate) fn scan_nearest(
        &self,
        queries: &[PreparedQuery],
        probes: usize,
        mut scan: impl FnMut(&Rows, &[u32]),
    ) {
        if probes >= self.cells.len() {
            let all: Vec<u32> = (0..queries.len() as u32).collect();
            for cell in &self.cells {
                scan(&cell.rows, &all);
            }
            return;
        }
        let visits = self.directory.nearest(queries, probes);
        if queries.len() == 1 {
            for visit in visits {
                scan(self.rows(visit.cell), &[0]);
            }
            return;
        }
        // Counting sort by cell.
        let mut ends = vec![0_usize; self.cells.len() + 1];
        for visit in &visits {
            ends[visit.cell as usize + 1] += 1;
        }
        for cell in 1..ends.len() {
            ends[cell] += ends[cell - 1];
        }
        let mut members = vec![0; visits.len()];
        for visit in &visits {
            let end = &mut ends[visit.cell as usize];
            members[*end] = visit.query;
            *end += 1;
        }
        let visited: Vec<(usize, usize, usize)> = (0..self.cells.len())
            .map(|cell| (cell, if cell == 0 { 0 } else { ends[cell - 1] }, ends[cell]))
            .filter(|&(_, start, end)| start < end)
            .collect();
        for (position, &(cell, start, end)) in visited.iter().enumerate() {
            if let Some(&(next, ..)) = visited.get(position + 1) {
                prefetch(self.cells[next].rows.blocks());
            }
            scan(&self.cells[cell].rows, &members[start..end]);
        }
    }

    pub(crate) fn memory_usage(&self) -> usize {
        let rows: usize = self.cells.iter().map(|cell| cell.rows.memory_usage()).sum();
        rows + self.cells.capacity() * size_of::<Cell>()
            + self.homes.memory_usage()
            + self.line.capacity() * size_of::<u32>()
            + self.directory.memory_usage()
    }

    fn add_cell(&mut self, centroid: &Descriptor) -> u32 {
        let cell = self.cells.len() as u32;
        self.cells.push(Cell {
            divide_above: self.capacity,
            ..Cell::default()
        });
        self.directory.set(cell, centroid);
        cell
    }

    /// Puts a row into a cell, and the cell into the line where it is over capacity.
    fn push(&mut self, cell: u32, id: u32, descriptor: &Descriptor) {
        // The look-up first, because it waits for memory; the other order is measurably slower.
        self.homes.set(id, cell);
        let into = &mut self.cells[cell as usize];
        into.rows.push(id, descriptor);
        if into.rows.len() > into.divide_above && !into.in_line {
            into.in_line = true;
            self.line.push_back(cell);
        }
    }

    /// Counts a change and divides the first cell in the line when one is due.
    fn change(&mut self) {
        self.changes_since_division += 1;
        if self.changes_since_division >= CHANGES_PER_DIVISION
            && let Some(cell) = self.line.pop_front()
        {
            self.changes_since_division = 0;
            self.cells[cell as usize].in_line = false;
            self.divide(cell);
        }
    }

    fn divide(&mut self, cell: u32) {
        let rows = &self.cells[cell as usize].rows;
        if rows.len() <= self.cells[cell as usize].divide_above {
            return;
        }
        let descriptors: Vec<Descriptor> =
            (0..rows.len()).map(|row| rows.descriptor(row)).collect();
        let Some(division) = divide(self.level, rows, &descriptors) else {
            self.cells[cell as usize].divide_above = 2 * rows.len();
            return;
        };
        let Some(before) = self.directory.centroid(cell) else {
            return;
        };
        let whole = std::mem::take(&mut self.cells[cell as usize].rows);
        let other = self.add_cell(&division.centroids[1]);
        self.directory.set(cell, &division.centroids[0]);
        let second = division.on_second.iter().filter(|&&side| side).count();
        for (half, size) in [(cell, whole.len() - second), (other, second)] {
            self.cells[half as usize].rows.reserve(size);
        }
        let sides = division.on_second.iter().zip(whole.ids());
        for ((&on_second, &id), descriptor) in sides.zip(&descriptors) {
            let half = if on_second { other } else { cell };
            self.cells[half as usize].rows.push(id, descriptor);
            if on_second {
                self.homes.set(id, other);
            }
        }
        for half in [cell, other] {
            let half = &mut self.cells[half as usize];
            let more = (half.rows.len() / DISSOLVE_SHARE).max(1);
            half.divide_above = self.capacity.max(half.rows.len() + more);
        }
        self.move_over(
            [cell, other],
            &division.centroids,
            &PreparedQuery::new(&before),
        );
    }

    /// Moves rows of the cells around to the halves of a division where these are nearer.
    fn move_over(&mut self, halves: [u32; 2], centroids: &[Descriptor; 2], around: &PreparedQuery) {
        let halves_prepared = centroids.each_ref().map(PreparedQuery::new);
        let around = std::slice::from_ref(around);
        let mut neighbours = self.directory.nearest(around, NEIGHBOURS + 2);
        neighbours.sort_unstable();
        let mut emptied = Vec::new();
        let mut distances = [Vec::new(), Vec::new(), Vec::new()];
        for (position, &Visit { cell, .. }) in neighbours.iter().enumerate() {
            if let Some(next) = neighbours.get(position + 1) {
                prefetch(self.rows(next.cell).blocks());
            }
            if halves.contains(&cell) {
                continue;
            }
            let Some(own) = self.directory.centroid(cell) else {
                continue;
            };
            let own = PreparedQuery::new(&own);
            let [first, second] = &halves_prepared;
            let rows = &self.cells[cell as usize].rows;
            for (from, out) in [first, second, &own].into_iter().zip(&mut distances) {
                row_scan::distances(rows, self.level, from, out);
            }
            // From the back, so that the row which `swap_remove` moves into the gap has been looked at.
            for row in (0..rows.len()).rev() {
                let [first, second, own] = distances.each_ref().map(|of| of[row]);
                if first.min(second) < own {
                    let rows = self.rows(cell);
                    let (id, descriptor) = (rows.ids()[row], rows.descriptor(row));
                    self.cells[cell as usize].rows.swap_remove(row);
                    self.push(halves[usize::from(second < first)], id, &descriptor);
                }
            }
            if self.rows(cell).len() == 0 {
                emptied.push(cell);
            }
        }
        // Descending, so that no number of the others changes.
        for &cell in emptied.iter().rev() {
            self.dissolve(cell);
        }
    }

    /// Removes a cell; its rows go to their nearest cells.
    fn dissolve(&mut self, cell: u32) {
        self.directory.remove(cell);
        if self.cells[cell as usize].in_line {
            self.line.retain(|&waiting| waiting != cell);
        }
        let gone = self.cells.swap_remove(cell as usize);
        let last = self.cells.len() as u32;
        if cell != last {
            self.rename(last, cell);
        }
        for (row, &id) in gone.rows.ids().iter().enumerate() {
            let descriptor = gone.rows.descriptor(row);
            let nearest = self.directory.nearest_one(&PreparedQuery::new(&descriptor));
            let into = nearest.unwrap_or_else(|| self.add_cell(&descriptor));
            self.push(into, id, &descriptor);
        }
    }

    /// The cell with number `from` has moved to the number `to`.
    fn rename(&mut self, from: u32, to: u32) {
        if let Some(centroid) = self.directory.centroid(from) {
            self.directory.remove(from);
            self.directory.set(to, &centroid);
        }
        let cell = &self.cells[to as usize];
        for &id in cell.rows.ids() {
            self.homes.set(id, to);
        }
        if cell.in_line {
            for waiting in self.line.iter_mut().filter(|waiting| **waiting == from) {
                *waiting = to;
            }
        }
    }
}
