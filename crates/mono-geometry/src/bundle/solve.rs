//! Levenberg-Marquardt for a bundle: damping by gain ratio, robust weights, the landmarks eliminated.
//!
//! Steps of an iteration: solve (H + mu diag(H)) step = -gradient; evaluate the cost there; gain ratio =
//! (decrease of the cost) / (decrease of the quadratic model, step^T (mu diag(H) step - gradient) / 2). A step that
//! lowers the cost is taken, mu *= max(1/3, 1 - (2 gain - 1)^3) and nu = 2; any other is refused, mu *= nu, nu *= 2
//! (Nielsen 1999; Madsen, Nielsen and Tingleff 2004, algorithm 3.16). A step that puts a landmark behind a camera that
//! sees it has no cost and is refused. Re-weighting alone creeps where large residuals pull against each other (a
//! landmark of few sightings, one of them wrong); a step whose gain is above 1.5 is stretched while the cost falls.
//!
//! All sizes are measured free of units by the diagonal of the Hessian: of the gradient max |g_j| / sqrt(h_j), of a
//! step sqrt(sum h_j d_j^2), which is its length in standard deviations each coordinate would have alone.
//!
//! Degenerate: a gauge that is left free does no harm here, the damping holds it; ask [`super::covariance()`] whether it
//! is. Landmarks that their sightings do not fix stay where they are along the open direction; the result lists them.

use nalgebra::{SVector, Vector3};

use super::layout::Layout;
use super::normal::{Estimate, Normal, Whitening, cost};
use super::pose::BundlePose;
use super::problem::Problem;
use super::schur::{InverseRoot, Schur};
use crate::error::{GeometryError, checked};
use crate::robust_loss::RobustLoss;

/// How to minimise, and when to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Loss of the pixels; odometry and priors are always quadratic.
    pub loss: RobustLoss,
    /// Steps tried, taken or refused.
    pub max_iterations: usize,
    /// Stop at a gradient this small, max |g_j| / sqrt(h_j), without unit; at least 0.
    pub gradient_tolerance: f64,
    /// Stop at a decrease of the cost this small, relative to the cost; at least 0.
    pub cost_tolerance: f64,
    /// Stop at a step this short, in conditional standard deviations; at least 0.
    pub step_tolerance: f64,
    /// First damping, relative to the diagonal of the Hessian; above 0.
    pub initial_damping: f64,
}

impl Default for Options {
    /// No robust loss, 100 iterations, gradient 1e-9, cost 1e-11, step 1e-8, damping 1e-7.
    fn default() -> Self {
        Self {
            loss: RobustLoss::None,
            max_iterations: 100,
            gradient_tolerance: 1e-9,
            cost_tolerance: 1e-11,
            step_tolerance: 1e-8,
            initial_damping: 1e-7,
        }
    }
}

/// Damping below this is no damping: one unit in the last place of the diagonal.
const MIN_DAMPING: f64 = f64::EPSILON;

/// At this damping a step is 1e-12 of one along the scaled gradient: no descent is left to find.
const MAX_DAMPING: f64 = 1e12;

/// A short step means convergence only if the damping did not make it short.
const FREE_DAMPING: f64 = 1.0;

/// A gain above 1 says that the robust weights bend the model more than the cost bends; it is 2 where the cost is a
/// straight slope. Then twice the step is tried, and twice that, while the cost falls.
const STRETCH_GAIN: f64 = 1.5;

/// Longest step tried that way, in steps.
const LONGEST_STRETCH: f64 = 256.0;

/// One iteration of the cost curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Cost after the iteration.
    pub cost: f64,
    /// Damping of the step, relative to the diagonal of the Hessian.
    pub damping: f64,
    /// Length of the step, in conditional standard deviations; NaN if the system could not be solved.
    pub step_norm: f64,
    /// Decrease of the cost over that of the model; `None` if there was no cost to compare (system not solved, a landmark
    /// behind a camera, overflow).
    pub gain_ratio: Option<f64>,
    /// Whether the step was taken.
    pub accepted: bool,
}

/// Why the minimisation ended: the measured value and the one it was compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Termination {
    /// The gradient is small enough.
    Gradient {
        /// max |g_j| / sqrt(h_j).
        largest: f64,
        /// The tolerance.
        threshold: f64,
    },
    /// The last step lowered the cost by next to nothing.
    CostChange {
        /// Decrease relative to the cost before.
        relative: f64,
        /// The tolerance.
        threshold: f64,
    },
    /// The step is short enough (it was not taken).
    Step {
        /// Its length, conditional standard deviations.
        length: f64,
        /// The tolerance.
        threshold: f64,
    },
    /// Not settled within the iterations allowed.
    MaxIterations {
        /// Relative decrease of the cost in the last step taken (1 if none was).
        relative: f64,
        /// Iterations made.
        iterations: usize,
    },
    /// No step lowered the cost, however short.
    DampingOverflow {
        /// Damping reached.
        damping: f64,
        /// Largest allowed.
        limit: f64,
    },
}

impl Termination {
    /// Whether a tolerance was met.
    #[must_use]
    pub fn converged(&self) -> bool {
        matches!(
            self,
            Self::Gradient { .. } | Self::CostChange { .. } | Self::Step { .. }
        )
    }
}

/// The minimum found, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Adjustment<P> {
    /// `world_from_body` of every image.
    pub poses: Vec<P>,
    /// Landmarks in the world, metres.
    pub landmarks: Vec<Vector3<f64>>,
    /// Cost of the start: half the sum of rho and of squared whitened errors.
    pub initial_cost: f64,
    /// Cost of the result.
    pub cost: f64,
    /// The cost curve.
    pub iterations: Vec<Iteration>,
    /// Why it ended.
    pub termination: Termination,
    /// Times the cost alone was evaluated.
    pub cost_evaluations: usize,
    /// Times residuals and Jacobians were.
    pub jacobian_evaluations: usize,
    /// Landmarks that their sightings do not fix at the result (seen once, from one place, at infinity, or never).
    pub undetermined_landmarks: Vec<usize>,
}

/// Minimises the cost of a bundle. O(observations D^2 + sum over landmarks of (poses seeing it)^2 D^2 + (D poses)^3) an
/// iteration.
///
/// # Errors
/// As [`Problem::check`]; [`GeometryError::InvalidElement`] with the observation whose landmark is behind its camera at
/// the start; [`GeometryError::InvalidParameter`] for an option out of range or a start whose cost overflows.
pub fn adjust<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
    options: &Options,
) -> Result<Adjustment<P>, GeometryError> {
    problem.check()?;
    options.check()?;
    let layout = Layout::new(problem);
    let whitening = Whitening::new(problem)?;
    let mut normal = Normal::new(&layout);
    let mut schur = Schur::new(&layout);
    let mut current = Estimate::new(problem);
    let mut candidate = current.clone();
    let mut stretched = current.clone();

    let initial_cost = checked(
        "cost of the start",
        cost(problem, &layout, &whitening, &options.loss, &current)?,
        "finite: pixels, landmarks or weights are too large",
        |_| true,
    )?;
    let mut result = Adjustment {
        poses: Vec::new(),
        landmarks: Vec::new(),
        initial_cost,
        cost: initial_cost,
        iterations: Vec::new(),
        termination: Termination::MaxIterations {
            relative: 1.0,
            iterations: options.max_iterations,
        },
        cost_evaluations: 1,
        jacobian_evaluations: 0,
        undetermined_landmarks: Vec::new(),
    };
    let mut damping = options.initial_damping;
    let mut growth = 2.0;
    let mut relative = 1.0;
    let mut stale = true;
    result.termination = loop {
        if stale {
            normal.fill(problem, &layout, &whitening, &options.loss, &current)?;
            result.jacobian_evaluations += 1;
            schur.set_scales(&normal);
            stale = false;
            let largest = largest_gradient(&normal, &schur);
            if largest <= options.gradient_tolerance {
                break Termination::Gradient {
                    largest,
                    threshold: options.gradient_tolerance,
                };
            }
            if result.iterations.last().is_some_and(|i| i.accepted)
                && relative <= options.cost_tolerance
            {
                break Termination::CostChange {
                    relative,
                    threshold: options.cost_tolerance,
                };
            }
        }
        if result.iterations.len() >= options.max_iterations {
            break Termination::MaxIterations {
                relative,
                iterations: result.iterations.len(),
            };
        }
        if damping > MAX_DAMPING {
            break Termination::DampingOverflow {
                damping,
                limit: MAX_DAMPING,
            };
        }
        let solved = schur.step(&layout, &normal, damping).is_ok();
        let model = Model::new(&normal, &schur, damping);
        let usable = solved && model.decrease.is_finite() && model.length.is_finite();
        if usable && model.length <= options.step_tolerance && damping < FREE_DAMPING {
            break Termination::Step {
                length: model.length,
                threshold: options.step_tolerance,
            };
        }
        let mut gain_ratio = None;
        let mut accepted = false;
        if usable {
            candidate.step_from(&current, &layout, &schur, 1.0, problem);
            result.cost_evaluations += 1;
            let tried = cost(problem, &layout, &whitening, &options.loss, &candidate);
            if let Some(next) = tried.ok().filter(|c| c.is_finite()) {
                let gain = (result.cost - next) / model.decrease;
                gain_ratio = Some(gain);
                accepted = next < result.cost && model.decrease > 0.0;
                let mut next = next;
                let mut factor = 2.0;
                while accepted && gain > STRETCH_GAIN && factor <= LONGEST_STRETCH {
                    stretched.step_from(&current, &layout, &schur, factor, problem);
                    result.cost_evaluations += 1;
                    let tried = cost(problem, &layout, &whitening, &options.loss, &stretched);
                    match tried {
                        Ok(lower) if lower < next => {
                            next = lower;
                            std::mem::swap(&mut candidate, &mut stretched);
                            factor *= 2.0;
                        }
                        _ => break,
                    }
                }
                if accepted {
                    relative = (result.cost - next) / result.cost;
                    result.cost = next;
                    std::mem::swap(&mut current, &mut candidate);
                    stale = true;
                    let shrink = 1.0 - (2.0 * gain - 1.0).powi(3);
                    growth = 2.0;
                    result.iterations.push(Iteration {
                        cost: next,
                        damping,
                        step_norm: model.length,
                        gain_ratio,
                        accepted,
                    });
                    damping = (damping * shrink.max(1.0 / 3.0)).max(MIN_DAMPING);
                }
            }
        }
        if !accepted {
            result.iterations.push(Iteration {
                cost: result.cost,
                damping,
                step_norm: if solved { model.length } else { f64::NAN },
                gain_ratio,
                accepted,
            });
            damping *= growth;
            growth *= 2.0;
        }
    };
    result.undetermined_landmarks = (0..normal.v.len())
        .filter(|&l| InverseRoot::new(&normal.v[l]).rank < 3)
        .collect();
    result.poses = current.poses;
    result.landmarks = current.landmarks;
    Ok(result)
}

impl Options {
    fn check(&self) -> Result<(), GeometryError> {
        self.loss.check()?;
        let not_negative = [
            ("gradient tolerance", self.gradient_tolerance),
            ("cost tolerance", self.cost_tolerance),
            ("step tolerance", self.step_tolerance),
        ];
        for (name, value) in not_negative {
            checked(name, value, "finite and not negative", |v| v >= 0.0)?;
        }
        checked(
            "initial damping",
            self.initial_damping,
            "finite and above 0",
            |v| v > 0.0,
        )
        .map(|_| ())
    }
}

impl<P: Copy> Estimate<P> {
    /// This estimate becomes `from` moved by a multiple of the step.
    fn step_from<const D: usize>(
        &mut self,
        from: &Self,
        layout: &Layout,
        schur: &Schur<D>,
        factor: f64,
        problem: &Problem<P, D>,
    ) where
        P: BundlePose<D>,
    {
        for (free, &pose) in layout.free_poses.iter().enumerate() {
            let delta = SVector::<f64, D>::from_column_slice(&schur.pose_step[free * D..][..D]);
            self.poses[pose] = from.poses[pose].retract(&(delta * factor));
        }
        for ((to, point), step) in self
            .landmarks
            .iter_mut()
            .zip(&from.landmarks)
            .zip(&schur.landmark_step)
        {
            *to = point + step * factor;
        }
        self.place(&problem.body_from_camera);
    }
}

/// What the quadratic model says of a step.
struct Model {
    /// step^T (mu diag(H) step - gradient) / 2.
    decrease: f64,
    /// sqrt(step^T diag(H) step).
    length: f64,
}

impl Model {
    fn new<const D: usize>(normal: &Normal<D>, schur: &Schur<D>, damping: f64) -> Self {
        let mut twice = 0.0;
        let mut squared = 0.0;
        for j in 0..schur.pose_step.len() {
            let (d, h) = (schur.pose_step[j], schur.pose_scale[j]);
            twice += d * (damping * h * d - normal.pose_gradient[j]);
            squared += h * d * d;
        }
        for (l, step) in schur.landmark_step.iter().enumerate() {
            let scaled = schur.landmark_scale[l].component_mul(step);
            twice += step.dot(&(scaled * damping - normal.landmark_gradient[l]));
            squared += scaled.dot(step);
        }
        Self {
            decrease: 0.5 * twice,
            length: squared.sqrt(),
        }
    }
}

/// max |g_j| / sqrt(h_j) over all coordinates.
fn largest_gradient<const D: usize>(normal: &Normal<D>, schur: &Schur<D>) -> f64 {
    let poses = normal
        .pose_gradient
        .iter()
        .zip(&schur.pose_scale)
        .map(|(g, h)| g.abs() / h.sqrt());
    let landmarks = normal
        .landmark_gradient
        .iter()
        .zip(&schur.landmark_scale)
        .flat_map(|(g, h)| {
            [0, 1, 2].map(|k| {
                if h[k] > 0.0 {
                    g[k].abs() / h[k].sqrt()
                } else {
                    0.0
                }
            })
        });
    poses.chain(landmarks).fold(0.0, f64::max)
}
