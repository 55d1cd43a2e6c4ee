//! The motion and the plane behind a homography.
//!
//! For points of a plane n . X = d (first camera's axes, n a unit vector) and normalised coordinates, H ~ R + (t / d) n^T.
//! Scaled so that the middle singular value is 1 and points keep positive depths:
//!
//! 1. H^T H = V diag(s1^2, 1, s3^2) V^T; the vectors v2 and u = (sqrt(1 - s3^2) v1 +- sqrt(s1^2 - 1) v3) / sqrt(s1^2 - s3^2)
//!    keep their lengths and angle under H, so n = v2 x u;
//! 2. R maps the basis (v2, u, n) to (H v2, H u, H v2 x H u); t / d = (H - R) n;
//! 3. n and -n (with -t / d) are the same H: the sign with n . (ray) > 0 for more of the matches is taken; two
//!    solutions remain, which only a third view or knowledge of the plane can tell apart if both see all points in front.
//!
//! Degenerate: s1 = s3, a camera that only turned (or the plane of infinite distance): R with t / d = 0, no normal.
//!
//! Source: Ma, Soatto, Košecká and Sastry, An Invitation to 3-D Vision (2004), 5.3; the closed form of Malis and Vargas
//! (2007) gives the same.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::pair::Correspondence;
use crate::linalg::{nearest_rotation, svd3};

/// One decomposition of a homography.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanePose {
    /// Rotation second_from_first.
    pub rotation: Rotation3<f64>,
    /// Translation second_from_first over the plane's distance from the first camera.
    pub translation_over_distance: Vector3<f64>,
    /// Unit normal of the plane in the first camera's axes, away from the camera; zero for a camera that only turned.
    pub normal: Vector3<f64>,
    /// Matches with n . ray > 0 in the first view: in front of the first camera if on the plane.
    pub in_front: usize,
}

/// The two motions behind a homography `second ~ H first` of normalised coordinates (one if the camera only turned), the
/// one with more of the matches in front first. Empty for NaN, a singular H or no matches. O(n).
///
/// `turn_only` is the relative difference of the outer singular values below which the camera is taken to have only
/// turned (relative to the middle one); a few eps for exact matrices, a few sigma_px / f for estimated ones.
#[must_use]
pub fn plane_poses(
    homography: &Matrix3<f64>,
    matches: &[Correspondence],
    turn_only: f64,
) -> Vec<PlanePose> {
    let Ok(svd) = svd3(homography) else {
        return Vec::new();
    };
    let s = svd.singular_values;
    if s[2] <= 3.0 * f64::EPSILON * s[0] || matches.is_empty() {
        return Vec::new();
    }
    // Points in front of both cameras have q2^T H q1 > 0.
    let positive = matches
        .iter()
        .filter(|m| m.second.push(1.0).dot(&(homography * m.first.push(1.0))) > 0.0)
        .count();
    let sign = if 2 * positive >= matches.len() {
        1.0
    } else {
        -1.0
    };
    let scale = sign / s[1];
    let h = homography * scale;
    let (s1, s3) = (s[0] / s[1], s[2] / s[1]);
    if s1 - s3 <= turn_only.max(16.0 * f64::EPSILON) {
        let Ok(rotation) = nearest_rotation(&h) else {
            return Vec::new();
        };
        return vec![PlanePose {
            rotation,
            translation_over_distance: Vector3::zeros(),
            normal: Vector3::zeros(),
            in_front: matches.len(),
        }];
    }
    let v = svd.v_transposed.transpose();
    let column = |k: usize| -> Vector3<f64> { v.column(k).into() };
    let (v1, v2, v3) = (column(0), column(1), column(2));
    // 1 - s3^2 and s1^2 - 1 by factors: no cancellation of squares.
    let along_first = ((1.0 - s3) * (1.0 + s3)).max(0.0).sqrt();
    let along_third = ((s1 - 1.0) * (s1 + 1.0)).max(0.0).sqrt();
    let mut poses = Vec::with_capacity(2);
    for side in [1.0, -1.0] {
        let u = (v1 * along_first + v3 * (side * along_third)).normalize();
        let mut normal = v2.cross(&u);
        let from = Matrix3::from_columns(&[v2, u, normal]);
        let (h2, hu) = (h * v2, h * u);
        let to = Matrix3::from_columns(&[h2, hu, h2.cross(&hu)]);
        let Ok(rotation) = nearest_rotation(&(to * from.transpose())) else {
            continue;
        };
        let mut translation = (h - rotation.matrix()) * normal;
        let ahead = matches
            .iter()
            .filter(|m| normal.dot(&m.first.push(1.0)) > 0.0)
            .count();
        let in_front = ahead.max(matches.len() - ahead);
        if ahead < in_front {
            normal = -normal;
            translation = -translation;
        }
        poses.push(PlanePose {
            rotation,
            translation_over_distance: translation,
            normal,
            in_front,
        });
    }
    poses.sort_by_key(|p| std::cmp::Reverse(p.in_front));
    poses
}
