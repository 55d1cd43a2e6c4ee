//! Two rooms with the same poster: where was this image taken? Both answers, with what speaks for each.
//!
//! `cargo run --release -p place-recognition --example locate`

#![expect(clippy::print_stdout, reason = "an example shows its result")]

use mono_geometry::{NoiseShape, Pinhole, Se3, so3};
use nalgebra::{Matrix3, Vector3};
use place_recognition::{CandidateOptions, PlaceError, PlaceIndex, PointMatch, PoseOptions, poses};

/// Dots of the poster.
const DOTS: u32 = 48;

/// A dot of the poster, four metres ahead of where its room was seen from.
fn dot(k: u32) -> Vector3<f64> {
    let at = f64::from(k);
    Vector3::new((1.7 * at).sin() * 1.5, (2.9 * at).sin(), 4.0)
}

fn descriptor(k: u32) -> [u8; 128] {
    std::array::from_fn(|i| ((k as usize * 37 + 1) * (i + 3) * 71 % 251) as u8)
}

fn main() -> Result<(), PlaceError> {
    // Landmarks 0..48 hang in the room at x = 0, 48..96 in the room at x = 30.
    let room = |landmark: u32| Vector3::new(30.0 * f64::from(landmark / DOTS), 0.0, 0.0);
    let mut index = PlaceIndex::new();
    for landmark in 0..2 * DOTS {
        index.insert(landmark, &descriptor(landmark % DOTS))?;
    }
    // The image was taken in the second room, a step to the right and turned to the left.
    let pinhole = Pinhole {
        width: 640,
        height: 480,
        fx: 400.0,
        fy: 400.0,
        cx: 319.5,
        cy: 239.5,
    };
    let turn = so3::exp(&Vector3::new(0.0, -0.1, 0.0));
    let truth = Se3::new(turn, room(DOTS) + Vector3::new(0.4, 0.0, 0.2));
    let seen = (0..DOTS).filter_map(|k| {
        let in_camera = truth.inverse().transform_point(&(room(DOTS) + dot(k)));
        Some((pinhole.project(&in_camera)?, descriptor(k)))
    });
    let (pixels, descriptors): (Vec<_>, Vec<_>) = seen.unzip();

    let candidates = index.candidates(&descriptors, &CandidateOptions::default())?;
    let matches: Vec<PointMatch> = candidates
        .iter()
        .map(|c| PointMatch {
            keypoint: c.keypoint,
            landmark: c.landmark,
            point_in_world: room(c.landmark) + dot(c.landmark % DOTS),
            point_covariance: Matrix3::identity() * 1e-4,
            seen_from: room(c.landmark),
            pixel_ideal: pixels[c.keypoint],
            sigma_px: 0.5,
            shape: NoiseShape::ROUND,
            quality: c.quality,
        })
        .collect();
    println!(
        "{} keypoints, {} candidates",
        descriptors.len(),
        candidates.len()
    );
    for place in poses(&pinhole, &matches, &PoseOptions::default())? {
        let at = place.world_from_camera.translation;
        let sigma_mm = 1000.0 * place.covariance[(0, 0)].sqrt();
        println!(
            "at ({:.2}, {:.2}, {:.2}) m, sideways +-{sigma_mm:.0} mm: {} inliers in {} cells, {:.2} by chance",
            at.x,
            at.y,
            at.z,
            place.inliers.len(),
            place.cells,
            place.by_chance
        );
    }
    Ok(())
}
