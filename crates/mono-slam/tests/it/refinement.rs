//! A camera refined over recorded drives whose truth is known.

use mono_slam::recorded::RecordedRun;
use mono_slam::refine::{RefineError, priors, refine};
use nalgebra::Matrix3;
use slam_batch::{Constant, Constants, Recording};
use slam_io::{CameraFile, MountFile, RunRecord, SigmaFile};
use slam_pipeline::config::Config;

#[expect(dead_code, reason = "shared with the tests of the batch")]
#[path = "../../../slam-batch/tests/it/simulation.rs"]
mod simulation;

use simulation::{Drive, settings};

/// The rig of the drive says what is wrong by these.
const FOCAL: f64 = -0.005;
const YAW: f64 = 0.01;

fn recorded(seed: u64) -> RecordedRun {
    let mut settings = settings();
    settings.points = 600;
    settings.truth = Constants::ZERO
        .with(Constant::FocalScale, FOCAL)
        .with(Constant::MountYaw, YAW);
    let drive = Drive::new(&settings, seed);
    let problem = &drive.problem;
    let mut config = Config::default();
    config.features.sigma_px = settings.model.sigma_px;
    config.odometry = settings.model.odometry.clone();
    config.carrier.tilt_sigma = settings.model.tilt_sigma;
    config.carrier.tilt_time_s = settings.model.tilt_time_s;
    let mut recording = Recording::default();
    for (k, keyframe) in problem.keyframes.iter().enumerate() {
        let seen: Vec<_> = problem
            .tracks
            .iter()
            .filter_map(|t| {
                let sighting = t.sightings.iter().find(|s| s.keyframe == k)?;
                Some((t.landmark, sighting.pixel, sighting.size_px))
            })
            .collect();
        let rows = keyframe.motion.clone().unwrap_or_default();
        recording.push_frame(keyframe.start, true, &rows, seen);
    }
    let pinhole = problem.rig.camera.pinhole();
    let mount = &problem.rig.mount.body_from_camera;
    RecordedRun {
        record: RunRecord {
            sequence: "drive".into(),
            warnings: Vec::new(),
            scale: slam_io::RunScale::Metric,
            predicted: Vec::new(),
            frames: Vec::new(),
            smoothed: problem
                .keyframes
                .iter()
                .enumerate()
                .map(|(k, keyframe)| (k as f64, keyframe.start))
                .collect(),
            smoother: None,
            tracks: Vec::new(),
            landmarks: Vec::new(),
            known_map: None,
            dead_reckoning: Vec::new(),
            reference: None,
            snapshots: Vec::new(),
            configuration: String::new(),
            seed,
            particles: 1,
            method: "exact".into(),
            wall_s: 0.0,
        },
        recording,
        rig: problem.rig,
        camera: CameraFile {
            width: pinhole.width as u32,
            height: pinhole.height as u32,
            fx: pinhole.fx,
            fy: pinhole.fy,
            cx: pinhole.cx,
            cy: pinhole.cy,
            distortion: *problem.rig.camera.distortion(),
            mount: MountFile {
                position_in_body: mount.translation.into(),
                rotation_body_from_camera: std::array::from_fn(|i| {
                    std::array::from_fn(|j| mount.rotation.matrix()[(i, j)])
                }),
            },
            sigma: SigmaFile::default(),
        },
        config: config.check().unwrap(),
    }
}

#[test]
fn a_wrong_focal_length_and_a_yawed_mount_come_right_within_their_sigmas() {
    let runs = [recorded(1), recorded(2)];
    let refinement = refine(&runs, &priors(&runs[0])).unwrap();
    let (before, after) = (&refinement.before, &refinement.after);
    let truth = before.fx * (1.0 + FOCAL);
    let sigma = after.sigma.fx.unwrap();
    assert!(sigma < 0.3 * (before.fx - truth), "{sigma} px");
    assert!(
        (after.fx - truth).abs() < 3.0 * sigma,
        "{} of {truth}",
        after.fx
    );
    assert!((after.fy / after.fx - before.fy / before.fx).abs() < 1e-12);

    // The mount: Rz(yaw) times that of the rig. Turned the other way it would be off by twice the yaw.
    let matrix = |file: &CameraFile| {
        let rows = file.mount.rotation_body_from_camera;
        Matrix3::from_fn(|i, j| rows[i][j])
    };
    let turn = matrix(after) * matrix(before).transpose();
    let yaw = turn[(1, 0)].atan2(turn[(0, 0)]);
    let sigma = after.sigma.mount_yaw.unwrap();
    assert!(
        (yaw - YAW).abs() < 3.0 * sigma && sigma < 0.3 * YAW,
        "{yaw} +- {sigma}"
    );
    // No lens, no coefficient.
    assert_eq!(after.sigma.k1, None);

    // One run alone knows less.
    let alone = refine(&runs[..1], &priors(&runs[0])).unwrap();
    assert!(alone.after.sigma.fx > after.sigma.fx);
}

#[test]
fn the_camera_file_s_own_sigmas_are_the_priors() {
    let mut run = recorded(3);
    run.camera.sigma.fx = Some(0.0);
    run.camera.sigma.mount_yaw = Some(1e-5);
    let refinement = refine(&[run.clone()], &priors(&run)).unwrap();
    assert_eq!(
        refinement.after.fx, run.camera.fx,
        "known exactly, so it stays"
    );
    assert!(refinement.after.sigma.mount_yaw.unwrap() <= 1e-5);
}

#[test]
fn runs_of_different_cameras_are_refused() {
    let (first, mut second) = (recorded(1), recorded(2));
    second.camera.cx += 1.0;
    assert!(matches!(
        refine(&[first.clone(), second], &priors(&first)),
        Err(RefineError::OtherCamera { index: 1 })
    ));
    assert!(matches!(
        refine(&[], &priors(&first)),
        Err(RefineError::NoRuns)
    ));
}
