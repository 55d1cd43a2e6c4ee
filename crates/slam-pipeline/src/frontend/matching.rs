//! The search for the keypoint of each landmark.
//!
//! In view: landmarks with a narrow gate take the nearest descriptor in it; the keypoints left take their two nearest
//! among all landmarks in view, by an exact scan with a ratio test (Eq. 21); landmarks still without a keypoint look
//! into their own gates, however wide. In the whole map: the ratio test alone, through a k-d forest (III.B).

use std::collections::BTreeMap;

use feature_kdtree::{Descriptor, DescriptorIndex as _, ExactScan, TwoNearest, distance_squared};
use nalgebra::Vector2;
use rayon::prelude::*;

use super::association::AssociationParams;
use super::catalogue::Catalogue;
use super::frame::FrameFeatures;
use super::prediction::Predicted;
use crate::method::DescriptorSearch;

/// Gates no wider than this are searched before the descriptors decide, pixels.
const NARROW_GATE_PX: f64 = 12.0;

/// The inputs of a search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Matcher<'a> {
    /// Keypoints of the frame.
    pub(crate) frame: &'a FrameFeatures<'a>,
    /// Descriptors of the landmarks.
    pub(crate) catalogue: &'a Catalogue,
    /// Landmarks predicted in view.
    pub(crate) in_view: &'a BTreeMap<u32, Predicted>,
    /// Thresholds.
    pub(crate) params: &'a AssociationParams,
}

/// Keypoints found so far: at most one a landmark, and one landmark a keypoint.
#[derive(Debug)]
struct Pairing {
    keypoint_of: BTreeMap<u32, usize>,
    used: Vec<bool>,
}

impl Pairing {
    fn add(&mut self, id: u32, keypoint: usize) {
        self.keypoint_of.insert(id, keypoint);
        self.used[keypoint] = true;
    }
}

/// A keypoint whose descriptor is still searched.
struct Query {
    keypoint: usize,
    pixel: Vector2<f64>,
}

impl Matcher<'_> {
    /// The keypoint of each landmark that has one, by landmark id.
    #[must_use]
    pub(crate) fn keypoints(&self) -> BTreeMap<u32, usize> {
        let mut pairing = Pairing {
            keypoint_of: BTreeMap::new(),
            used: vec![false; self.frame.ideal.len()],
        };
        match self.params.search {
            DescriptorSearch::InView => {
                self.guided(NARROW_GATE_PX, &mut pairing);
                self.in_view(&mut pairing);
                self.guided(f64::INFINITY, &mut pairing);
            }
            DescriptorSearch::WholeMapForest => self.in_forest(&mut pairing),
        }
        pairing.keypoint_of
    }

    /// The two nearest landmarks in view of every keypoint that is not used yet.
    fn in_view(&self, pairing: &mut Pairing) {
        let visible: ExactScan = self
            .in_view
            .keys()
            .filter_map(|id| Some((*id, &*self.catalogue.get(*id)?.look)))
            .collect();
        let open = self.open(pairing);
        let queries: Vec<Descriptor> = open
            .iter()
            .map(|q| self.frame.features.descriptors[q.keypoint])
            .collect();
        let mut nearest = Vec::new();
        visible.two_nearest_batch(&queries, &mut nearest);
        self.take_distinct(&open, &nearest, pairing);
    }

    /// The two nearest descriptors of the whole map of every keypoint.
    fn in_forest(&self, pairing: &mut Pairing) {
        let Some(forest) = self.catalogue.forest() else {
            return;
        };
        let open = self.open(pairing);
        let queries: Vec<Descriptor> = open
            .iter()
            .map(|q| self.frame.features.descriptors[q.keypoint])
            .collect();
        let mut nearest = Vec::new();
        forest.two_nearest_batch(&queries, &mut nearest);
        self.take_distinct(&open, &nearest, pairing);
    }

    fn open(&self, pairing: &Pairing) -> Vec<Query> {
        (0..self.frame.ideal.len())
            .filter(|&k| !pairing.used[k])
            .filter_map(|keypoint| {
                Some(Query {
                    keypoint,
                    pixel: self.frame.ideal[keypoint]?,
                })
            })
            .collect()
    }

    /// Keeps the pairs that pass the ratio test and the gate, the nearest keypoint of each landmark.
    fn take_distinct(&self, open: &[Query], nearest: &[Option<TwoNearest>], pairing: &mut Pairing) {
        let ratio_squared = f64::from(self.params.ratio * self.params.ratio);
        let mut best: BTreeMap<u32, (u32, usize)> = BTreeMap::new();
        for (query, nearest) in open.iter().zip(nearest) {
            let Some(nearest) = nearest else { continue };
            let first = nearest.first;
            // A landmark of the whole map may be out of view.
            let Some(predicted) = self.in_view.get(&first.id) else {
                continue;
            };
            let distinct = nearest.second.is_none_or(|second| {
                f64::from(first.distance_squared)
                    < ratio_squared * f64::from(second.distance_squared)
            });
            let gated = self
                .params
                .gate
                .admits(&(query.pixel - predicted.pixel), &predicted.covariance);
            if distinct && gated && !pairing.keypoint_of.contains_key(&first.id) {
                let candidate = (first.distance_squared, query.keypoint);
                best.entry(first.id)
                    .and_modify(|b| *b = (*b).min(candidate))
                    .or_insert(candidate);
            }
        }
        for (id, (_, keypoint)) in best {
            pairing.add(id, keypoint);
        }
    }

    /// Landmarks without a keypoint look into their own gates of at most `radius_limit_px`; the best pairs are
    /// served first.
    fn guided(&self, radius_limit_px: f64, pairing: &mut Pairing) {
        let open: Vec<(u32, &Predicted)> = self
            .in_view
            .iter()
            .filter(|(id, _)| !pairing.keypoint_of.contains_key(id))
            .map(|(id, p)| (*id, p))
            .collect();
        let mut found: Vec<(u32, u32, usize)> = open
            .into_par_iter()
            .filter_map(|(id, predicted)| {
                let (distance_squared, keypoint) =
                    self.look_into_gate(id, predicted, radius_limit_px)?;
                Some((distance_squared, id, keypoint))
            })
            .collect();
        found.sort_unstable();
        for (_, id, keypoint) in found {
            if !pairing.used[keypoint] {
                pairing.add(id, keypoint);
            }
        }
    }

    /// Squared descriptor distance and index of the keypoint that passes the test of the guided search.
    fn look_into_gate(
        &self,
        id: u32,
        predicted: &Predicted,
        radius_limit_px: f64,
    ) -> Option<(u32, usize)> {
        let ratio_squared = f64::from(self.params.guided_ratio * self.params.guided_ratio);
        let entry = self.catalogue.get(id)?;
        let radius = self.params.gate.radius_px(&predicted.covariance);
        if radius > radius_limit_px {
            return None;
        }
        let mut first = (u32::MAX, usize::MAX);
        let mut second = u32::MAX;
        for (k, pixel) in self.frame.nearby.around(predicted.pixel, radius) {
            let innovation = pixel - predicted.pixel;
            if !self.params.gate.admits(&innovation, &predicted.covariance) {
                continue;
            }
            let d = distance_squared(&entry.descriptor, &self.frame.features.descriptors[k]);
            // Of equal distances the lower index wins, in whatever order they come.
            if (d, k) < first {
                second = first.0;
                first = (d, k);
            } else {
                second = second.min(d);
            }
        }
        (first.0 <= self.params.guided_distance_squared
            && f64::from(first.0) < ratio_squared * f64::from(second))
        .then_some(first)
    }
}
