//! Figures of one run against the truth. Nothing is aligned: start and scale are the filter's to keep.

use crate::recording::Recording;
use estimation_base::{Se2, wrap};
use nalgebra::{Matrix3, Point3, Vector3};
use slam_pipeline::MapLandmark;
use trajectory_eval::{Alignment, StampedPose, Statistics, absolute_error};

/// The 95 % quantile of chi-square with three degrees of freedom: an honest filter's NEES is below it in 95 % of the
/// frames.
const NEES_LIMIT: f64 = 7.814_727_903_251_179;
/// The largest NEES that is told: that of a covariance which is not positive definite.
const MOST_NEES: f64 = 1e12;

/// Standard deviation added to every claimed position, metres, and heading, radians: a set of
/// particles that collapsed on one claims certainty, for which the NEES would be infinite.
const LEAST_SIGMA: f64 = 1e-4;

/// Errors of a path, pose by pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PathErrors {
    /// Root mean square distance of the positions, metres.
    pub(crate) position_rmse_m: f64,
    /// Distance of the last positions, metres.
    pub(crate) final_m: f64,
    /// Root mean square of the wrapped heading differences, radians.
    pub(crate) heading_rmse_rad: f64,
    /// Relative error of the path's scale, see [`scale_error`].
    pub(crate) scale_error: f64,
}

/// Compares two paths of equal length; `None` when they are empty.
pub(crate) fn path_errors(estimate: &[Se2], truth: &[Se2]) -> Option<PathErrors> {
    let figures = |of: fn(&Se2, &Se2) -> f64| {
        let errors: Vec<f64> = estimate.iter().zip(truth).map(|(e, t)| of(e, t)).collect();
        Some((Statistics::of(&errors)?.rmse, *errors.last()?))
    };
    let (position_rmse_m, final_m) = figures(|e, t| (e.x - t.x).hypot(e.y - t.y))?;
    let (heading_rmse_rad, _) = figures(|e, t| wrap(e.phi - t.phi))?;
    Some(PathErrors {
        position_rmse_m,
        final_m,
        heading_rmse_rad,
        scale_error: scale_error(estimate, truth),
    })
}

/// By how much the estimated path is too long, as a share: the scale s of the rotation and
/// scale about the start that bring the truth closest to the estimate, less one.
///
/// With displacements from the start as complex numbers, `s = |sum conj(t) e| / sum |t|^2`: a
/// wrong first heading does not count. NaN for a truth that never leaves its start.
pub(crate) fn scale_error(estimate: &[Se2], truth: &[Se2]) -> f64 {
    let (Some(e0), Some(t0)) = (estimate.first(), truth.first()) else {
        return f64::NAN;
    };
    let (mut dot, mut cross, mut square) = (0.0, 0.0, 0.0);
    for (e, t) in estimate.iter().zip(truth) {
        let (ex, ey) = (e.x - e0.x, e.y - e0.y);
        let (tx, ty) = (t.x - t0.x, t.y - t0.y);
        dot += tx * ex + ty * ey;
        cross += tx * ey - ty * ex;
        square += tx * tx + ty * ty;
    }
    dot.hypot(cross) / square - 1.0
}

/// How honest the claimed covariances of the frames after the first are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Honesty {
    /// Mean normalised estimation error squared, three degrees of freedom.
    pub(crate) nees: f64,
    /// Share of the frames below [`NEES_LIMIT`].
    pub(crate) inside: f64,
    /// Share of the frames within three standard deviations in x, y and heading.
    pub(crate) three_sigma: [f64; 3],
}

/// Compares errors with claims, with a tenth of a millimetre and milliradian added to the claim. The first frame is
/// left out: its pose is the origin by definition.
pub(crate) fn honesty(estimate: &[Se2], covariances: &[Matrix3<f64>], truth: &[Se2]) -> Honesty {
    let (mut nees, mut inside, mut within, mut frames) = (0.0, 0.0, [0.0; 3], 0.0_f64);
    for ((e, covariance), t) in estimate.iter().zip(covariances).zip(truth).skip(1) {
        let d = Vector3::new(e.x - t.x, e.y - t.y, wrap(e.phi - t.phi));
        let claimed = covariance + Matrix3::identity() * LEAST_SIGMA.powi(2);
        let value = claimed
            .cholesky()
            .map_or(MOST_NEES, |factor| d.dot(&factor.solve(&d)).min(MOST_NEES));
        nees += value;
        inside += f64::from(u8::from(value <= NEES_LIMIT));
        for axis in 0..3 {
            let sigma = claimed[(axis, axis)].max(0.0).sqrt();
            within[axis] += f64::from(u8::from(d[axis].abs() <= 3.0 * sigma));
        }
        frames += 1.0;
    }
    let frames = frames.max(1.0);
    Honesty {
        nees: nees / frames,
        inside: inside / frames,
        three_sigma: within.map(|count| count / frames),
    }
}

/// Root mean square position error after one turn about the start; `None` for a robot that stood still.
pub(crate) fn heading_freed_rmse_m(estimate: &[Se2], truth: &[Se2]) -> Option<f64> {
    let stamped = |path: &[Se2]| -> Vec<StampedPose> {
        path.iter()
            .enumerate()
            .map(|(k, pose)| StampedPose::planar(k as f64, pose.x, pose.y, pose.phi))
            .collect()
    };
    let error = absolute_error(&stamped(estimate), &stamped(truth), Alignment::Heading).ok()?;
    Some(error.translation_m.rmse)
}

/// Distance of each landmark from the surface point its last sighting saw, metres, in map
/// order; landmarks without a unique one are left out.
pub(crate) fn landmark_errors(landmarks: &[MapLandmark], recording: &Recording) -> Vec<f64> {
    landmarks
        .iter()
        .filter_map(|landmark| {
            let truth = recording.surface_point(landmark.descriptor.as_deref()?)?;
            Some((Point3::from(landmark.position) - truth).norm())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    fn bent_path(scale: f64, turn: f64) -> Vec<Se2> {
        (0..40)
            .map(|k| {
                let t = f64::from(k) * 0.1;
                let (x, y) = (scale * t, scale * 0.2 * t * t);
                Se2 {
                    x: 5.0 + x * turn.cos() - y * turn.sin(),
                    y: -1.0 + x * turn.sin() + y * turn.cos(),
                    phi: turn,
                }
            })
            .collect()
    }

    #[test]
    fn scale_error_is_the_factor_whatever_the_first_heading() {
        let truth = bent_path(1.0, 0.0);
        for (scale, turn) in [(1.0, 0.0), (1.07, 0.0), (0.8, 0.3), (1.2, -2.0)] {
            let error = scale_error(&bent_path(scale, turn), &truth);
            assert!((error - (scale - 1.0)).abs() < 1e-12, "{scale} {error}");
        }
        assert!(scale_error(&truth[..1], &truth[..1]).is_nan());
    }

    #[test]
    fn path_errors_of_a_shifted_path_across_the_cut_of_the_circle() {
        let truth = vec![
            Se2 {
                x: 1.0,
                y: 1.0,
                phi: PI - 0.01
            };
            4
        ];
        let mut estimate = truth.clone();
        for pose in &mut estimate {
            pose.x += 0.3;
            pose.y -= 0.4;
            pose.phi = -PI + 0.01;
        }
        let errors = path_errors(&estimate, &truth).unwrap();
        assert!((errors.position_rmse_m - 0.5).abs() < 1e-12);
        assert!((errors.final_m - 0.5).abs() < 1e-12);
        assert!((errors.heading_rmse_rad - 0.02).abs() < 1e-12);
        assert_eq!(path_errors(&[], &[]), None);
    }

    #[test]
    fn nees_counts_errors_in_claimed_sigmas_and_skips_the_known_start() {
        let at = |x: f64, y: f64, phi: f64| Se2 { x, y, phi };
        let truth = [at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.1), at(2.0, 0.0, 0.0)];
        let estimate = [
            at(9.0, 0.0, 0.0),
            at(1.2, 0.1, 0.1 + TAU - 0.31),
            at(2.1, 0.0, 0.0),
        ];
        let claim = Matrix3::from_diagonal(&Vector3::new(0.01, 0.04, 0.01));
        let found = honesty(&estimate, &[Matrix3::zeros(), claim, claim], &truth);
        // (0.2 / 0.1)^2 + (0.1 / 0.2)^2 + (0.31 / 0.1)^2 and (0.1 / 0.1)^2, but for the least sigma.
        assert!((found.nees - (13.86 + 1.0) / 2.0).abs() < 1e-4, "{found:?}");
        assert_eq!(found.inside, 0.5);
        assert_eq!(found.three_sigma, [1.0, 1.0, 0.5]);
        // A covariance that is none counts as infinitely wrong.
        let broken = honesty(&estimate, &[-claim; 3], &truth);
        assert_eq!((broken.nees, broken.inside), (MOST_NEES, 0.0));
    }

    #[test]
    fn the_limit_is_the_quantile() {
        let quantile = estimation_base::chi_square_quantile(3.0, 0.95).unwrap();
        assert!((NEES_LIMIT - quantile).abs() < 1e-8, "{quantile}");
    }

    #[test]
    fn a_turned_path_has_no_error_once_its_heading_is_freed() {
        let truth = bent_path(1.0, 0.0);
        let turned = bent_path(1.0, 0.4);
        assert!(path_errors(&turned, &truth).unwrap().position_rmse_m > 0.3);
        assert!(heading_freed_rmse_m(&turned, &truth).unwrap() < 1e-12);
        assert_eq!(heading_freed_rmse_m(&truth[..1], &truth[..1]), None);
    }
}
