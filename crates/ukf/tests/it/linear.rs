//! On linear models every form of the filter is the Kalman filter.

use nalgebra::{SMatrix, SVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use ukf::{
    AugmentedPoints, CholeskyError, CholeskyFactor, Measured, SigmaPoints, SquareRootUkf, Step,
    Ukf, UkfError, stacked_workspace,
};

fn normal<const R: usize, const C: usize>(rng: &mut ChaCha8Rng) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Full, positive definite, condition number up to about 1e2.
fn covariance<const N: usize>(rng: &mut ChaCha8Rng) -> SMatrix<f64, N, N> {
    let root = normal::<N, N>(rng) * (0.5 / (N as f64).sqrt());
    root * root.transpose() + SMatrix::<f64, N, N>::identity() * 0.1
}

/// Positive and negative centre weights, in means and in covariances.
fn sets<const L: usize>() -> [SigmaPoints<L>; 6] {
    [
        SigmaPoints::default(),
        SigmaPoints::paper(),
        SigmaPoints::julier(3.0 - L as f64).expect("valid parameters"),
        SigmaPoints::scaled(0.5, 2.0, 0.0).expect("valid parameters"),
        SigmaPoints::simplex(0.0).expect("valid parameters"),
        SigmaPoints::simplex(0.3).expect("valid parameters"),
    ]
}

/// The Kalman update in Joseph's form.
fn kalman<const L: usize, const M: usize>(
    mean: &SVector<f64, L>,
    p: &SMatrix<f64, L, L>,
    innovation: &SVector<f64, M>,
    h: &SMatrix<f64, M, L>,
    r: &SMatrix<f64, M, M>,
) -> (SVector<f64, L>, SMatrix<f64, L, L>, f64, f64) {
    let s = h * p * h.transpose() + r;
    let factor = s.cholesky().expect("positive definite");
    let gain = factor.solve(&(h * p)).transpose();
    let rest = SMatrix::<f64, L, L>::identity() - gain * h;
    let nis = innovation.dot(&factor.solve(innovation));
    let log_determinant = 2.0 * factor.l().diagonal().map(f64::ln).sum();
    (
        mean + gain * innovation,
        rest * p * rest.transpose() + gain * r * gain.transpose(),
        nis,
        -0.5 * (nis + log_determinant + M as f64 * std::f64::consts::TAU.ln()),
    )
}

/// All entries of covariances here are of order 1, so 1e-12 is some 4000 eps: 10 steps of some 400
/// operations each.
const TOLERANCE: f64 = 1e-12;

fn check_size<const L: usize, const M: usize>(seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (f, h) = (
        normal::<L, L>(&mut rng) * (0.7 / (L as f64).sqrt()),
        normal::<M, L>(&mut rng),
    );
    let (p, q, r) = (
        covariance::<L>(&mut rng),
        covariance::<L>(&mut rng),
        covariance::<M>(&mut rng),
    );
    let start = normal::<L, 1>(&mut rng);
    let measurements: Vec<SVector<f64, M>> = (0..10).map(|_| normal::<M, 1>(&mut rng)).collect();
    let (q_root, r_root) = (
        CholeskyFactor::definite(&q).expect("a positive definite problem"),
        CholeskyFactor::definite(&r).expect("a positive definite problem"),
    );
    for set in sets::<L>() {
        let mut plain = Ukf::new(start, p, set).expect("a positive definite problem");
        let mut augmented = plain;
        let root = CholeskyFactor::definite(&p).expect("a positive definite problem");
        let mut square_root =
            SquareRootUkf::new(start, root, set).expect("a positive definite problem");
        let (mut mean, mut cov) = (start, p);
        for z in &measurements {
            (mean, cov) = (f * mean, f * cov * f.transpose() + q);
            plain
                .predict(&q, |x| f * x)
                .expect("a positive definite problem");
            square_root
                .predict(&q_root, |x| f * x)
                .expect("a positive definite problem");
            augmented
                .predict_augmented(&q, &AugmentedPoints::<L, L>::default(), |x, w| f * x + w)
                .expect("a positive definite problem");

            let (nis, log_likelihood);
            (mean, cov, nis, log_likelihood) = kalman(&mean, &cov, &(z - h * mean), &h, &r);
            let told = [
                plain
                    .update(z, &r, |x| h * x)
                    .expect("a positive definite problem"),
                square_root
                    .update(z, &r_root, |x| h * x)
                    .expect("a positive definite problem"),
                augmented
                    .update_augmented(z, &r, &AugmentedPoints::<L, M>::default(), |x, v| h * x + v)
                    .expect("a positive definite problem"),
            ];
            for told in told {
                assert!((told.nis - nis).abs() < TOLERANCE * (1.0 + nis));
                let scale = 1.0 + log_likelihood.abs();
                assert!((told.log_likelihood - log_likelihood).abs() < TOLERANCE * scale);
            }
        }
        for (m, c) in [
            (plain.mean(), *plain.covariance()),
            (square_root.mean(), square_root.covariance()),
            (augmented.mean(), *augmented.covariance()),
        ] {
            assert!((m - mean).amax() < TOLERANCE, "{L}: {}", (m - mean).amax());
            assert!((c - cov).amax() < TOLERANCE, "{L}: {}", (c - cov).amax());
            assert_eq!(c, c.transpose());
        }
    }
}

#[test]
fn plain_square_root_and_augmented_filters_are_the_kalman_filter() {
    for seed in 0..20 {
        check_size::<1, 1>(seed);
        check_size::<2, 1>(seed);
        check_size::<3, 2>(seed);
        check_size::<4, 4>(seed);
        check_size::<5, 3>(seed);
        check_size::<6, 2>(seed);
    }
}

/// Three blocks of two rows: one after the other, stacked, and in the information form.
#[test]
fn sequential_stacked_and_information_updates_are_one() {
    const K: usize = 3;
    for seed in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = covariance::<4>(&mut rng);
        let start = normal::<4, 1>(&mut rng);
        let h: [SMatrix<f64, 2, 4>; K] = std::array::from_fn(|_| normal(&mut rng));
        let blocks: [Measured<SVector<f64, 2>, 2>; K] = std::array::from_fn(|_| Measured {
            value: normal(&mut rng),
            noise: covariance(&mut rng),
        });
        let values = blocks.map(|block| block.value);
        let mut r = SMatrix::<f64, 6, 6>::zeros();
        let mut stacked_h = SMatrix::<f64, 6, 4>::zeros();
        let mut z = SVector::<f64, 6>::zeros();
        for k in 0..K {
            r.fixed_view_mut::<2, 2>(2 * k, 2 * k)
                .copy_from(&blocks[k].noise);
            stacked_h.fixed_view_mut::<2, 4>(2 * k, 0).copy_from(&h[k]);
            z.fixed_rows_mut::<2>(2 * k).copy_from(&blocks[k].value);
        }
        let exact = kalman(&start, &p, &(z - stacked_h * start), &stacked_h, &r);
        for set in sets::<4>() {
            let filter = Ukf::new(start, p, set).unwrap();
            let mut workspace = vec![f64::NAN; stacked_workspace::<4, 2>(K)];
            let (mut a, mut b, mut c) = (filter, filter, filter);
            let fits = [
                a.update_sequentially(&blocks, |x, k| h[k] * x).unwrap(),
                b.update_information(&blocks, |x, k| h[k] * x).unwrap(),
                c.update_stacked(&values, r.as_slice(), &mut workspace, |x, k| h[k] * x)
                    .unwrap(),
            ];
            for (filter, fit) in [a, b, c].iter().zip(fits) {
                assert!((filter.mean() - exact.0).amax() < TOLERANCE);
                assert!((filter.covariance() - exact.1).amax() < TOLERANCE);
                assert_eq!(fit.rows, 6);
                assert!((fit.nis - exact.2).abs() < TOLERANCE * (1.0 + exact.2));
                assert!((fit.log_likelihood - exact.3).abs() < TOLERANCE * (1.0 + exact.2));
            }
            // correlated blocks, which only the stacked form takes
            let full = covariance::<6>(&mut rng);
            let exact = kalman(&start, &p, &(z - stacked_h * start), &stacked_h, &full);
            let mut d = filter;
            d.update_stacked(&values, full.as_slice(), &mut workspace, |x, k| h[k] * x)
                .unwrap();
            assert!((d.mean() - exact.0).amax() < TOLERANCE);
            assert!((d.covariance() - exact.1).amax() < TOLERANCE);
            // and not as if they were not
            assert!((d.covariance() - a.covariance()).amax() > 1e-3);
        }
    }
}

/// Bearings to two beacons: the forms differ where h is curved, by less than the curvature's share.
#[test]
fn curved_measurements_differ_by_the_curvature() {
    let start = SVector::<f64, 2>::new(0.3, -0.2);
    let beacons = [[4.0, 1.0], [-2.0, 5.0]];
    let predict = |x: &SVector<f64, 2>, k: usize| {
        let d = SVector::<f64, 2>::new(beacons[k][0], beacons[k][1]) - x;
        SVector::<f64, 1>::new(d.y.atan2(d.x))
    };
    let mut gaps = Vec::new();
    for spread in [0.4, 0.2, 0.1] {
        let p = SMatrix::<f64, 2, 2>::identity() * (spread * spread);
        let filter = Ukf::new(start, p, SigmaPoints::default()).unwrap();
        let blocks: [_; 2] = std::array::from_fn(|k| Measured {
            value: predict(&SVector::<f64, 2>::new(0.3 + spread, -0.2), k),
            noise: SMatrix::<f64, 1, 1>::new(0.02 * spread * spread),
        });
        let values = blocks.map(|block| block.value);
        let noise = [blocks[0].noise[0], 0.0, 0.0, blocks[1].noise[0]];
        let mut workspace = [0.0; stacked_workspace::<2, 1>(2)];
        let (mut a, mut b, mut c) = (filter, filter, filter);
        a.update_sequentially(&blocks, predict).unwrap();
        b.update_information(&blocks, predict).unwrap();
        c.update_stacked(&values, &noise, &mut workspace, predict)
            .unwrap();
        let gap = (a.mean() - c.mean())
            .amax()
            .max((b.mean() - c.mean()).amax());
        assert!(gap > 0.0, "curvature must show");
        gaps.push(gap / spread);
    }
    // second order in the spread, so relative to it first order at least
    assert!(
        gaps[1] < 0.7 * gaps[0] && gaps[2] < 0.7 * gaps[1],
        "{gaps:?}"
    );
}

#[test]
fn bad_blocks_name_themselves_and_change_nothing() {
    let p = SMatrix::<f64, 2, 2>::identity();
    let mut filter = Ukf::new(SVector::<f64, 2>::zeros(), p, SigmaPoints::default()).unwrap();
    let before = filter;
    let first = |x: &SVector<f64, 2>, _: usize| SVector::<f64, 1>::new(x[0]);
    let good = Measured {
        value: SVector::<f64, 1>::new(1.0),
        noise: SMatrix::<f64, 1, 1>::new(1.0),
    };
    let lost = Measured {
        value: SVector::<f64, 1>::new(f64::NAN),
        ..good
    };
    let negative = Measured {
        noise: SMatrix::<f64, 1, 1>::new(-2.5),
        ..good
    };
    assert!(matches!(
        filter.update_sequentially(&[good, lost], first),
        Err(UkfError::NotFinite {
            step: Step::Innovation,
            ..
        })
    ));
    assert!(
        filter
            .update_sequentially(&[good, negative], first)
            .is_err()
    );
    assert!(matches!(
        filter.update_information(&[good, lost], first),
        Err(UkfError::NotFinite {
            step: Step::Innovation,
            ..
        })
    ));
    assert!(matches!(
        filter.update_information(&[good, negative], first),
        Err(UkfError::Covariance {
            step: Step::Innovation,
            reason: CholeskyError::NotPositiveDefinite { pivot: 0, .. }
        })
    ));
    let values = [good.value, good.value];
    let mut workspace = vec![0.0; stacked_workspace::<2, 1>(2)];
    assert_eq!(
        filter.update_stacked(&values, &[1.0; 3], &mut workspace, first),
        Err(UkfError::Length {
            what: "the noise of stacked rows",
            given: 3,
            required: 4
        })
    );
    assert_eq!(
        filter.update_stacked(&values, &[1.0, 0.0, 0.0, 1.0], &mut workspace[1..], first),
        Err(UkfError::Length {
            what: "the workspace",
            given: workspace.len() - 1,
            required: workspace.len()
        })
    );
    assert!(matches!(
        filter.update_stacked(&values, &[1.0, 0.5, 0.0, 1.0], &mut workspace, first),
        Err(UkfError::Covariance {
            step: Step::Innovation,
            reason: CholeskyError::NotSymmetric {
                row: 1,
                column: 0,
                ..
            }
        })
    ));
    // twice the same row without noise: the second has no variance of its own
    assert!(matches!(
        filter.update_stacked(&values, &[0.0; 4], &mut workspace, first),
        Err(UkfError::Covariance {
            step: Step::Innovation,
            reason: CholeskyError::NotPositiveDefinite { pivot: 1, .. }
        })
    ));
    let nan = [good.value, lost.value];
    assert!(
        filter
            .update_stacked(&nan, &[1.0, 0.0, 0.0, 1.0], &mut workspace, first)
            .is_err()
    );
    assert_eq!(filter, before);
    // no measurement is no news
    assert_eq!(filter.update_sequentially(&[], first).unwrap().rows, 0);
    assert_eq!(
        filter.update_information::<_, 1>(&[], first).unwrap().nis,
        0.0
    );
    assert_eq!(
        filter
            .update_stacked(&[], &[], &mut [], first)
            .unwrap()
            .rows,
        0
    );
    assert!((filter.covariance() - p).amax() < 4.0 * f64::EPSILON);
}
