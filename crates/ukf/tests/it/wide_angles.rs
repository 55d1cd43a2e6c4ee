//! Headings and rotations of which little is known.

use std::f64::consts::PI;

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector1, Vector2, Vector3};
use proptest::prelude::*;
use ukf::{
    Angle, AugmentedPoints, Manifold, Se2, SigmaPoints, SquareRootUkf, Ukf, UkfError,
    unscented_transform,
};

type Scalar = SMatrix<f64, 1, 1>;

fn sets() -> [SigmaPoints<1>; 4] {
    [
        SigmaPoints::default(),
        SigmaPoints::paper(),
        SigmaPoints::scaled(0.5, 2.0, 0.0).expect("a spread"),
        SigmaPoints::simplex(0.3).expect("a weight"),
    ]
}

/// A robot that does not know its heading and reads a compass: the points lay past pi and were seen from the other side,
/// and the filter answered 1.345 +- 0.633 with a NIS of 25.4.
#[test]
fn regress_a_compass_tells_a_heading_of_which_nothing_was_known() {
    let compass = Angle::new(0.5);
    let noise = Scalar::new(0.01);
    for sigma in [1.0, 1.5, 1.81, 2.0, 2.5, PI, 4.0] {
        for set in sets() {
            let mut filter = Ukf::new(Angle::new(-2.0), Scalar::new(sigma * sigma), set).unwrap();
            let told = filter.update(&compass, &noise, |x| *x).unwrap();
            // as on a line: 2.5 rad away
            let variance = 1.0 / (1.0 / (sigma * sigma) + 1.0 / 0.01);
            let pulled = 0.5 - 2.5 * variance / (sigma * sigma);
            assert!((filter.mean().radians() - pulled).abs() < 1e-9, "{sigma}");
            assert!(
                (filter.covariance()[0] / variance - 1.0).abs() < 1e-9,
                "{sigma}"
            );
            assert!(
                (told.nis - 6.25 / (sigma * sigma + 0.01)).abs() < 1e-9,
                "{sigma}"
            );
        }
    }
    let mut filter = Ukf::new(
        Angle::new(-2.0),
        Scalar::new(PI * PI),
        SigmaPoints::default(),
    )
    .unwrap();
    filter.update(&compass, &noise, |x| *x).unwrap();
    assert!((filter.mean().radians() - 0.5).abs() < 0.003);
    assert!((filter.covariance()[0].sqrt() - 0.1).abs() < 1e-4);
}

/// Doing nothing told a filter its heading: sigma pi came back as 0.488, of headings and of rotations.
#[test]
fn regress_a_prediction_that_does_nothing_keeps_what_is_not_known() {
    for sigma in [0.1, 1.8, 1.82, 2.0, PI, 4.5] {
        for set in sets() {
            let mut filter = Ukf::new(Angle::new(1.0), Scalar::new(sigma * sigma), set).unwrap();
            filter.predict(&Scalar::new(0.0), |x| *x).unwrap();
            assert!(
                (filter.covariance()[0].sqrt() / sigma - 1.0).abs() < 1e-9,
                "{sigma}"
            );
            assert!((filter.mean().radians() - 1.0).abs() < 1e-9);
        }
        let attitude = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.9));
        let p = Matrix3::identity() * (sigma * sigma);
        let mut filter = Ukf::new(attitude, p, SigmaPoints::default()).unwrap();
        filter.predict(&Matrix3::zeros(), |x| *x).unwrap();
        assert!(
            (filter.covariance() - p).amax() < 1e-9 * sigma * sigma,
            "{sigma}"
        );
        assert!(filter.mean().angle_to(&attitude) < 1e-9);
    }
}

/// A star tracker after a tumble: all three axes unknown.
#[test]
fn a_rotation_of_which_nothing_was_known_is_measured() {
    let truth = UnitQuaternion::from_scaled_axis(Vector3::new(0.8, -0.9, 1.1));
    for sigma in [1.5, 1.81, PI] {
        let p = Matrix3::identity() * (sigma * sigma);
        let mut filter = Ukf::new(UnitQuaternion::identity(), p, SigmaPoints::default()).unwrap();
        filter
            .update(&truth, &(Matrix3::identity() * 1e-4), |x| *x)
            .unwrap();
        assert!(filter.mean().angle_to(&truth) < 1e-3);
        assert!((filter.covariance() - Matrix3::identity() * 1e-4).amax() < 1e-8);
    }
}

/// A pose whose heading is unknown and whose place is known: the points of the other axes stay where they are.
#[test]
fn a_pose_with_an_unknown_heading_keeps_its_place() {
    let p = Matrix3::from_diagonal(&Vector3::new(0.04, 0.09, PI * PI));
    let mut filter = Ukf::new(Se2::new(3.0, -1.0, 2.0), p, SigmaPoints::default()).unwrap();
    filter.predict(&Matrix3::zeros(), |x| *x).unwrap();
    assert!((filter.covariance() - p).amax() < 1e-9);
    filter
        .update(&Angle::new(-1.0), &Scalar::new(1e-4), |x| Angle::new(x.phi))
        .unwrap();
    assert!((filter.mean().phi + 1.0).abs() < 1e-3);
    assert!((filter.covariance()[(2, 2)].sqrt() - 0.01).abs() < 1e-5);

    // noise inside the model, and the square-root form
    let mut augmented = Ukf::new(Se2::new(3.0, -1.0, 2.0), p, SigmaPoints::default()).unwrap();
    let points = AugmentedPoints::default();
    augmented
        .predict_augmented(&Scalar::new(0.01), &points, |x, w: &Vector1<f64>| {
            x.retract(&Vector3::new(0.0, 0.0, w[0]))
        })
        .unwrap();
    assert!((augmented.covariance()[(2, 2)] / (PI * PI + 0.01) - 1.0).abs() < 1e-9);
    let root = ukf::CholeskyFactor::definite(&p).unwrap();
    let none = ukf::CholeskyFactor::semidefinite(&Matrix3::zeros()).unwrap();
    let mut square_root =
        SquareRootUkf::new(Se2::new(3.0, -1.0, 2.0), root, SigmaPoints::default()).unwrap();
    square_root.predict(&none, |x| *x).unwrap();
    assert!((square_root.covariance() - p).amax() < 1e-9);
}

/// Wider than the second order can mean anything: the width given and the width that fits are told.
#[test]
fn a_width_beyond_the_space_is_refused_with_its_number() {
    for sigma in [5.0, 10.0, 1e3, 1e6, 1e150] {
        let mut filter = Ukf::new(
            Angle::new(0.3),
            Scalar::new(sigma * sigma),
            SigmaPoints::default(),
        )
        .unwrap();
        let before = filter;
        match filter.predict(&Scalar::new(0.0), |x| *x).unwrap_err() {
            UkfError::TooWide {
                axis: 0,
                sigma: given,
                at_most,
            } => {
                assert!((given / sigma - 1.0).abs() < 1e-12);
                // 0.9 pi sqrt(3)
                assert!((at_most - 4.897).abs() < 1e-3, "{at_most}");
            }
            other => panic!("{other:?}"),
        }
        assert!(
            filter
                .update(&Angle::new(0.0), &Scalar::new(1.0), |x| *x)
                .is_err()
        );
        assert_eq!(filter, before);
    }
    let mut filter = Ukf::new(Angle::new(0.3), Scalar::new(100.0), SigmaPoints::default()).unwrap();
    assert_eq!(
        filter
            .predict(&Scalar::new(0.0), |x| *x)
            .unwrap_err()
            .to_string(),
        "the standard deviation along axis 0 of the state is 10, at most 4.89726 can be spread on a circle; \
         a heading of which nothing is known has 1.81 rad"
    );
}

/// Steps that are lost in a vector's own rounding are no fold.
#[test]
fn vectors_are_never_too_wide() {
    for (at, sigma) in [
        (0.0, 1e9),
        (1e9, 1e-9),
        (1e15, 1.0),
        (-1e300, 1e-300),
        (5.0, 0.0),
    ] {
        let p = Scalar::new(sigma * sigma);
        let out =
            unscented_transform(&Vector1::new(at), &p, &SigmaPoints::default(), |x| *x).unwrap();
        assert_eq!(out.mean[0], at);
    }
    // a place far away beside a heading that is unknown
    let p = Matrix3::from_diagonal(&Vector3::new(1e-18, 1e-18, PI * PI));
    let far = Se2::new(1e9, 1e9, 1.0);
    let out =
        unscented_transform(&far, &p, &SigmaPoints::default(), |x| Angle::new(x.phi)).unwrap();
    let covariance: Scalar = out.covariance;
    assert!((covariance[0] / (PI * PI) - 1.0).abs() < 1e-6);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Rotations of any width up to the bound, correlated: an identity keeps mean and covariance, or the width is refused.
    #[test]
    fn every_accepted_width_comes_back(
        entries in prop::array::uniform9(-1.0..1.0_f64), width in 0.01..4.0_f64, centre in -3.0..3.0_f64,
    ) {
        let root = Matrix3::from_row_slice(&entries) * width;
        let p = root * root.transpose() + Matrix3::identity() * 1e-6;
        let attitude = UnitQuaternion::from_scaled_axis(Vector3::new(centre, 0.2, -0.4));
        for set in [SigmaPoints::default(), SigmaPoints::simplex(0.25).unwrap(), SigmaPoints::paper()] {
            let mut filter = Ukf::new(attitude, p, set).unwrap();
            match filter.predict(&Matrix3::zeros(), |x| *x) {
                Ok(()) => {
                    prop_assert!((filter.covariance() - p).amax() < 1e-6 * p.amax());
                    prop_assert!(filter.mean().angle_to(&attitude) < 1e-6);
                }
                Err(UkfError::TooWide { sigma, at_most, .. }) => prop_assert!(sigma > at_most && at_most > 2.0),
                Err(other) => prop_assert!(false, "{other:?}"),
            }
        }
        let plane = Vector2::new(1e3 * width, -width);
        let kept = unscented_transform(&plane, &(SMatrix::<f64, 2, 2>::identity() * width), &SigmaPoints::default(), |x| *x).unwrap();
        prop_assert!((kept.mean - plane).amax() < 1e-12 * plane.amax());
    }
}
