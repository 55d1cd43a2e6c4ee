//! Names beside those of nalgebra: both crates under glob imports, as examples of others write them.

use nalgebra::*;
use ukf::*;

/// Every name of ukf is named here, so that none of them can become ambiguous unseen.
#[test]
fn both_crates_can_be_imported_whole() {
    let points: SigmaPoints<2> = SigmaPoints::default();
    let mut filter: Ukf<Vector2<f64>, 2> =
        Ukf::new(Vector2::new(0.0, 1.0), Matrix2::identity(), points).unwrap();
    let augmented: AugmentedPoints<2, 1> = AugmentedPoints::default();
    let told: Innovation<1> = filter
        .update(&Vector1::new(0.5), &Matrix1::new(0.1), |x| {
            Vector1::new(x[0])
        })
        .unwrap();
    let gate: Gate<1> = filter
        .gate(&Vector1::new(0.5), &Matrix1::new(0.1), 9.0, |x| {
            Vector1::new(x[0])
        })
        .unwrap();
    let iterated: Iterated<1> = filter
        .update_iterated(
            &Vector1::new(0.5),
            &Matrix1::new(0.1),
            &Iterations::default(),
            |x| Vector1::new(x[0]),
        )
        .unwrap();
    let measured: Measured<Vector1<f64>, 1> = Measured {
        value: Vector1::new(0.5),
        noise: Matrix1::new(0.1),
    };
    let fit: JointFit = filter
        .update_sequentially(&[measured], |x, _| Vector1::new(x[0]))
        .unwrap();
    let moved: Transformed<Vector2<f64>, 2, 2> =
        unscented_transform(filter.mean(), filter.covariance(), &points, |x| *x).unwrap();
    let moved_by_noise: Transformed<Vector2<f64>, 2, 2> = augmented_transform(
        filter.mean(),
        filter.covariance(),
        &Matrix1::new(0.1),
        &augmented,
        |x, w| x + Vector2::new(w[0], 0.0),
    )
    .unwrap();
    let corrected: Update<Vector2<f64>, 2, 1> = unscented_correction(
        filter.mean(),
        filter.covariance(),
        &points,
        &Vector1::new(0.5),
        &Matrix1::new(0.1),
        |x| Vector1::new(x[0]),
    )
    .unwrap();
    let factor: CholeskyFactor<2> = CholeskyFactor::definite(filter.covariance()).unwrap();
    let root: SquareRootUkf<Vector2<f64>, 2> =
        SquareRootUkf::new(*filter.mean(), factor, points).unwrap();
    let mut estimates = [Estimate {
        mean: *filter.mean(),
        covariance: *filter.covariance(),
    }; 2];
    let filtered = estimates;
    rts_smooth(
        &filtered,
        &mut estimates,
        &points,
        |_| Matrix2::identity(),
        |_, x| *x,
    )
    .unwrap();
    let judged: Consistency = assess_consistency([1.0, 0.9], 1, 0.95).unwrap();
    let (heading, pose): (Angle, Se2) = (Angle::new(0.1), Se2::new(0.0, 0.0, 0.1));
    let failed: UkfError = SigmaPoints::<2>::julier(-2.0).unwrap_err();
    let wrong: CholeskyError = CholeskyFactor::definite(&Matrix1::new(-1.0)).unwrap_err();
    let step = Step::Prediction;
    let nees = normalized_error_squared(&Vector1::new(1.0), &Matrix1::new(1.0)).unwrap();
    assert_eq!(stacked_workspace::<2, 1>(1), 1 + 2 + 1 + 5);
    assert!(matches!(judged.verdict, Verdict::Consistent));
    assert!(f64::EPSILON == <f64 as Real>::EPSILON && nees == 1.0);
    assert!(chi_square_quantile(1.0, 0.5).is_ok() && step != Step::Function);
    let _ = (
        told,
        gate,
        iterated,
        fit,
        moved,
        moved_by_noise,
        corrected,
        root,
        failed,
        wrong,
    );
    assert_eq!(pose.phi, heading.radians());
    let nearby = heading.retract(&Vector1::new(0.1));
    assert!(Manifold::<1>::local(&heading, &nearby)[0] > 0.0);
}
