//! The stages that no input can make fail are made to fail from inside: they leave no trace either.

use mono_geometry::{Camera, Distortion, Mount, Pinhole};
use vision_sift::{Features, Keypoint};

use super::{FrameInput, Slam, SlamError};
use crate::config::{Config, Method};
use crate::rig::Rig;

fn rig() -> Rig {
    let pinhole = Pinhole {
        width: 320,
        height: 240,
        fx: 300.0,
        fy: 300.0,
        cx: 160.0,
        cy: 120.0,
    };
    Rig {
        camera: Camera::new(pinhole, Distortion::None).unwrap(),
        mount: Mount::forward(),
    }
}

fn features(count: u8) -> Features {
    Features {
        keypoints: (0..count)
            .map(|i| Keypoint {
                x: 10.0 + 12.0 * f32::from(i),
                y: 50.0,
                sigma: 2.0,
                angle: 0.0,
                response: 0.1,
            })
            .collect(),
        descriptors: (0..count).map(|i| [i; 128]).collect(),
    }
}

/// A system of `method` after a first frame of `features(24)`, about to make a keyframe of the next one.
fn after_the_first_frame(method: Method) -> Slam {
    let mut config = Config::default();
    config.filter.method = method;
    let mut slam = Slam::new(rig(), &config.check().unwrap()).unwrap();
    let first = FrameInput {
        features: &features(24),
        odometry: &[],
    };
    slam.step(&first, &mut |_| {}).unwrap();
    slam.keyframes.max_gap_s = 0.0;
    slam
}

/// Gives `next` to `slam`, which refuses it and is what it was.
fn refusal(slam: &mut Slam, next: &Features) -> SlamError {
    let before = format!("{slam:?}");
    let input = FrameInput {
        features: next,
        odometry: &[],
    };
    let error = slam.step(&input, &mut |_| {}).unwrap_err();
    assert_eq!(format!("{slam:?}"), before, "{error}");
    error
}

#[test]
fn an_index_that_refuses_leaves_no_trace() {
    let mut slam = after_the_first_frame(Method::Paper);
    // The next identities are in the forest already.
    slam.state.catalogue.restart_identities();
    // Keypoints that match nothing are new features.
    let strangers = Features {
        descriptors: vec![[200; 128]; 24],
        ..features(24)
    };
    let error = refusal(&mut slam, &strangers);
    assert!(matches!(error, SlamError::Index(_)), "{error}");
}

#[test]
fn a_filter_step_that_fails_leaves_no_trace() {
    let mut slam = after_the_first_frame(Method::Exact);
    // The weight of this particle is not a number.
    slam.state.filter.particles_mut()[3].pose.phi = f64::NAN;
    let error = refusal(&mut slam, &features(24));
    assert!(
        matches!(error, SlamError::Filter { frame: 1, .. }),
        "{error}"
    );
}
