//! Errors of a path, as it is and after the rigid motion that fits it best.

use nalgebra::{Rotation2, Vector2};

/// The rotation and shift that bring `estimated` closest to `truth` in least squares (the closed form of
/// Horn and Umeyama in the plane, without scale). Slices of equal length.
pub(crate) fn fit_rigid(
    estimated: &[Vector2<f64>],
    truth: &[Vector2<f64>],
) -> (Rotation2<f64>, Vector2<f64>) {
    let count = truth.len() as f64;
    let from: Vector2<f64> = estimated.iter().sum::<Vector2<f64>>() / count;
    let to: Vector2<f64> = truth.iter().sum::<Vector2<f64>>() / count;
    let (mut cos, mut sin) = (0.0, 0.0);
    for (a, b) in estimated.iter().zip(truth) {
        let (a, b) = (a - from, b - to);
        cos += a.dot(&b);
        sin += a.perp(&b);
    }
    let rotation = Rotation2::new(sin.atan2(cos));
    (rotation, to - rotation * from)
}

/// Mean squared distance, square metres.
pub(crate) fn mean_squared(estimated: &[Vector2<f64>], truth: &[Vector2<f64>]) -> f64 {
    let sum: f64 = estimated
        .iter()
        .zip(truth)
        .map(|(a, b)| (a - b).norm_squared())
        .sum();
    sum / truth.len() as f64
}

/// All points moved.
pub(crate) fn moved(
    points: &[Vector2<f64>],
    motion: &(Rotation2<f64>, Vector2<f64>),
) -> Vec<Vector2<f64>> {
    points
        .iter()
        .map(|point| motion.0 * point + motion.1)
        .collect()
}
