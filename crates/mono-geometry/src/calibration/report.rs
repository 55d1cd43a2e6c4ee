//! The result of a calibration: camera, covariance, residuals, the way it ended, and its warnings.

use nalgebra::{DMatrix, Matrix6, Vector2};

use super::input::LensModel;
use super::warning::CalibrationWarning;
use crate::camera::Camera;
use crate::least_squares::Termination;
use crate::se3::Se3;

/// A calibrated camera and everything needed to judge it.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The camera.
    pub camera: Camera,
    /// The model that was estimated.
    pub model: LensModel,
    /// The estimated parameters, in the order of [`Camera::parameters`]; a fixed k3 is not among them.
    pub parameters: Vec<ParameterEstimate>,
    /// Covariance of the parameters, p x p in their order: the inverse of the information with the poses eliminated,
    /// times [`Self::variance_factor`]. Row and column of a parameter that the views do not fix at all are zero, but
    /// for an infinite diagonal.
    ///
    /// With a robust loss it is that of the re-weighted problem at the solution.
    pub covariance: DMatrix<f64>,
    /// Correlation of the parameters, p x p; zero off the diagonal for a parameter that the views do not fix.
    pub correlation: DMatrix<f64>,
    /// Condition number of the reduced Jacobian, its columns scaled to unit length before the poses are eliminated;
    /// infinite if it is of deficient rank.
    pub condition: f64,
    /// The views that were used, in the order given.
    pub views: Vec<ViewReport>,
    /// Root mean square over all corners of the distance between found and projected pixel (both coordinates together,
    /// as OpenCV reports it).
    pub rms_px: f64,
    /// Mean of that distance, pixels.
    pub mean_error_px: f64,
    /// Sum of squared normalised residuals over the degrees of freedom: 1 if the sigmas given are right. The
    /// covariances contain it.
    pub variance_factor: f64,
    /// 2 corners - parameters - 6 views.
    pub degrees_of_freedom: usize,
    /// Normalised undistorted radius (tangent of the angle off the axis) of the outermost corner: what lies beyond it
    /// in the image is extrapolated.
    pub max_corner_radius: f64,
    /// Where the intrinsics started.
    pub start: IntrinsicsStart,
    /// Cost (half the sum of squared normalised residuals, through the loss) at the start and after every accepted step
    /// of the last refinement.
    pub cost_curve: Vec<f64>,
    /// How the refinement ended.
    pub termination: Termination,
    /// Reasons to doubt the result; empty for a good calibration.
    pub warnings: Vec<CalibrationWarning>,
}

impl Calibration {
    /// The estimate of the named parameter, `None` if it was not estimated.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        self.parameters.iter().find(|p| p.name == name)
    }
}

/// A parameter with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterEstimate {
    /// As in [`Camera::parameter_names`].
    pub name: &'static str,
    /// Estimate; pixels for fx, fy, cx, cy, without unit for the lens.
    pub value: f64,
    /// Standard deviation, same unit, scaled by the residuals; infinite if the views do not fix the parameter.
    pub sigma: f64,
}

/// One view after the refinement.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewReport {
    /// Index in the list given to [`super::calibrate`].
    pub view: usize,
    /// Pose of the target: maps its points to camera axes.
    pub camera_from_board: Se3,
    /// Covariance of (rho, omega) in pose * exp(rho, omega) (target axes; metres, radians), the uncertainty of the
    /// camera included. `None` if the views leave a parameter of the camera open.
    pub pose_covariance: Option<Matrix6<f64>>,
    /// Found minus projected pixel of every corner, in the order given.
    pub residuals_px: Vec<Vector2<f64>>,
    /// Root mean square of their lengths.
    pub rms_px: f64,
    /// Mean of their lengths.
    pub mean_error_px: f64,
}

/// Where the intrinsics started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum IntrinsicsStart {
    /// Closed form from the image of the absolute conic.
    ClosedForm,
    /// One focal length in closed form, the principal point at the image centre.
    CentreAssumed,
    /// Focal length equal to the longer side of the image: the homographies do not contain it.
    FocalLengthAssumed,
    /// Search over the focal length of an equidistant fisheye, the principal point at the image centre.
    EquidistantSearch,
}
