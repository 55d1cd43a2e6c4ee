//! Landmarks without depth: the start, the derivative, and whether the point that comes of them is as good as it says.

use estimation_base::{Se2, wrap};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{BearingLandmark, RbpfError};

fn bearing_to(pose: &Se2, point: [f64; 2]) -> f64 {
    wrap((point[1] - pose.y).atan2(point[0] - pose.x) - pose.phi)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// The expected bearing is that of the point, its variance that of numerical derivatives by bearing and inverse distance.
    #[test]
    fn the_expected_bearing_and_its_variance_are_those_of_the_point(
        bearing in -3.0..3.0_f64, nearest in 0.2..5.0_f64, x in -1.0..1.0_f64, y in -1.0..1.0_f64, phi in -3.0..3.0_f64,
    ) {
        let landmark = BearingLandmark::first_seen(&Se2::new(0.3, -0.2, 0.4), bearing, 0.02, nearest).unwrap();
        let [beta, rho] = landmark.mean();
        let point = [0.3 + beta.cos() / rho, -0.2 + beta.sin() / rho];
        let pose = Se2::new(x, y, phi);
        if (point[0] - x).hypot(point[1] - y) > 0.1 * nearest {
            let (expected, variance) = landmark.expected(&pose).unwrap();
            prop_assert!(wrap(expected - bearing_to(&pose, point)).abs() < 1e-12);
            // d h / d beta and d h / d rho by differences, the covariance is diagonal at first
            let of = |beta: f64, rho: f64| {
                bearing_to(&pose, [0.3 + beta.cos() / rho, -0.2 + beta.sin() / rho])
            };
            let step = 1e-6;
            let by_beta = wrap(of(beta + step, rho) - of(beta - step, rho)) / (2.0 * step);
            let by_rho = wrap(of(beta, rho + step) - of(beta, rho - step)) / (2.0 * step);
            let sigma_rho = 0.25 / nearest;
            let numerical = (by_beta * 0.02).powi(2) + (by_rho * sigma_rho).powi(2);
            prop_assert!((numerical / variance - 1.0).abs() < 1e-5, "{} {}", numerical, variance);
        }
    }
}

/// 600 landmarks 1 to 12 m away, passed by with a bearing every 0.2 m: the squared error of the points over their covariance
/// is chi-square of two degrees. The bound is four standard errors, 2 / sqrt(n), wider by the curvature that the index 0.1 allows.
#[test]
fn the_point_is_as_good_as_its_covariance_says() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let sigma = 0.01;
    let (mut sum, mut count, mut far) = (0.0, 0_u32, 0);
    for _ in 0..600 {
        let point = [rng.random_range(1.0..9.0), rng.random_range(1.0..8.0)];
        let mut measured =
            |pose: &Se2| bearing_to(pose, point) + sigma * rng.sample::<f64, _>(StandardNormal);
        let start = Se2::new(0.0, 0.0, 0.1);
        let bearing = measured(&start);
        let mut landmark = BearingLandmark::first_seen(&start, bearing, sigma, 1.0).unwrap();
        let mut pose = start;
        for _ in 0..20 {
            pose = pose.compose(&Se2::new(0.2, 0.0, -0.01));
            let bearing = measured(&pose);
            assert!(landmark.update(&pose, bearing, sigma).unwrap().is_some());
        }
        let Some(found) = landmark.point(&pose) else {
            far += 1;
            continue;
        };
        let error = [point[0] - found.position[0], point[1] - found.position[1]];
        let [[a, b], [_, c]] = found.covariance;
        let squared = (c * error[0] * error[0] - 2.0 * b * error[0] * error[1]
            + a * error[1] * error[1])
            / (a * c - b * b);
        sum += squared;
        count += 1;
    }
    let mean = sum / f64::from(count);
    let standard_error = 2.0 / f64::from(count).sqrt();
    assert!(count > 300 && far < 300, "{count} {far}");
    assert!(
        (mean - 2.0).abs() < 4.0 * standard_error + 0.1,
        "{mean} of {count}"
    );
}

/// A Gaussian over the position cannot say it: after one bearing the landmark may be at 1 m or at infinity.
#[test]
fn the_first_bearing_leaves_the_distance_open() {
    let start = Se2::new(1.0, 2.0, 0.5);
    let landmark = BearingLandmark::first_seen(&start, 0.3, 0.01, 1.0).unwrap();
    let sigma_rho = landmark.covariance()[1][1].sqrt();
    assert_eq!(landmark.mean()[1] - 2.0 * sigma_rho, 0.0);
    assert_eq!(landmark.mean()[1] + 2.0 * sigma_rho, 1.0);
    // seen from 1 m to the side both ends are expected within three sigma
    let aside = start.compose(&Se2::new(0.0, 1.0, 0.0));
    let (expected, variance) = landmark.expected(&aside).unwrap();
    for distance in [1.0, 1e9] {
        let beta: f64 = 0.8;
        let point = [1.0 + distance * beta.cos(), 2.0 + distance * beta.sin()];
        let off = wrap(bearing_to(&aside, point) - expected);
        assert!(off * off < 9.0 * variance, "{distance}");
    }
    assert_eq!(landmark.point(&aside), None);
}

#[test]
fn wrong_settings_are_refused_and_the_landmark_itself_has_no_bearing() {
    let start = Se2::new(0.0, 0.0, 0.0);
    assert_eq!(
        BearingLandmark::first_seen(&start, 0.0, 0.0, 1.0)
            .unwrap_err()
            .to_string(),
        "the standard deviation of a bearing must be finite and above 0 rad, 0 given"
    );
    assert!(BearingLandmark::first_seen(&start, 0.0, 0.1, -1.0).is_err());
    let mut landmark = BearingLandmark::first_seen(&start, 0.0, 0.1, 1.0).unwrap();
    let before = landmark;
    assert!(matches!(
        landmark.update(&start, f64::NAN, 0.1),
        Err(RbpfError::NotFinite { .. })
    ));
    // its mean lies 2 m ahead
    assert_eq!(landmark.expected(&Se2::new(2.0, 0.0, 0.0)), None);
    assert_eq!(
        landmark.update(&Se2::new(2.0, 0.0, 0.0), 0.1, 0.1),
        Ok(None)
    );
    assert_eq!(landmark, before);
}
