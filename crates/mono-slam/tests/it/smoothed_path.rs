//! The smoothed path of a run on rendered images, and what it takes from the camera file.

use std::path::Path;

use mono_slam::run::run_sequence;
use slam_io::{Sequence, run_figures};
use slam_pipeline::config::{Config, Method};

fn wall() -> Sequence {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/wall");
    Sequence::open(&root).unwrap()
}

#[test]
fn the_smoothed_path_is_the_batch_and_better_than_the_filtered_one() {
    let config = Config::default().check().unwrap();
    let run = run_sequence(&wall(), &config, &|| 0.0, &mut |_| {}).unwrap();
    let smoother = run.smoother.as_ref().unwrap();
    assert_eq!((smoother.method.as_str(), &smoother.note), ("batch", &None));
    assert_eq!(smoother.constants.len(), 2, "turning centre and bias");
    let figures = run_figures(&run);
    let rmse = |path: &str| figures.errors[path]["none"].position_m.rmse;
    // Measured: 14.5 and 11.8 mm; the path of the best particle is no better than the filtered one.
    assert!(
        rmse("smoothed") < 0.95 * rmse("filtered"),
        "{:?}",
        figures.errors
    );
    // Associations are those of the keyframes.
    let keyframes = |frame: usize| run.frames[frame].report.keyframe;
    assert!(run.tracks.iter().all(|row| keyframes(row.frame)));
    assert!(run.tracks.len() > smoother.sightings);
    assert!(run.tracks.is_sorted_by_key(|row| (row.frame, row.landmark)));
}

#[test]
fn the_other_methods_keep_the_path_of_their_best_particle() {
    let mut config = Config::default();
    config.filter.method = Method::Conventional;
    config.filter.particles = 10;
    let config = config.check().unwrap();
    let run = run_sequence(&wall(), &config, &|| 0.0, &mut |_| {}).unwrap();
    let smoother = run.smoother.unwrap();
    assert_eq!(smoother.method, "best particle");
    let note = smoother.note.unwrap();
    assert!(note.contains("conventional"), "{note}");
    assert_eq!(run.smoothed.len(), run.frames.len());
}

/// Only the command used to apply them; other callers of the library ran with those of the configuration.
#[test]
fn regress_standard_deviations_of_the_camera_file_enter_every_run() {
    let mut sequence = wall();
    let fx = sequence.camera.fx;
    sequence.camera.sigma.fx = Some(0.01 * fx);
    sequence.camera.sigma.cx = Some(0.003 * fx);
    sequence.camera.sigma.mount_yaw = Some(0.004);
    let config = Config::default().check().unwrap();
    let run = |sequence: &Sequence| run_sequence(sequence, &config, &|| 0.0, &mut |_| {});
    let configuration = run(&sequence).unwrap().configuration;
    for line in ["focal_sigma = 0.01", "mount_yaw_sigma = 0.005"] {
        assert!(configuration.contains(line), "{configuration}");
    }
    sequence.camera.sigma.fx = Some(f64::INFINITY);
    let error = run(&sequence).unwrap_err().to_string();
    assert!(
        error.contains("[sigma] of camera.toml") && error.contains("focal_sigma"),
        "{error}"
    );
}
