//! Several scans folded into one, for fewer frames and less of the noise that each drawn pose adds to the
//! map.
//!
//! Odometry over a second is far better than a bearing with 8 degrees of noise. So each measurement is
//! carried to the last pose of its block by odometry, and those of the same landmark are averaged
//! there. A filter that takes a block of K scans as one frame draws one pose instead of K, and the map
//! of a particle, which remembers its draws, walks away K times slower.

use super::simulation::{COMMAND_INTERVAL, COMMANDS_PER_SCAN, Scan, Settings, WHEELBASE};
use estimation_base::wrap;
use nalgebra::{Vector2, Vector3};
use std::collections::BTreeMap;

/// The number K of scans to fold, at most `longest`. It keeps the heading error of the odometry over the
/// block below half the bearing noise of the averages: sqrt(K) h < (1/2) sigma / sqrt(K).
pub(crate) fn block_size(settings: &Settings, longest: usize) -> usize {
    let per_command = settings.speed * COMMAND_INTERVAL * settings.steering_deviation / WHEELBASE;
    let per_scan = per_command * (COMMANDS_PER_SCAN as f64).sqrt();
    ((settings.bearing_deviation / (2.0 * per_scan)) as usize).clamp(1, longest)
}

/// Folds blocks of `size` scans, each into one scan at its last pose. The averages have the covariance
/// R / `size`, so a landmark that is missing in a scan of its block (2 % of the measurements) is left out.
pub(crate) fn fold_scans(scans: &[Scan], size: usize) -> Vec<Scan> {
    scans.chunks_exact(size).filter_map(fold).collect()
}

fn fold(block: &[Scan]) -> Option<Scan> {
    let mut pose = Vector3::<f64>::zeros();
    let mut seen = BTreeMap::<u32, Vec<Vector2<f64>>>::new();
    for scan in block {
        for &[speed, steering] in &scan.commands {
            let distance = speed * COMMAND_INTERVAL;
            let (sin, cos) = (pose.z + steering).sin_cos();
            pose += Vector3::new(cos, sin, steering.sin() / WHEELBASE) * distance;
        }
        for (id, measured) in &scan.measurements {
            let (sin, cos) = (pose.z + measured.y).sin_cos();
            let point = pose.xy() + Vector2::new(cos, sin) * measured.x;
            seen.entry(*id).or_default().push(point);
        }
    }
    let measurements = seen
        .into_iter()
        .filter(|(_, points)| points.len() == block.len())
        .map(|(id, points)| (id, average(&points, &pose)))
        .collect();
    let last = block.last()?;
    Some(Scan {
        truth: last.truth,
        commands: block
            .iter()
            .flat_map(|scan| scan.commands.iter().copied())
            .collect(),
        measurements,
    })
}

/// Mean range and bearing from `pose`: polar like the noise, so that a wide arc of points does not pull
/// their mean towards the robot.
fn average(points: &[Vector2<f64>], pose: &Vector3<f64>) -> Vector2<f64> {
    let polar = |point: &Vector2<f64>| {
        let offset = point - pose.xy();
        Vector2::new(offset.norm(), offset.y.atan2(offset.x) - pose.z)
    };
    let first = polar(&points[0]);
    let mut sum = Vector2::zeros();
    for point in points {
        let difference = polar(point) - first;
        sum += Vector2::new(difference.x, wrap(difference.y));
    }
    let mean = first + sum / points.len() as f64;
    Vector2::new(mean.x, wrap(mean.y))
}
