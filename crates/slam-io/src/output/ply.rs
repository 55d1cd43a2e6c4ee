//! `map.ply`: the landmarks as an ASCII point cloud any viewer opens.
//!
//! Colour runs from teal (certain) through yellow to red (uncertain) on a logarithmic
//! scale between one centimetre and one metre of standard deviation.

use std::fmt::Write as _;

use slam_pipeline::MapLandmark;

use crate::figures::uncertainty_m;

/// Standard deviation drawn as fully certain, metres.
const CERTAIN_M: f64 = 0.01;
/// Standard deviation drawn as fully uncertain, metres.
const UNCERTAIN_M: f64 = 1.0;
/// Colours at the ends and in the middle of the scale.
const COLOURS: [[f64; 3]; 3] = [
    [20.0, 150.0, 130.0],
    [235.0, 190.0, 60.0],
    [205.0, 50.0, 50.0],
];

/// The whole file.
pub(super) fn ply(landmarks: &[MapLandmark]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\ncomment metres; x forward, y left, z up of the first body pose\n\
         element vertex {}\n\
         property double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float uncertainty_m\nproperty uint id\nproperty uint observations\nend_header\n",
        landmarks.len()
    );
    for landmark in landmarks {
        let p = landmark.position;
        let sigma_m = uncertainty_m(landmark);
        let [red, green, blue] = colour(sigma_m);
        // Writing into a String cannot fail.
        let _ = writeln!(
            text,
            "{} {} {} {red} {green} {blue} {} {} {}",
            p.x, p.y, p.z, sigma_m as f32, landmark.id, landmark.observations
        );
    }
    text
}

fn colour(sigma_m: f64) -> [u8; 3] {
    let share = ((sigma_m / CERTAIN_M).ln() / (UNCERTAIN_M / CERTAIN_M).ln()).clamp(0.0, 1.0);
    let place = 2.0 * share;
    let (from, to) = if place < 1.0 { (0, 1) } else { (1, 2) };
    let blend = place - from as f64;
    std::array::from_fn(|channel| {
        (COLOURS[from][channel] * (1.0 - blend) + COLOURS[to][channel] * blend).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_logarithmic_between_its_ends() {
        assert_eq!(colour(0.0), [20, 150, 130]);
        assert_eq!(colour(CERTAIN_M), [20, 150, 130]);
        assert_eq!(colour(0.1), [235, 190, 60]);
        assert_eq!(colour(UNCERTAIN_M), [205, 50, 50]);
        assert_eq!(colour(30.0), [205, 50, 50]);
    }
}
