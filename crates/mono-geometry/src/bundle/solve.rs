//! Levenberg-Marquardt for a bundle: damping by gain ratio, robust weights, the landmarks eliminated.
//!
//! The iteration is that of the crate's Levenberg-Marquardt driver, the damping relative to diag(H). A landmark that a step
//! would put behind a camera that sees it is carried along with one of its cameras instead, lest one of thousands hold
//! all others up; a step without a cost even so is refused. Re-weighting alone creeps where large residuals pull against each other (a
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
use crate::camera::Camera;
use crate::error::{GeometryError, checked};
use crate::least_squares::{self, Control, Iteration, Model, Taken, Termination, Trial, minimise};
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

/// A short step means convergence only if the damping did not make it short.
const FREE_DAMPING: f64 = 1.0;

/// A gain above 1 says that the robust weights bend the model more than the cost bends; it is 2 where the cost is a
/// straight slope. Then twice the step is tried, and twice that, while the cost falls.
const STRETCH_GAIN: f64 = 1.5;

/// Longest step tried that way, in steps.
const LONGEST_STRETCH: f64 = 256.0;

/// The minimum found, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Adjustment<P> {
    /// `world_from_body` of every image.
    pub poses: Vec<P>,
    /// Landmarks in the world, metres.
    pub landmarks: Vec<Vector3<f64>>,
    /// The camera, where [`Problem::intrinsics`] left any of it free.
    pub camera: Option<Camera>,
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
    let current = Estimate::new(problem);
    let initial_cost = checked(
        "cost of the start",
        cost(problem, &layout, &whitening, &options.loss, &current)?,
        "finite: pixels, landmarks or weights are too large",
        |_| true,
    )?;
    let mut bundle = Bundle {
        problem,
        options,
        normal: Normal::new(&layout),
        schur: Schur::new(&layout),
        layout,
        whitening,
        candidate: current.clone(),
        stretched: current.clone(),
        current,
        cost: initial_cost,
        candidate_cost: initial_cost,
        iterations: Vec::new(),
        cost_evaluations: 1,
        jacobian_evaluations: 0,
    };
    bundle.linearise()?;
    let control = Control {
        damping: options.initial_damping,
        first_damping: options.initial_damping,
        max_iterations: options.max_iterations,
    };
    let (termination, _) = minimise(&mut bundle, &control)?;
    let v = &bundle.normal.v;
    Ok(Adjustment {
        undetermined_landmarks: (0..v.len())
            .filter(|&l| InverseRoot::new(&v[l]).rank < 3)
            .collect(),
        poses: bundle.current.poses,
        landmarks: bundle.current.landmarks,
        camera: bundle.current.camera,
        initial_cost,
        cost: bundle.cost,
        iterations: bundle.iterations,
        termination,
        cost_evaluations: bundle.cost_evaluations,
        jacobian_evaluations: bundle.jacobian_evaluations,
    })
}

/// The bundle at its current estimate, and buffers for the next.
struct Bundle<'a, P, const D: usize> {
    problem: &'a Problem<P, D>,
    options: &'a Options,
    layout: Layout,
    whitening: Whitening<D>,
    normal: Normal<D>,
    schur: Schur<D>,
    current: Estimate<P>,
    candidate: Estimate<P>,
    stretched: Estimate<P>,
    cost: f64,
    candidate_cost: f64,
    iterations: Vec<Iteration>,
    cost_evaluations: usize,
    jacobian_evaluations: usize,
}

impl<P: BundlePose<D>, const D: usize> Bundle<'_, P, D> {
    /// Fills the normal equations at the current estimate.
    fn linearise(&mut self) -> Result<(), GeometryError> {
        self.jacobian_evaluations += 1;
        self.normal.fill(
            self.problem,
            &self.layout,
            &self.whitening,
            &self.options.loss,
            &self.current,
        )?;
        self.schur.set_scales(&self.normal);
        Ok(())
    }

    fn cost_of(&self, estimate: &Estimate<P>) -> Option<f64> {
        let Self {
            problem,
            layout,
            whitening,
            options,
            ..
        } = self;
        cost(problem, layout, whitening, &options.loss, estimate)
            .ok()
            .filter(|c| c.is_finite())
    }
}

impl<P: BundlePose<D>, const D: usize> least_squares::Problem for Bundle<'_, P, D> {
    type Error = GeometryError;

    fn cost(&self) -> f64 {
        self.cost
    }

    fn solve(&mut self, damping: f64) -> Result<Option<Model>, GeometryError> {
        let solved = self.schur.step(&self.layout, &self.normal, damping);
        Ok(solved
            .is_ok()
            .then(|| model(&self.normal, &self.schur, damping)))
    }

    fn evaluate(&mut self, model: &Model) -> Option<Trial> {
        let (layout, schur, problem) = (&self.layout, &self.schur, self.problem);
        self.candidate
            .step_from(&self.current, layout, schur, 1.0, problem)?;
        self.cost_evaluations += 1;
        let unit_cost = match self.cost_of(&self.candidate) {
            Some(cost) => cost,
            None => {
                // One landmark of thousands must not cost the step.
                self.candidate.bring_to_front(&self.current, &self.layout);
                self.cost_evaluations += 1;
                self.cost_of(&self.candidate)?
            }
        };
        let mut cost = unit_cost;
        let gain = (self.cost - cost) / model.decrease;
        let mut factor = 2.0;
        while cost < self.cost && gain > STRETCH_GAIN && factor <= LONGEST_STRETCH {
            let (layout, schur) = (&self.layout, &self.schur);
            let moved = self
                .stretched
                .step_from(&self.current, layout, schur, factor, problem);
            self.cost_evaluations += 1;
            let lower = moved.and_then(|()| self.cost_of(&self.stretched));
            let Some(lower) = lower.filter(|lower| *lower < cost) else {
                break;
            };
            cost = lower;
            std::mem::swap(&mut self.candidate, &mut self.stretched);
            factor *= 2.0;
        }
        self.candidate_cost = cost;
        Some(Trial { cost, unit_cost })
    }

    fn accept(&mut self) -> Result<(), GeometryError> {
        std::mem::swap(&mut self.current, &mut self.candidate);
        self.cost = self.candidate_cost;
        self.linearise()
    }

    fn at_estimate(&self, last: Option<Taken>) -> Option<Termination> {
        let largest = largest_gradient(&self.normal, &self.schur);
        if largest <= self.options.gradient_tolerance {
            return Some(Termination::Gradient {
                largest,
                threshold: self.options.gradient_tolerance,
            });
        }
        let relative = last?.relative;
        (relative <= self.options.cost_tolerance).then_some(Termination::CostChange {
            relative,
            threshold: self.options.cost_tolerance,
        })
    }

    fn before_step(&self, model: &Model, damping: f64) -> Option<Termination> {
        (model.length <= self.options.step_tolerance && damping < FREE_DAMPING).then_some(
            Termination::Step {
                length: model.length,
                threshold: self.options.step_tolerance,
            },
        )
    }

    fn record(&mut self, iteration: Iteration) {
        self.iterations.push(iteration);
    }
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
    /// This estimate becomes `from` moved by a multiple of the step; `None` where no camera has the moved parameters.
    fn step_from<const D: usize>(
        &mut self,
        from: &Self,
        layout: &Layout,
        schur: &Schur<D>,
        factor: f64,
        problem: &Problem<P, D>,
    ) -> Option<()>
    where
        P: BundlePose<D>,
    {
        if let (Some(camera), Some(intrinsics)) = (&from.camera, problem.unknown_camera()) {
            self.camera = Some(intrinsics.moved(camera, &schur.camera_step, factor)?);
        }
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
        Some(())
    }
}

/// The quadratic model: decrease step^T (mu diag(H) step - gradient) / 2, length sqrt(step^T diag(H) step).
fn model<const D: usize>(normal: &Normal<D>, schur: &Schur<D>, damping: f64) -> Model {
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
    for (k, &d) in schur.camera_step.iter().enumerate() {
        let h = schur.camera_scale[k];
        twice += d * (damping * h * d - normal.border.gradient[k]);
        squared += h * d * d;
    }
    Model {
        decrease: 0.5 * twice,
        length: squared.sqrt(),
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
    let camera = normal
        .border
        .gradient
        .iter()
        .zip(&schur.camera_scale)
        .map(|(g, h)| g.abs() / h.sqrt());
    poses.chain(landmarks).chain(camera).fold(0.0, f64::max)
}
