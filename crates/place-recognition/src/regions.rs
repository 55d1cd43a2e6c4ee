//! Which part of a map to search first: a vote of the candidates by where their landmarks were seen from.
//!
//! The landmarks of one view were seen from near one another, while wrong candidates lie all over the map. A vote counts,
//! for every place from which a landmark was seen, the candidates seen from within a radius, weighed by their quality. In a
//! map of a hundred rooms a region holds a hundredth of the wrong candidates, so that sampling in it is short, and most
//! regions hold too few keypoints for a pose and cost nothing.
//!
//! Degenerate: with one position for all, the map is one region. Ties go to the first position in the order (x, y, z).

use nalgebra::Vector3;
use std::collections::BTreeSet;

use crate::point_match::PointMatch;

/// A vote counts at least this much, so that many weak candidates still make a region.
const LEAST_WEIGHT: f64 = 0.05;

/// The positions from which the candidates were seen.
#[derive(Debug)]
pub(crate) struct Regions {
    positions: Vec<Vector3<f64>>,
    /// Position of each match.
    position_of: Vec<usize>,
    /// Positions that may still be the centre of a region.
    open: Vec<bool>,
    radius_m: f64,
}

impl Regions {
    /// Regions with a radius of `reach` times the median depth of the candidates. O(n log n).
    pub(crate) fn new(matches: &[PointMatch], reach: f64) -> Self {
        let mut depths: Vec<f64> = matches.iter().map(PointMatch::depth_m).collect();
        depths.sort_unstable_by(f64::total_cmp);
        let median = depths.get(depths.len() / 2).copied().unwrap_or(0.0);
        let mut order: Vec<usize> = (0..matches.len()).collect();
        let compare = |a: &Vector3<f64>, b: &Vector3<f64>| {
            (a.x.total_cmp(&b.x)).then(a.y.total_cmp(&b.y).then(a.z.total_cmp(&b.z)))
        };
        order.sort_by(|a, b| compare(&matches[*a].seen_from, &matches[*b].seen_from));
        let mut positions: Vec<Vector3<f64>> = Vec::new();
        let mut position_of = vec![0; matches.len()];
        for index in order {
            let position = matches[index].seen_from;
            if positions.last() != Some(&position) {
                positions.push(position);
            }
            position_of[index] = positions.len() - 1;
        }
        Self {
            open: vec![true; positions.len()],
            positions,
            position_of,
            radius_m: reach * median,
        }
    }

    /// The matches of the region with most votes among those of `remaining`, in ascending order; `None` when no open
    /// centre has `least_keypoints` different keypoints around it. Its centre is closed, and what lies within half the
    /// radius of it. O(positions^2) at most; positions far apart along x cost nothing.
    pub(crate) fn next(
        &mut self,
        matches: &[PointMatch],
        remaining: &[usize],
        least_keypoints: usize,
    ) -> Option<Vec<usize>> {
        let mut weights = vec![0.0; self.positions.len()];
        for index in remaining {
            weights[self.position_of[*index]] += matches[*index].quality.max(LEAST_WEIGHT);
        }
        for centre in self.centres_by_votes(&weights) {
            if !self.open[centre] {
                continue;
            }
            self.close_around(centre);
            let members: Vec<usize> = remaining
                .iter()
                .copied()
                .filter(|index| self.near(centre, self.position_of[*index], 1.0))
                .collect();
            let keypoints: BTreeSet<usize> = members.iter().map(|i| matches[*i].keypoint).collect();
            if keypoints.len() >= least_keypoints {
                return Some(members);
            }
        }
        None
    }

    fn near(&self, a: usize, b: usize, share: f64) -> bool {
        (self.positions[a] - self.positions[b]).norm() <= share * self.radius_m
    }

    /// Open centres that have votes, most votes first.
    fn centres_by_votes(&self, weights: &[f64]) -> Vec<usize> {
        let mut votes: Vec<(f64, usize)> = Vec::new();
        let mut first = 0;
        for centre in 0..self.positions.len() {
            let x = self.positions[centre].x;
            while self.positions[first].x < x - self.radius_m {
                first += 1;
            }
            if !self.open[centre] || weights[centre] <= 0.0 {
                continue;
            }
            let sum = (first..self.positions.len())
                .take_while(|other| self.positions[*other].x <= x + self.radius_m)
                .filter(|other| self.near(centre, *other, 1.0))
                .map(|other| weights[other])
                .sum();
            votes.push((sum, centre));
        }
        votes.sort_by(|a, b| b.0.total_cmp(&a.0));
        votes.into_iter().map(|(_, centre)| centre).collect()
    }

    fn close_around(&mut self, centre: usize) {
        for other in 0..self.positions.len() {
            if other == centre || self.near(centre, other, 0.5) {
                self.open[other] = false;
            }
        }
    }
}
