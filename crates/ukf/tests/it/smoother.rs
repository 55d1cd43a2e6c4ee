//! Smoothing, iterating and gating.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use ukf::{
    CholeskyError, Estimate, Iterations, Manifold, Se2, SigmaPoints, Step, Ukf, UkfError, Verdict,
    assess_consistency, chi_square_quantile, normalized_error_squared, rts_smooth,
    unscented_transform,
};

fn normal<const R: usize, const C: usize>(rng: &mut ChaCha8Rng) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|_, _| rng.sample(StandardNormal))
}

fn covariance<const N: usize>(rng: &mut ChaCha8Rng) -> SMatrix<f64, N, N> {
    let root = normal::<N, N>(rng) * (0.5 / (N as f64).sqrt());
    root * root.transpose() + SMatrix::<f64, N, N>::identity() * 0.1
}

/// Entries of order 1, 30 steps of some hundred operations each: about 4000 eps.
const TOLERANCE: f64 = 1e-12;

fn check_smoother<const L: usize>(seed: u64) {
    const STEPS: usize = 30;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let f = normal::<L, L>(&mut rng) * (0.7 / (L as f64).sqrt());
    let h = normal::<2, L>(&mut rng);
    let (q, r, p) = (
        covariance::<L>(&mut rng),
        covariance::<2>(&mut rng),
        covariance::<L>(&mut rng),
    );
    let start = normal::<L, 1>(&mut rng);
    let z: Vec<SVector<f64, 2>> = (0..STEPS).map(|_| normal(&mut rng)).collect();
    // closed form: filter, then smooth with inverses
    let (mut filtered, mut predicted) = (vec![], vec![]);
    let (mut m, mut c) = (start, p);
    for z in &z {
        (m, c) = (f * m, f * c * f.transpose() + q);
        predicted.push((m, c));
        let s = h * c * h.transpose() + r;
        let k = c * h.transpose() * s.try_inverse().expect("definite");
        let rest = SMatrix::<f64, L, L>::identity() - k * h;
        (m, c) = (
            m + k * (z - h * m),
            rest * c * rest.transpose() + k * r * k.transpose(),
        );
        filtered.push((m, c));
    }
    let mut exact = filtered.clone();
    for k in (0..STEPS - 1).rev() {
        let (ahead_m, ahead_c) = predicted[k + 1];
        let gain = filtered[k].1 * f.transpose() * ahead_c.try_inverse().expect("definite");
        exact[k].0 = filtered[k].0 + gain * (exact[k + 1].0 - ahead_m);
        exact[k].1 = filtered[k].1 + gain * (exact[k + 1].1 - ahead_c) * gain.transpose();
    }
    for set in [
        SigmaPoints::default(),
        SigmaPoints::paper(),
        SigmaPoints::julier(3.0 - L as f64).expect("valid"),
        SigmaPoints::scaled(0.5, 2.0, 0.0).expect("valid"),
        SigmaPoints::simplex(0.2).expect("valid"),
    ] {
        let mut filter = Ukf::new(start, p, set).expect("definite");
        let estimates: Vec<_> = z
            .iter()
            .map(|z| {
                filter.predict(&q, |x| f * x).expect("definite");
                filter.update(z, &r, |x| h * x).expect("definite");
                Estimate {
                    mean: *filter.mean(),
                    covariance: *filter.covariance(),
                }
            })
            .collect();
        let mut smoothed = estimates.clone();
        rts_smooth(&estimates, &mut smoothed, &set, |_| q, |_, x| f * x).expect("definite");
        for (ours, theirs) in smoothed.iter().zip(&exact) {
            assert!((ours.mean - theirs.0).amax() < TOLERANCE);
            assert!((ours.covariance - theirs.1).amax() < TOLERANCE);
            assert_eq!(ours.covariance, ours.covariance.transpose());
        }
        // the first state gained from the future, the last did not
        assert!(smoothed[0].covariance.trace() < 0.999 * estimates[0].covariance.trace());
        assert_eq!(smoothed[STEPS - 1], estimates[STEPS - 1]);
    }
}

#[test]
fn on_linear_models_it_is_the_rauch_tung_striebel_smoother() {
    for seed in 0..10 {
        check_smoother::<1>(seed);
        check_smoother::<3>(seed);
        check_smoother::<6>(seed);
    }
}

/// A robot on an arc that sees its distance to two beacons, headings across the cut: smoothing lowers the error, and the
/// smoothed covariance is its own.
#[test]
fn a_smoothed_pose_is_better_and_consistent() {
    const STEPS: usize = 40;
    let deviation = Vector3::new(0.05, 0.02, 0.05);
    let q = Matrix3::from_diagonal(&deviation.component_mul(&deviation));
    let r = Matrix2::identity() * 0.04;
    let drive = |x: &Se2| x.retract(&Vector3::new(0.3, 0.0, 0.15));
    let see = |x: &Se2| Vector2::new((x.x - 4.0).hypot(x.y - 1.0), (x.x + 3.0).hypot(x.y - 5.0));
    let (mut before, mut after, mut nees) = (0.0, 0.0, vec![]);
    for seed in 0..100 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = Se2::new(0.0, 0.0, 2.0);
        let p = q * 4.0;
        let mut filter = Ukf::new(
            truth.retract(&(normal::<3, 1>(&mut rng).component_mul(&deviation) * 2.0)),
            p,
            SigmaPoints::default(),
        )
        .unwrap();
        let (mut truths, mut filtered) = (vec![], vec![]);
        for _ in 0..STEPS {
            truth = drive(&truth).retract(&normal::<3, 1>(&mut rng).component_mul(&deviation));
            let z = see(&truth) + normal::<2, 1>(&mut rng) * 0.2;
            filter.predict(&q, drive).unwrap();
            filter.update(&z, &r, see).unwrap();
            truths.push(truth);
            filtered.push(Estimate {
                mean: *filter.mean(),
                covariance: *filter.covariance(),
            });
        }
        let mut smoothed = filtered.clone();
        rts_smooth(
            &filtered,
            &mut smoothed,
            filter.sigma_points(),
            |_| q,
            |_, x| drive(x),
        )
        .unwrap();
        for k in 0..STEPS {
            before += filtered[k].mean.local(&truths[k]).norm_squared();
            after += smoothed[k].mean.local(&truths[k]).norm_squared();
        }
        let middle = &smoothed[STEPS / 2];
        let error = middle.mean.local(&truths[STEPS / 2]);
        nees.push(normalized_error_squared(&error, &middle.covariance).unwrap());
    }
    assert!(after < 0.7 * before, "{after} of {before}");
    let verdict = assess_consistency(nees, 3, 0.999).unwrap();
    assert_eq!(verdict.verdict, Verdict::Consistent, "{verdict:?}");
}

#[test]
fn bad_smoother_input_is_an_error() {
    let good = Estimate {
        mean: Vector2::new(1.0, 2.0),
        covariance: Matrix2::identity(),
    };
    let set = SigmaPoints::default();
    let one = |_| Matrix2::identity();
    let stay = |_, x: &Vector2<f64>| *x;
    let mut out = [good; 2];
    assert_eq!(
        rts_smooth(&[good; 3], &mut out, &set, one, stay),
        Err(UkfError::Length {
            what: "the slice of smoothed states",
            given: 2,
            required: 3
        })
    );
    assert_eq!(
        rts_smooth::<f64, Vector2<f64>, 2>(&[], &mut [], &set, one, stay),
        Ok(())
    );
    let lost = Estimate {
        mean: Vector2::new(f64::NAN, 0.0),
        ..good
    };
    assert!(matches!(
        rts_smooth(&[lost, good], &mut out, &set, one, stay),
        Err(UkfError::NotFinite {
            step: Step::Function,
            ..
        })
    ));
    let indefinite = Estimate {
        covariance: Matrix2::new(1.0, 2.0, 2.0, 1.0),
        ..good
    };
    assert!(matches!(
        rts_smooth(&[indefinite, good], &mut out, &set, one, stay),
        Err(UkfError::Covariance {
            step: Step::SigmaPoints,
            reason: CholeskyError::NotPositiveDefinite { pivot: 1, .. }
        })
    ));
    // nothing random between the states: P^- has no inverse
    let point = Estimate {
        covariance: Matrix2::zeros(),
        ..good
    };
    assert!(matches!(
        rts_smooth(&[point, good], &mut out, &set, |_| Matrix2::zeros(), stay),
        Err(UkfError::Covariance {
            step: Step::Prediction,
            reason: CholeskyError::NotPositiveDefinite { pivot: 0, .. }
        })
    ));
}

/// Distances to two beacons, 50 times as precise as the prior, which spreads over a third of the way to them: one linearisation
/// at the prior takes all of that curvature for noise, the last of many rounds nearly none.
#[test]
fn iterating_pays_for_precise_curved_measurements() {
    let r = Matrix2::identity() * 1e-4;
    let p = Matrix2::identity() * 0.25;
    let beacons = [Vector2::new(0.3, 1.5), Vector2::new(1.5, -0.2)];
    let see = |x: &Vector2<f64>| Vector2::from_fn(|k, _| (x - beacons[k]).norm());
    let (mut single, mut many) = ((0.0, 0.0), (0.0, vec![]));
    let mut converged = 0;
    const DRAWS: u32 = 400;
    for seed in 0..u64::from(DRAWS) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // nearer than two deviations, where no second solution competes
        let truth = normal::<2, 1>(&mut rng).map(|x| 0.5 * x.clamp(-2.0, 1.0));
        let z = see(&truth) + normal::<2, 1>(&mut rng) * 0.01;
        let filter = Ukf::new(Vector2::zeros(), p, SigmaPoints::default()).unwrap();
        let (mut once, mut iterated) = (filter, filter);
        once.update(&z, &r, see).unwrap();
        let limits = Iterations {
            at_most: 30,
            ..Iterations::default()
        };
        let told = iterated.update_iterated(&z, &r, &limits, see).unwrap();
        converged += u32::from(told.converged);
        single.0 += (truth - once.mean()).norm_squared();
        single.1 += once.covariance().trace();
        let error = truth - iterated.mean();
        many.0 += error.norm_squared();
        many.1
            .push(normalized_error_squared(&error, iterated.covariance()).unwrap());
    }
    let verdict = assess_consistency(many.1, 2, 0.999).unwrap();
    println!(
        "single {single:?}, iterated {}, {converged} converged, {verdict:?}",
        many.0
    );
    assert!(converged >= DRAWS * 98 / 100, "{converged}");
    assert!(
        many.0 < 0.1 * single.0,
        "squared errors {} and {}",
        many.0,
        single.0
    );
    assert_eq!(verdict.verdict, Verdict::Consistent, "{verdict:?}");
}

#[test]
fn on_linear_models_iterating_changes_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (p, r) = (covariance::<3>(&mut rng), covariance::<2>(&mut rng));
    let (h, z) = (normal::<2, 3>(&mut rng), normal::<2, 1>(&mut rng));
    let filter = Ukf::new(normal::<3, 1>(&mut rng), p, SigmaPoints::default()).unwrap();
    let (mut once, mut iterated) = (filter, filter);
    let single = once.update(&z, &r, |x| h * x).unwrap();
    let told = iterated
        .update_iterated(&z, &r, &Iterations::default(), |x| h * x)
        .unwrap();
    assert!(told.converged && told.rounds == 2);
    assert!((once.mean() - iterated.mean()).amax() < TOLERANCE);
    assert!((once.covariance() - iterated.covariance()).amax() < TOLERANCE);
    assert!((single.log_likelihood - told.innovation.log_likelihood).abs() < TOLERANCE);

    // a bad one is an error and changes nothing
    let before = iterated;
    let lost = Vector2::new(f64::NAN, 0.0);
    let limits = Iterations::default();
    assert!(
        iterated
            .update_iterated(&lost, &r, &limits, |x| h * x)
            .is_err()
    );
    assert!(
        iterated
            .update_iterated(&z, &-r, &limits, |x| h * x)
            .is_err()
    );
    let point = Ukf::new(Vector3::zeros(), Matrix3::zeros(), SigmaPoints::default()).unwrap();
    assert!(matches!(
        point.clone().update_iterated(&z, &r, &limits, |x| h * x),
        Err(UkfError::Covariance {
            step: Step::SigmaPoints,
            reason: CholeskyError::NotPositiveDefinite { pivot: 0, .. }
        })
    ));
    assert_eq!(iterated, before);
}

#[test]
fn a_gate_lets_in_what_it_should() {
    let bound = chi_square_quantile(2.0, 0.95).unwrap();
    let r = Matrix2::identity() * 0.5;
    let filter = Ukf::new(
        Vector2::zeros(),
        Matrix2::identity(),
        SigmaPoints::default(),
    )
    .unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut refused = 0_u32;
    const DRAWS: u32 = 20_000;
    for _ in 0..DRAWS {
        let z = normal::<2, 1>(&mut rng) * 1.5_f64.sqrt();
        let mut gated = filter;
        let gate = gated.update_gated(&z, &r, bound, |x| *x).unwrap();
        assert_eq!(gate, filter.gate(&z, &r, bound, |x| *x).unwrap());
        if gate.accepted() {
            let mut updated = filter;
            updated.update(&z, &r, |x| *x).unwrap();
            assert_eq!(gated, updated);
        } else {
            assert_eq!(gated, filter);
            refused += 1;
        }
    }
    // 5 % of them, within 5 standard errors
    let expected = 0.05 * f64::from(DRAWS);
    assert!(
        (f64::from(refused) - expected).abs() < 5.0 * (expected * 0.95).sqrt(),
        "{refused}"
    );
    assert!(
        filter
            .gate(&Vector2::new(f64::NAN, 0.0), &r, bound, |x| *x)
            .is_err()
    );
    // a NaN bound accepts nothing
    assert!(
        !filter
            .gate(&Vector2::zeros(), &r, f64::NAN, |x| *x)
            .unwrap()
            .accepted()
    );
}

/// Rotations spread over half a radian about any attitude, half a turn included: the mean of the sigma points is the
/// attitude itself, the covariance comes back, and a filter's heading error is a chi-square of three.
#[test]
fn attitudes_have_means_and_covariances_everywhere() {
    let p = Matrix3::new(0.2, 0.05, 0.0, 0.05, 0.1, 0.02, 0.0, 0.02, 0.3);
    for tangent in [
        [0.0, 0.0, 0.0],
        [3.1, 0.0, 0.0],
        [0.0, -3.1, 0.6],
        [1.0, 2.0, -1.5],
    ] {
        let attitude = UnitQuaternion::identity().retract(&Vector3::from(tangent));
        let out = unscented_transform(&attitude, &p, &SigmaPoints::default(), |x| *x).unwrap();
        assert!(attitude.local(&out.mean).norm() < 1e-14);
        assert!((out.covariance - p).amax() < 1e-14);
        // a turn of the world turns the mean and leaves the body's covariance
        let turn = UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0);
        let turned =
            unscented_transform(&attitude, &p, &SigmaPoints::default(), |x| turn * x).unwrap();
        assert!((turn * attitude).local(&turned.mean).norm() < 1e-14);
        assert!((turned.covariance - p).amax() < 1e-13);
    }
}
