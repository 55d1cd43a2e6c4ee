//! Weights are carried from frame to frame, and sum to one whatever their size.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{
    FilterConfig, NoMapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, RbpfError,
    Resampler, Streams,
};
use std::convert::Infallible;

/// A random walk of unit variance, measured with variance 1/2.
struct Walk;

impl Proposal<f64, f64> for Walk {
    type Error = Infallible;

    fn propose(&self, x: &mut f64, z: &f64, rng: &mut ChaCha8Rng) -> Result<f64, Infallible> {
        *x += rng.sample::<f64, _>(StandardNormal);
        Ok(-(z - *x).powi(2))
    }
}

/// Two frames without resampling: the carried weights give the posterior of the pose under both;
/// forgetting the first gives another, many standard errors away. Unit walk from N(0, 1), measured
/// with variance r at -1.5 and then at 2, seen from a prior that is sampled.
#[test]
fn dropping_the_previous_weight_fails() {
    let (measurements, r) = ([-1.5, 2.0], 0.5);
    let (mut mean, mut variance) = (0.0, 0.0);
    for z in measurements {
        variance += 1.0;
        let gain = variance / (variance + r);
        mean += gain * (z - mean);
        variance -= gain * variance;
    }
    let estimate = |seed, shift: f64, forget: bool| {
        let set = ParticleSet::from_parts(vec![0.0; 400], vec![shift; 400], (0..400).collect())
            .expect("valid set");
        let config = FilterConfig {
            resampling_threshold: 0.0,
            ..FilterConfig::default()
        };
        let mut filter = ParticleFilter::new(set, Streams::new(seed), config).expect("valid");
        for (frame, z) in (0..).zip(measurements) {
            if forget {
                let particles = filter.set().particles().to_vec();
                let set = ParticleSet::new(particles).expect("valid set");
                filter = ParticleFilter::new(set, Streams::new(seed), config).expect("valid");
            }
            filter
                .step(frame, &z, &Walk, &NoRejuvenation, &NoMapUpdate)
                .expect("valid step");
        }
        filter.set().weighted_mean(|x| *x).expect("normalised")
    };
    let over_seeds = |forget| {
        let values: Vec<f64> = (0..100).map(|seed| estimate(seed, 0.0, forget)).collect();
        let n = values.len() as f64;
        let average = values.iter().sum::<f64>() / n;
        let spread = values.iter().map(|v| (v - average).powi(2)).sum::<f64>() / (n - 1.0);
        (average, (spread / n).sqrt())
    };
    // the bias of a ratio of sums over 400 particles is about the variance over 400, inside the error
    let (carried, error) = over_seeds(false);
    assert!(
        (carried - mean).abs() < 4.5 * error,
        "{carried} {mean} {error}"
    );
    let (forgotten, error) = over_seeds(true);
    assert!(
        (forgotten - mean).abs() > 20.0 * error,
        "{forgotten} {mean} {error}"
    );
    // a constant on all log weights: eps * 1e4 on each, over weights that sum to one
    for shift in [-1e4, 1e4] {
        assert!((estimate(1, shift, false) - estimate(1, 0.0, false)).abs() < 1e-10);
    }
}

/// The sum of the log weights was formed before it was taken off: beyond 1e16 its logarithm of four was rounded
/// away, and each of four equal particles had the weight one.
#[test]
fn regress_weights_sum_to_one_for_increments_beyond_1e16() {
    for increment in [-1e17, 1e17, -1e300, f64::MIN, f64::MAX] {
        let mut set = ParticleSet::new(vec![(); 4]).expect("four particles");
        let log_evidence = set.reweight(&[increment; 4]).expect("finite increments");
        assert_eq!(set.weights(), vec![0.25; 4], "{increment:e}");
        assert_eq!(log_evidence, increment);
        assert_eq!(set.weighted_mean(|()| 1.0), Ok(1.0));
        // the same by the other door
        let origins = (0..4).collect();
        let set = ParticleSet::from_parts(vec![(); 4], vec![increment; 4], origins);
        assert_eq!(set.expect("finite weights").weights(), vec![0.25; 4]);
    }
}

/// A weight was lost beside an increment beyond 1e16: a particle of a thousandth came out as likely as one of all.
#[test]
fn regress_earlier_weights_survive_an_increment_beyond_1e16() {
    let logs = vec![0.999_f64.ln(), 0.001_f64.ln()];
    let mut set = ParticleSet::from_parts(vec![(); 2], logs, vec![0, 1]).expect("two particles");
    set.reweight(&[-1e17, -1e17]).expect("finite increments");
    let weights = set.weights();
    assert!((weights[0] - 0.999).abs() < 1e-15 && (weights[1] - 0.001).abs() < 1e-15);
}

/// Any bit pattern that is no NaN and not +inf: denormals, zeros and -inf among them, and ties more often than chance.
fn log_value() -> impl Strategy<Value = f64> {
    let any = proptest::num::f64::ANY.prop_map(|x| {
        if x.is_nan() || x == f64::INFINITY {
            f64::NEG_INFINITY
        } else {
            x
        }
    });
    prop_oneof![
        6 => any,
        2 => (0..4_i32).prop_map(|k| -1e17 * f64::from(k)),
        2 => -40.0..40.0_f64,
        1 => Just(f64::NEG_INFINITY),
        1 => Just(f64::MIN),
        1 => Just(f64::MAX),
    ]
}

fn check_weights(before: &[f64], after: &[f64]) -> Result<(), TestCaseError> {
    let sum: f64 = after.iter().map(|weight| weight.exp()).sum();
    // each exponential rounds by a unit, the logarithm of the sum by one of log n; a sum below 2^17 that was taken off
    // at once rounds by a unit of it, and weights that sum to one so nearly are left as they are
    let rounding = (8.0 * (after.len() as f64 + 1.0) + 2.0 * 131_072.0) * f64::EPSILON;
    prop_assert!((sum - 1.0).abs() < rounding, "{sum}");
    for (a, x) in before.iter().zip(after) {
        prop_assert!(!x.is_nan() && *x <= rounding);
        prop_assert!(*a != f64::NEG_INFINITY || *x == f64::NEG_INFINITY);
        for (b, y) in before.iter().zip(after) {
            prop_assert!(a < b || x >= y, "{a:e} -> {x:e}, {b:e} -> {y:e}");
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

    #[test]
    fn weights_sum_to_one_and_keep_their_order_over_all_of_f64(
        logs in prop::collection::vec(log_value(), 1..12),
        seed in any::<u64>(),
    ) {
        let count = logs.len();
        let set = ParticleSet::from_parts(vec![(); count], logs.clone(), (0..count).collect());
        if logs.iter().all(|l| *l == f64::NEG_INFINITY) {
            let told = matches!(set, Err(RbpfError::DegenerateWeights { zero, .. }) if zero == count);
            prop_assert!(told);
            return Ok(());
        }
        let set = set.expect("one weight is finite");
        check_weights(&logs, set.log_weights())?;
        let largest = set.log_weights().iter().copied().fold(f64::NEG_INFINITY, f64::max);
        prop_assert_eq!(set.log_weights()[set.best()], largest);
        let n_eff = set.effective_count();
        prop_assert!(n_eff > 1.0 - 1e-12 && n_eff < count as f64 * (1.0 + 1e-12));
        // what is resampled has weight
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for slot in Resampler::Systematic.resample(set.log_weights(), count, &mut rng).expect("weights") {
            prop_assert!(set.log_weights()[slot] > f64::NEG_INFINITY);
        }
    }

    #[test]
    fn increments_of_any_size_leave_weights_that_sum_to_one(
        pairs in prop::collection::vec((log_value(), log_value()), 1..12),
    ) {
        let (logs, increments): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        prop_assume!(logs.iter().any(|l| *l > f64::NEG_INFINITY));
        let count = logs.len();
        let mut set = ParticleSet::from_parts(vec![(); count], logs, (0..count).collect())
            .expect("one weight is finite");
        let before = set.clone();
        let alive = before.log_weights().iter().zip(&increments)
            .any(|(w, l)| *w > f64::NEG_INFINITY && *l > f64::NEG_INFINITY);
        let evidence = set.reweight(&increments);
        if alive {
            prop_assert!(!evidence.expect("one sum is finite").is_nan());
            let sum: f64 = set.weights().iter().sum();
            // 2^17 eps where the sum comes off at once
            prop_assert!((sum - 1.0).abs() < 8.0 * (count as f64 + 1.0) * f64::EPSILON + 2.9e-11, "{sum}");
        } else {
            let told = matches!(evidence, Err(RbpfError::DegenerateWeights { .. }));
            prop_assert!(told);
            prop_assert_eq!(&set, &before);
        }
    }

    #[test]
    fn nan_and_infinity_are_errors_that_change_nothing(
        logs in prop::collection::vec(log_value(), 1..12),
        at in any::<prop::sample::Index>(),
        bad in prop_oneof![Just(f64::NAN), Just(f64::INFINITY)],
    ) {
        let count = logs.len();
        let mut set = ParticleSet::new(vec![(); count]).expect("particles");
        let before = set.clone();
        let mut increments = logs;
        increments[at.index(count)] = bad;
        let told = matches!(set.reweight(&increments), Err(RbpfError::DegenerateWeights { .. }));
        prop_assert!(told);
        prop_assert_eq!(&set, &before);
        let given = ParticleSet::from_parts(vec![(); count], increments, (0..count).collect());
        let told = matches!(given, Err(RbpfError::DegenerateWeights { .. }));
        prop_assert!(told);
    }
}

/// Weights far from one another have a log-sum that is rounded by their sizes: such a set was normalised again when it was
/// put together from its own parts, and lost bits.
#[test]
fn regress_a_set_put_together_from_its_parts_lost_bits() {
    for seed in 0..500 {
        let mut rng = Streams::new(seed).shared(0, rbpf_core::Purpose::Scene);
        let mut set = ParticleSet::new(vec![(); 12]).expect("valid set");
        for _ in 0..5 {
            let increments: Vec<f64> = (0..12)
                .map(|_| 3.0 * rng.sample::<f64, _>(StandardNormal))
                .collect();
            set.reweight(&increments).expect("finite weights");
        }
        let again = ParticleSet::from_parts(
            set.particles().to_vec(),
            set.log_weights().to_vec(),
            set.origins().to_vec(),
        );
        assert_eq!(again.expect("valid set"), set, "seed {seed}");
    }
}
