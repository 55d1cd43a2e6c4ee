//! The camera as an unknown of a bundle: parameters that all images share, each with a prior.
//!
//! The residuals are then those of the real picture, pi(T_i^-1 X_j; c) - z, and the cost grows by 1/2 sum ((c_k - m_k) / s_k)^2
//! over the parameters c_k that are free. A pixel z of the real picture is known by its ideal pixel and the camera that it
//! was made with, the calibrated one, whose parameters are also the means m of the prior. What an observation says of the noise of the
//! ideal pixel is taken to the real one by the derivative of that lens: round again, if the shape is that of the lens.
//!
//! A lens that moves may fold inside the picture for some steps: the cost goes on by the formula of the lens, which is smooth there.
//!
//! Degenerate: focal length and distances grow together unless the camera turns, motions are measured, or landmarks lie in
//! depth; the principal point is hardly told from a turn of the camera. The priors hold what the pixels leave open, and the
//! covariance says so; without priors ([`f64::INFINITY`]) the answer may be [`GeometryError::InvalidElement`].

use nalgebra::{DVector, Matrix2, Vector2};

use crate::camera::{Camera, ParameterJacobian, Pinhole};
use crate::error::{GeometryError, bad};
use crate::noise_shape::NoiseShape;

/// A camera whose parameters are adjusted with the poses and landmarks; the same for all images.
///
/// ```
/// use mono_geometry::bundle::Intrinsics;
/// use mono_geometry::{Camera, Distortion, Pinhole};
///
/// let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 319.5, cy: 239.5 };
/// let lens = Distortion::Radtan { k1: -0.2, k2: 0.05, p1: 0.0, p2: 0.0, k3: 0.0 };
/// // fx, fy to 2 %, the principal point to 5 px, k1 and k2; the other three are held.
/// let sigmas = vec![8.0, 8.0, 5.0, 5.0, 0.02, 0.02, 0.0, 0.0, 0.0];
/// let intrinsics = Intrinsics::new(Camera::new(pinhole, lens)?, sigmas);
/// assert_eq!(intrinsics.free(), [0, 1, 2, 3, 4, 5]);
/// # Ok::<(), mono_geometry::GeometryError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Intrinsics {
    /// The camera that the ideal pixels of the problem were made with: its parameters are the means of the prior.
    pub calibrated: Camera,
    /// The start of the minimisation and the place of its result; image size and lens model are those of `calibrated`.
    pub estimate: Camera,
    /// Prior standard deviation of every one of [`Camera::parameters`], in its unit: zero holds the parameter as `estimate`
    /// has it, [`f64::INFINITY`] leaves it to the pixels alone.
    pub sigmas: Vec<f64>,
}

impl Intrinsics {
    /// A camera as it was calibrated, with the standard deviations of its parameters.
    #[must_use]
    pub fn new(camera: Camera, sigmas: Vec<f64>) -> Self {
        Self {
            calibrated: camera,
            estimate: camera,
            sigmas,
        }
    }

    /// Indices of the parameters that are free, ascending.
    #[must_use]
    pub fn free(&self) -> Vec<usize> {
        (0..self.sigmas.len())
            .filter(|&k| self.sigmas[k] > 0.0)
            .collect()
    }

    /// The first number that cannot be used; `pinhole` is that of the problem.
    pub(super) fn check(&self, pinhole: &Pinhole) -> Result<(), GeometryError> {
        let list = "camera parameter";
        let (means, values) = (self.calibrated.parameters(), self.estimate.parameters());
        if values.len() != means.len()
            || self.estimate.parameter_names() != self.calibrated.parameter_names()
        {
            return Err(GeometryError::Shape {
                rows: values.len(),
                columns: 1,
                required: "the estimate has the lens model of the calibrated camera",
            });
        }
        if self.sigmas.len() != means.len() {
            return Err(GeometryError::Shape {
                rows: self.sigmas.len(),
                columns: 1,
                required: "as many standard deviations as the camera has parameters",
            });
        }
        for (index, &sigma) in self.sigmas.iter().enumerate() {
            if sigma.is_nan() || sigma < 0.0 {
                return Err(bad(
                    list,
                    index,
                    "prior standard deviation",
                    sigma,
                    "0 (held) or above, infinite for none",
                ));
            }
        }
        let own = self.calibrated.pinhole();
        let pairs = [pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy]
            .into_iter()
            .zip([own.fx, own.fy, own.cx, own.cy]);
        for (index, (of_problem, calibrated)) in pairs.enumerate() {
            if of_problem != calibrated {
                return Err(bad(
                    list,
                    index,
                    "value in the pinhole of the problem",
                    of_problem,
                    "that of the calibrated camera",
                ));
            }
        }
        Ok(())
    }

    /// Whether anything differs from a camera that is known.
    pub(super) fn is_unknown(&self) -> bool {
        self.estimate != self.calibrated || self.sigmas.iter().any(|s| *s > 0.0)
    }

    /// Where the image of the calibrated camera shows an ideal pixel, and its noise there, relative to the same sigma.
    pub(super) fn real_pixel(
        &self,
        pixel_ideal: &Vector2<f64>,
        shape: &NoiseShape,
    ) -> (Vector2<f64>, NoiseShape) {
        let pinhole = self.calibrated.pinhole();
        let normalized = pinhole.normalize(pixel_ideal);
        let (distorted, lens) = self
            .calibrated
            .distortion()
            .distort_with_jacobian(&normalized);
        let (fx, fy) = (pinhole.fx, pinhole.fy);
        let real_by_ideal = Matrix2::new(
            lens[(0, 0)],
            lens[(0, 1)] * fx / fy,
            lens[(1, 0)] * fy / fx,
            lens[(1, 1)],
        );
        (pinhole.pixel(&distorted), shape.carried(&real_by_ideal))
    }

    /// Information of the prior of a parameter.
    fn information(&self, parameter: usize) -> f64 {
        // Zero for an infinite sigma.
        self.sigmas[parameter].powi(-2)
    }

    /// Twice the prior's part of the cost for a camera.
    pub(super) fn prior_cost(&self, camera: &Camera) -> f64 {
        let off = camera.parameters() - self.calibrated.parameters();
        self.free()
            .into_iter()
            .map(|k| off[k] * off[k] * self.information(k))
            .sum()
    }

    /// Information and gradient of the prior, one entry a free parameter.
    pub(super) fn prior(&self, camera: &Camera) -> (DVector<f64>, DVector<f64>) {
        let off = camera.parameters() - self.calibrated.parameters();
        let free = self.free();
        let information =
            DVector::from_iterator(free.len(), free.iter().map(|&k| self.information(k)));
        let gradient = DVector::from_iterator(free.len(), free.iter().map(|&k| off[k]))
            .component_mul(&information);
        (information, gradient)
    }

    /// A camera whose free parameters are moved; `None` where there is no such camera.
    pub(super) fn moved(&self, from: &Camera, step: &DVector<f64>, factor: f64) -> Option<Camera> {
        let mut parameters = from.parameters();
        for (k, step) in self.free().into_iter().zip(step.iter()) {
            parameters[k] += step * factor;
        }
        from.with_parameters(parameters.as_slice()).ok()
    }
}

/// The columns of the free parameters move to the front, the others become zero.
pub(super) fn gather(jacobian: &ParameterJacobian, free: &[usize]) -> ParameterJacobian {
    let mut gathered = ParameterJacobian::zeros();
    for (column, &parameter) in free.iter().enumerate() {
        gathered.set_column(column, &jacobian.column(parameter));
    }
    gathered
}
