//! From a solution to its report: residuals, correlations and warnings.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};

use super::covariance::Uncertainty;
use super::input::WarningLimits;
use super::report::{Calibration, ViewReport};
use super::start::UsableView;
use super::warning::CalibrationWarning;
use crate::camera::Camera;
use crate::se3::Se3;

/// Share of a parameter in a weak combination from which on it is named.
const NAMED_SHARE: f64 = 0.3;

/// Residuals of one view.
pub(super) fn view_report(
    camera: &Camera,
    view: &UsableView<'_>,
    pose: &Se3,
    pose_covariance: Option<nalgebra::Matrix6<f64>>,
) -> ViewReport {
    let residuals_px: Vec<Vector2<f64>> = view
        .view
        .corners
        .iter()
        .map(|c| {
            let projected = camera.project(&pose.transform_point(&c.board_m.push(0.0)));
            // Every corner projects at a solution.
            projected.map_or(Vector2::zeros(), |pixel| c.pixel - pixel)
        })
        .collect();
    let (rms_px, mean_error_px) = lengths(residuals_px.iter());
    ViewReport {
        view: view.index,
        camera_from_board: *pose,
        pose_covariance,
        residuals_px,
        rms_px,
        mean_error_px,
    }
}

/// Root mean square and mean of lengths.
pub(super) fn lengths<'a>(residuals: impl Iterator<Item = &'a Vector2<f64>> + Clone) -> (f64, f64) {
    let count = residuals.clone().count().max(1) as f64;
    let square = residuals.clone().map(Vector2::norm_squared).sum::<f64>();
    let sum = residuals.map(Vector2::norm).sum::<f64>();
    ((square / count).sqrt(), sum / count)
}

/// Correlation of a covariance; zero where a variance is infinite or zero.
pub(super) fn correlation(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let size = covariance.nrows();
    DMatrix::from_fn(size, size, |i, j| {
        let product = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
        if i == j {
            1.0
        } else if product > 0.0 && product.is_finite() {
            (covariance[(i, j)] / product).clamp(-1.0, 1.0)
        } else {
            0.0
        }
    })
}

/// All warnings about a calibration whose other fields are filled in.
pub(super) fn warnings(
    calibration: &Calibration,
    uncertainty: &Uncertainty,
    views: &[UsableView<'_>],
    limits: &WarningLimits,
) -> Vec<CalibrationWarning> {
    let mut warnings = Vec::new();
    if !calibration.termination.converged() {
        warnings.push(CalibrationWarning::NotConverged {
            termination: calibration.termination,
        });
    }
    let allowed = allowed_sigmas(calibration, uncertainty, limits);
    for (parameter, limit) in calibration.parameters.iter().zip(allowed.iter()) {
        if parameter.sigma > *limit {
            warnings.push(CalibrationWarning::WeakParameter {
                name: parameter.name,
                value: parameter.value,
                sigma: parameter.sigma,
                limit: *limit,
            });
        }
    }
    warnings.extend(weak_combinations(calibration, uncertainty, &allowed));
    warnings.extend(correlated(calibration, limits));
    warnings.extend(parallel(calibration, limits));
    warnings.extend(extrapolated(calibration, views, limits));
    warnings.extend(outlying_views(calibration, limits));
    warnings
}

/// The standard deviation of each parameter that matters.
fn allowed_sigmas(
    calibration: &Calibration,
    uncertainty: &Uncertainty,
    limits: &WarningLimits,
) -> DVector<f64> {
    let pinhole = calibration.camera.pinhole();
    let (x, y) = (
        limits.sigma_share * pinhole.fx,
        limits.sigma_share * pinhole.fy,
    );
    let lens = limits.sigma_share * (pinhole.fx * pinhole.fy).sqrt();
    DVector::from_fn(calibration.parameters.len(), |k, _| match k {
        0 | 2 => x,
        1 | 3 => y,
        _ => lens / uncertainty.reach_px[k],
    })
}

fn weak_combinations(
    calibration: &Calibration,
    uncertainty: &Uncertainty,
    allowed: &DVector<f64>,
) -> Vec<CalibrationWarning> {
    let named = |direction: DVector<f64>, sigmas_over_limit: f64| {
        let mut terms: Vec<_> = calibration
            .parameters
            .iter()
            .zip(direction.iter())
            .filter(|(_, share)| share.abs() > NAMED_SHARE)
            .map(|(parameter, share)| (parameter.name, *share))
            .collect();
        terms.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        CalibrationWarning::WeakCombination {
            terms,
            sigmas_over_limit,
        }
    };
    if !uncertainty.open.is_empty() {
        let open = uncertainty.open.iter();
        return open
            .map(|d| named(d.component_div(allowed).normalize(), f64::INFINITY))
            .collect();
    }
    let size = allowed.len();
    let scaled = DMatrix::from_fn(size, size, |i, j| {
        uncertainty.camera[(i, j)] / (allowed[i] * allowed[j])
    });
    if !scaled.iter().all(|v| v.is_finite()) {
        return Vec::new();
    }
    let eigen = scaled.symmetric_eigen();
    let worst = eigen.eigenvalues.imax();
    let sigmas_over_limit = eigen.eigenvalues[worst].max(0.0).sqrt();
    if sigmas_over_limit > 1.0 {
        vec![named(
            eigen.eigenvectors.column(worst).into_owned(),
            sigmas_over_limit,
        )]
    } else {
        Vec::new()
    }
}

fn correlated(calibration: &Calibration, limits: &WarningLimits) -> Vec<CalibrationWarning> {
    let mut warnings = Vec::new();
    for j in 0..calibration.parameters.len() {
        for i in 0..j {
            let correlation = calibration.correlation[(i, j)];
            // fx and fy: see the limit's documentation.
            if (i, j) != (0, 1) && correlation.abs() > limits.correlation {
                warnings.push(CalibrationWarning::Correlated {
                    first: calibration.parameters[i].name,
                    second: calibration.parameters[j].name,
                    correlation,
                    limit: limits.correlation,
                });
            }
        }
    }
    warnings
}

fn parallel(calibration: &Calibration, limits: &WarningLimits) -> Option<CalibrationWarning> {
    let normals: Vec<Vector3<f64>> = calibration
        .views
        .iter()
        .map(|v| v.camera_from_board.rotation * Vector3::z())
        .collect();
    let mut largest_angle_rad: f64 = 0.0;
    for (k, a) in normals.iter().enumerate() {
        for b in &normals[..k] {
            // Planes, not sides: a normal and its opposite are parallel.
            let angle = a.cross(b).norm().atan2(a.dot(b).abs());
            largest_angle_rad = largest_angle_rad.max(angle);
        }
    }
    (largest_angle_rad < limits.plane_angle_rad).then_some(
        CalibrationWarning::ViewsNearlyParallel {
            largest_angle_rad,
            required_rad: limits.plane_angle_rad,
        },
    )
}

fn extrapolated(
    calibration: &Calibration,
    views: &[UsableView<'_>],
    limits: &WarningLimits,
) -> Option<CalibrationWarning> {
    let pinhole = calibration.camera.pinhole();
    if calibration.camera.distortion().parameters().is_empty() {
        return None;
    }
    let centre = Vector2::new(pinhole.cx, pinhole.cy);
    let corners = views.iter().flat_map(|v| &v.view.corners);
    let corner_radius_px = corners.fold(0.0, |m: f64, c| m.max((c.pixel - centre).norm()));
    let (right, bottom) = (pinhole.width as f64 - 0.5, pinhole.height as f64 - 0.5);
    let image_radius_px = [(-0.5, -0.5), (right, -0.5), (-0.5, bottom), (right, bottom)]
        .iter()
        .fold(0.0, |m: f64, (x, y)| {
            m.max((Vector2::new(*x, *y) - centre).norm())
        });
    let covered = corner_radius_px >= limits.covered_radius * image_radius_px;
    (!covered).then_some(CalibrationWarning::DistortionExtrapolated {
        corner_radius_px,
        image_radius_px,
        required_share: limits.covered_radius,
    })
}

fn outlying_views(calibration: &Calibration, limits: &WarningLimits) -> Vec<CalibrationWarning> {
    // The residuals of noise-free corners are rounding errors, whose ratios mean nothing.
    if matches!(calibration.termination, crate::Termination::Exact { .. }) {
        return Vec::new();
    }
    let mut sorted: Vec<f64> = calibration.views.iter().map(|v| v.rms_px).collect();
    sorted.sort_by(f64::total_cmp);
    // Of an even number the lower one: with two views the worse can still be told.
    let Some(&median_rms_px) = sorted.get(sorted.len().saturating_sub(1) / 2) else {
        return Vec::new();
    };
    let outlying = |v: &&ViewReport| v.rms_px > limits.view_residual * median_rms_px;
    calibration
        .views
        .iter()
        .filter(outlying)
        .map(|v| CalibrationWarning::ViewResidual {
            view: v.view,
            rms_px: v.rms_px,
            median_rms_px,
            limit: limits.view_residual,
        })
        .collect()
}
