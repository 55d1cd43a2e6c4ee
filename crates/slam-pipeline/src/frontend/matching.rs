//! The search for the keypoint of each landmark.
//!
//! In view: landmarks with a narrow gate take the nearest descriptor in it; the keypoints left take their two nearest
//! among all landmarks in view, by an exact scan with a ratio test (Eq. 21); landmarks still without a keypoint look
//! into their own gates, however wide. In the whole map: the ratio test alone, through a k-d forest (III.B).

use std::collections::BTreeMap;

use feature_kdtree::{
    Descriptor, DescriptorIndex as _, ExactScan, TwoNearest, distance_squared_within,
};
use nalgebra::Vector2;
use rayon::prelude::*;

use super::association::AssociationParams;
use super::catalogue::Catalogue;
use super::frame::FrameFeatures;
use super::prediction::{InView, Predicted};
use crate::method::DescriptorSearch;

/// Gates no wider than this are searched before the descriptors decide, pixels.
const NARROW_GATE_PX: f64 = 12.0;

/// The inputs of a search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Matcher<'a> {
    /// Keypoints of the frame.
    pub(crate) frame: &'a FrameFeatures<'a>,
    /// Where the whole map is searched.
    pub(crate) catalogue: &'a Catalogue,
    /// Landmarks predicted in view.
    pub(crate) in_view: &'a InView<'a>,
    /// Thresholds.
    pub(crate) params: &'a AssociationParams,
}

/// Keypoints found so far: at most one a landmark, and one landmark a keypoint.
#[derive(Debug)]
struct Pairing {
    /// By the landmark's place in view.
    keypoint_of: Vec<Option<usize>>,
    used: Vec<bool>,
}

impl Pairing {
    fn add(&mut self, position: usize, keypoint: usize) {
        self.keypoint_of[position] = Some(keypoint);
        self.used[keypoint] = true;
    }
}

/// A keypoint whose descriptor is still searched.
struct Query {
    keypoint: usize,
    pixel: Vector2<f64>,
}

impl Matcher<'_> {
    /// The landmarks that have a keypoint, by their place in view, with it; in order of the landmarks.
    #[must_use]
    pub(crate) fn keypoints(&self) -> Vec<(usize, usize)> {
        let mut pairing = Pairing {
            keypoint_of: vec![None; self.in_view.len()],
            used: vec![false; self.frame.ideal.len()],
        };
        match self.params.search {
            DescriptorSearch::InView => {
                self.guided(|radius_px| radius_px <= NARROW_GATE_PX, &mut pairing);
                self.in_view(&mut pairing);
                // A narrow gate that was in vain before would be again.
                self.guided(|radius_px| radius_px > NARROW_GATE_PX, &mut pairing);
            }
            DescriptorSearch::WholeMapForest => self.in_forest(&mut pairing),
        }
        let found = pairing.keypoint_of.iter().enumerate();
        found.filter_map(|(i, k)| Some((i, (*k)?))).collect()
    }

    /// The two nearest landmarks in view of every keypoint that is not used yet.
    fn in_view(&self, pairing: &mut Pairing) {
        let landmarks = self.in_view.landmarks().iter();
        let visible: ExactScan = landmarks.map(|(id, p)| (*id, &*p.entry.look)).collect();
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
        let mut best: BTreeMap<usize, (u32, usize)> = BTreeMap::new();
        for (query, nearest) in open.iter().zip(nearest) {
            let Some(nearest) = nearest else { continue };
            let first = nearest.first;
            let distinct = nearest.second.is_none_or(|second| {
                f64::from(first.distance_squared)
                    < ratio_squared * f64::from(second.distance_squared)
            });
            if !distinct {
                continue;
            }
            // A landmark of the whole map may be out of view.
            let Some(position) = self.in_view.position(first.id) else {
                continue;
            };
            let predicted = &self.in_view.landmarks()[position].1;
            let innovation = query.pixel - predicted.pixel;
            let gated = self.params.gate.admits(&innovation, &predicted.covariance);
            if gated && pairing.keypoint_of[position].is_none() {
                let candidate = (first.distance_squared, query.keypoint);
                best.entry(position)
                    .and_modify(|b| *b = (*b).min(candidate))
                    .or_insert(candidate);
            }
        }
        for (position, (_, keypoint)) in best {
            pairing.add(position, keypoint);
        }
    }

    /// Landmarks without a keypoint whose gates have a radius that is `wanted` look into them; the best pairs are
    /// served first.
    fn guided(&self, wanted: impl Fn(f64) -> bool + Sync, pairing: &mut Pairing) {
        let mut found: Vec<(u32, usize, usize)> = self
            .in_view
            .landmarks()
            .par_iter()
            .zip(&pairing.keypoint_of)
            .enumerate()
            .filter(|(_, (_, keypoint))| keypoint.is_none())
            .filter_map(|(position, ((_, predicted), _))| {
                let radius = self.params.gate.radius_px(&predicted.covariance);
                let (distance_squared, keypoint) =
                    wanted(radius).then(|| self.look_into_gate(predicted, radius))??;
                Some((distance_squared, position, keypoint))
            })
            .collect();
        found.sort_unstable();
        for (_, position, keypoint) in found {
            if !pairing.used[keypoint] {
                pairing.add(position, keypoint);
            }
        }
    }

    /// Squared descriptor distance and index of the keypoint that passes the test of the guided search.
    fn look_into_gate(&self, predicted: &Predicted<'_>, radius: f64) -> Option<(u32, usize)> {
        let ratio_squared = f64::from(self.params.guided_ratio * self.params.guided_ratio);
        let most = self.params.guided_distance_squared;
        // A second farther than this cannot refuse a first that is near enough.
        let limit = most.max((f64::from(most) / ratio_squared).ceil() as u32);
        let mut first = (u32::MAX, usize::MAX);
        let mut second = u32::MAX;
        for (k, pixel) in self.frame.nearby.around(predicted.pixel, radius) {
            let innovation = pixel - predicted.pixel;
            if !self.params.gate.admits(&innovation, &predicted.covariance) {
                continue;
            }
            let descriptor = &self.frame.features.descriptors[k];
            let Some(d) =
                distance_squared_within(&predicted.entry.descriptor, descriptor, limit.min(second))
            else {
                continue;
            };
            // Of equal distances the lower index wins, in whatever order they come.
            if (d, k) < first {
                second = first.0;
                first = (d, k);
            } else {
                second = second.min(d);
            }
        }
        (first.0 <= most && f64::from(first.0) < ratio_squared * f64::from(second)).then_some(first)
    }
}
