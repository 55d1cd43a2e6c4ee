//! Whether the numbers of a map can be those of a map.

use nalgebra::Matrix3;
use slam_pipeline::KnownMap;

use super::bytes::Fault;

/// Negative eigenvalue of a correlation matrix that rounding explains, and rounding of a rotation.
const ROUNDING: f64 = 1e-9;

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
