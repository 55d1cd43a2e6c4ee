//! Calibration of a camera from images of a planar target (Zhang 2000).
//!
//! Problem: points of known position on a plane (the corners of a checkerboard) were found in several images, the
//! target at an unknown pose in each. Estimate fx, fy, cx, cy (no skew) and the lens, the pose of every view, and how
//! well they are known. [`calibrate`] is the whole method:
//!
//! 1. a homography a view ([`crate::homography::fit`]);
//! 2. intrinsics from the image of the absolute conic ([`closed_form_intrinsics`]), with fall-backs
//!    ([`IntrinsicsStart`]);
//! 3. the pose of every view in closed form ([`pose_from_homography`]);
//! 4. k1 and k2 by linear least squares (a fisheye starts from an equidistant lens instead);
//! 5. Levenberg-Marquardt over everything, the poses eliminated view by view;
//! 6. covariance of every parameter and pose, residuals, and warnings where the views do not constrain the camera.
//!
//! Degenerate: planes parallel to the image do not contain the focal length; parallel planes, or one view repeated,
//! give two constraints only; corners near the image centre do not contain the lens; both are answered by standard
//! deviations (infinite ones included) and [`CalibrationWarning`]s that name the parameters. Fewer views or corners
//! than unknowns is an error with the counts. Not for targets that are not flat to a fraction of a pixel: their shape
//! goes into the lens.
//!
//! Source: Zhang, A Flexible New Technique for Camera Calibration, IEEE PAMI 22 (2000). Derivation: `docs/math`.

mod closed_form;
mod covariance;
mod error;
mod input;
mod judge;
mod refine;
mod report;
mod start;
mod view_pose;
mod warning;

pub use closed_form::{ClosedForm, Skew, closed_form_intrinsics, focal_length_from_centre};
pub use error::CalibrationError;
pub use input::{CalibrationOptions, CalibrationView, Corner, LensModel, WarningLimits};
pub use report::{Calibration, IntrinsicsStart, ParameterEstimate, ViewReport};
pub use view_pose::pose_from_homography;
pub use warning::{CalibrationWarning, SkipReason};

use crate::error::checked;

/// Views needed: two constraints each for the four parameters of the pinhole.
const MIN_VIEWS: usize = 2;

/// Calibrates a camera with an image of `width` x `height` pixels.
///
/// Views without a homography (fewer than four corners, collinear corners) are left out with a warning. O(corners) a
/// step, usually 5 to 15 steps.
///
/// # Errors
/// [`CalibrationError`]: a corner that is not finite, fewer than two usable views, fewer equations than unknowns, an option or
/// an image size out of range.
///
/// ```
/// use mono_geometry::calibration::{CalibrationOptions, CalibrationView, LensModel, calibrate};
/// use mono_geometry::{Camera, Distortion, Pinhole, Se3, so3};
/// use nalgebra::{Vector2, Vector3};
///
/// let pinhole = Pinhole { width: 640, height: 480, fx: 520.0, fy: 525.0, cx: 322.0, cy: 238.0 };
/// let truth = Camera::new(pinhole, Distortion::Radtan { k1: -0.1, k2: 0.01, p1: 0.0, p2: 0.0, k3: 0.0 })?;
/// // The corners of a board of 25 mm, seen from six sides.
/// let board: Vec<Vector2<f64>> =
///     (0..54).map(|i| Vector2::new(0.025 * f64::from(i % 9), 0.025 * f64::from(i / 9))).collect();
/// let views: Vec<CalibrationView> = (0..6)
///     .map(|view| {
///         let side = f64::from(view);
///         let turn = so3::exp(&Vector3::new(0.5 * side.cos(), 0.5 * side.sin(), 0.1 * side));
///         let camera_from_board = Se3::new(turn, Vector3::new(-0.1 + 0.02 * side, -0.07, 0.35));
///         let seen = |at: &Vector2<f64>| truth.project(&camera_from_board.transform_point(&at.push(0.0)));
///         let pixels: Vec<_> = board.iter().map(|at| seen(at).expect("in front")).collect();
///         CalibrationView::new(&board, &pixels, 0.1)
///     })
///     .collect();
/// let options = CalibrationOptions { model: LensModel::Radtan, ..CalibrationOptions::default() };
/// let found = calibrate(640, 480, &views, &options)?;
/// assert!(found.rms_px < 1e-6);
/// let fx = found.parameter("fx").expect("a parameter");
/// assert!((fx.value - 520.0).abs() < 1e-3 && fx.sigma < 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn calibrate(
    width: usize,
    height: usize,
    views: &[CalibrationView],
    options: &CalibrationOptions,
) -> Result<Calibration, CalibrationError> {
    options.loss.check()?;
    checked(
        "max_iterations",
        options.max_iterations as f64,
        "at least 1",
        |v| v >= 1.0,
    )?;
    let (usable, mut warnings) = start::usable_views(views)?;
    require_views(usable.len(), views.len())?;
    let begin = start::start(width, height, options.model, usable)?;
    warnings.extend(begin.warnings);
    let usable = begin.views;
    require_views(usable.len(), views.len())?;
    let free = options.model.free_parameters();
    require_equations(&usable, free)?;

    let mut camera = begin.camera;
    let mut poses = begin.poses;
    if options.model == LensModel::Rational {
        // The quotient has no useful linear start: the polynomial first.
        let first = refine::refine(
            &usable,
            LensModel::Radtan.free_parameters(),
            options.loss,
            options.max_iterations,
            camera,
            poses,
        );
        let mut parameters = first.camera.parameters().as_slice().to_vec();
        parameters.resize(free, 0.0);
        let lens = options.model.ideal().with_parameters(&parameters[4..])?;
        camera = crate::camera::Camera::new(*first.camera.pinhole(), lens)?;
        poses = first.poses;
    }
    let refined = refine::refine(
        &usable,
        free,
        options.loss,
        options.max_iterations,
        camera,
        poses,
    );
    let camera = refined.camera;
    let uncertainty =
        covariance::uncertainty(&usable, free, options.loss, &camera, &refined.poses)?;
    let reports: Vec<ViewReport> = usable
        .iter()
        .zip(&refined.poses)
        .zip(&uncertainty.poses)
        .map(|((view, pose), covariance)| judge::view_report(&camera, view, pose, *covariance))
        .collect();
    let (rms_px, mean_error_px) = judge::lengths(reports.iter().flat_map(|v| &v.residuals_px));
    let values = camera.parameters();
    let names = camera.parameter_names();
    let parameters = (0..free)
        .map(|k| ParameterEstimate {
            name: names[k],
            value: values[k],
            sigma: uncertainty.camera[(k, k)].sqrt(),
        })
        .collect();
    let mut max_corner_radius: f64 = 0.0;
    for (view, pose) in usable.iter().zip(&refined.poses) {
        for corner in &view.view.corners {
            let point = pose.transform_point(&corner.board_m.push(0.0));
            max_corner_radius = max_corner_radius.max(point.xy().norm() / point.z);
        }
    }
    let mut calibration = Calibration {
        camera,
        model: options.model,
        parameters,
        correlation: judge::correlation(&uncertainty.camera),
        covariance: uncertainty.camera.clone(),
        condition: uncertainty.condition,
        views: reports,
        rms_px,
        mean_error_px,
        variance_factor: uncertainty.variance_factor,
        degrees_of_freedom: uncertainty.degrees_of_freedom,
        max_corner_radius,
        start: begin.source,
        cost_curve: refined.cost_curve,
        termination: refined.termination,
        warnings: Vec::new(),
    };
    warnings.extend(judge::warnings(
        &calibration,
        &uncertainty,
        &usable,
        &options.limits,
    ));
    calibration.warnings = warnings;
    Ok(calibration)
}

fn require_views(usable: usize, given: usize) -> Result<(), CalibrationError> {
    if usable < MIN_VIEWS {
        return Err(CalibrationError::TooFewViews {
            usable,
            given,
            required: MIN_VIEWS,
        });
    }
    Ok(())
}

fn require_equations(
    usable: &[start::UsableView<'_>],
    parameters: usize,
) -> Result<(), CalibrationError> {
    let corners: usize = usable.iter().map(|v| v.view.corners.len()).sum();
    let unknowns = parameters + 6 * usable.len();
    if 2 * corners <= unknowns {
        return Err(CalibrationError::TooFewCorners {
            corners,
            equations: 2 * corners,
            parameters,
            views: usable.len(),
            unknowns,
        });
    }
    Ok(())
}
