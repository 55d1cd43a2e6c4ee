//! The filter against closed forms, and the printed forms it must not equal.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector1, Vector2, Vector3};
use proptest::prelude::*;
use std::f64::consts::PI;
use ukf::{
    Angle, CholeskyError, CholeskyFactor, Manifold, Se2, SigmaPoints, Step, Ukf, UkfError,
    unscented_correction, unscented_transform, unscented_update,
};

use crate::lost_pivot;

fn no_files() -> ProptestConfig {
    ProptestConfig {
        failure_persistence: None,
        cases: 64,
        ..ProptestConfig::default()
    }
}

fn entries<const N: usize>(range: f64) -> impl Strategy<Value = [f64; N]> {
    prop::array::uniform(-range..range)
}

/// B B^T plus a floor: positive definite with condition number up to about 1e3.
fn covariance<const N: usize>(root: &[f64], floor: f64) -> SMatrix<f64, N, N> {
    let root = SMatrix::<f64, N, N>::from_row_slice(root);
    root * root.transpose() + SMatrix::<f64, N, N>::identity() * floor
}

fn sets() -> [SigmaPoints<3>; 5] {
    [
        SigmaPoints::default(),
        SigmaPoints::paper(),
        SigmaPoints::julier(1.0).expect("valid parameters"),
        SigmaPoints::scaled(0.5, 2.0, 0.0).expect("valid parameters"),
        SigmaPoints::simplex(0.2).expect("valid parameters"),
    ]
}

/// Textbook Kalman filter: mean, covariance, nis, log likelihood.
fn kalman_update(
    mean: Vector3<f64>,
    p: Matrix3<f64>,
    z: Vector2<f64>,
    h: Matrix2x3<f64>,
    r: Matrix2<f64>,
) -> (Vector3<f64>, Matrix3<f64>, f64, f64) {
    let s = h * p * h.transpose() + r;
    let inverse = s.try_inverse().expect("positive definite");
    let k = p * h.transpose() * inverse;
    let innovation = z - h * mean;
    let nis = innovation.dot(&(inverse * innovation));
    let joseph = Matrix3::identity() - k * h;
    let posterior = joseph * p * joseph.transpose() + k * r * k.transpose();
    let log_likelihood = -0.5 * (nis + s.determinant().ln()) - (2.0 * PI).ln();
    (mean + k * innovation, posterior, nis, log_likelihood)
}

proptest! {
    #![proptest_config(no_files())]
    #[test]
    fn linear_models_equal_the_kalman_filter(
        mean in entries::<3>(2.0),
        p in entries::<9>(1.0),
        f in entries::<9>(1.0),
        q in entries::<9>(0.5),
        h in entries::<6>(1.0),
        r in entries::<4>(0.5),
        z in entries::<2>(2.0),
    ) {
        let (mean, z) = (Vector3::from(mean), Vector2::from(z));
        let (p, q) = (covariance::<3>(&p, 0.1), covariance::<3>(&q, 0.1));
        let (f, h) = (Matrix3::from_row_slice(&f), Matrix2x3::from_row_slice(&h));
        let r = covariance::<2>(&r, 0.1);
        for set in sets() {
            let mut filter = Ukf::new(mean, p, set).unwrap();
            let (mut m, mut c) = (mean, p);
            for _ in 0..3 {
                filter.predict(&q, |x| f * x).unwrap();
                m = f * m;
                c = f * c * f.transpose() + q;
                prop_assert!((filter.mean() - m).amax() < 1e-12);
                prop_assert!((filter.covariance() - c).amax() < 1e-12 * (1.0 + c.amax()));

                let told = filter.update(&z, &r, |x| h * x).unwrap();
                let (next_m, next_c, nis, log_likelihood) = kalman_update(m, c, z, h, r);
                let scale = 1.0 + c.amax();
                (m, c) = (next_m, next_c);
                prop_assert!((filter.mean() - m).amax() < 1e-12 * scale);
                prop_assert!((filter.covariance() - c).amax() < 1e-12 * scale);
                prop_assert!((told.nis - nis).abs() < 1e-11 * (1.0 + nis) * scale);
                prop_assert!((told.log_likelihood - log_likelihood).abs() < 1e-11 * (1.0 + nis) * scale);
                prop_assert_eq!(*filter.covariance(), filter.covariance().transpose());
            }
        }
    }

    /// E[x^T A x + b^T x + c] = m^T A m + tr(A P) + b^T m + c for every set.
    #[test]
    fn the_mean_of_a_quadratic_is_exact(
        mean in entries::<3>(2.0), p in entries::<9>(1.0), a in entries::<9>(1.0), b in entries::<3>(1.0),
    ) {
        let (mean, b, p) = (Vector3::from(mean), Vector3::from(b), covariance::<3>(&p, 0.05));
        let a = Matrix3::from_row_slice(&a);
        let exact = mean.dot(&(a * mean)) + (a * p).trace() + b.dot(&mean) + 0.7;
        for set in sets() {
            let out = unscented_transform(&mean, &p, &set, |x| {
                Vector1::new(x.dot(&(a * x)) + b.dot(x) + 0.7)
            }).unwrap();
            prop_assert!((out.mean[0] - exact).abs() < 1e-12 * (1.0 + exact.abs()));
        }
    }

    /// beta = 2, kappa = 3 - L: the variance of x^2 in one dimension is exact, 2 P^2 + 4 m^2 P;
    /// the paper's beta = 0 with gamma 2 has it as well, since L + lambda = 3.
    #[test]
    fn the_variance_of_a_square_is_exact_without_beta(m in -2.0..2.0_f64, p in 0.01..2.0_f64) {
        let out = unscented_transform(
            &Vector1::new(m), &SMatrix::<f64, 1, 1>::new(p), &SigmaPoints::paper(),
            |x| Vector1::new(x[0] * x[0]),
        ).unwrap();
        let exact = 2.0 * p * p + 4.0 * m * m * p;
        prop_assert!((out.covariance[(0, 0)] - exact).abs() < 1e-12 * (1.0 + exact));
    }
}

/// One numeric case in which every misprint gives another number than the filter does.
#[test]
fn the_printed_forms_give_other_numbers() {
    let p = Matrix3::new(0.5, 0.1, 0.0, 0.1, 0.4, 0.05, 0.0, 0.05, 0.3);
    let q = Matrix3::from_diagonal(&Vector3::new(0.2, 0.1, 0.3));
    let r = Matrix2::new(0.3, 0.05, 0.05, 0.2);
    let h = Matrix2x3::new(1.0, 0.5, -0.2, 0.0, 1.0, 0.4);
    let (mean, z) = (Vector3::new(1.0, -1.0, 0.5), Vector2::new(0.7, 0.1));

    let mut filter = Ukf::new(mean, p, SigmaPoints::default()).unwrap();
    filter.predict(&q, |x| *x).unwrap();
    let told = filter.update(&z, &r, |x| h * x).unwrap();

    let grown = p + q;
    let s = h * grown * h.transpose() + r;
    assert!((told.covariance - s).amax() < 1e-14);
    // without R (Eq. 6, 8, 10), and from sigma points not drawn again after Q was added
    let without_r = h * grown * h.transpose();
    let not_redrawn = h * p * h.transpose() + r;
    for wrong in [without_r, not_redrawn] {
        assert!((told.covariance - wrong).amax() > 0.1);
        let k = grown * h.transpose() * wrong.try_inverse().unwrap();
        let wrong_mean = mean + k * (z - h * mean);
        assert!((filter.mean() - wrong_mean).amax() > 0.01);
        assert!((filter.covariance() - (grown - k * wrong * k.transpose())).amax() > 0.01);
    }
    // the right posterior is (P^-1 + H^T R^-1 H)^-1
    let information = grown.try_inverse().unwrap() + h.transpose() * r.try_inverse().unwrap() * h;
    assert!((filter.covariance() - information.try_inverse().unwrap()).amax() < 1e-13);
}

/// Eq. 16 as printed multiplies P (3x3) by the 2x2 S^-1 and cannot even be formed for a camera; for
/// M = L it can, as K = P S^-1, and is wrong unless H is the identity.
#[test]
fn the_landmark_gain_is_the_cross_covariance() {
    let (mean, p) = (Vector2::new(2.0, 1.0), Matrix2::new(0.3, 0.1, 0.1, 0.2));
    let (h, r) = (Matrix2::new(2.0, 0.0, 1.0, -1.0), Matrix2::identity() * 0.1);
    let z = Vector2::new(4.4, 0.7);
    let update = unscented_update(&mean, &p, &z, &r, |x| h * x).unwrap();
    let s = h * p * h.transpose() + r;
    let inverse = s.try_inverse().unwrap();
    let right = mean + p * h.transpose() * inverse * (z - h * mean);
    let printed = mean + p * inverse * (z - h * mean);
    assert!((update.mean - right).amax() < 1e-14);
    assert!((update.mean - printed).amax() > 0.05);
    assert!((update.innovation.residual - (z - h * mean)).amax() < 1e-14);
}

#[test]
fn angles_near_the_cut_are_averaged_on_the_circle() {
    // sigma points on both sides of pi; the arithmetic mean of the wrapped values is near zero
    let heading = Angle::new(PI - 0.05);
    let p = SMatrix::<f64, 1, 1>::new(0.04);
    let set = SigmaPoints::<1>::default();
    let out = unscented_transform(&heading, &p, &set, |x| *x).unwrap();
    assert!((out.mean.radians() - heading.radians()).abs() < 1e-15);
    assert!((out.covariance[(0, 0)] - 0.04).abs() < 1e-15);
    let naive: f64 = (0..set.count())
        .map(|i| {
            let point = heading.retract(&(set.offset(i) * 0.2));
            set.mean_weight(i) * point.radians()
        })
        .sum();
    assert!((naive - heading.radians()).abs() > 0.5);

    // a measurement from the other side of the cut pulls the short way
    let mut filter = Ukf::new(heading, p, set).unwrap();
    let measured = Angle::new(-PI + 0.05);
    let told = filter
        .update(&measured, &SMatrix::<f64, 1, 1>::new(0.04), |x| *x)
        .unwrap();
    assert!((told.residual[0] - 0.1).abs() < 1e-14);
    assert!((filter.mean().radians().abs() - PI).abs() < 1e-14);
}

/// A heading x + a x^2 with x ~ N(0, P) has the mean a P: the reference-point mean finds it, the direction of
/// the weighted sum of unit vectors does not (0.04 rad too small; with a negative centre weight 0.008 too large).
#[test]
fn the_direction_of_summed_unit_vectors_is_another_mean() {
    let (a, p) = (0.4, 0.3_f64);
    let heading = |x: &Vector1<f64>| Angle::new(3.0 + x[0] + a * x[0] * x[0]);
    let narrow = SigmaPoints::<1>::julier(-0.4).unwrap(); // centre weight -2/3
    for set in [SigmaPoints::default(), narrow] {
        let variance = SMatrix::<f64, 1, 1>::new(p);
        let out = unscented_transform(&Vector1::new(0.0), &variance, &set, heading).unwrap();
        let exact = Angle::new(3.0 + a * p);
        assert!(exact.local(&out.mean)[0].abs() < 1e-14);
        let (mut sin, mut cos) = (0.0, 0.0);
        for index in 0..set.count() {
            let value = heading(&(set.offset(index) * p.sqrt())).radians();
            sin += set.mean_weight(index) * value.sin();
            cos += set.mean_weight(index) * value.cos();
        }
        let direction = Angle::new(sin.atan2(cos));
        assert!(exact.local(&direction)[0].abs() > 0.005);
    }
}

#[test]
fn a_pose_turned_round_has_the_same_covariance() {
    let p = Matrix3::new(0.04, 0.01, 0.0, 0.01, 0.02, 0.003, 0.0, 0.003, 0.05);
    let step = Vector3::new(0.5, 0.0, 0.3);
    let set = SigmaPoints::<3>::default();
    let reference = unscented_transform(&Se2::default(), &p, &set, |x| x.retract(&step)).unwrap();
    for phi in [3.0, PI, -3.1, 1.5] {
        let start = Se2::new(10.0, -4.0, phi);
        let turned = unscented_transform(&start, &p, &set, |x| x.retract(&step)).unwrap();
        assert!((turned.covariance - reference.covariance).amax() < 1e-12);
        assert!((turned.cross_covariance - reference.cross_covariance).amax() < 1e-12);
        let relative = start.local(&turned.mean) - Se2::default().local(&reference.mean);
        assert!(relative.amax() < 1e-12);
    }
}

#[test]
fn bad_input_is_an_error_and_the_state_stays() {
    let mean = Vector2::new(1.0, 2.0);
    let r = SMatrix::<f64, 1, 1>::new(0.1);
    let mut filter = Ukf::new(mean, Matrix2::identity(), SigmaPoints::default()).unwrap();
    let before = filter;
    let first = |x: &Vector2<f64>| Vector1::new(x[0]);

    let error = filter
        .update(&Vector1::new(f64::NAN), &r, first)
        .unwrap_err();
    assert_eq!(
        error,
        UkfError::NotFinite {
            step: Step::Innovation,
            what: "the measurement"
        }
    );
    let nowhere = |_: &Vector2<f64>| Vector1::new(f64::NAN);
    assert!(matches!(
        filter.update(&Vector1::new(0.0), &r, nowhere),
        Err(UkfError::NotFinite {
            step: Step::Function,
            ..
        })
    ));
    // a value missing only at one sigma point
    let half = |x: &Vector2<f64>| Vector1::new(if x[0] > 2.0 { f64::INFINITY } else { x[0] });
    assert!(filter.update(&Vector1::new(0.0), &r, half).is_err());
    assert!(
        filter
            .update(
                &Vector1::new(0.0),
                &SMatrix::<f64, 1, 1>::new(f64::NAN),
                first
            )
            .is_err()
    );
    assert_eq!(
        filter
            .update(&Vector1::new(0.0), &SMatrix::<f64, 1, 1>::new(-3.0), first)
            .map_err(lost_pivot)
            .map(|_| ()),
        Err(Some((Step::Innovation, 0, -3.0)))
    );
    let shrink = Matrix2::new(0.0, 0.0, 0.0, -5.0);
    assert_eq!(
        filter
            .predict(&shrink, |x| *x)
            .map_err(lost_pivot)
            .map(|_| ()),
        Err(Some((Step::Prediction, 1, -5.0)))
    );
    assert_eq!(filter, before);

    let indefinite = Matrix2::new(1.0, 2.0, 2.0, 1.0);
    let refused = Some((Step::SigmaPoints, 1, -3.0));
    assert_eq!(
        lost_pivot(Ukf::new(mean, indefinite, SigmaPoints::default()).unwrap_err()),
        refused
    );
    assert_eq!(
        lost_pivot(
            unscented_update(&mean, &indefinite, &Vector1::new(0.0), &r, first).unwrap_err()
        ),
        refused
    );
    assert!(
        Ukf::new(
            Vector2::new(f64::NAN, 0.0),
            Matrix2::identity(),
            SigmaPoints::default()
        )
        .is_err()
    );
}

/// A state known exactly in some direction is legal: it stays as it is there.
#[test]
fn a_semidefinite_prior_is_updated_where_it_can_be() {
    let p = Matrix3::new(1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0);
    let update = unscented_update(
        &Vector3::zeros(),
        &p,
        &Vector1::new(1.0),
        &SMatrix::<f64, 1, 1>::new(1.0),
        |x| Vector1::new(x[1] + x[2]),
    )
    .unwrap();
    assert!((update.mean - Vector3::new(0.5, 0.5, 0.0)).amax() < 1e-14);
    assert!((update.covariance - p * 0.5).amax() < 1e-14);
    // an off-diagonal entry beside a zero variance is not semidefinite
    let broken = Matrix2::new(0.0, 0.1, 0.1, 1.0);
    assert!(matches!(
        CholeskyFactor::semidefinite(&broken),
        Err(CholeskyError::CovarianceWithoutVariance { pivot: 0, .. })
    ));
    assert!(CholeskyFactor::definite(&p).is_err());
}

/// A measurement 1e8 times as precise as the prior, again and again: symmetric and accepted always.
#[test]
fn precise_measurements_do_not_break_the_covariance() {
    let mut mean = Vector3::new(1.0, 2.0, 3.0);
    let mut p = Matrix3::identity() * 100.0;
    let r = Matrix2::identity() * 1e-12;
    for k in 0..50 {
        let turn = f64::from(k) * 0.37;
        let h = Matrix2x3::new(turn.cos(), turn.sin(), 0.5, -turn.sin(), turn.cos(), 0.1);
        let truth: SVector<f64, 3> = Vector3::new(0.9, 2.1, 3.3);
        let update = unscented_update(&mean, &p, &(h * truth), &r, |x| h * x).unwrap();
        (mean, p) = (update.mean, update.covariance);
        assert_eq!(p, p.transpose());
    }
    assert!((mean - Vector3::new(0.9, 2.1, 3.3)).amax() < 1e-5);
}

/// A set with a strongly negative centre weight can make P - K S K^T indefinite: reported, not
/// returned.
#[test]
fn an_indefinite_posterior_is_an_error() {
    // L + kappa = 1/2: centre weight -1. h = x + x^2 then has P_xz = 1 but P_zz = 1/2
    let set = SigmaPoints::<1>::julier(-0.5).unwrap();
    let result = unscented_correction(
        &Vector1::new(0.0),
        &SMatrix::<f64, 1, 1>::new(1.0),
        &set,
        &Vector1::new(0.5),
        &SMatrix::<f64, 1, 1>::new(0.01),
        |x| Vector1::new(x[0] + x[0] * x[0]),
    );
    let expected = 1.0 - 1.0 / 0.51;
    assert!(matches!(
        lost_pivot(result.unwrap_err()),
        Some((Step::Posterior, 0, value)) if (value - expected).abs() < 1e-12
    ));
}
