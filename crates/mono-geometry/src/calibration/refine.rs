//! Full refinement (Zhang 2000, section 3.2 and Eq. 14): Levenberg-Marquardt over the camera and the pose of every
//! view.
//!
//! Minimise sum rho(|pixel - project(camera, pose_v X)|^2 / sigma^2) / 2 over the p <= 12 free parameters of the camera
//! and 6 of every pose, pose * exp(delta). A pose touches the corners of its own view only, so the normal equations are
//! an arrow: with U = sum Jc^T Jc, W_v = Jc^T Jp, V_v = Jp^T Jp the poses are eliminated view by view,
//!
//! (U - sum W_v V_v^-1 W_v^T) dc = g_c - sum W_v V_v^-1 g_v, then dp_v = V_v^-1 (g_v - W_v^T dc).
//!
//! Cost O(corners (p + 6)^2 + views p^2 6 + p^3) a step; nothing grows with the square of the views. The damping is
//! Marquardt's, on the diagonal, so the units of the parameters do not matter. A step that puts a corner behind the
//! camera or past the fold of the lens is refused.
//!
//! Degenerate: directions that no corner sees have a singular reduced matrix; the damping holds them where they
//! started.

use std::convert::Infallible;

use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, SVector, Vector6};

use super::start::UsableView;
use crate::camera::{Camera, MAX_PARAMETERS};
use crate::least_squares::{Control, Model, Problem, Taken, Termination, Trial, minimise};
use crate::linalg::cholesky;
use crate::robust_loss::RobustLoss;
use crate::se3::Se3;

/// Share of the cost below which a decrease counts as none: a step of about 1e-7 sqrt(2 n) standard deviations.
const DECREASE_TOLERANCE: f64 = 1e-14;
/// The same when the cost no longer falls: its own rounding errors, over thousands of terms.
const ROUNDING_TOLERANCE: f64 = 1e-11;
/// Pixels of noise-free corners are right to a few of these times their size.
const EXACT_ULPS: f64 = 8.0;
/// Damping of the first step, relative to the diagonal.
const FIRST_DAMPING: f64 = 1e-4;
/// A small decrease means convergence only if the damping did not make it small.
const FREE_DAMPING: f64 = 1e-3;

/// Free parameters of the camera, the 6 of a pose, the residual.
const COLUMNS: usize = MAX_PARAMETERS + 7;
type Cross = SMatrix<f64, MAX_PARAMETERS, 6>;

/// The refined camera and poses.
pub(super) struct Refined {
    pub(super) camera: Camera,
    pub(super) poses: Vec<Se3>,
    pub(super) cost_curve: Vec<f64>,
    pub(super) termination: Termination,
}

/// Refines the first `free` parameters of the camera and all poses.
pub(super) fn refine(
    views: &[UsableView<'_>],
    free: usize,
    loss: RobustLoss,
    max_iterations: usize,
    camera: Camera,
    poses: Vec<Se3>,
) -> Refined {
    let Some(system) = System::build(views, free, loss, &camera, &poses) else {
        return Refined {
            camera,
            poses,
            cost_curve: Vec::new(),
            termination: Termination::IterationLimit {
                iterations: 0,
                relative: 1.0,
            },
        };
    };
    let mut arrow = Arrow {
        views,
        free,
        loss,
        camera,
        poses,
        cost_curve: vec![system.cost],
        system,
        step: None,
        candidate: None,
        rounding: rounding_cost(views),
    };
    let control = Control {
        damping: FIRST_DAMPING,
        first_damping: FIRST_DAMPING,
        max_iterations,
    };
    let Ok((termination, _)) = minimise(&mut arrow, &control);
    Refined {
        camera: arrow.camera,
        poses: arrow.poses,
        cost_curve: arrow.cost_curve,
        termination,
    }
}

/// Camera and poses being refined.
struct Arrow<'a> {
    views: &'a [UsableView<'a>],
    free: usize,
    loss: RobustLoss,
    camera: Camera,
    poses: Vec<Se3>,
    system: System,
    step: Option<Step>,
    candidate: Option<(Camera, Vec<Se3>, System)>,
    cost_curve: Vec<f64>,
    /// Cost of rounding errors alone.
    rounding: f64,
}

impl Problem for Arrow<'_> {
    type Error = Infallible;

    fn cost(&self) -> f64 {
        self.system.cost
    }

    fn solve(&mut self, damping: f64) -> Result<Option<Model>, Infallible> {
        self.step = self.system.solve(self.free, damping);
        Ok(self.step.as_ref().map(|step| Model {
            decrease: step.predicted_decrease,
            length: step.camera.norm(),
        }))
    }

    fn evaluate(&mut self, _model: &Model) -> Option<Trial> {
        let step = self.step.as_ref()?;
        let mut parameters = self.camera.parameters();
        for k in 0..self.free {
            parameters[k] += step.camera[k];
        }
        // A focal length that is no longer positive makes no camera: the step was too long.
        let camera = self.camera.with_parameters(parameters.as_slice()).ok()?;
        let poses: Vec<Se3> = self
            .poses
            .iter()
            .zip(&step.poses)
            .map(|(pose, delta)| pose.compose(&Se3::exp(delta)))
            .collect();
        let system = System::build(self.views, self.free, self.loss, &camera, &poses)?;
        let trial = Trial::new(system.cost);
        self.candidate = Some((camera, poses, system));
        Some(trial)
    }

    fn accept(&mut self) -> Result<(), Infallible> {
        if let Some((camera, poses, system)) = self.candidate.take() {
            self.cost_curve.push(system.cost);
            (self.camera, self.poses, self.system) = (camera, poses, system);
        }
        Ok(())
    }

    fn at_estimate(&self, _last: Option<Taken>) -> Option<Termination> {
        (self.system.cost <= self.rounding).then_some(Termination::Exact {
            cost: self.system.cost,
            threshold: self.rounding,
        })
    }

    fn before_step(&self, model: &Model, damping: f64) -> Option<Termination> {
        self.settled(model, DECREASE_TOLERANCE * self.system.cost)
            .filter(|_| damping <= FREE_DAMPING)
    }

    fn after_refusal(&self, model: &Model) -> Option<Termination> {
        self.settled(model, ROUNDING_TOLERANCE * self.system.cost + self.rounding)
    }
}

impl Arrow<'_> {
    fn settled(&self, model: &Model, threshold: f64) -> Option<Termination> {
        (model.decrease <= threshold).then_some(Termination::PredictedDecrease {
            decrease: model.decrease,
            threshold,
        })
    }
}

/// Cost of corners that are wrong by rounding alone.
fn rounding_cost(views: &[UsableView<'_>]) -> f64 {
    let corners = views.iter().flat_map(|v| &v.view.corners);
    corners
        .map(|c| (EXACT_ULPS * f64::EPSILON * c.pixel.amax().max(1.0) / c.sigma_px).powi(2))
        .sum()
}

struct Step {
    camera: DVector<f64>,
    poses: Vec<Vector6<f64>>,
    /// Decrease of the cost that the quadratic model promises.
    predicted_decrease: f64,
}

struct ViewBlock {
    /// Jc^T Jp.
    cross: Cross,
    /// Jp^T Jp.
    pose: Matrix6<f64>,
    /// Jp^T r.
    gradient: Vector6<f64>,
}

/// The arrow of normal equations.
struct System {
    camera: SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS>,
    gradient: SVector<f64, MAX_PARAMETERS>,
    views: Vec<ViewBlock>,
    cost: f64,
}

impl System {
    /// `None` if a corner does not project.
    fn build(
        views: &[UsableView<'_>],
        free: usize,
        loss: RobustLoss,
        camera: &Camera,
        poses: &[Se3],
    ) -> Option<Self> {
        let mut system = Self {
            camera: SMatrix::zeros(),
            gradient: SVector::zeros(),
            views: Vec::with_capacity(views.len()),
            cost: 0.0,
        };
        let used = free + 7;
        for (view, pose) in views.iter().zip(poses) {
            // Lower triangle of [Jc Jp r]^T [Jc Jp r].
            let mut product = [[0.0_f64; COLUMNS]; COLUMNS];
            for corner in &view.view.corners {
                let point = corner.board_m.push(0.0);
                let (pixel, by_point, by_parameters) =
                    camera.project_with_jacobians(&pose.transform_point(&point))?;
                let by_pose = by_point * pose.point_jacobian(&point);
                let error = (corner.pixel - pixel) / corner.sigma_px;
                let at = loss.at(error.norm_squared());
                system.cost += 0.5 * at.rho;
                let root = at.weight.sqrt();
                let scale = root / corner.sigma_px;
                for axis in 0..2 {
                    let mut row = [0.0_f64; COLUMNS];
                    for k in 0..free {
                        row[k] = by_parameters[(axis, k)] * scale;
                    }
                    for k in 0..6 {
                        row[free + k] = by_pose[(axis, k)] * scale;
                    }
                    row[free + 6] = error[axis] * root;
                    for i in 0..used {
                        let factor = row[i];
                        for (sum, value) in product[i][..=i].iter_mut().zip(&row) {
                            *sum += factor * value;
                        }
                    }
                }
            }
            for i in 0..free {
                for j in 0..=i {
                    system.camera[(i, j)] += product[i][j];
                }
                system.gradient[i] += product[free + 6][i];
            }
            system.views.push(ViewBlock {
                cross: Cross::from_fn(|i, j| if i < free { product[free + j][i] } else { 0.0 }),
                pose: Matrix6::from_fn(|i, j| product[free + i.max(j)][free + i.min(j)]),
                gradient: Vector6::from_fn(|i, _| product[free + 6][free + i]),
            });
        }
        system.camera.fill_upper_triangle_with_lower_triangle();
        system.cost.is_finite().then_some(system)
    }

    /// The damped step; `None` if the reduced matrix is not positive definite.
    fn solve(&self, free: usize, damping: f64) -> Option<Step> {
        let damp = 1.0 + damping;
        let mut reduced = self.camera;
        let mut right = self.gradient;
        for k in 0..free {
            reduced[(k, k)] *= damp;
        }
        let mut factors = Vec::with_capacity(self.views.len());
        for view in &self.views {
            let mut pose = view.pose;
            for k in 0..6 {
                pose[(k, k)] *= damp;
            }
            let factor = cholesky(&pose).ok()?;
            let eliminated = factor.solve(&view.cross.transpose());
            reduced -= view.cross * eliminated;
            right -= view.cross * factor.solve(&view.gradient);
            factors.push(factor);
        }
        let matrix = DMatrix::from_fn(free, free, |i, j| 0.5 * (reduced[(i, j)] + reduced[(j, i)]));
        let rhs = DVector::from_fn(free, |i, _| right[i]);
        let solution = matrix.cholesky()?.solve(&rhs);
        let mut camera = SVector::<f64, MAX_PARAMETERS>::zeros();
        camera.rows_mut(0, free).copy_from(&solution);
        let mut decrease = camera.dot(&self.gradient)
            + damping
                * (0..free)
                    .map(|k| self.camera[(k, k)] * camera[k] * camera[k])
                    .sum::<f64>();
        let mut poses = Vec::with_capacity(self.views.len());
        for (view, factor) in self.views.iter().zip(&factors) {
            let delta = factor.solve(&(view.gradient - view.cross.transpose() * camera));
            decrease += delta.dot(&view.gradient);
            for k in 0..6 {
                decrease += damping * view.pose[(k, k)] * delta[k] * delta[k];
            }
            poses.push(delta);
        }
        // The model: g^T d - d^T A d / 2 with (A + damping D) d = g, hence (g^T d + damping d^T D d) / 2.
        let finite = solution.iter().all(|v| v.is_finite()) && decrease.is_finite();
        finite.then_some(Step {
            camera: solution,
            poses,
            predicted_decrease: 0.5 * decrease,
        })
    }
}
