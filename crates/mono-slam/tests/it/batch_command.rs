//! `mono-slam batch` after `mono-slam run`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn mono_slam(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mono-slam"))
        .args(arguments)
        .output()
        .unwrap()
}

/// A folder that goes away.
struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        // Leaving a folder behind is no reason to fail a test.
        drop(fs::remove_dir_all(&self.0));
    }
}

#[test]
fn a_run_is_solved_again_from_its_folder() {
    let wall = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/wall");
    let scratch =
        Scratch(std::env::temp_dir().join(format!("mono-slam-batch-{}", std::process::id())));
    let folder = scratch.0.join("run");
    let (wall, run) = (wall.to_str().unwrap(), folder.to_str().unwrap());
    let done = mono_slam(&["run", wall, "--out", run, "--quiet"]);
    assert!(done.status.success(), "{done:?}");

    // Into the folder of the run, and with a constant held and one opened wide.
    let output = mono_slam(&[
        "batch",
        run,
        "--out",
        run,
        "--prior",
        "turn_rate_bias_radps=0",
        "--prior",
        "turning_centre_m=0.5",
    ]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}");
    assert!(
        text.contains("converged") && text.contains("filtered / batch"),
        "{text}"
    );
    let json: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.join("batch.json")).unwrap()).unwrap();
    assert_eq!(json["constants"].as_array().unwrap().len(), 1);
    assert_eq!(json["constants"][0]["name"], "turning_centre_m");
    assert!(
        json["filtered_over_batch"].as_f64().unwrap() > 1.0,
        "{json}"
    );
    let lines = |name: &str| {
        fs::read_to_string(folder.join(name))
            .unwrap()
            .lines()
            .count()
    };
    assert_eq!(lines("covariance_batch.csv"), lines("covariance.csv"));
    assert_eq!(lines("trajectory_batch.tum"), lines("trajectory.tum"));

    // The run itself is as it was: its smoothed path is the batch of the default priors.
    let again = scratch.0.join("again");
    let output = mono_slam(&[
        "batch",
        run,
        "--out",
        again.to_str().unwrap(),
        "--filter-limit",
    ]);
    assert!(output.status.success());
    let json: serde_json::Value =
        serde_json::from_slice(&fs::read(again.join("batch.json")).unwrap()).unwrap();
    let rmse = |name: &str| json["rmse_m"][name].as_f64().unwrap();
    // The batch may look back, the filter has drawn its particles; both are off the limit, and by little.
    assert!(rmse("limit of a filter") < 1.2 * rmse("filtered"), "{json}");
    let x = |path: &Path| -> Vec<f64> {
        let text = fs::read_to_string(path).unwrap();
        text.lines()
            .filter(|line| !line.starts_with('#'))
            .map(|line| line.split(' ').nth(1).unwrap().parse().unwrap())
            .collect()
    };
    let smoothed = x(&folder.join("trajectory_smoothed.tum"));
    // At the end there is nothing to look back from.
    let (limit, whole) = (
        x(&again.join("trajectory_limit.tum")),
        x(&again.join("trajectory_batch.tum")),
    );
    assert_eq!(limit.len(), whole.len());
    assert!((limit.last().unwrap() - whole.last().unwrap()).abs() < 1e-4);
    assert!(limit.iter().zip(&whole).any(|(a, b)| (a - b).abs() > 1e-4));
    for (a, b) in smoothed.iter().zip(x(&again.join("trajectory_batch.tum"))) {
        assert!((a - b).abs() < 1e-4, "{a} against {b}");
    }

    // The camera refined over the run reads back with its sigmas, and prints before and after.
    let camera = scratch.0.join("camera.toml");
    let output = mono_slam(&[
        "calibrate",
        "--from-run",
        run,
        "--out",
        camera.to_str().unwrap(),
    ]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}");
    assert!(
        text.contains("before") && text.contains("fx (px)"),
        "{text}"
    );
    let refined = slam_io::read_calibration(&camera, &slam_io::CalibrationRequest::default())
        .unwrap()
        .camera;
    let sigma = refined.sigma.fx.unwrap();
    assert!(sigma > 0.0 && sigma < 0.01 * refined.fx, "{sigma}");
    assert!(
        (refined.fx - 368.826_2).abs() < 3.0 * sigma,
        "{}",
        refined.fx
    );

    let refused = |arguments: &[&str], code: i32, expected: &str| {
        let output = mono_slam(arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(message.contains(expected), "{message}");
    };
    refused(
        &["batch", run, "--out", run, "--prior", "gravity=1"],
        2,
        "no constant is named gravity; there are wheel_scale,",
    );
    refused(
        &["batch", run, "--out", run, "--max-ate", "0.0001"],
        3,
        "--max-ate allows 0.0001 m",
    );
    refused(
        &["calibrate", "--from-run", "no/run", "--out", "camera.toml"],
        2,
        "no/run: no finished run: expected the folder that `mono-slam run SEQUENCE --out DIR` wrote, found nothing there",
    );
    refused(
        &["calibrate", "--out", "camera.toml"],
        2,
        "required arguments were not provided",
    );
    fs::remove_file(folder.join("tracks.csv")).unwrap();
    refused(
        &["batch", run, "--out", run],
        2,
        "expected a run with associations in tracks.csv, found none",
    );
    fs::write(
        folder.join("tracks.csv"),
        "frame,landmark,x_px,y_px\n0,1,20,30\n77,1,20,30\n",
    )
    .unwrap();
    refused(
        &["batch", run, "--out", run],
        2,
        "expected keyframes of the run in tracks.csv, found frame 77",
    );
}
