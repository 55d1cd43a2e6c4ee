//! NEES and NIS of a nonlinear filter over many runs, inside their chi-square bounds.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use ukf::{
    Angle, Manifold, Se2, SigmaPoints, Ukf, Verdict, assess_consistency, normalized_error_squared,
};

#[derive(Clone, Copy)]
struct RangeBearing {
    range: f64,
    bearing: Angle,
}

impl Manifold<2> for RangeBearing {
    fn retract(&self, t: &Vector2<f64>) -> Self {
        Self {
            range: self.range + t[0],
            bearing: self.bearing.retract(&t.fixed_rows::<1>(1).into()),
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
    let direction = Angle::new(offset.y.atan2(offset.x));
    RangeBearing {
        range: offset.norm(),
        bearing: Angle::new(direction.radians() - pose.phi),
    }
}

/// 100 runs of 30 steps. Bounds at 99.9 %; the same runs judged with the noise halved must fail,
/// so the test has the power to see a wrong covariance.
#[test]
fn a_range_bearing_robot_is_consistent() {
    let process_deviation = Vector3::new(0.03, 0.01, 0.02);
    let measurement_deviation = Vector2::new(0.1, 0.02);
    let q = Matrix3::from_diagonal(&process_deviation.component_mul(&process_deviation));
    let r = Matrix2::from_diagonal(&measurement_deviation.component_mul(&measurement_deviation));
    let beacons = [Vector2::new(5.0, 0.0), Vector2::new(-2.0, 4.0)];
    let step = Vector3::new(0.2, 0.0, 0.1);
    for (trust, verdict) in [(1.0, Verdict::Consistent), (0.5, Verdict::Overconfident)] {
        let (mut nees, mut nis) = (vec![], vec![]);
        for seed in 0..100 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut normal = || rng.sample::<f64, _>(StandardNormal);
            let start_deviation = Vector3::new(0.1, 0.1, 0.05);
            let p = Matrix3::from_diagonal(&start_deviation.component_mul(&start_deviation));
            // heading towards the cut at pi
            let mean = Se2::new(0.0, 0.0, 2.5);
            let noise = Vector3::from_fn(|_, _| normal()).component_mul(&start_deviation);
            let mut truth = mean.retract(&noise);
            let mut filter = Ukf::new(mean, p * trust, SigmaPoints::default()).unwrap();
            for _ in 0..30 {
                let noise = Vector3::from_fn(|_, _| normal()).component_mul(&process_deviation);
                truth = truth.retract(&step).retract(&noise);
                filter
                    .predict(&(q * trust), |pose| pose.retract(&step))
                    .unwrap();
                for beacon in beacons {
                    let noise =
                        Vector2::from_fn(|_, _| normal()).component_mul(&measurement_deviation);
                    let z = observe(&truth, beacon).retract(&noise);
                    let told = filter.update(&z, &(r * trust), |pose| observe(pose, beacon));
                    nis.push(told.unwrap().nis);
                }
            }
            let error = filter.mean().local(&truth);
            nees.push(normalized_error_squared(&error, filter.covariance()).unwrap());
        }
        let nees = assess_consistency(nees, 3, 0.999).unwrap();
        let nis = assess_consistency(nis, 2, 0.999).unwrap();
        assert_eq!(nees.verdict, verdict, "{nees:?}");
        assert_eq!(nis.verdict, verdict, "{nis:?}");
    }
}
