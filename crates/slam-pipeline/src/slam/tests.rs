//! A stage that no input can make fail is made to fail from inside.

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
                x: 10.0 + 15.0 * f32::from(i),
                y: 50.0,
                sigma: 2.0,
                angle: 0.0,
                response: 0.1,
            })
            .collect(),
        descriptors: (0..count).map(|i| [i; 128]).collect(),
    }
}

#[test]
fn an_index_that_refuses_leaves_no_trace() {
    let mut config = Config::default();
    config.filter.method = Method::Paper;
    let mut slam = Slam::new(rig(), &config.check().unwrap()).unwrap();
    let step = |slam: &mut Slam| {
        let input = FrameInput {
            features: &features(8),
            odometry: &[],
        };
        slam.step(&input, &mut |_| {})
    };
    step(&mut slam).unwrap();
    // The next identities are in the forest already.
    slam.state.catalogue.restart_identities();
    // A keyframe whose keypoints match nothing: all of them are new features.
    let input = FrameInput {
        features: &Features {
            descriptors: vec![[200; 128]; 8],
            ..features(8)
        },
        odometry: &[],
    };
    slam.state.frames_since_keyframe = 100;
    let before = format!("{slam:?}");
    let error = slam.step(&input, &mut |_| {}).unwrap_err();
    assert!(matches!(error, SlamError::Index(_)), "{error}");
    assert_eq!(format!("{slam:?}"), before);
}
