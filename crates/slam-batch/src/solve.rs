//! The iteration: damped Gauss-Newton over poses and constants, landmarks solved again after every step.
//!
//! 1. Fill the reduced system at the present poses, landmarks and calibration.
//! 2. Solve (S + mu diag S) dx = -g; move; refine every landmark; compare the costs.
//! 3. Accept a step that lowers the cost and damp less, else damp more and try again (Marquardt).
//! 4. Stop when the step promises less than a thousandth of a unit of chi-square, or at the limit.
//!
//! Degenerate: without sightings the answer is dead reckoning; without odometry that moves, the scale is that of the
//! floors, and its sigma says so.

use mono_geometry::Camera;
use mono_geometry::linalg::DenseCholesky;
use nalgebra::{DMatrix, Vector2};
use slam_pipeline::Odometer;

use crate::error::BatchError;
use crate::landmark::{Landmark, Pixels};
use crate::pixel::{Seen, Sensor, View};
use crate::problem::{Problem, Track};
use crate::process_noise::{MotionSquares, NoiseFactors};
use crate::solution::{Fit, Solution};
use crate::state::{Layout, State};
use crate::system::{Beliefs, Motion, System, squares};

/// A step that promises less than this of chi-square is none.
const NO_PROMISE: f64 = 1e-3;
/// Damping at which no step is left to try.
const STUCK: f64 = 1e8;
/// Times the problem is solved again with more process noise, at most.
const WIDENINGS: usize = 3;
/// Inverse depths that no parallax shows stay within this many times that of the nearest landmark.
const OPEN_DEPTHS: f64 = 10.0;

/// Solves a problem.
///
/// Where the residuals of the motions are larger than the stated process noise allows, the noise grows and the problem is solved
/// again, three times at most: see [`Solution::noise`].
///
/// Time of each is that of 10 to 15 iterations of O(sightings x keyframes that share a landmark + unknowns^3 / 6), and of one
/// inverse for the covariance. The answer is the same, bit for bit, on every call.
///
/// # Errors
/// [`BatchError`] for a problem that fails [`Problem::check`], has no landmark seen twice, or whose odometry or rig the
/// geometry refuses. A limit reached is no error: see [`Solution::converged`].
///
/// ```
/// use mono_geometry::{Camera, Distortion, Mount, Pinhole, Se2};
/// use slam_batch::{Keyframe, Model, Problem, Sighting, Track, solve};
/// use slam_pipeline::config::Config;
/// use slam_pipeline::{OdometryInterval, Rig};
/// use nalgebra::Vector3;
///
/// let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 320.0, cy: 240.0 };
/// let rig = Rig { camera: Camera::new(pinhole, Distortion::None)?, mount: Mount::forward() };
/// // Three keyframes, 0.5 m apart by the odometry.
/// let row = OdometryInterval { duration_s: 1.0, v_mps: 0.5, omega_radps: 0.0 };
/// let keyframes = (0..3)
///     .map(|k| Keyframe {
///         start: Se2::new(0.5 * f64::from(k), 0.0, 0.0),
///         motion: (k > 0).then(|| vec![row]),
///     })
///     .collect();
/// // Landmarks ahead, seen from places that the wheels tell a little wrong.
/// let truth = [0.0, 0.51, 0.99];
/// let tracks = (0..20_u32)
///     .map(|landmark| {
///         let i = f64::from(landmark);
///         let point = Vector3::new(4.0 + (2.0 * i).sin(), (3.0 * i).sin(), (5.0 * i).cos());
///         let seen = |(keyframe, x): (usize, &f64)| {
///             let q = Vector3::new(-point.y, -point.z, point.x - x);
///             Sighting { keyframe, pixel: rig.camera.project(&q).expect("in front"), size_px: 1.2 }
///         };
///         Track { landmark, sightings: truth.iter().enumerate().map(seen).collect() }
///     })
///     .collect();
/// let mut config = Config::default();
/// config.odometry.forward_per_sqrt_m = 0.03;
/// let model = Model::of(&config.check()?);
/// let solution = solve(&Problem { rig, keyframes, tracks, model })?;
/// assert!(solution.converged);
/// // The wheels tell the length of the way, the images its middle.
/// let middle = solution.poses[1].pose.x / solution.poses[2].pose.x;
/// assert!((middle - 0.51 / 0.99).abs() < 2e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn solve(problem: &Problem) -> Result<Solution, BatchError> {
    let (mut best, mut squares) = solve_once(problem)?;
    let mut widened = problem.clone();
    for _ in 0..WIDENINGS {
        let factors = squares.factors();
        if factors == NoiseFactors::NOMINAL {
            break;
        }
        widened.model = widened.model.widened(&factors);
        // What was found stands where the wider one is not.
        let Ok((mut next, after)) = solve_once(&widened) else {
            break;
        };
        if best.converged && !next.converged {
            break;
        }
        next.noise = best.noise.then(&factors);
        (best, squares) = (next, after);
    }
    Ok(best)
}

/// The solution with the noise as the model states it, and the squares of the residuals of its motions.
fn solve_once(problem: &Problem) -> Result<(Solution, MotionSquares), BatchError> {
    problem.check()?;
    let layout = Layout::new(problem);
    let motions = motions(problem)?;
    let starts: Vec<usize> = (0..problem.keyframes.len())
        .filter(|k| problem.keyframes[*k].motion.is_none())
        .collect();
    let (mut seen, mut identities) = (Vec::new(), Vec::new());
    for track in &problem.tracks {
        let inside = inside_lens(&problem.rig.camera, track);
        if inside.len() > 1 {
            seen.push(inside);
            identities.push(track.landmark);
        }
    }
    if seen.is_empty() {
        return Err(BatchError::NoTracks);
    }
    let iteration = Iteration {
        problem,
        layout: &layout,
        beliefs: Beliefs {
            model: &problem.model,
            motions: &motions,
            starts: &starts,
        },
        seen,
        identities,
        lever_m: problem.rig.mount.body_from_camera.translation.xy(),
    };
    iteration.run()
}

fn inside_lens(camera: &Camera, track: &Track) -> Vec<Seen> {
    track
        .sightings
        .iter()
        .filter_map(|s| Seen::new(s, camera))
        .collect()
}

fn motions(problem: &Problem) -> Result<Vec<Motion>, BatchError> {
    let mut motions: Vec<Motion> = Vec::new();
    for (to, keyframe) in problem.keyframes.iter().enumerate() {
        let Some(rows) = &keyframe.motion else {
            continue;
        };
        let mut odometer = Odometer::new(&problem.model.odometry);
        for row in rows {
            odometer.push(row)?;
        }
        let first = problem.keyframes[to - 1].motion.is_none();
        motions.push(Motion::new(to, first, rows.clone(), &odometer.control()));
    }
    Ok(motions)
}

struct Iteration<'a> {
    problem: &'a Problem,
    layout: &'a Layout,
    beliefs: Beliefs<'a>,
    /// Sightings of each landmark that has two of them, inside the lens.
    seen: Vec<Vec<Seen>>,
    identities: Vec<u32>,
    lever_m: Vector2<f64>,
}

/// An estimate and its cost.
struct Estimate {
    state: State,
    views: Vec<View>,
    landmarks: Vec<Landmark>,
    /// Twice the costs.
    pixel_cost: f64,
    belief_cost: f64,
}

impl Estimate {
    fn cost(&self) -> f64 {
        0.5 * (self.pixel_cost + self.belief_cost)
    }
}

impl Iteration<'_> {
    fn run(&self) -> Result<(Solution, MotionSquares), BatchError> {
        let mut best = self.first()?;
        let mut system = System::new(self.layout.size);
        let mut damping = 1e-6;
        let (mut iterations, mut converged) = (0, false);
        while iterations < self.problem.model.max_iterations && !converged {
            iterations += 1;
            self.fill(&mut system, &best)?;
            loop {
                let Some(step) = damped_step(&system, damping)? else {
                    damping *= 10.0;
                    if damping > STUCK {
                        converged = false;
                        iterations = self.problem.model.max_iterations;
                        break;
                    }
                    continue;
                };
                let promise: f64 = -step
                    .iter()
                    .zip(&system.gradient)
                    .map(|(s, g)| s * g)
                    .sum::<f64>();
                if promise < NO_PROMISE {
                    converged = true;
                    break;
                }
                if let Some(next) = self.moved(&best, &step)
                    && next.cost() < best.cost()
                {
                    best = next;
                    damping = (damping * 0.1).max(1e-9);
                    break;
                }
                damping = (damping * 10.0).max(1e-5);
                if damping > STUCK {
                    // No step of any length lowers the cost: the bottom to rounding.
                    converged = true;
                    break;
                }
            }
        }
        self.fill(&mut system, &best)?;
        let covariance = inverse(system)?;
        let sightings = self.seen.iter().map(Vec::len).sum();
        let fit = Fit {
            cost: best.cost(),
            pixel_chi_square: best.pixel_cost,
            motion_chi_square: best.belief_cost,
            sightings,
            degrees_of_freedom: (2 * sightings)
                .saturating_sub(3 * best.landmarks.len() + self.layout.size),
        };
        let squares = self
            .beliefs
            .motion_squares(&best.state, self.layout, &self.lever_m);
        let solution = Solution::new(
            self.problem,
            self.layout,
            &best.state,
            self.placed(&best),
            &covariance,
            fit,
            iterations,
            converged,
        );
        Ok((solution, squares))
    }

    fn pixels(&self, state: &State) -> Result<Pixels<'_>, BatchError> {
        let model = &self.problem.model;
        let rho_sigma = OPEN_DEPTHS / model.min_depth_m;
        Ok(Pixels {
            sensor: Sensor::new(&self.problem.rig.camera, &state.constants, model.sigma_px)?,
            loss: &model.loss,
            rho_information: 1.0 / (rho_sigma * rho_sigma),
        })
    }

    fn views(&self, state: &State) -> Vec<View> {
        let rotation = self.problem.rig.mount.body_from_camera.rotation;
        state
            .poses
            .iter()
            .map(|pose| View::new(pose, rotation.matrix()))
            .collect()
    }

    fn first(&self) -> Result<Estimate, BatchError> {
        let state = State::start(self.problem);
        let views = self.views(&state);
        let pixels = self.pixels(&state)?;
        let landmarks = self
            .seen
            .iter()
            .map(|seen| pixels.start(&views, seen))
            .collect();
        Ok(self.settled(state, landmarks, &pixels))
    }

    /// The estimate after a step; `None` after one so far that the camera is none.
    fn moved(&self, from: &Estimate, step: &[f64]) -> Option<Estimate> {
        let state = from.state.moved(self.layout, step);
        let pixels = self.pixels(&state).ok()?;
        Some(self.settled(state, from.landmarks.clone(), &pixels))
    }

    fn settled(&self, state: State, mut landmarks: Vec<Landmark>, pixels: &Pixels<'_>) -> Estimate {
        let views = self.views(&state);
        let pixel_cost = landmarks
            .iter_mut()
            .zip(&self.seen)
            .map(|(landmark, seen)| pixels.settle(landmark, &views, seen))
            .sum();
        let belief_cost = squares(&self.beliefs.residuals(&state, self.layout, &self.lever_m));
        Estimate {
            state,
            views,
            landmarks,
            pixel_cost,
            belief_cost,
        }
    }

    fn fill(&self, system: &mut System, at: &Estimate) -> Result<(), BatchError> {
        let pixels = self.pixels(&at.state)?;
        system.clear();
        for (landmark, seen) in at.landmarks.iter().zip(&self.seen) {
            system.add_landmark(&pixels, self.layout, &at.views, landmark, seen);
        }
        system.add_scalars(
            &self
                .beliefs
                .residuals(&at.state, self.layout, &self.lever_m),
        );
        Ok(())
    }

    /// Identity, anchor and position in the unit of the map of every landmark at a finite distance.
    fn placed(&self, at: &Estimate) -> Vec<(u32, usize, nalgebra::Vector3<f64>)> {
        let farthest = 1e3 / self.problem.model.min_depth_m;
        at.landmarks
            .iter()
            .zip(&self.identities)
            .filter(|(landmark, _)| landmark.parameters.z * farthest > 1.0)
            .map(|(landmark, identity)| {
                let placed = landmark.place(&at.views);
                (
                    *identity,
                    landmark.anchor,
                    placed.origin + placed.direction / placed.rho,
                )
            })
            .collect()
    }
}

/// `None` where the damped matrix is not positive definite.
fn damped_step(system: &System, damping: f64) -> Result<Option<Vec<f64>>, BatchError> {
    let size = system.gradient.len();
    let mut matrix = system.matrix.clone();
    for i in 0..size {
        matrix[(i, i)] *= 1.0 + damping;
    }
    let Ok(factor) = DenseCholesky::new(matrix, &vec![0.0; size]) else {
        return Ok(None);
    };
    let mut step: Vec<f64> = system.gradient.iter().map(|g| -g).collect();
    factor.solve_in_place(&mut step)?;
    Ok(Some(step))
}

fn inverse(system: System) -> Result<DMatrix<f64>, BatchError> {
    let size = system.gradient.len();
    let floor: Vec<f64> = (0..size)
        .map(|i| f64::EPSILON * (system.rounding[i] + size as f64 * system.matrix[(i, i)].abs()))
        .collect();
    Ok(DenseCholesky::new(system.matrix, &floor)?.inverse())
}
