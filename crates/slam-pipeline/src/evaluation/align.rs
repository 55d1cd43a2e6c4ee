//! Least-squares alignment of matched positions.
//!
//! Minimises `sum |y_i - (s R x_i + t)|^2` (Umeyama, PAMI 1991). The rotation is found by
//! Horn's quaternion form (JOSA A 1987): the unit quaternion is the eigenvector of the
//! largest eigenvalue of a symmetric 4x4 matrix built from the cross-covariance. It is
//! always a proper rotation, equal to Umeyama's, and needs no singular value
//! decomposition. The scale is `sum y_i' . R x_i' / sum |x_i'|^2` with centred points.
//! In the plane (SE(2)) the angle has a closed form and height is left alone.
//!
//! Positions on one line leave the rotation about it open: that is an error for SE(3) and
//! Sim(3) and no problem for SE(2).

use std::fmt;

use nalgebra::{Isometry3, Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3};

use super::EvaluationError;

/// What may be removed from the estimate before errors are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alignment {
    /// Nothing: both trajectories share a frame.
    None,
    /// Rotation about z and translation in the plane.
    Se2,
    /// Rotation and translation.
    Se3,
    /// Rotation, translation and scale.
    Sim3,
}

impl fmt::Display for Alignment {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Alignment::None => "none",
            Alignment::Se2 => "se2",
            Alignment::Se3 => "se3",
            Alignment::Sim3 => "sim3",
        })
    }
}

/// `x -> scale * R x + t`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Scale; one unless the alignment was [`Alignment::Sim3`].
    pub scale: f64,
    /// Rotation and translation, applied after the scale.
    pub reference_from_estimate: Isometry3<f64>,
}

impl Similarity {
    /// The aligned pose: its position scaled, then moved; its rotation turned.
    pub fn apply(&self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let mut scaled = *pose;
        scaled.translation.vector *= self.scale;
        self.reference_from_estimate * scaled
    }
}

/// The similarity of the asked kind that brings `estimate` closest to `reference` (same lengths, metres).
///
/// # Errors
/// [`EvaluationError::Degenerate`] when the positions do not determine it.
pub fn align_positions(
    estimate: &[Vector3<f64>],
    reference: &[Vector3<f64>],
    alignment: Alignment,
) -> Result<Similarity, EvaluationError> {
    let identity = Similarity {
        scale: 1.0,
        reference_from_estimate: Isometry3::identity(),
    };
    if alignment == Alignment::None {
        return Ok(identity);
    }
    let degenerate = |reason| EvaluationError::Degenerate {
        alignment,
        poses: estimate.len(),
        reason,
    };
    let poses = estimate.len().min(reference.len());
    if poses < 2 {
        return Err(degenerate("at least two are needed"));
    }
    let mean = |points: &[Vector3<f64>]| points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let (estimate_mean, reference_mean) = (mean(estimate), mean(reference));
    let mut cross = Matrix3::zeros();
    let mut estimate_square = 0.0;
    let mut reference_square = 0.0;
    for (x, y) in estimate.iter().zip(reference) {
        let (x, y) = (x - estimate_mean, y - reference_mean);
        cross += x * y.transpose();
        estimate_square += x.norm_squared();
        reference_square += y.norm_squared();
    }
    // Rounding of the centred coordinates: what is smaller carries no direction.
    let size = estimate_mean.norm_squared() + reference_mean.norm_squared();
    let floor = (f64::EPSILON * f64::EPSILON) * size * poses as f64;
    if estimate_square.min(reference_square) <= floor {
        return Err(degenerate("they all coincide"));
    }
    let rotation = match alignment {
        Alignment::Se2 => {
            let (sin, cos) = (cross[(0, 1)] - cross[(1, 0)], cross[(0, 0)] + cross[(1, 1)]);
            if sin.hypot(cos) <= f64::EPSILON * (estimate_square * reference_square).sqrt() {
                return Err(degenerate("they fix no direction in the plane"));
            }
            UnitQuaternion::from_euler_angles(0.0, 0.0, sin.atan2(cos))
        }
        _ => horn_rotation(&cross).ok_or_else(|| degenerate("they lie on one line"))?,
    };
    let scale = match alignment {
        Alignment::Sim3 => {
            (rotation.to_rotation_matrix().matrix().transpose() * cross.transpose()).trace()
                / estimate_square
        }
        _ => 1.0,
    };
    let mut translation = reference_mean - rotation * (estimate_mean * scale);
    if alignment == Alignment::Se2 {
        translation.z = 0.0;
    }
    Ok(Similarity {
        scale,
        reference_from_estimate: Isometry3::from_parts(translation.into(), rotation),
    })
}

/// Rotation maximising `sum y . R x` for `cross = sum x y^T`; `None` when it is not unique.
fn horn_rotation(cross: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let s = |row: usize, column: usize| cross[(row, column)];
    let (a, b, c) = (s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0));
    let (d, e, f) = (s(0, 1) + s(1, 0), s(2, 0) + s(0, 2), s(1, 2) + s(2, 1));
    let (xx, yy, zz) = (s(0, 0), s(1, 1), s(2, 2));
    #[rustfmt::skip]
    let horn = Matrix4::new(
        xx + yy + zz, a,            b,            c,
        a,            xx - yy - zz, d,            e,
        b,            d,            yy - xx - zz, f,
        c,            e,            f,            zz - xx - yy,
    );
    let eigen = horn.symmetric_eigen();
    let mut order = [0, 1, 2, 3];
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let largest = eigen.eigenvalues[order[0]];
    let gap = largest - eigen.eigenvalues[order[1]];
    // The gap is twice the sum of the two smaller (signed) singular values of the cross-covariance.
    if largest <= 0.0 || gap <= 1e-12 * largest {
        return None;
    }
    let q = eigen.eigenvectors.column(order[0]);
    Some(UnitQuaternion::from_quaternion(Quaternion::new(
        q[0], q[1], q[2], q[3],
    )))
}
