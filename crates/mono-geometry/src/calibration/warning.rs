//! Reasons to doubt a calibration: parameters that the views do not constrain, and views that do not fit.

use estimation_base::Readable;

use crate::least_squares::Termination;

/// One doubt, with the measured value and the limit it broke.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationWarning {
    /// A view was left out.
    #[error("view {view} was left out: {reason}")]
    ViewSkipped {
        /// Index of the view.
        view: usize,
        /// Why.
        reason: SkipReason,
    },
    /// The refinement did not end in a minimum.
    #[error("the refinement did not converge: {termination}")]
    NotConverged {
        /// How it ended.
        termination: Termination,
    },
    /// The standard deviation of a parameter is large against what matters.
    #[error(
        "{name} = {} has a standard deviation of {}, required: at most {}",
        Readable(*.value),
        Readable(*.sigma),
        Readable(*.limit)
    )]
    WeakParameter {
        /// Its name.
        name: &'static str,
        /// Its estimate.
        value: f64,
        /// Its standard deviation; infinite if the views do not fix it.
        sigma: f64,
        /// The largest that goes unmentioned.
        limit: f64,
    },
    /// A combination of parameters is known less well than any limit allows: the direction in which the views constrain
    /// the camera least.
    #[error(
        "the views do not constrain the combination {}: standard deviation {} times the limit",
        combination(.terms),
        Readable(*.sigmas_over_limit)
    )]
    WeakCombination {
        /// Parameters that take part (share above 0.3 of the unit vector), the largest first. Shares are in units of
        /// each parameter's own limit.
        terms: Vec<(&'static str, f64)>,
        /// Standard deviation along the combination over the limit; infinite if the views do not fix it.
        sigmas_over_limit: f64,
    },
    /// Two parameters can hardly be told apart.
    #[error(
        "{first} and {second} are correlated by {}, required: at most {} in magnitude",
        Readable(*.correlation),
        Readable(*.limit)
    )]
    Correlated {
        /// Name of the first.
        first: &'static str,
        /// Name of the second.
        second: &'static str,
        /// Their correlation.
        correlation: f64,
        /// The largest magnitude that goes unmentioned.
        limit: f64,
    },
    /// The planes of the target are nearly parallel in all views.
    #[error(
        "the target planes differ by at most {} rad, required: {} rad",
        Readable(*.largest_angle_rad),
        Readable(*.required_rad)
    )]
    ViewsNearlyParallel {
        /// Angle between the two most different planes, radians.
        largest_angle_rad: f64,
        /// The smallest that goes unmentioned.
        required_rad: f64,
    },
    /// The corners stay far inside the image: the lens is known only there.
    #[error(
        "corners reach {} px from the principal point, the image {} px, required: a share of {}",
        Readable(*.corner_radius_px),
        Readable(*.image_radius_px),
        Readable(*.required_share)
    )]
    DistortionExtrapolated {
        /// Distance of the outermost corner from the principal point, pixels.
        corner_radius_px: f64,
        /// Distance of the farthest image corner, pixels.
        image_radius_px: f64,
        /// The smallest share that goes unmentioned.
        required_share: f64,
    },
    /// A view fits much worse than the others.
    #[error(
        "view {view} has a residual of {} px, the median view {} px, required: at most {} times as much",
        Readable(*.rms_px),
        Readable(*.median_rms_px),
        Readable(*.limit)
    )]
    ViewResidual {
        /// Index of the view.
        view: usize,
        /// Its root mean square residual, pixels.
        rms_px: f64,
        /// The median over the views, pixels.
        median_rms_px: f64,
        /// The largest ratio that goes unmentioned.
        limit: f64,
    },
}

/// Why a view was left out.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkipReason {
    /// Too few corners for a homography.
    #[error("{corners} corners, required: at least 4")]
    TooFewCorners {
        /// Corners given.
        corners: usize,
    },
    /// The corners do not fix a homography.
    #[error("its corners fix {rank} of 8 degrees of freedom of a homography: they are collinear")]
    Collinear {
        /// Degrees of freedom that are fixed.
        rank: usize,
    },
    /// No pose of the target explains the corners: some would be behind the camera or outside the lens's field.
    #[error("{corners} of its corners would be behind the camera or outside the field of the lens")]
    NotVisible {
        /// Number of such corners.
        corners: usize,
    },
}

/// 0.8 fx - 0.6 cx
fn combination(terms: &[(&'static str, f64)]) -> String {
    let mut text = String::new();
    for (k, (name, share)) in terms.iter().enumerate() {
        let sign = match (k, *share < 0.0) {
            (0, false) => "",
            (0, true) => "-",
            (_, false) => " + ",
            (_, true) => " - ",
        };
        text += &format!("{sign}{:.2} {name}", share.abs());
    }
    text
}
