//! Bias and standard deviation of the corners against rendered truth, and whether a corner knows its own error.

use camera_calibration::find_board;
use wall_scenes::{Look, board_poses};

use crate::common::{BOARD, camera, pictures, renderer, size, view};

/// Errors of all coordinates in pictures that share a look, in pixels, and in units of each corner's own sigma.
fn errors(look: &Look, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let (mut pixels, mut normalised) = (Vec::new(), Vec::new());
    for picture in pictures(&BOARD, 480, look, 8, seed) {
        let found = find_board(view(&picture.image), size(&BOARD)).unwrap();
        for (k, corner) in found.corners.iter().enumerate() {
            for axis in 0..2 {
                let error = corner[axis] - picture.corners[k][axis];
                pixels.push(error);
                normalised.push(error / found.sigmas_px[k]);
            }
        }
    }
    (pixels, normalised)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn corners_are_unbiased_and_as_good_as_noise_and_blur_allow() {
    // RMS error (px) by noise (levels) and blur (px); measured, plus 20 %. Half the noise, half the error.
    for (noise, blur_px, bound) in [
        (0.0, 0.7, BOUNDS[0]),
        (2.0, 0.7, BOUNDS[1]),
        (8.0, 0.7, BOUNDS[2]),
        (2.0, 1.5, BOUNDS[3]),
    ] {
        let look = Look {
            noise,
            blur_px,
            ..Look::default()
        };
        let (pixels, normalised) = errors(&look, 40);
        let (bias, spread) = (mean(&pixels), rms(&pixels));
        println!(
            "noise {noise} blur {blur_px}: bias {bias:.5} px, RMS {spread:.5} px, in own sigmas {:.3}",
            rms(&normalised)
        );
        assert!(spread < bound, "noise {noise}, blur {blur_px}: {spread} px");
        // Standard error of the mean, 4.5 of them.
        let error = spread / (pixels.len() as f64).sqrt();
        assert!(
            bias.abs() < 4.5 * error,
            "noise {noise}, blur {blur_px}: bias {bias} px"
        );
    }
}

/// See the test above.
const BOUNDS: [f64; 4] = [0.0105, 0.014, 0.038, 0.0225];

#[test]
fn where_noise_dominates_a_corner_knows_its_own_error() {
    let look = Look {
        noise: 8.0,
        ..Look::default()
    };
    let (_, normalised) = errors(&look, 41);
    let chi_square: f64 = normalised.iter().map(|z| z * z).sum::<f64>() / normalised.len() as f64;
    // Chi-square over n degrees: variance 2 / n; 4.5 standard errors, and 10 % for the model's own error.
    let band = 4.5 * (2.0 / normalised.len() as f64).sqrt() + 0.1;
    assert!(
        (chi_square - 1.0).abs() < band,
        "{chi_square} not within {band} of 1"
    );
}

#[test]
fn the_fit_is_better_than_the_saddle_it_starts_from() {
    // The saddle's Newton step sees 3 x 3 blurred pixels; the fit sees the edges. If the fit returned its start, the
    // RMS would be that of the saddle, several times larger.
    let look = Look {
        noise: 4.0,
        ..Look::default()
    };
    let camera = camera(480);
    let renderer = renderer(480);
    let pose = board_poses(&BOARD, &camera, 1, 77);
    let mut errors = Vec::new();
    for index in 0..6 {
        let picture = renderer.render(&BOARD, &pose[0], &look, 77, index);
        let found = find_board(view(&picture.image), size(&BOARD)).unwrap();
        for (corner, truth) in found.corners.iter().zip(&picture.corners) {
            errors.extend([corner[0] - truth[0], corner[1] - truth[1]]);
        }
    }
    assert!(rms(&errors) < 0.05, "{}", rms(&errors));
}
