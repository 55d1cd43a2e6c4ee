//! Landmarks given the poses: solved again after every step of the poses (variable projection, Golub and Pereyra 1973).
//!
//! A landmark stays in the axes of its anchor camera, so it follows a step of the poses before it is refined. Without
//! the second step the iteration would move along the curved valley of the scale in steps as short as its bend.

use mono_geometry::RobustLoss;
use nalgebra::{Matrix3, Vector2, Vector3};

use crate::pixel::{BEHIND_SIGMAS, Seen, Sensor, View};

/// Direction (u, v) and inverse depth rho in the anchor camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Landmark {
    /// Keyframe of its anchor.
    pub(crate) anchor: usize,
    /// (u, v, rho).
    pub(crate) parameters: Vector3<f64>,
}

/// A landmark in world axes: X = origin + direction / rho.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    /// Centre of the anchor.
    pub(crate) origin: Vector3<f64>,
    /// (u, v, 1) in world axes.
    pub(crate) direction: Vector3<f64>,
    /// Inverse depth.
    pub(crate) rho: f64,
    /// Rotation from anchor to world axes; its first two columns are d direction / d (u, v).
    pub(crate) world_from_anchor: Matrix3<f64>,
}

impl Landmark {
    pub(crate) fn place(&self, views: &[View]) -> Placed {
        let anchor = &views[self.anchor];
        let world_from_anchor = anchor.camera_from_world.transpose();
        let [u, v, rho] = self.parameters.into();
        Placed {
            origin: anchor.centre,
            direction: world_from_anchor * Vector3::new(u, v, 1.0),
            rho,
            world_from_anchor,
        }
    }
}

impl Placed {
    /// q in the axes of `view`.
    pub(crate) fn in_view(&self, view: &View) -> Vector3<f64> {
        view.camera_from_world * (self.direction + (self.origin - view.centre) * self.rho)
    }

    /// dq / d(u, v, rho).
    pub(crate) fn in_view_by_parameters(&self, view: &View) -> Matrix3<f64> {
        let mut by = view.camera_from_world * self.world_from_anchor;
        by.set_column(2, &(view.camera_from_world * (self.origin - view.centre)));
        by
    }
}

/// The measuring side of the landmarks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pixels<'a> {
    pub(crate) sensor: Sensor,
    pub(crate) loss: &'a RobustLoss,
    /// Information that keeps rho in place where no parallax does.
    pub(crate) rho_information: f64,
}

/// Squared residuals (sigmas) above which a landmark is sought elsewhere, a sighting.
const BAD_FIT: f64 = 9.0;
/// Inverse depths at which it is sought, shares of the sigma of an inverse depth that no parallax shows.
const LADDER: [f64; 4] = [0.0, 0.01, 0.03, 0.1];
/// Steps of a landmark at most.
const STEPS: usize = 8;
/// A step shorter than this many standard deviations ends the refinement.
const SHORT: f64 = 1e-3;

impl Pixels<'_> {
    /// The landmark at the pixel of its first sighting, at the inverse depth that the others show on their epipolar
    /// lines (linear least squares), not refined. Sightings must not be empty.
    pub(crate) fn start(&self, views: &[View], seen: &[Seen]) -> Landmark {
        let direction = seen[0].direction;
        let mut landmark = Landmark {
            anchor: seen[0].keyframe,
            parameters: Vector3::new(direction.x, direction.y, 0.0),
        };
        let placed = landmark.place(views);
        let (mut information, mut vector) = (0.0, 0.0);
        for s in &seen[1..] {
            let view = &views[s.keyframe];
            let at_infinity = placed.in_view(view);
            let by_rho = view.camera_from_world * (placed.origin - view.centre);
            let n = s.direction;
            if at_infinity.z < 0.05 {
                continue;
            }
            for (axis, n) in [(0, n.x), (1, n.y)] {
                let slope = by_rho[axis] - n * by_rho.z;
                let residual = at_infinity[axis] - n * at_infinity.z;
                information += slope * slope;
                vector -= slope * residual;
            }
        }
        if information > 0.0 {
            landmark.parameters.z = (vector / information).max(0.0);
        }
        landmark
    }

    /// The landmark of least cost for these poses, near where it is; one that fits badly is also sought from its start
    /// and from a ladder of depths, because a path that has bent can leave it in a valley of its own. Returns twice
    /// the cost.
    pub(crate) fn settle(&self, landmark: &mut Landmark, views: &[View], seen: &[Seen]) -> f64 {
        let mut cost = self.refine(landmark, views, seen);
        if seen.is_empty() || cost < BAD_FIT * seen.len() as f64 {
            return cost;
        }
        let start = self.start(views, seen);
        let near = self.rho_information.sqrt().recip();
        let ladder = LADDER.map(|share| share * near);
        for rho in core::iter::once(start.parameters.z).chain(ladder) {
            let mut candidate = start;
            candidate.parameters.z = rho;
            let new = self.refine(&mut candidate, views, seen);
            if new < cost {
                *landmark = candidate;
                cost = new;
            }
        }
        cost
    }

    /// Twice the cost of the sightings of a landmark.
    pub(crate) fn cost(&self, landmark: &Landmark, views: &[View], seen: &[Seen]) -> f64 {
        let placed = landmark.place(views);
        seen.iter()
            .map(|s| {
                let q = placed.in_view(&views[s.keyframe]);
                self.rho(self.sensor.residual(s, &q))
            })
            .sum()
    }

    fn rho(&self, residual: Option<Vector2<f64>>) -> f64 {
        let squared = residual.map_or(f64::INFINITY, |r| r.norm_squared());
        self.loss.at(squared.min(BEHIND_SIGMAS * BEHIND_SIGMAS)).rho
    }

    /// Moves the landmark to the least cost near it; returns twice that cost. O(sightings) a step.
    fn refine(&self, landmark: &mut Landmark, views: &[View], seen: &[Seen]) -> f64 {
        let mut cost = self.cost(landmark, views, seen);
        let mut damping = 1e-6;
        for _ in 0..STEPS {
            let placed = landmark.place(views);
            let mut hessian = Matrix3::zeros();
            let mut gradient = Vector3::zeros();
            for s in seen {
                let view = &views[s.keyframe];
                let q = placed.in_view(view);
                let Some((residual, by_point)) = self.sensor.linearise(s, &q) else {
                    continue;
                };
                let squared = residual.norm_squared();
                if squared > BEHIND_SIGMAS * BEHIND_SIGMAS {
                    continue;
                }
                let weight = self.loss.at(squared).weight;
                let by = by_point * placed.in_view_by_parameters(view);
                hessian += by.tr_mul(&by) * weight;
                gradient += by.tr_mul(&residual) * weight;
            }
            hessian[(2, 2)] += self.rho_information;
            let mut done = true;
            for _ in 0..6 {
                let mut damped = hessian;
                for i in 0..3 {
                    damped[(i, i)] *= 1.0 + damping;
                }
                let Some(factor) = damped.cholesky() else {
                    damping *= 10.0;
                    continue;
                };
                let step = -factor.solve(&gradient);
                let candidate = Landmark {
                    parameters: landmark.parameters + step,
                    ..*landmark
                };
                let new = self.cost(&candidate, views, seen);
                if new <= cost {
                    *landmark = candidate;
                    cost = new;
                    damping = (damping * 0.1).max(1e-9);
                    done = -gradient.dot(&step) < SHORT * SHORT;
                    break;
                }
                damping = (damping * 10.0).max(1e-4);
            }
            if done {
                break;
            }
        }
        cost
    }
}
