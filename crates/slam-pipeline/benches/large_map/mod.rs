//! Maps of any size, and the frames of a robot that drives through the first metres of them.
//!
//! A robot has driven past shelves to its left, a keyframe every half metre with forty landmarks each, two to six metres
//! away. The first keyframes of all maps are the same, and so are the frames.

use mono_geometry::{Camera, Distortion, Mount, Pinhole, Se2, Se3};
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use slam_pipeline::{
    FrameInput, KnownErrors, KnownKeyframe, KnownLandmark, KnownMap, MapUse, OdometryInterval, Rig,
    Slam, SlamError, config::Config,
};
use vision_sift::{Features, Keypoint};

/// Landmarks of a keyframe.
const LANDMARKS: usize = 40;
/// Metres between keyframes.
const STEP_M: f64 = 0.5;
/// Metres between rows of shelves.
const ROW_M: f64 = 12.0;
/// Keyframe of the map at which the frames begin.
const BEGIN: usize = 8;
/// Metres a frame.
const FRAME_M: f64 = 0.1;

/// A camera that looks to the left of the body.
pub(crate) fn rig() -> Option<Rig> {
    let pinhole = Pinhole {
        width: 640,
        height: 480,
        fx: 520.0,
        fy: 520.0,
        cx: 319.5,
        cy: 239.5,
    };
    let sideways = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    Some(Rig {
        camera: Camera::new(pinhole, Distortion::None).ok()?,
        mount: Mount::new(&sideways, &Vector3::new(0.0, 0.0, 1.0)).ok()?,
    })
}

fn body(rows_of: usize, keyframe: usize) -> Se2 {
    Se2::new(
        STEP_M * (keyframe % rows_of) as f64,
        ROW_M * (keyframe / rows_of) as f64,
        0.0,
    )
}

fn camera_of(rig: &Rig, body: &Se2) -> Se3 {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), body.phi);
    let mount = &rig.mount.body_from_camera;
    Se3::new(
        turn * mount.rotation,
        Vector3::new(body.x, body.y, 0.0) + turn * mount.translation,
    )
}

/// A map of `landmarks` landmarks, in rows of `rows_of` keyframes one behind the other.
pub(crate) fn map(rig: &Rig, landmarks: usize, rows_of: usize) -> KnownMap {
    let count = landmarks.div_ceil(LANDMARKS);
    let mut known = KnownMap {
        camera: rig.camera,
        keyframes: Vec::with_capacity(count),
        errors: KnownErrors {
            keyframes: vec![0],
            rows: vec![vec![Matrix3::identity() * 1e-6]],
        },
        landmarks: Vec::with_capacity(landmarks),
    };
    for keyframe in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(keyframe as u64);
        let body = body(rows_of, keyframe);
        let world_from_camera = camera_of(rig, &body);
        known.keyframes.push(KnownKeyframe {
            world_from_camera,
            body,
            covariance: Matrix3::identity() * 1e-6,
        });
        for index in 0..LANDMARKS {
            let depth = rng.random_range(2.0..6.0);
            known.landmarks.push(KnownLandmark {
                id: (keyframe * LANDMARKS + index) as u32,
                anchor: keyframe as u32,
                parameters: Vector3::new(
                    rng.random_range(-0.6..0.6),
                    rng.random_range(-0.45..0.45),
                    1.0 / depth,
                ),
                covariance: Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, 1e-5)),
                descriptor: core::array::from_fn(|_| rng.random_range(0..120)),
                observations: 8,
                existence: 5.0,
                last_direction: world_from_camera.rotation * Vector3::z(),
            });
        }
    }
    known
}

/// The features of frame `frame`: the landmarks of the first row, with half a pixel of noise.
pub(crate) fn frame(rig: &Rig, map: &KnownMap, frame: usize) -> Features {
    let mut rng = ChaCha8Rng::seed_from_u64(1_000_000 + frame as u64);
    let at = Se2::new(STEP_M * BEGIN as f64 + FRAME_M * frame as f64, 0.0, 0.0);
    let camera = camera_of(rig, &at);
    let pinhole = *rig.camera.pinhole();
    let mut features = Features::default();
    for l in map.landmarks.iter().take(40 * LANDMARKS) {
        let anchor = &map.keyframes[l.anchor as usize].world_from_camera;
        let p = l.parameters;
        let point = anchor.translation + anchor.rotation * (Vector3::new(p.x, p.y, 1.0) / p.z);
        let q = camera.rotation.inverse() * (point - camera.translation);
        let pixel = pinhole.pixel(&Vector2::new(q.x / q.z, q.y / q.z));
        let noise = Vector2::new(rng.random_range(-0.8..0.8), rng.random_range(-0.8..0.8));
        let seen = pixel + noise;
        let inside = seen.x > 0.0 && seen.y > 0.0 && seen.x < 639.0 && seen.y < 479.0;
        if q.z > 0.5 && inside && anchor.translation.y == 0.0 {
            features.keypoints.push(Keypoint {
                x: seen.x as f32,
                y: seen.y as f32,
                sigma: 2.0,
                angle: 0.0,
                response: 0.05,
            });
            features.descriptors.push(
                l.descriptor
                    .map(|v| v.saturating_add(rng.random_range(0..8))),
            );
        }
    }
    features
}

/// The odometry of a frame.
pub(crate) fn odometry(frame: usize) -> Vec<OdometryInterval> {
    let interval = OdometryInterval {
        duration_s: 0.2,
        v_mps: FRAME_M / 0.2,
        omega_radps: 0.0,
    };
    if frame == 0 {
        Vec::new()
    } else {
        vec![interval]
    }
}

/// A system that has begun in `map` and driven `frames` frames.
pub(crate) fn driven(
    rig: &Rig,
    map: &KnownMap,
    particles: u32,
    frames: usize,
) -> Result<Slam, Box<dyn std::error::Error>> {
    let mut config = Config::default();
    config.filter.particles = particles;
    let mut slam = Slam::with_map(*rig, &config.check()?, map, MapUse::Extend)?;
    for index in 0..frames {
        step(&mut slam, rig, map, index)?;
    }
    Ok(slam)
}

/// Gives frame `index` to `slam`; whether it was a keyframe, and its matches.
pub(crate) fn step(
    slam: &mut Slam,
    rig: &Rig,
    map: &KnownMap,
    index: usize,
) -> Result<(bool, usize), SlamError> {
    let features = frame(rig, map, index);
    let odometry = odometry(index);
    let input = FrameInput {
        features: &features,
        odometry: &odometry,
    };
    let report = slam.step(&input, &mut |_| {})?;
    Ok((report.keyframe, report.matches))
}
