//! The rate at which the base reports its motion changes nothing: noise is per square root of second, metre and radian.

use slam_pipeline::config::ValidConfig;
use slam_pipeline::{FrameInput, Odometer, OdometryInterval, Slam};
use vision_sift::Features;

use crate::drive::{Drive, FRAMES, config, rig};

/// The same interval as `parts` rows.
fn split(whole: &OdometryInterval, parts: u32) -> Vec<OdometryInterval> {
    let part = OdometryInterval {
        duration_s: whole.duration_s / f64::from(parts),
        ..*whole
    };
    vec![part; parts as usize]
}

/// Covariance of every pose of the drive with `parts` rows of odometry a second; blind: without the images.
fn covariances(
    drive: &Drive,
    config: &ValidConfig,
    parts: u32,
    blind: bool,
) -> Vec<nalgebra::Matrix3<f64>> {
    let mut slam = Slam::new(rig(), config).unwrap();
    let nothing = Features::default();
    (0..FRAMES)
        .map(|index| {
            let seen = drive.input(index);
            let rows: Vec<_> = seen.odometry.iter().flat_map(|o| split(o, parts)).collect();
            let input = FrameInput {
                features: if blind { &nothing } else { seen.features },
                odometry: &rows,
            };
            let report = slam.step(&input, &mut |_| {}).unwrap();
            report.estimate.covariance
        })
        .collect()
}

#[test]
fn an_increment_has_the_same_covariance_at_every_row_rate() {
    let settings = config(1, 0);
    let whole = OdometryInterval {
        duration_s: 1.0,
        v_mps: 0.6,
        omega_radps: 0.4,
    };
    let at = |parts: u32| {
        let mut odometer = Odometer::new(&settings.odometry);
        for row in split(&whole, parts) {
            odometer.push(&row).unwrap();
        }
        odometer.control().covariance
    };
    let fine = at(5000);
    for rate in [10, 50, 200] {
        // A row is an arc whose noise acts along all of it: second order of its share of the whole.
        let off = (at(rate) - fine).amax() / fine.amax();
        assert!(off < 1.0 / f64::from(rate).powi(2), "{rate} Hz: {off}");
    }
}

/// Blind, where the covariance is that of the odometry, 10, 50 and 200 rows a second end within a per cent; seeing, where the
/// images bound it, within five: increments that differ in the third digit lead to other draws and resamplings.
#[test]
fn the_filter_is_as_sure_at_every_row_rate() {
    let drive = Drive::new(3);
    let settings = config(20, 3);
    for (blind, bound) in [(true, 0.01), (false, 0.05)] {
        let slow = covariances(&drive, &settings, 10, blind);
        for rate in [50, 200] {
            let fast = covariances(&drive, &settings, rate, blind);
            let (slow, fast) = (slow[FRAMES - 1], fast[FRAMES - 1]);
            for axis in 0..3 {
                let ratio = fast[(axis, axis)] / slow[(axis, axis)];
                assert!(
                    (ratio - 1.0).abs() < bound,
                    "{rate} rows a second, blind {blind}, axis {axis}: variance times {ratio}"
                );
            }
        }
    }
}
