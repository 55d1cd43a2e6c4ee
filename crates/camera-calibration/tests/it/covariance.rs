//! Rendered images give a camera whose covariance is honest.

use camera_calibration::{
    BoardSize, CalibrationRun, CalibrationSettings, SearchedImage, calibrate_boards,
};
use mono_geometry::calibration::LensModel;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use wall_scenes::{BoardRenderer, BoardSetSpec, board_poses};

use crate::common::view;

const SETTINGS: CalibrationSettings = CalibrationSettings {
    board: BoardSize {
        columns: 9,
        rows: 6,
    },
    square_m: 0.04,
    model: LensModel::RadtanK3,
};

/// Normalised squared error of the estimated camera parameters.
fn nees(run: &CalibrationRun, truth: &[f64]) -> f64 {
    let calibration = &run.calibration;
    let count = calibration.parameters.len();
    let error = DVector::from_fn(count, |k, _| calibration.parameters[k].value - truth[k]);
    // The scales differ by a million: divide them out before the factorisation.
    let sigma: Vec<f64> = calibration.parameters.iter().map(|p| p.sigma).collect();
    let scaled = DMatrix::from_fn(count, count, |i, j| {
        calibration.covariance[(i, j)] / (sigma[i] * sigma[j])
    });
    let whitened = error.component_div(&DVector::from_column_slice(&sigma));
    whitened.dot(&scaled.cholesky().unwrap().solve(&whitened))
}

#[test]
fn rendered_images_give_the_camera_within_its_own_covariance() {
    const SEEDS: u64 = 20;
    // One lens for all seeds, so the way through it is computed once.
    let mut spec = BoardSetSpec::small(8, 0);
    spec.look.noise = 4.0;
    spec.look.clutter = false;
    let camera = spec.camera().unwrap();
    let renderer = BoardRenderer::new(camera);
    let values: Vec<(f64, usize)> = (0..SEEDS)
        .into_par_iter()
        .map(|seed| {
            let images = board_poses(&spec.board, &camera, 8, 500 + seed)
                .iter()
                .enumerate()
                .map(|(k, pose)| {
                    let picture = renderer.render(&spec.board, pose, &spec.look, seed, k as u64);
                    let name = format!("{seed}-{k}");
                    SearchedImage::search(name, view(&picture.image), SETTINGS.board)
                })
                .collect();
            let run = calibrate_boards(images, &SETTINGS).unwrap();
            assert_eq!(run.calibration.views.len(), 8, "seed {seed}");
            (
                nees(&run, camera.parameters().as_slice()),
                run.calibration.parameters.len(),
            )
        })
        .collect();
    let sum: f64 = values.iter().map(|value| value.0).sum();
    let dimension = values[0].1;
    // The sum is chi-square with seeds x dimension degrees, as long as the estimate is linear in the noise.
    let degrees = SEEDS as f64 * dimension as f64;
    let band = 4.5 * (2.0 * degrees).sqrt();
    println!("NEES {:.2} of {dimension}", sum / SEEDS as f64);
    assert!(
        (sum - degrees).abs() < band,
        "{sum} not within {band} of {degrees}"
    );
}
