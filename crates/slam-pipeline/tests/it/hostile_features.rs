//! Features that no detector finds: no panic, and poses that stay numbers.
//!
//! Hundreds of keypoints in one place, descriptors that are all alike, coordinates beyond the image or none, one keypoint, odometry
//! of any size. Frames like these come between good ones, so that there is a map to damage.

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use slam_pipeline::config::{Method, ValidConfig};
use slam_pipeline::{FrameInput, OdometryInterval, Slam};
use vision_sift::{Features, Keypoint};

use crate::drive::{Drive, config, rig};

/// Cases unless `MONO_SLAM_CASES` says otherwise.
const CASES: u32 = 60;

/// A coordinate or size as nobody would give it.
fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => 0.0..320.0_f32,
        1 => prop::num::f32::ANY,
        1 => prop::sample::select(vec![
            0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, 319.5, 1e9,
        ]),
    ]
}

fn keypoint() -> impl Strategy<Value = Keypoint> {
    (number(), number(), number(), number(), number()).prop_map(|(x, y, sigma, angle, response)| {
        Keypoint {
            x,
            y,
            sigma,
            angle,
            response,
        }
    })
}

/// Features of one frame: of all sorts, or many of one place, with descriptors that differ or do not.
fn features() -> impl Strategy<Value = Features> {
    let places = prop_oneof![
        2 => prop::collection::vec(keypoint(), 0..60),
        1 => (keypoint(), 1..600_usize).prop_map(|(k, n)| vec![k; n]),
    ];
    (places, any::<u8>(), any::<bool>(), 0..3_usize).prop_map(|(keypoints, tone, alike, short)| {
        let count = if short == 1 {
            keypoints.len().saturating_sub(1)
        } else {
            keypoints.len()
        };
        let descriptors = (0..count)
            .map(|i| {
                core::array::from_fn(|j| {
                    if alike {
                        tone
                    } else {
                        tone.wrapping_mul(i as u8).wrapping_add(j as u8)
                    }
                })
            })
            .collect();
        Features {
            keypoints,
            descriptors,
        }
    })
}

fn odometry() -> impl Strategy<Value = Vec<OdometryInterval>> {
    let any = prop_oneof![4 => -1.0..1.0_f64, 1 => prop::num::f64::ANY];
    let interval = (any.clone(), any.clone(), any).prop_map(|(duration_s, v_mps, omega_radps)| {
        OdometryInterval {
            duration_s,
            v_mps,
            omega_radps,
        }
    });
    prop::collection::vec(interval, 0..3)
}

fn of_method(method: Method) -> ValidConfig {
    let mut plain = (*config(4, 1)).clone();
    plain.filter.method = method;
    plain.check().unwrap()
}

#[test]
fn frames_of_any_features() {
    let cases = std::env::var("MONO_SLAM_CASES").map_or(CASES, |n| n.parse().unwrap());
    let drive = Drive::new(5);
    let mapped = [Method::Exact, Method::Paper, Method::Conventional].map(|method| {
        let mut slam = Slam::new(rig(), &of_method(method)).unwrap();
        for i in 0..6 {
            slam.step(&drive.input(i), &mut |_| {}).unwrap();
        }
        slam
    });
    let settings = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let frames = prop::collection::vec((features(), odometry()), 1..4);
    TestRunner::new_with_rng(settings, rng)
        .run(
            &(0..3_usize, any::<bool>(), frames),
            |(which, fresh, frames)| {
                let mut slam = if fresh {
                    Slam::new(rig(), &of_method(Method::Exact)).unwrap()
                } else {
                    mapped[which].clone()
                };
                for (features, odometry) in &frames {
                    let input = FrameInput { features, odometry };
                    let before = slam.smoothed_path();
                    match slam.step(&input, &mut |_| {}) {
                        Ok(report) => {
                            let estimate = &report.estimate;
                            prop_assert!(
                                estimate.pose.x.is_finite() && estimate.pose.phi.is_finite()
                            );
                            prop_assert!(estimate.covariance.iter().all(|v| v.is_finite()));
                        }
                        Err(error) => {
                            prop_assert!(!error.to_string().is_empty());
                            prop_assert_eq!(slam.smoothed_path(), before);
                        }
                    }
                }
                // It goes on.
                let good = slam.step(&drive.input(7), &mut |_| {});
                prop_assert!(good.is_ok(), "{:?}", good.err());
                Ok(())
            },
        )
        .unwrap();
}

/// A pose of infinity came of a number that is finite.
#[test]
fn regress_a_speed_that_no_robot_has_is_refused() {
    let mut slam = Slam::new(rig(), &of_method(Method::Exact)).unwrap();
    let input = FrameInput {
        features: &Features::default(),
        odometry: &[OdometryInterval {
            duration_s: 0.7,
            v_mps: -2.4e151,
            omega_radps: 0.0,
        }],
    };
    let error = slam.step(&input, &mut |_| {}).unwrap_err();
    assert!(
        error.to_string().contains("required: -1000 to 1000"),
        "{error}"
    );
}
