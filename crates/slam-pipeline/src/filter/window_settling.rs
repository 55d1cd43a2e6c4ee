//! The landmarks of a window given its poses (variable projection, Golub and Pereyra 1973).
//!
//! A step of the poses moves the landmarks to first order. Where it is long, they are then off their valley, the cost rises
//! although the poses are better, and an iteration over both creeps along the curved valley of the scale. Solved again for the
//! new poses they follow it, and the adjustment settles in two or three steps.

use mono_geometry::PlacedCamera;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::window_equations::{Node, UNSEEN_COST, Unknowns, WindowProblem};
use super::window_landmarks::Track;
use super::window_sight::Target;

/// Steps of a landmark at given poses.
const STEPS: usize = 6;
/// A landmark has settled when a step gains less than this of the cost.
const SETTLED: f64 = 1e-4;
/// Landmarks that one parallel task takes at least.
const LEAST_TRACKS: usize = 64;

impl WindowProblem<'_> {
    /// Moves every landmark to its best place given the poses. O(sightings) a step.
    pub(crate) fn settle(&self, at: &mut Unknowns) {
        let nodes = self.nodes(&at.poses);
        self.tracks
            .par_iter()
            .zip(&mut at.landmarks)
            .with_min_len(LEAST_TRACKS)
            .for_each(|(track, mean)| {
                let anchor = match track.parametrisation.anchor() {
                    None => None,
                    Some(keyframe) => match self.camera(&nodes, keyframe) {
                        Some((camera, _)) => Some(camera),
                        None => return,
                    },
                };
                self.settle_landmark(track, anchor.as_ref(), &nodes, mean);
            });
    }

    fn settle_landmark(
        &self,
        track: &Track,
        anchor: Option<&PlacedCamera>,
        nodes: &[Node],
        mean: &mut Vector3<f64>,
    ) {
        let Some((mut cost, mut step)) = self.landmark_step(track, anchor, nodes, mean) else {
            return;
        };
        for _ in 0..STEPS {
            let candidate = *mean + step;
            match self.landmark_step(track, anchor, nodes, &candidate) {
                Some((next, further)) if next < cost => {
                    *mean = candidate;
                    let gained = cost - next;
                    (cost, step) = (next, further);
                    if gained < SETTLED {
                        return;
                    }
                }
                _ => step *= 0.25,
            }
        }
    }

    /// The cost of a landmark at `mean` and the Gauss-Newton step from there.
    fn landmark_step(
        &self,
        track: &Track,
        anchor: Option<&PlacedCamera>,
        nodes: &[Node],
        mean: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        let pinhole = self.rig.pinhole();
        let target = Target::new(anchor, mean);
        let mut information = track.prior_information;
        let mut vector = track.prior_vector - track.prior_information * mean;
        let mut cost = mean.dot(&(track.prior_information * mean * 0.5 - track.prior_vector));
        for sighting in &track.sightings {
            let Some(sight) = target.sight(pinhole, &nodes[sighting.step].camera, sighting) else {
                cost += UNSEEN_COST;
                continue;
            };
            cost += sight.cost;
            let weighted = sight.by_landmark * sight.weight;
            information += weighted.tr_mul(&sight.by_landmark);
            vector += weighted.tr_mul(&sight.residual);
        }
        Some((cost, information.cholesky()?.solve(&vector)))
    }
}
