//! The filters in `f32`: against the same filters in `f64`, and at the size of their rounding.

use nalgebra::{Matrix1, Matrix2, Matrix3, UnitQuaternion, Vector1, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use ukf::generic::{SigmaPoints, SquareRootUkf, Ukf};
use ukf::{CholeskyFactor, Manifold, Real, UkfError, generic, single, unscented_update};

/// A robot with heading that sees the range and bearing of two beacons for 200 steps; the last mean and covariance.
fn drive<T: Real>() -> Result<(Vector3<f64>, Matrix3<f64>), UkfError>
where
    generic::Se2<T>: Manifold<3, T>,
{
    let of = |value: f64| T::of(value);
    let start = generic::Se2::new(of(0.0), of(0.0), of(0.0));
    let covariance = Matrix3::from_diagonal(&Vector3::new(of(0.1), of(0.1), of(0.05)));
    let mut filter = Ukf::new(start, covariance, SigmaPoints::default())?;
    let process = Matrix3::from_diagonal(&Vector3::new(of(1e-4), of(1e-6), of(1e-5)));
    let noise = Matrix2::from_diagonal(&Vector2::new(of(0.01), of(1e-3)));
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut truth = ukf::Se2::new(0.2, -0.1, 0.1);
    let step = ukf::Se2::new(0.1, 0.0, 0.03);
    for _ in 0..200 {
        truth = truth.compose(&step);
        filter.predict(&process, |pose| {
            pose.compose(&generic::Se2::new(of(0.1), of(0.0), of(0.03)))
        })?;
        for beacon in [Vector2::new(3.0, 4.0), Vector2::new(-2.0, 5.0)] {
            let seen = truth.inverse().act(&beacon);
            let range = seen.norm() + rng.random_range(-0.17..0.17);
            let bearing = seen.y.atan2(seen.x) + rng.random_range(-0.05..0.05);
            let beacon = beacon.map(of);
            let measured = RangeBearing {
                range: of(range),
                bearing: generic::Angle::new(of(bearing)),
            };
            filter.update(&measured, &noise, |pose| {
                let seen = pose.inverse().act(&beacon);
                RangeBearing {
                    range: seen.norm(),
                    bearing: generic::Angle::new(seen.y.atan2(seen.x)),
                }
            })?;
        }
    }
    let (mean, covariance) = (filter.mean(), filter.covariance());
    Ok((
        Vector3::new(mean.x.into(), mean.y.into(), mean.phi.into()),
        covariance.map(Into::into),
    ))
}

#[derive(Clone)]
struct RangeBearing<T> {
    range: T,
    bearing: generic::Angle<T>,
}

impl<T: Real> Manifold<2, T> for RangeBearing<T> {
    fn retract(&self, tangent: &Vector2<T>) -> Self {
        Self {
            range: self.range + tangent.x,
            bearing: self.bearing.retract(&Vector1::new(tangent.y)),
        }
    }

    fn local(&self, other: &Self) -> Vector2<T> {
        Vector2::new(
            other.range - self.range,
            self.bearing.local(&other.bearing)[0],
        )
    }
}

/// 400 updates, each rounding by a few eps of `f32` (1.2e-7) of numbers up to 5 and contracting what came before.
#[test]
fn a_drive_in_single_precision_ends_where_double_precision_does() {
    let (single, double) = (drive::<f32>().unwrap(), drive::<f64>().unwrap());
    assert!((single.0 - double.0).amax() < 1e-4, "{single:?} {double:?}");
    assert!((single.1 - double.1).amax() < 1e-4 * double.1.amax());
    assert!((single.0 - double.0).amax() > 0.0);
}

/// The factor form keeps standard deviations within 1e7 of one another: the closed form of the scalar update holds where
/// variances differ by 1e12, of which `f32` could not hold the difference.
#[test]
fn a_precise_measurement_leaves_its_own_variance() {
    let mut filter = single::Ukf::new(
        Vector2::new(0.0, 0.0),
        Matrix2::identity() * 1e6,
        single::SigmaPoints::default(),
    )
    .unwrap();
    filter
        .update(&Vector1::new(1.0), &Matrix1::new(1e-6), |x| {
            Vector1::new(x[0])
        })
        .unwrap();
    let variance = filter.covariance()[(0, 0)];
    assert!((variance / 1e-6 - 1.0).abs() < 1e-4, "{variance}");
    assert!((filter.mean()[0] - 1.0).abs() < 1e-6);
}

/// Rounding of a mean far from zero is not taken for the fold of a circle.
#[test]
fn a_mean_of_a_million_is_no_fold() {
    let moved = |mean: f32, sigma: f32| {
        let covariance = Matrix1::new(sigma * sigma);
        let mut filter = single::Ukf::new(
            Vector1::new(mean),
            covariance,
            single::SigmaPoints::default(),
        )
        .unwrap();
        filter.predict(&Matrix1::new(0.0), |x| *x).unwrap();
        filter.covariance()[0].sqrt()
    };
    for sigma in [0.5, 3.0, 1e3] {
        assert!((moved(1e6, sigma) / sigma - 1.0).abs() < 0.1, "{sigma}");
    }
    // and an unknown heading is one
    let mut heading = single::Ukf::new(
        single::Angle::new(-2.0),
        Matrix1::new(9.87),
        single::SigmaPoints::default(),
    )
    .unwrap();
    heading
        .update(&single::Angle::new(0.5), &Matrix1::new(0.01), |x| *x)
        .unwrap();
    assert!((heading.mean().radians() - 0.5).abs() < 0.003);
    assert!((heading.covariance()[0].sqrt() - 0.1).abs() < 1e-3);
}

#[test]
fn errors_tell_their_numbers_in_either_precision() {
    let error = single::SigmaPoints::<3>::scaled(0.0, 0.0, 2.0).unwrap_err();
    assert_eq!(error, UkfError::InvalidSpread { value: 0.0 });
    let indefinite = Matrix2::new(1.0_f32, 2.0, 2.0, 1.0);
    let update = unscented_update(
        &Vector2::new(0.0_f32, 0.0),
        &indefinite,
        &Vector1::new(0.0),
        &Matrix1::new(1.0),
        |x| Vector1::new(x[0]),
    );
    let told = update.unwrap_err().to_string();
    assert!(told.contains("pivot 1 of the matrix is -3"), "{told}");
}

#[test]
fn rotations_and_factors_work_in_single_precision() {
    let turn = Vector3::new(0.3_f32, -0.2, 1.1);
    let start = UnitQuaternion::<f32>::identity();
    let turned = start.retract(&turn);
    assert!((start.local(&turned) - turn).amax() < 1e-6);
    let root = single::CholeskyFactor::definite(&(Matrix3::identity() * 0.04)).unwrap();
    let mut filter = SquareRootUkf::new(start, root, SigmaPoints::default()).unwrap();
    let noise = single::CholeskyFactor::definite(&(Matrix3::identity() * 1e-4)).unwrap();
    filter.predict(&noise, |q| q.retract(&turn)).unwrap();
    filter.update(&turned, &noise, |q| *q).unwrap();
    assert!(filter.mean().local(&turned).norm() < 1e-2);
    let double = CholeskyFactor::definite(&(Matrix3::<f64>::identity() * 1e-4)).unwrap();
    assert!((f64::from(noise.lower()[(0, 0)]) - double.lower()[(0, 0)]).abs() < 1e-9);
}
