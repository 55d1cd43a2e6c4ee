//! From a run of the filter to its batch, and back to every frame.

use nalgebra::Vector2;
use slam_batch::{Model, Recording, solve};
use slam_pipeline::Slam;

#[expect(dead_code, reason = "shared with the tests of the frame loop")]
#[path = "../../../slam-pipeline/tests/it/drive.rs"]
mod drive;

use drive::{Drive, FRAMES, config, rig};

#[test]
fn the_batch_of_a_run_is_better_than_its_filter() {
    const SEEDS: u64 = 6;
    let (mut filtered_rmse, mut best_rmse, mut batch_rmse) = (0.0, 0.0, 0.0);
    for seed in 0..SEEDS {
        let drive = Drive::new(seed);
        let config = config(20, seed);
        let mut slam = Slam::new(rig(), &config).unwrap();
        let mut recording = Recording::default();
        let mut filtered = Vec::new();
        for i in 0..FRAMES {
            let input = drive.input(i);
            let report = slam.step(&input, &mut |_| {}).unwrap();
            recording.push(input.features, &report, input.odometry);
            filtered.push(report.estimate.pose);
        }
        assert_eq!(recording.frames(), FRAMES);
        let best = slam.smoothed_path();
        let problem = recording.problem(rig(), Model::of(&config), &best);
        assert_eq!(problem.keyframes.len(), recording.keyframes().len());
        let solution = solve(&problem).unwrap();
        assert!(solution.converged);
        let path = recording.whole_path(&solution);
        // Keyframes are those of the solution, the others lie between.
        for (k, frame) in recording.keyframes().iter().enumerate() {
            assert_eq!(path[*frame], solution.poses[k]);
        }
        let of = |x: f64, y: f64| Vector2::new(x, y);
        let rmse = |path: &[Vector2<f64>]| drive.rmse(path) / SEEDS as f64;
        filtered_rmse += rmse(&filtered.iter().map(|p| of(p.x, p.y)).collect::<Vec<_>>());
        best_rmse += rmse(&best.iter().map(|p| of(p.x, p.y)).collect::<Vec<_>>());
        batch_rmse += rmse(
            &path
                .iter()
                .map(|e| of(e.pose.x, e.pose.y))
                .collect::<Vec<_>>(),
        );
    }
    let figures =
        format!("filter {filtered_rmse:.4}, its best path {best_rmse:.4}, batch {batch_rmse:.4} m");
    assert!(batch_rmse < 0.9 * filtered_rmse, "{figures}");
    // The path of the best particle comes from local batches and is as good.
    assert!(best_rmse < 0.9 * filtered_rmse, "{figures}");
}

#[test]
fn frames_between_keyframes_take_their_share_of_the_correction() {
    use mono_geometry::{Camera, Distortion, Mount, Pinhole, Se2};
    use slam_pipeline::{OdometryInterval, Rig};

    let pinhole = Pinhole {
        width: 640,
        height: 480,
        fx: 400.0,
        fy: 400.0,
        cx: 320.0,
        cy: 240.0,
    };
    let rig = Rig {
        camera: Camera::new(pinhole, Distortion::None).unwrap(),
        mount: Mount::forward(),
    };
    // The filter thinks that the robot made 0.1 m a frame; every fourth frame is a keyframe, and the images say 0.11 m
    // of the second stretch.
    let row = OdometryInterval {
        duration_s: 0.25,
        v_mps: 0.4,
        omega_radps: 0.0,
    };
    let mut recording = Recording::default();
    for frame in 0..9_i32 {
        let truth = 0.1 * f64::from(frame) + 0.01 * f64::from((frame - 4).max(0));
        let seen = (0..60_u32).filter_map(|landmark| {
            let i = f64::from(landmark);
            let q = nalgebra::Vector3::new(
                1.5 * (2.0 * i).sin(),
                (5.0 * i).cos(),
                4.0 + (3.0 * i).sin() - truth,
            );
            Some((landmark, rig.camera.project(&q)?, 1.2))
        });
        recording.push_frame(
            Se2::new(0.1 * f64::from(frame), 0.0, 0.0),
            frame % 4 == 0,
            &[row],
            seen.collect::<Vec<_>>(),
        );
    }
    assert_eq!(recording.keyframes(), [0, 4, 8]);
    let mut config = slam_pipeline::config::Config::default();
    config.odometry.forward_per_sqrt_m = 0.03;
    let problem = recording.problem(rig, Model::of(&config.check().unwrap()), &[]);
    let solution = solve(&problem).unwrap();
    let path = recording.whole_path(&solution);
    let x = |frame: usize| path[frame].pose.x;
    let (first, second) = (x(4) - x(0), x(8) - x(4));
    assert!(second > 1.08 * first, "{first}, {second}");
    for frame in 0..8 {
        let share = if frame < 4 { first } else { second } / 4.0;
        assert!((x(frame + 1) - x(frame) - share).abs() < 1e-6, "{frame}");
    }
    // Half way, half the variance of either end.
    let variance = |frame: usize| path[frame].covariance[(0, 0)];
    assert!((variance(6) - 0.5 * (variance(4) + variance(8))).abs() < 1e-12);
}
