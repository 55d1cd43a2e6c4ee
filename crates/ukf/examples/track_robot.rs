//! A robot drives a circle and sees two beacons by range and bearing; the filter follows it, and
//! says whether its own covariance was honest.
//!
//! `cargo run --example track_robot`

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use ukf::{Angle, Manifold, Se2, SigmaPoints, Ukf, UkfError, assess_consistency};

/// A measurement is a point of its own space: the bearing wraps, the range does not.
#[derive(Clone, Copy)]
struct RangeBearing {
    range: f64,
    bearing: Angle,
}

impl Manifold<2> for RangeBearing {
    fn retract(&self, tangent: &Vector2<f64>) -> Self {
        Self {
            range: self.range + tangent.x,
            bearing: Angle::new(self.bearing.radians() + tangent.y),
        }
    }

    fn local(&self, other: &Self) -> Vector2<f64> {
        Vector2::new(
            other.range - self.range,
            self.bearing.local(&other.bearing)[0],
        )
    }
}

fn observe(pose: &Se2, beacon: Vector2<f64>) -> RangeBearing {
    let offset = beacon - Vector2::new(pose.x, pose.y);
    RangeBearing {
        range: offset.norm(),
        bearing: Angle::new(offset.y.atan2(offset.x) - pose.phi),
    }
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), UkfError> {
    let step = Vector3::new(0.2, 0.0, 0.1);
    let process_deviation = Vector3::new(0.02, 0.005, 0.01);
    let measurement_deviation = Vector2::new(0.05, 0.01);
    let q = Matrix3::from_diagonal(&process_deviation.map(|d| d * d));
    let r = Matrix2::from_diagonal(&measurement_deviation.map(|d| d * d));
    let beacons = [Vector2::new(4.0, 1.0), Vector2::new(-3.0, 5.0)];

    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut normal = || -> f64 { rng.sample(StandardNormal) };
    let mut truth = Se2::default();
    let mut filter = Ukf::new(truth, Matrix3::identity() * 1e-4, SigmaPoints::default())?;
    let mut nis = Vec::new();
    for k in 1..=126 {
        let noise = Vector3::from_fn(|_, _| normal()).component_mul(&process_deviation);
        truth = truth.retract(&step).retract(&noise);
        filter.predict(&q, |pose| pose.retract(&step))?;
        for beacon in beacons {
            let noise = Vector2::from_fn(|_, _| normal()).component_mul(&measurement_deviation);
            let measured = observe(&truth, beacon).retract(&noise);
            nis.push(
                filter
                    .update(&measured, &r, |pose| observe(pose, beacon))?
                    .nis,
            );
        }
        if k % 21 == 0 {
            let error = filter.mean().local(&truth);
            let deviation = filter.covariance().diagonal().map(f64::sqrt);
            println!(
                "step {k:3}: error forward {:+.3} m (sigma {:.3}), left {:+.3} m (sigma {:.3})",
                error.x, deviation.x, error.y, deviation.y
            );
        }
    }
    let judged = assess_consistency(nis, 2, 0.95)?;
    println!(
        "mean NIS {:.2}, 95 % bounds {:.2} to {:.2}: {:?}",
        judged.mean, judged.lower, judged.upper, judged.verdict
    );
    Ok(())
}
