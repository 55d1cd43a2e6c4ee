//! Three parameters of a point from its sightings: Gauss-Newton on the reprojection error, with covariance.
//!
//! The step that triangulation and inverse depth share: with the whitened Jacobian J of all pixels by the three parameters and the
//! residuals r, the step solves (J^T J) step = J^T r; a step that would raise the error, or put the point behind a
//! camera, is damped (see [`crate::least_squares`]). The length of a step is measured in standard deviations of the
//! estimate, sqrt(step^T J^T J step), so one tolerance serves near and far points. At the minimum (J^T J)^-1 is the
//! covariance.
//!
//! Degenerate: sightings that do not fix the parameters make J^T J singular; the caller says which rejection that is.

use nalgebra::{Matrix3, Vector3};

use crate::least_squares::{Control, Model, Problem, Termination, Trial, minimise};
use crate::linalg::{self, cholesky};
use crate::triangulation::Rejection;

/// A step this short, in standard deviations of the estimate, changes nothing that matters.
pub(crate) const STEP_TOLERANCE_SIGMAS: f64 = 1e-6;

/// Damping after the first refused step.
const FIRST_DAMPING: f64 = 1e-3;

/// A sum that grows by less than this share is taken to have stayed: rounding.
const ROUNDING: f64 = 1e-12;

/// Normal equations of the reprojection error at one estimate.
pub(crate) struct NormalEquations {
    pub(crate) information: Matrix3<f64>,
    /// J^T r, with r = observed - predicted: the step solves information * step = gradient.
    pub(crate) gradient: Vector3<f64>,
    pub(crate) chi_square: f64,
}

/// The minimum of the reprojection error.
pub(crate) struct Minimum {
    pub(crate) parameters: Vector3<f64>,
    pub(crate) covariance: Matrix3<f64>,
    pub(crate) chi_square: f64,
    pub(crate) iterations: usize,
}

/// Iterates from `start` until the step is below [`STEP_TOLERANCE_SIGMAS`]. O(views) per step.
///
/// # Errors
/// That of `normal_at` at the start, `singular` where the parameters are not fixed, [`Rejection::NotConverged`].
pub(crate) fn three_parameters<N, S>(
    start: &Vector3<f64>,
    normal_at: N,
    singular: S,
    max_iterations: usize,
) -> Result<Minimum, Rejection>
where
    N: Fn(&Vector3<f64>) -> Result<NormalEquations, Rejection>,
    S: Fn(&Vector3<f64>) -> Rejection,
{
    let mut sightings = Sightings {
        parameters: *start,
        normal: normal_at(start)?,
        step: Vector3::zeros(),
        step_sigmas: f64::INFINITY,
        candidate: None,
        normal_at,
        singular,
    };
    let control = Control {
        damping: 0.0,
        first_damping: FIRST_DAMPING,
        max_iterations,
    };
    let (termination, iterations) = minimise(&mut sightings, &control)?;
    let Sightings {
        parameters, normal, ..
    } = &sightings;
    if !termination.converged() {
        return Err(Rejection::NotConverged {
            iterations,
            step_sigmas: sightings.step_sigmas,
            required_sigmas: STEP_TOLERANCE_SIGMAS,
        });
    }
    let covariance = cholesky(&normal.information)
        .and_then(|factor| linalg::covariance(&factor))
        .map_err(|_singular| (sightings.singular)(parameters))?;
    Ok(Minimum {
        parameters: *parameters,
        covariance,
        chi_square: normal.chi_square,
        iterations,
    })
}

struct Sightings<N, S> {
    parameters: Vector3<f64>,
    normal: NormalEquations,
    step: Vector3<f64>,
    /// Length of the undamped step, in standard deviations.
    step_sigmas: f64,
    candidate: Option<(Vector3<f64>, NormalEquations)>,
    normal_at: N,
    singular: S,
}

impl<N, S> Problem for Sightings<N, S>
where
    N: Fn(&Vector3<f64>) -> Result<NormalEquations, Rejection>,
    S: Fn(&Vector3<f64>) -> Rejection,
{
    type Error = Rejection;

    fn cost(&self) -> f64 {
        self.normal.chi_square
    }

    fn solve(&mut self, damping: f64) -> Result<Option<Model>, Rejection> {
        let NormalEquations {
            information,
            gradient,
            ..
        } = &self.normal;
        let factor =
            cholesky(information).map_err(|_singular| (self.singular)(&self.parameters))?;
        self.step = factor.solve(gradient);
        self.step_sigmas = self.step.dot(gradient).max(0.0).sqrt();
        if damping > 0.0 {
            let mut damped = *information;
            for k in 0..3 {
                damped[(k, k)] *= 1.0 + damping;
            }
            let Ok(factor) = cholesky(&damped) else {
                return Ok(None);
            };
            self.step = factor.solve(gradient);
        }
        // chi-square is twice the cost of the model.
        let scaled = information.diagonal().component_mul(&self.step);
        Ok(Some(Model {
            decrease: self.step.dot(gradient) + damping * scaled.dot(&self.step),
            length: self.step_sigmas,
        }))
    }

    fn evaluate(&mut self, _model: &Model) -> Option<Trial> {
        let parameters = self.parameters + self.step;
        let normal = (self.normal_at)(&parameters).ok()?;
        let trial = Trial::new(normal.chi_square);
        self.candidate = Some((parameters, normal));
        Some(trial)
    }

    fn accept(&mut self) -> Result<(), Rejection> {
        if let Some((parameters, normal)) = self.candidate.take() {
            (self.parameters, self.normal) = (parameters, normal);
        }
        Ok(())
    }

    fn improves(&self, chi_square: f64) -> bool {
        chi_square <= self.normal.chi_square * (1.0 + ROUNDING)
    }

    fn before_step(&self, model: &Model, _damping: f64) -> Option<Termination> {
        (model.length <= STEP_TOLERANCE_SIGMAS).then_some(Termination::Step {
            length: model.length,
            threshold: STEP_TOLERANCE_SIGMAS,
        })
    }
}
