//! Selection of the few smallest of many distances, for each query of a batch.
//!
//! A query collects keys (distance over number) below its bound. When its buffer is full, the wanted ones are
//! selected, the rest is dropped, and the bound becomes the largest of them; most later distances then fail one
//! comparison. Ties go to the lower number, so the result does not depend on the order in which keys are offered.

use crate::cells::Visit;
use crate::near_rows::Collector;

/// Keys that a query collects beyond twice the wanted ones before it selects: enough for all centroids of a cell or two.
const SLACK: usize = 128;

/// Keeps the `wanted` smallest of the (distance, number) pairs offered to each query.
#[derive(Debug, Clone)]
pub(crate) struct Smallest {
    wanted: usize,
    room: usize,
    /// The buffers of all queries, `room` keys each.
    keys: Vec<u64>,
    queries: Vec<State>,
}

#[derive(Debug, Clone, Copy)]
struct State {
    /// Only keys below this can still be wanted.
    bound: u64,
    count: usize,
}

impl Smallest {
    /// Empty buffers for so many queries; `wanted` is at least one.
    pub(crate) fn new(wanted: usize, queries: usize) -> Self {
        let room = 2 * wanted + SLACK;
        let fresh = State {
            bound: u64::MAX,
            count: 0,
        };
        Self {
            wanted,
            room,
            keys: vec![0; room * queries],
            queries: vec![fresh; queries],
        }
    }

    /// The smallest of every query as cells to visit: in the order of the queries, in no order within a query.
    pub(crate) fn visits(mut self) -> Vec<Visit> {
        let mut visits = Vec::with_capacity(self.queries.len() * self.wanted);
        for query in 0..self.queries.len() {
            self.select(query);
            let start = self.room * query;
            let keys = &self.keys[start..start + self.queries[query].count];
            visits.extend(keys.iter().map(|&key| Visit {
                cell: key as u32,
                query: query as u32,
            }));
        }
        visits
    }

    /// The smallest keys of one query, ascending.
    pub(crate) fn sorted(mut self, query: usize) -> Vec<u64> {
        self.select(query);
        let start = self.room * query;
        let mut keys = self.keys[start..start + self.queries[query].count].to_vec();
        keys.sort_unstable();
        keys
    }

    fn select(&mut self, query: usize) {
        let state = &mut self.queries[query];
        if state.count > self.wanted {
            let start = self.room * query;
            let keys = &mut self.keys[start..start + state.count];
            let (_, &mut last, _) = keys.select_nth_unstable(self.wanted - 1);
            state.count = self.wanted;
            state.bound = last;
        }
    }
}

impl Collector for Smallest {
    #[inline]
    fn limit(&self, query: u32) -> u32 {
        (self.queries[query as usize].bound >> 32) as u32
    }

    #[inline]
    fn take(&mut self, query: u32, distance_squared: u32, number: u32) {
        let query = query as usize;
        let state = &mut self.queries[query];
        let key = u64::from(distance_squared) << 32 | u64::from(number);
        if key < state.bound {
            self.keys[self.room * query + state.count] = key;
            state.count += 1;
            if state.count == self.room {
                self.select(query);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn agrees_with_sorting() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for wanted in [1, 2, 7, 40] {
            for count in [0, 1, 6, 39, 41, 1000, 5000] {
                let mut smallest = Smallest::new(wanted, 3);
                // Few values: many ties.
                let distances: Vec<u32> = (0..count).map(|_| rng.random_range(0..60)).collect();
                for (number, &distance) in (0..).zip(&distances) {
                    if distance <= smallest.limit(1) {
                        smallest.take(1, distance, count as u32 - number);
                    }
                }
                let mut all: Vec<(u32, u32)> = (0..)
                    .zip(distances)
                    .map(|(number, distance)| (distance, count as u32 - number))
                    .collect();
                all.sort_unstable();
                let mut expected: Vec<u32> = all.iter().take(wanted).map(|&(_, n)| n).collect();
                expected.sort_unstable();
                let visits = smallest.visits();
                assert!(visits.iter().all(|visit| visit.query == 1));
                let mut found: Vec<u32> = visits.iter().map(|visit| visit.cell).collect();
                found.sort_unstable();
                assert_eq!(found, expected, "{wanted} of {count}");
            }
        }
    }
}
