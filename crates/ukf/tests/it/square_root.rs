//! The square-root filter where the plain one is at its limit, and noise that is not added.

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector1, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use ukf::{
    Angle, AugmentedPoints, CholeskyError, CholeskyFactor, SigmaPoints, SquareRootUkf, Step, Ukf,
    UkfError, augmented_transform, unscented_transform,
};

type Scalar = SMatrix<f64, 1, 1>;

/// A car with position, speed and acceleration, all known to kilometres at first, whose position is
/// measured to a micrometre at 100 Hz: P spans 1e6 to 1e-12 in the first steps.
struct IllConditioned {
    f: Matrix3<f64>,
    q: Matrix3<f64>,
    r: f64,
    start: Matrix3<f64>,
}

const STEPS: u32 = 1_000_000;

fn ill_conditioned() -> IllConditioned {
    let dt = 0.01_f64;
    let jerk = Vector3::new(dt.powi(3) / 6.0, dt * dt / 2.0, dt);
    IllConditioned {
        f: Matrix3::new(1.0, dt, dt * dt / 2.0, 0.0, 1.0, dt, 0.0, 0.0, 1.0),
        // rank one: process noise along one direction only
        q: jerk * jerk.transpose() * 1e-6,
        r: 1e-12,
        start: Matrix3::identity() * 1e6,
    }
}

#[test]
fn a_million_steps_stay_positive_definite() {
    let model = ill_conditioned();
    let q = CholeskyFactor::semidefinite(&model.q).unwrap();
    let r = CholeskyFactor::definite(&Scalar::new(model.r)).unwrap();
    let start = CholeskyFactor::definite(&model.start).unwrap();
    let mut filter = SquareRootUkf::new(Vector3::zeros(), start, SigmaPoints::default()).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut truth = Vector3::new(300.0, -20.0, 1.0);
    let mut half_way = Matrix3::zeros();
    let (mut nees, mut counted) = (0.0, 0_u32);
    for step in 0..STEPS {
        let push = rng.sample::<f64, _>(StandardNormal) * 1e-3;
        truth = model.f * truth + Vector3::new(1e-6 / 6.0, 0.5e-4, 1e-2) * push;
        let noise = rng.sample::<f64, _>(StandardNormal) * model.r.sqrt();
        // far from the origin the position itself rounds by eps |x|: stay near it
        if truth.x.abs() > 1e3 {
            truth *= 0.0;
            filter = SquareRootUkf::new(truth, *filter.root(), SigmaPoints::default()).unwrap();
        }
        filter.predict(&q, |x| model.f * x).unwrap();
        let z = Vector1::new(truth.x + noise);
        filter.update(&z, &r, |x| Vector1::new(x.x)).unwrap();
        let lower = filter.root().lower();
        assert!(
            (0..3).all(|k| lower[(k, k)] > 0.0 && lower[(k, k)].is_finite()),
            "step {step}"
        );
        if step == STEPS / 2 {
            half_way = filter.covariance();
        }
        if step > 1000 && step % 1000 == 0 {
            nees += filter.root().mahalanobis_squared(&(truth - filter.mean()));
            counted += 1;
        }
    }
    // the covariance does not see the data but for rounding: deviations are differences of positions of up to
    // 1e3, so each is off by eps 1e3 of its sqrt(P_00), and ten of them enter a root
    let last = filter.covariance();
    let rounding = 10.0 * f64::EPSILON * 1e3 / last[(0, 0)].sqrt();
    assert!(rounding < 1e-5);
    for k in 0..3 {
        assert!((last[(k, k)] / half_way[(k, k)] - 1.0).abs() < rounding);
    }
    // and it is the error's: the mean of `counted` almost independent chi-squares of 3
    let mean = nees / f64::from(counted);
    let error = (6.0 / f64::from(counted)).sqrt();
    assert!((mean - 3.0).abs() < 5.0 * error, "NEES {mean} +- {error}");
}

/// The plain filter on the same model: every covariance it shows is finite and symmetric; if it ends,
/// then by its error.
#[test]
fn the_plain_filter_keeps_its_promise_or_says_so() {
    let model = ill_conditioned();
    let mut filter = Ukf::new(Vector3::zeros(), model.start, SigmaPoints::default()).unwrap();
    let r = Scalar::new(model.r);
    for _ in 0..100_000 {
        let before = filter;
        let told = filter
            .predict(&model.q, |x| model.f * x)
            .and_then(|()| filter.update(&Vector1::new(0.0), &r, |x| Vector1::new(x.x)));
        let covariance = filter.covariance();
        assert!(covariance.iter().all(|entry| entry.is_finite()));
        assert_eq!(*covariance, covariance.transpose());
        if let Err(error) = told {
            assert!(matches!(error, UkfError::Covariance { .. }));
            assert!(before.covariance().iter().all(|entry| entry.is_finite()));
            return;
        }
    }
}

/// A curved model with headings: the two forms are one filter.
#[test]
fn on_curved_models_both_forms_agree() {
    let set = SigmaPoints::<1>::scaled(0.8, 2.0, 0.0).unwrap();
    let (p, q, r) = (
        Scalar::new(0.05),
        Scalar::new(0.01),
        Matrix2::new(0.1, 0.02, 0.02, 0.2),
    );
    let mut plain = Ukf::new(Angle::new(3.0), p, set).unwrap();
    let root = |m: &Scalar| CholeskyFactor::definite(m).unwrap();
    let mut square_root = SquareRootUkf::new(Angle::new(3.0), root(&p), set).unwrap();
    let r_root = CholeskyFactor::definite(&r).unwrap();
    for step in 0..50 {
        let turn = |x: &Angle| Angle::new(x.radians() + 0.2 + 0.05 * x.radians().sin());
        let see = |x: &Angle| Vector2::new(x.radians().cos(), 2.0 * x.radians().sin());
        plain.predict(&q, turn).unwrap();
        square_root.predict(&root(&q), turn).unwrap();
        let truth = 3.0 + 0.2 * f64::from(step);
        let z = Vector2::new(truth.cos(), 2.0 * truth.sin());
        let a = plain.update(&z, &r, see).unwrap();
        let b = square_root.update(&z, &r_root, see).unwrap();
        let gap = Angle::new(plain.mean().radians() - square_root.mean().radians());
        assert!(gap.radians().abs() < 1e-13);
        assert!((plain.covariance() - square_root.covariance()).amax() < 1e-14);
        assert!((a.nis - b.nis).abs() < 1e-12 * (1.0 + a.nis));
        assert!((a.covariance - b.covariance).amax() < 1e-13);
    }
}

/// Centre weight -1 (L + kappa = 1/2): x^2 - x^2 terms leave less than nothing.
#[test]
fn a_failed_downdate_is_an_error_with_step_and_pivot() {
    let set = SigmaPoints::<1>::julier(-0.5).unwrap();
    let one = CholeskyFactor::definite(&Scalar::new(1.0)).unwrap();
    let tiny = CholeskyFactor::definite(&Scalar::new(1e-4)).unwrap();
    let mut filter = SquareRootUkf::new(Vector1::new(0.0), one, set).unwrap();
    let before = filter;
    // values 0, 1/2, 1/2: mean 1, deviations -1, -1/2, -1/2 of weights -1, 1, 1: variance -1/2
    let error = filter
        .predict(&tiny, |x| Vector1::new(x[0] * x[0]))
        .unwrap_err();
    match error {
        UkfError::Covariance {
            step: Step::Prediction,
            reason:
                CholeskyError::NotPositiveDefinite {
                    pivot: 0, value, ..
                },
        } => {
            assert!((value - (1.0 - 1.0 / 0.5001)).abs() < 1e-12);
        }
        other => panic!("{other:?}"),
    }
    let error = filter
        .update(&Vector1::new(0.5), &tiny, |x| Vector1::new(x[0] * x[0]))
        .unwrap_err();
    assert!(matches!(
        error,
        UkfError::Covariance {
            step: Step::Innovation,
            reason: CholeskyError::NotPositiveDefinite { pivot: 0, .. }
        }
    ));
    // h = x + x^2 has S = 1/2 > 0 but takes all of P and more
    let error = filter
        .update(&Vector1::new(0.5), &tiny, |x| {
            Vector1::new(x[0] + x[0] * x[0])
        })
        .unwrap_err();
    assert!(matches!(
        error,
        UkfError::Covariance {
            step: Step::Posterior,
            reason: CholeskyError::NotPositiveDefinite { pivot: 0, .. }
        }
    ));
    assert_eq!(filter, before);
}

#[test]
fn bad_input_is_an_error_and_the_state_stays() {
    let one = CholeskyFactor::definite(&Matrix2::identity()).unwrap();
    let r = CholeskyFactor::definite(&Scalar::new(0.1)).unwrap();
    let none = CholeskyFactor::semidefinite(&Scalar::new(0.0)).unwrap();
    let set = SigmaPoints::<2>::default();
    assert!(SquareRootUkf::new(Vector2::new(f64::NAN, 0.0), one, set).is_err());
    let mut filter = SquareRootUkf::new(Vector2::new(1.0, 2.0), one, set).unwrap();
    let before = filter;
    let first = |x: &Vector2<f64>| Vector1::new(x[0]);
    assert!(matches!(
        filter.update(&Vector1::new(f64::INFINITY), &r, first),
        Err(UkfError::NotFinite {
            step: Step::Innovation,
            ..
        })
    ));
    assert!(matches!(
        filter.update(&Vector1::new(0.0), &r, |_| Vector1::new(f64::NAN)),
        Err(UkfError::NotFinite {
            step: Step::Function,
            ..
        })
    ));
    assert!(matches!(
        filter.predict(&one, |x| x * f64::NAN),
        Err(UkfError::NotFinite {
            step: Step::Function,
            ..
        })
    ));
    // a constant without noise has no innovation variance
    assert!(matches!(
        filter.update(&Vector1::new(0.0), &none, |_| Vector1::new(3.0)),
        Err(UkfError::Covariance {
            step: Step::Innovation,
            reason: CholeskyError::NotPositiveDefinite { pivot: 0, .. }
        })
    ));
    assert_eq!(filter, before);
    let lower = Matrix2::new(1.0, 0.0, 0.3, -2.0);
    assert_eq!(
        CholeskyFactor::from_lower(&lower),
        Err(CholeskyError::NotPositiveDefinite {
            pivot: 1,
            value: -2.0,
            required: 0.0
        })
    );

    // the plain filter refuses covariances that are not symmetric, beyond rounding
    let lopsided = Matrix2::new(1.0, 0.2, 0.1, 1.0);
    let refused = |step| UkfError::Covariance {
        step,
        reason: CholeskyError::NotSymmetric {
            row: 1,
            column: 0,
            difference: 0.1 - 0.2,
        },
    };
    let mean = Vector2::new(1.0, 2.0);
    assert_eq!(
        Ukf::new(mean, lopsided, set).unwrap_err(),
        refused(Step::SigmaPoints)
    );
    let mut plain = Ukf::new(mean, Matrix2::identity(), set).unwrap();
    let kept = plain;
    assert_eq!(
        plain.predict(&lopsided, |x| *x).unwrap_err(),
        refused(Step::Prediction)
    );
    let z = Vector2::zeros();
    assert_eq!(
        plain.update(&z, &lopsided, |x| *x).unwrap_err(),
        refused(Step::Innovation)
    );
    let points = AugmentedPoints::<2, 2>::default();
    assert_eq!(
        plain
            .update_augmented(&z, &lopsided, &points, |x, v| x + v)
            .unwrap_err(),
        refused(Step::SigmaPoints)
    );
    let indefinite = Matrix2::new(1.0, 2.0, 2.0, 1.0);
    assert!(
        plain
            .predict_augmented(&indefinite, &points, |x, w| x + w)
            .is_err()
    );
    assert!(
        plain
            .update_augmented(&(z * f64::NAN), &Matrix2::identity(), &points, |x, v| x + v)
            .is_err()
    );
    assert_eq!(plain, kept);
    assert!(Ukf::new(mean, Matrix2::new(1.0, 0.2, 0.2 + 1e-15, 1.0), set).is_ok());
    assert!(AugmentedPoints::<2, 2>::scaled(0.0, 2.0, 0.0).is_err());
    assert!(AugmentedPoints::<2, 2>::scaled(1.0, 2.0, -4.0).is_err());
}

/// x (1 + w): P + m^2 Q from the points; the exact variance has P Q more, which no point sees.
#[test]
fn noise_that_multiplies() {
    let (m, p, q) = (3.0, 0.2, 0.01);
    for points in [
        AugmentedPoints::default(),
        AugmentedPoints::scaled(0.7, 2.0, 0.5).unwrap(),
    ] {
        let out = augmented_transform(
            &Vector1::new(m),
            &Scalar::new(p),
            &Scalar::new(q),
            &points,
            |x, w: &Vector1<f64>| Vector1::new(x[0] * (1.0 + w[0])),
        )
        .unwrap();
        assert!((out.mean[0] - m).abs() < 1e-14);
        assert!((out.covariance[0] - (p + m * m * q)).abs() < 1e-14);
        assert!((out.cross_covariance[0] - p).abs() < 1e-14);
    }
    // added instead of multiplied, the noise would count 9 times less
    let added = unscented_transform(
        &Vector1::new(m),
        &Scalar::new(p),
        &SigmaPoints::default(),
        |x| *x,
    )
    .unwrap();
    assert!((added.covariance[0] + q - (p + m * m * q)).abs() > 0.05);
}

/// A unicycle driven by noisy speed and turn rate: the augmented prediction against 2e5 draws.
#[test]
fn control_noise_through_the_arc() {
    let drive = |x: &Vector3<f64>, w: &Vector2<f64>| {
        let (v, turn) = (1.0 + w[0], 0.5 + w[1]);
        let heading = x[2] + 0.5 * turn;
        x + Vector3::new(v * heading.cos(), v * heading.sin(), turn)
    };
    let q = Matrix2::new(0.01, 0.002, 0.002, 0.02);
    let p = Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.01));
    let points = AugmentedPoints::<3, 2>::default();
    let mut filter = Ukf::new(Vector3::zeros(), p, SigmaPoints::default()).unwrap();
    filter.predict_augmented(&q, &points, drive).unwrap();

    const DRAWS: u32 = 200_000;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let q_root = *CholeskyFactor::definite(&q).unwrap().lower();
    let (mut sum, mut square) = (Vector3::zeros(), Matrix3::zeros());
    for _ in 0..DRAWS {
        let x = Vector3::from_fn(|k, _| rng.sample::<f64, _>(StandardNormal) * p[(k, k)].sqrt());
        let w = q_root * Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let y = drive(&x, &w);
        sum += y;
        square += y * y.transpose();
    }
    let mean = sum / f64::from(DRAWS);
    let covariance = square / f64::from(DRAWS) - mean * mean.transpose();
    for i in 0..3 {
        // 5 standard errors, and the fourth order that the points leave out: E[d^4] / 8 < 1e-4
        let error = 5.0 * (covariance[(i, i)] / f64::from(DRAWS)).sqrt();
        assert!(
            (filter.mean()[i] - mean[i]).abs() < error + 1e-4,
            "mean {i}"
        );
        for j in 0..3 {
            let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            let error = scale * 5.0 * (2.0 / f64::from(DRAWS)).sqrt();
            let gap = (filter.covariance()[(i, j)] - covariance[(i, j)]).abs();
            assert!(gap < error + 5e-4, "({i}, {j}): {gap}");
        }
    }
    assert!((filter.covariance()[(0, 2)] - covariance[(0, 2)]).abs() < 1e-3);
}

/// y = sin(x + 0.4): mean and variance are exact to fourth order in the spread with the default set (L + lambda = 3), so
/// halving it divides the error by 2^6 in the mean.
#[test]
fn the_error_falls_with_the_documented_order() {
    let at = 0.4_f64;
    let gap = |set: &SigmaPoints<1>, p: f64| {
        let out = unscented_transform(&Vector1::new(at), &Scalar::new(p), set, |x| {
            Vector1::new(x[0].sin())
        })
        .unwrap();
        // E sin = sin m e^{-P/2}; Var = (1 - cos 2m e^{-2P}) / 2 - mean^2
        let mean = at.sin() * (-p / 2.0).exp();
        let variance = 0.5 * (1.0 - (2.0 * at).cos() * (-2.0 * p).exp()) - mean * mean;
        (
            (out.mean[0] - mean).abs(),
            (out.covariance[0] - variance).abs(),
        )
    };
    let ratio = |set: &SigmaPoints<1>| {
        let (coarse, fine) = (gap(set, 0.16), gap(set, 0.04));
        (coarse.0 / fine.0, coarse.1 / fine.1)
    };
    // default: mean to P^2 (error P^3: a factor 64), covariance to P (error P^2: a factor 16)
    let (mean, covariance) = ratio(&SigmaPoints::scaled(1.0, 0.0, 2.0).unwrap());
    assert!((40.0..90.0).contains(&mean), "{mean}");
    assert!(covariance > 12.0, "{covariance}");
    // another spread: mean to P (error P^2), as any set of sigma points
    let (mean, covariance) = ratio(&SigmaPoints::scaled(1.0, 0.0, 0.5).unwrap());
    assert!((10.0..24.0).contains(&mean), "{mean}");
    assert!((10.0..24.0).contains(&covariance), "{covariance}");
}
