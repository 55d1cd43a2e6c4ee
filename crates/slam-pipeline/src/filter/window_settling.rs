//! The landmarks of a window given its poses (variable projection, Golub and Pereyra 1973).
//!
//! A step of the poses moves the landmarks to first order. Where it is long, they are then off their valley, the cost rises
//! although the poses are better, and an iteration over both creeps along the curved valley of the scale. Solved again for the
//! new poses they follow it, and the adjustment settles in two or three steps.

use mono_geometry::inverse_depth::LandmarkGeometry;
use nalgebra::Vector3;

use super::window_equations::{Node, UNSEEN_COST, Unknowns, WindowProblem};
use super::window_landmarks::Track;

/// Steps of a landmark at given poses.
const STEPS: usize = 6;
/// A landmark has settled when a step gains less than this of the cost.
const SETTLED: f64 = 1e-4;

impl WindowProblem<'_> {
    /// Moves every landmark to its best place given the poses. O(sightings) a step.
    pub(crate) fn settle(&self, at: &mut Unknowns) {
        let Some(nodes) = self.nodes(&at.poses) else {
            return;
        };
        let Unknowns {
            poses, landmarks, ..
        } = at;
        for (track, mean) in self.tracks.iter().zip(landmarks) {
            let anchor = track.parametrisation.anchor();
            let anchor = anchor.map(|keyframe| self.node(poses, keyframe));
            let geometry = match anchor {
                None => LandmarkGeometry::Point,
                Some(Some(node)) => LandmarkGeometry::InverseDepth {
                    anchor: node.camera,
                },
                Some(None) => continue,
            };
            self.settle_landmark(track, &geometry, &nodes, mean);
        }
    }

    fn settle_landmark(
        &self,
        track: &Track,
        geometry: &LandmarkGeometry,
        nodes: &[Node],
        mean: &mut Vector3<f64>,
    ) {
        let Some((mut cost, mut step)) = self.landmark_step(track, geometry, nodes, mean) else {
            return;
        };
        for _ in 0..STEPS {
            let candidate = *mean + step;
            match self.landmark_step(track, geometry, nodes, &candidate) {
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
        geometry: &LandmarkGeometry,
        nodes: &[Node],
        mean: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        let pinhole = self.rig.pinhole();
        let ray = geometry.ray(mean);
        let mut information = track.prior_information;
        let mut vector = track.prior_vector - track.prior_information * mean;
        let mut cost = mean.dot(&(track.prior_information * mean * 0.5 - track.prior_vector));
        for sighting in &track.sightings {
            let camera = &nodes[sighting.step].camera;
            let Some(predicted) = ray.project(pinhole, camera) else {
                cost += UNSEEN_COST;
                continue;
            };
            let whitening = &sighting.whitening;
            let by_landmark = whitening.rows(geometry.parameter_jacobian(pinhole, camera, mean)?);
            let residual = whitening.rows(sighting.pixel - predicted);
            let (weight, part) = sighting.weigh(residual.norm());
            cost += part;
            information += by_landmark.tr_mul(&by_landmark) * weight;
            vector += by_landmark.tr_mul(&residual) * weight;
        }
        Some((cost, information.cholesky()?.solve(&vector)))
    }
}
