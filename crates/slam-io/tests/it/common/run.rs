//! A small run with every kind of value in it.

use mono_geometry::{Camera, Distortion, Pinhole, Se2, Se3};
use nalgebra::{Matrix3, Vector3};
use slam_io::{
    DrawnKeypoint, FrameRecord, FrameSnapshot, GreyImage, LearnedValue, RunRecord, SmootherRecord,
    StageTimes, TrackRow,
};
use slam_pipeline::{
    FrameReport, KeypointFate, KnownErrors, KnownKeyframe, KnownLandmark, KnownMap, MapLandmark,
    PoseEstimate,
};

/// Frames of [`small_run`].
pub(crate) const FRAMES: usize = 12;

/// A robot driving a gentle left turn; dead reckoning drifts to the right of it.
pub(crate) fn small_run() -> RunRecord {
    let truth = |index: usize| {
        let phi = 0.02 * index as f64;
        Se2 {
            x: phi.sin() * 5.0,
            y: (1.0 - phi.cos()) * 5.0,
            phi,
        }
    };
    let frames = (0..FRAMES)
        .map(|index| {
            let exact = truth(index);
            let spread = 1e-4 * (1.0 + index as f64);
            FrameRecord {
                index,
                time_s: 0.1 * index as f64,
                keypoints: 100 + index,
                report: FrameReport {
                    estimate: PoseEstimate {
                        pose: Se2 {
                            x: exact.x + 0.003 * index as f64 / 3.0,
                            y: exact.y,
                            phi: exact.phi + 0.001,
                        },
                        covariance: Matrix3::new(
                            spread,
                            1e-5,
                            0.0,
                            1e-5,
                            2.0 * spread,
                            1e-6,
                            0.0,
                            1e-6,
                            spread / 10.0,
                        ),
                    },
                    keyframe: index % 2 == 0,
                    matches: 60,
                    outliers: 4,
                    new_landmarks: if index == 0 { 40 } else { 2 },
                    landmarks: 40 + 2 * index,
                    n_eff: 50.0 / (1.0 + (index % 3) as f64),
                    unique_ancestors: 50 - index,
                    resampled: index % 3 == 2,
                    es_acceptance: (index > 1).then_some(0.25),
                    nis: (index > 0).then_some(0.9 + 0.02 * index as f64),
                    notes: if index == 5 {
                        vec!["too few matches, \"odometry\" only".into()]
                    } else {
                        Vec::new()
                    },
                    odometry_doubted: false,
                    tracking: slam_pipeline::Tracking::Tracking,
                    revisit: false,
                    keypoints: Vec::new(),
                },
                times: StageTimes {
                    decode_ms: 1.0,
                    features_ms: 20.0,
                    association_ms: 5.0,
                    proposal_ms: 3.0,
                    evolution_ms: 2.0,
                    mapping_ms: 4.0,
                    total_ms: 35.0,
                },
            }
        })
        .collect();
    let landmarks = (0..5_u32)
        .map(|id| MapLandmark {
            id: 3 * id,
            position: Vector3::new(f64::from(id) / 3.0, 2.0, 0.1),
            covariance: Matrix3::identity() * (1e-4 * f64::from(1 + id * id * id)),
            observations: 2 + id,
            descriptor: (id % 2 == 0)
                .then(|| Box::new(std::array::from_fn(|index| (index as u32 * (id + 1)) as u8))),
        })
        .collect();
    RunRecord {
        sequence: "small <run> & \"test\"".into(),
        warnings: vec![slam_io::Warning::new(
            "odometry-ends-early",
            "The odometry ends 2 s <before> the images.",
        )],
        scale: slam_io::RunScale::Metric,
        predicted: Vec::new(),
        frames,
        smoothed: (0..FRAMES)
            .map(|index| (0.1 * index as f64, truth(index)))
            .collect(),
        smoother: Some(SmootherRecord {
            method: "batch".into(),
            note: None,
            iterations: 6,
            sightings: 2,
            constants: vec![LearnedValue {
                name: "turn_rate_bias_radps".into(),
                value: 0.1 / 3.0,
                sigma: 1e-3,
                prior_sigma: 2e-3,
            }],
        }),
        tracks: [(0, 3, 1.0 / 3.0), (0, 8, 7.5), (4, 3, 1.25)]
            .map(|(frame, landmark, x_px)| TrackRow {
                frame,
                landmark,
                x_px,
                y_px: 2.0 * x_px,
                size_px: 1.0 + x_px / 3.0,
            })
            .to_vec(),
        landmarks,
        known_map: Some(known_map()),
        dead_reckoning: (0..FRAMES)
            .map(|index| {
                let exact = truth(index);
                Se2 {
                    y: exact.y - 0.01 * index as f64,
                    ..exact
                }
            })
            .collect(),
        reference: Some(
            (0..FRAMES)
                .map(|index| (0.1 * index as f64, truth(index)))
                .collect(),
        ),
        snapshots: vec![
            FrameSnapshot::of_image(
                4,
                FRAMES,
                &GreyImage {
                    width: 16,
                    height: 8,
                    pixels: (0..128).collect(),
                },
            )
            .with_keypoints(&[
                DrawnKeypoint {
                    x: 3.5,
                    y: 2.25,
                    sigma: 1.6,
                    fate: KeypointFate::Matched,
                    predicted: Some([4.0, 2.0]),
                },
                DrawnKeypoint {
                    x: 9.0,
                    y: 5.0,
                    sigma: 2.0,
                    fate: KeypointFate::New,
                    predicted: None,
                },
            ]),
        ],
        configuration: "[filter]\nmethod = \"novel\" # <script>alert(1)</script>\n".into(),
        seed: 7,
        particles: 50,
        method: "novel".into(),
        wall_s: 1.5,
    }
}

/// Two keyframes and a landmark.
fn known_map() -> KnownMap {
    let pinhole = Pinhole {
        width: 16,
        height: 8,
        fx: 9.0,
        fy: 9.0,
        cx: 7.5,
        cy: 3.5,
    };
    let keyframe = |x: f64| KnownKeyframe {
        world_from_camera: Se3 {
            translation: Vector3::new(x, 0.0, 0.3),
            ..Se3::identity()
        },
        body: Se2::new(x, 0.0, 0.0),
        covariance: Matrix3::identity() * x,
    };
    KnownMap {
        camera: Camera::new(pinhole, Distortion::None).unwrap(),
        keyframes: vec![keyframe(0.0), keyframe(1.0 / 3.0)],
        errors: KnownErrors {
            keyframes: vec![0, 1],
            rows: vec![
                vec![Matrix3::zeros()],
                vec![Matrix3::zeros(), Matrix3::identity() / 3.0],
            ],
        },
        landmarks: vec![KnownLandmark {
            id: 3,
            anchor: 1,
            parameters: Vector3::new(0.1, 0.2, 0.5),
            covariance: Matrix3::identity() * 1e-5,
            descriptor: [9; 128],
            observations: 3,
            existence: 4.5,
            last_direction: Vector3::x(),
        }],
    }
}
