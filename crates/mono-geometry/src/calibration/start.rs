//! Where the refinement starts: homographies, intrinsics and poses of all views, first lens coefficients.
//!
//! Perspective lenses (Zhang 2000, sections 3.1 and 3.3): a homography a view; intrinsics in closed form, or with the
//! principal point at the image centre, or with an assumed focal length; of these the one whose poses reproduce the
//! corners best. Then k1 and k2 by linear least squares from what is left of the residuals, g = 1 + k1 r^2 + k2 r^4.
//!
//! Fisheyes see no homography: the pixels are first taken through an equidistant lens, |pixel - centre| = f theta,
//! whose f is searched over the angles 20 to 110 degrees at half the longer side; of these the one whose poses
//! reproduce the corners best.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};

use super::closed_form::{Skew, closed_form_intrinsics, focal_length_from_centre, image_centre};
use super::error::CalibrationError;
use super::input::{CalibrationView, LensModel};
use super::report::IntrinsicsStart;
use super::view_pose::pose_from_homography;
use super::warning::{CalibrationWarning, SkipReason};
use crate::camera::{Camera, Pinhole};
use crate::distortion::Distortion;
use crate::homography::{self, Homography, HomographyError};
use crate::linalg::lstsq;
use crate::se3::Se3;

/// Candidates of the fisheye's focal length.
const FISHEYE_STEPS: u32 = 24;
/// Rays further off the axis take no part in a fisheye's homographies, radians (75 degrees).
const FISHEYE_MAX_ANGLE: f64 = 1.309;
/// Views used to search the fisheye's focal length.
const FISHEYE_VIEWS: usize = 12;

/// A view that can be used, with its homography board -> pixel (of the distorted pixels).
#[derive(Debug, Clone)]
pub(super) struct UsableView<'a> {
    pub(super) index: usize,
    pub(super) view: &'a CalibrationView,
    pub(super) homography: Homography,
}

impl UsableView<'_> {
    fn middle(&self) -> Vector2<f64> {
        let count = self.view.corners.len() as f64;
        self.view.corners.iter().map(|c| c.board_m / count).sum()
    }
}

/// A start, and the views that it can explain.
pub(super) struct Start<'a> {
    pub(super) camera: Camera,
    pub(super) views: Vec<UsableView<'a>>,
    pub(super) poses: Vec<Se3>,
    pub(super) source: IntrinsicsStart,
    pub(super) warnings: Vec<CalibrationWarning>,
}

/// The views that have a homography; warnings for the others.
///
/// # Errors
/// [`CalibrationError::InvalidCorner`].
pub(super) fn usable_views(
    views: &[CalibrationView],
) -> Result<(Vec<UsableView<'_>>, Vec<CalibrationWarning>), CalibrationError> {
    let mut usable = Vec::with_capacity(views.len());
    let mut warnings = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let finite = |v: &Vector2<f64>| v.iter().all(|c| c.is_finite());
        if let Some(corner) = view.corners.iter().position(|c| {
            !(finite(&c.board_m) && finite(&c.pixel) && c.sigma_px > 0.0 && c.sigma_px.is_finite())
        }) {
            return Err(CalibrationError::InvalidCorner {
                view: index,
                corner,
            });
        }
        let board: Vec<_> = view.corners.iter().map(|c| c.board_m).collect();
        let pixels: Vec<_> = view.corners.iter().map(|c| c.pixel).collect();
        let reason = match homography::fit(&board, &pixels) {
            Ok(fit) => {
                usable.push(UsableView {
                    index,
                    view,
                    homography: fit.homography,
                });
                continue;
            }
            Err(HomographyError::Degenerate { rank }) => SkipReason::Collinear { rank },
            Err(_too_few) => SkipReason::TooFewCorners {
                corners: view.corners.len(),
            },
        };
        warnings.push(CalibrationWarning::ViewSkipped {
            view: index,
            reason,
        });
    }
    Ok((usable, warnings))
}

/// Camera and poses to start from.
///
/// # Errors
/// [`CalibrationError::Geometry`] for an image size of zero.
pub(super) fn start<'a>(
    width: usize,
    height: usize,
    model: LensModel,
    views: Vec<UsableView<'a>>,
) -> Result<Start<'a>, CalibrationError> {
    let (camera, source) = if model == LensModel::KannalaBrandt {
        let camera = fisheye_camera(width, height, &views)?;
        (camera, IntrinsicsStart::EquidistantSearch)
    } else {
        perspective_camera(width, height, &views)?
    };
    let mut kept = Vec::with_capacity(views.len());
    let mut poses = Vec::with_capacity(views.len());
    let mut warnings = Vec::new();
    for view in views {
        let pose = pose(&camera, &view);
        let hidden = pose.map_or(view.view.corners.len(), |pose| {
            hidden(&camera, &view, &pose)
        });
        match pose {
            Some(pose) if hidden == 0 => {
                kept.push(view);
                poses.push(pose);
            }
            _ => warnings.push(CalibrationWarning::ViewSkipped {
                view: view.index,
                reason: SkipReason::NotVisible { corners: hidden },
            }),
        }
    }
    let camera = match model {
        LensModel::Pinhole | LensModel::KannalaBrandt => camera,
        _ => with_radial(&camera, &kept, &poses)?,
    };
    Ok(Start {
        camera,
        views: kept,
        poses,
        source,
        warnings,
    })
}

/// Corners that do not project.
fn hidden(camera: &Camera, view: &UsableView<'_>, pose: &Se3) -> usize {
    let corners = view.view.corners.iter();
    corners
        .filter(|c| {
            camera
                .project(&pose.transform_point(&c.board_m.push(0.0)))
                .is_none()
        })
        .count()
}

/// Mean distance of the corners from their projections; infinite if one has none.
fn misfit(camera: &Camera, views: &[UsableView<'_>]) -> f64 {
    let mut sum = 0.0;
    let mut count = 0;
    for view in views {
        let Some(pose) = pose(camera, view) else {
            return f64::INFINITY;
        };
        for corner in &view.view.corners {
            let Some(pixel) = camera.project(&pose.transform_point(&corner.board_m.push(0.0)))
            else {
                return f64::INFINITY;
            };
            sum += (pixel - corner.pixel).norm();
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

fn pose(camera: &Camera, view: &UsableView<'_>) -> Option<Se3> {
    if camera.distortion().parameters().is_empty() {
        return pose_from_homography(camera.pinhole(), &view.homography, &view.middle());
    }
    // Through the lens: normalised points of the corners that are not too far off the axis.
    let mut board = Vec::new();
    let mut normalized = Vec::new();
    for corner in &view.view.corners {
        if let Ok(point) = camera.undistort(&corner.pixel)
            && point.norm().atan() < FISHEYE_MAX_ANGLE
        {
            board.push(corner.board_m);
            normalized.push(point);
        }
    }
    let through_lens = homography::rough(&board, &normalized)?;
    let unit = Pinhole {
        width: 1,
        height: 1,
        fx: 1.0,
        fy: 1.0,
        cx: 0.0,
        cy: 0.0,
    };
    let count = board.len() as f64;
    let middle = board.iter().map(|b| b / count).sum();
    pose_from_homography(&unit, &through_lens, &middle)
}

fn perspective_camera(
    width: usize,
    height: usize,
    views: &[UsableView<'_>],
) -> Result<(Camera, IntrinsicsStart), CalibrationError> {
    let homographies: Vec<_> = views.iter().map(|v| v.homography).collect();
    let centre = image_centre(width, height);
    let side = width.max(height) as f64;
    let pinhole = |fx: f64, fy: f64, cx: f64, cy: f64| Pinhole {
        width,
        height,
        fx,
        fy,
        cx,
        cy,
    };
    let assumed = Camera::new(pinhole(side, side, centre.x, centre.y), Distortion::None)?;
    let mut candidates = Vec::new();
    if let Some(k) = closed_form_intrinsics(&homographies, width, height, Skew::Zero) {
        let found = pinhole(k.fx, k.fy, k.cx, k.cy);
        if found.contains(&Vector2::new(k.cx, k.cy), 0.0) {
            candidates.push((found, IntrinsicsStart::ClosedForm));
        }
    }
    if let Some(f) = focal_length_from_centre(&homographies, width, height) {
        candidates.push((
            pinhole(f, f, centre.x, centre.y),
            IntrinsicsStart::CentreAssumed,
        ));
    }
    let mut best = (assumed, IntrinsicsStart::FocalLengthAssumed);
    let mut least = f64::INFINITY;
    for (pinhole, source) in candidates {
        let camera = Camera::new(pinhole, Distortion::None)?;
        let cost = misfit(&camera, views);
        // The focal length of a lens is a tenth to fifty times the side of its image.
        let sane =
            pinhole.fx.min(pinhole.fy) > 0.1 * side && pinhole.fx.max(pinhole.fy) < 50.0 * side;
        if sane && cost < least {
            least = cost;
            best = (camera, source);
        }
    }
    Ok(best)
}

fn fisheye_camera(
    width: usize,
    height: usize,
    views: &[UsableView<'_>],
) -> Result<Camera, CalibrationError> {
    let centre = image_centre(width, height);
    let half = 0.5 * width.max(height) as f64;
    let lens = LensModel::KannalaBrandt.ideal();
    let (low, high) = (20.0_f64.to_radians(), 110.0_f64.to_radians());
    // A few views, spread over the list, decide.
    let stride = views.len().div_ceil(FISHEYE_VIEWS).max(1);
    let some: Vec<_> = views.iter().step_by(stride).cloned().collect();
    let mut best: Option<(f64, Camera)> = None;
    for step in 0..FISHEYE_STEPS {
        let share = f64::from(step) / f64::from(FISHEYE_STEPS - 1);
        let f = half / (low * (high / low).powf(share));
        let pinhole = Pinhole {
            width,
            height,
            fx: f,
            fy: f,
            cx: centre.x,
            cy: centre.y,
        };
        let camera = Camera::new(pinhole, lens)?;
        let cost = misfit(&camera, &some);
        if best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, camera));
        }
    }
    match best {
        Some((_, camera)) => Ok(camera),
        None => Err(CalibrationError::TooFewViews {
            usable: views.len(),
            given: views.len(),
            required: 2,
        }),
    }
}

/// k1 and k2 by linear least squares; halved until every corner projects.
fn with_radial(
    camera: &Camera,
    views: &[UsableView<'_>],
    poses: &[Se3],
) -> Result<Camera, CalibrationError> {
    let pinhole = *camera.pinhole();
    let corners: usize = views.iter().map(|v| v.view.corners.len()).sum();
    let mut rows = DMatrix::zeros((2 * corners).max(2), 2);
    let mut right = DVector::zeros((2 * corners).max(2));
    let mut row = 0;
    for (view, pose) in views.iter().zip(poses) {
        for corner in &view.view.corners {
            let point: Vector3<f64> = pose.transform_point(&corner.board_m.push(0.0));
            let normalized = point.xy() / point.z;
            let r2 = normalized.norm_squared();
            let ideal = pinhole.pixel(&normalized);
            let arm = Vector2::new(pinhole.fx * normalized.x, pinhole.fy * normalized.y);
            for axis in 0..2 {
                rows[(row, 0)] = arm[axis] * r2;
                rows[(row, 1)] = arm[axis] * r2 * r2;
                right[row] = corner.pixel[axis] - ideal[axis];
                row += 1;
            }
        }
    }
    let solution = lstsq(&rows, &right)?.solution;
    let mut k = Vector2::new(solution[0], solution[1]);
    for _ in 0..6 {
        let lens = LensModel::Radtan
            .ideal()
            .with_parameters(&[k.x, k.y, 0.0, 0.0, 0.0])?;
        let candidate = Camera::new(pinhole, lens)?;
        let all = views
            .iter()
            .zip(poses)
            .all(|(v, p)| hidden(&candidate, v, p) == 0);
        if all {
            return Ok(candidate);
        }
        k *= 0.5;
    }
    Ok(Camera::new(pinhole, LensModel::Radtan.ideal())?)
}
