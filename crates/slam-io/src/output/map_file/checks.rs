//! Whether the numbers of a map can be those of a map.

use nalgebra::{DMatrix, Matrix3};
use slam_pipeline::KnownMap;

use super::bytes::Fault;

/// Keyframes whose errors are known together, at most: a factor of their covariance is computed.
const MOST_ERRORS: usize = 256;
/// Negative eigenvalue of a correlation matrix that rounding explains, and rounding of a rotation.
const ROUNDING: f64 = 1e-9;
/// The same of the errors of many keyframes together, which long sums of products give.
const JOINT_ROUNDING: f64 = 1e-6;

/// Refuses a covariance that is not symmetric or has a negative variance in some direction; `what` names its owner.
///
/// Units differ between the axes, so the matrix is judged with every axis scaled by its own standard deviation.
pub(super) fn covariance(matrix: &Matrix3<f64>, what: &str) -> Result<(), Fault> {
    let fault = |found: String| {
        Err(Fault::new(
            format!("a positive semi-definite covariance of {what}"),
            found,
        ))
    };
    let scale = matrix
        .diagonal()
        .map(|v| if v > 0.0 { v.sqrt().recip() } else { 1.0 });
    let correlation = Matrix3::from_diagonal(&scale) * matrix * Matrix3::from_diagonal(&scale);
    if !correlation.iter().all(|v| v.is_finite()) {
        return fault("one of numbers beyond any scale".to_owned());
    }
    let skew = (correlation - correlation.transpose()).amax();
    if skew > ROUNDING {
        return fault(format!("one that is not symmetric by {skew:.3e}"));
    }
    let least = correlation.symmetric_eigenvalues().min();
    // NaN is no eigenvalue either.
    if least >= -ROUNDING {
        Ok(())
    } else {
        fault(format!("one with the eigenvalue {least:.3e}"))
    }
}

/// Refuses a matrix that is no rotation.
pub(super) fn rotation(matrix: &Matrix3<f64>, what: &str) -> Result<(), Fault> {
    let error = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    if error <= ROUNDING && matrix.determinant() > 0.0 {
        Ok(())
    } else {
        Err(Fault::new(
            format!("a rotation of {what}"),
            format!("a matrix that misses one by {error:.3e}"),
        ))
    }
}

/// Refuses an id that does not follow its predecessor.
pub(super) fn ascending(before: Option<u32>, id: u32) -> Result<(), Fault> {
    match before {
        Some(before) if id <= before => Err(Fault::new(
            "landmarks in ascending order of id",
            format!("{id} after {before}"),
        )),
        _ => Ok(()),
    }
}

/// Refuses errors of keyframes that are not there, or whose joint covariance has a negative variance in some direction.
pub(super) fn errors(map: &KnownMap) -> Result<(), Fault> {
    let (listed, keyframes) = (&map.errors.keyframes, map.keyframes.len());
    let ascending = listed.windows(2).all(|pair| pair[0] < pair[1]);
    let within = listed
        .last()
        .is_none_or(|last| (*last as usize) < keyframes);
    if !ascending || !within || listed.len() > MOST_ERRORS {
        return Err(Fault::new(
            format!("errors of at most {MOST_ERRORS} of {keyframes} keyframes in their order"),
            format!("{} that are not", listed.len()),
        ));
    }
    for (row, keyframe) in map.errors.rows.iter().zip(listed) {
        if let Some(own) = row.last() {
            covariance(own, &format!("the error of keyframe {keyframe}"))?;
        }
    }
    let size = 3 * listed.len();
    let at = |i: usize, j: usize| map.errors.rows[i / 3][j / 3][(i % 3, j % 3)];
    let scale = |i: usize| {
        let variance = at(i, i);
        if variance > 0.0 {
            variance.sqrt().recip()
        } else {
            1.0
        }
    };
    let joint = DMatrix::from_fn(size, size, |i, j| {
        let (row, column) = (i.max(j), i.min(j));
        let same = f64::from(u8::from(i == j));
        at(row, column) * scale(i) * scale(j) + JOINT_ROUNDING * same
    });
    match joint.cholesky() {
        Some(_) => Ok(()),
        None => Err(Fault::new(
            "a positive semi-definite covariance of the errors of the keyframes",
            "one with a negative variance",
        )),
    }
}

/// Refuses anchors that are no keyframes.
pub(super) fn anchors_in_range(map: &KnownMap) -> Result<(), Fault> {
    let keyframes = map.keyframes.len();
    match map
        .landmarks
        .iter()
        .find(|landmark| landmark.anchor as usize >= keyframes)
    {
        None => Ok(()),
        Some(landmark) => Err(Fault::new(
            format!("anchors among {keyframes} keyframes"),
            format!("keyframe {} at landmark {}", landmark.anchor, landmark.id),
        )),
    }
}
