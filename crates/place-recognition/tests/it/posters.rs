//! Two equal posters in different rooms: two answers, both right.

use mono_geometry::{NoiseShape, Se3};
use nalgebra::{Matrix3, Vector2, Vector3};
use place_recognition::{CandidateOptions, PlaceIndex, PointMatch, PoseOptions, poses};
use rand::RngExt;

use crate::world::{PINHOLE, World, apart, normal};

#[test]
fn two_equal_posters_give_two_hypotheses() {
    for seed in 0..10 {
        let mut world = World::new(seed, 10);
        let mut index = PlaceIndex::new();
        let mut landmarks: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
        let poster: Vec<(Vector3<f64>, [u8; 128])> = (0..60)
            .map(|_| {
                let x = world.rng.random_range(-1.5..1.5);
                let y = world.rng.random_range(-1.2..1.2);
                let descriptor = std::array::from_fn(|_| world.rng.random_range(0..90));
                (Vector3::new(x, y, 4.0), descriptor)
            })
            .collect();
        let mut add = |index: &mut PlaceIndex, point, room, descriptor: &[u8; 128]| {
            index.insert(landmarks.len() as u32, descriptor).unwrap();
            landmarks.push((point, World::seen_from(room)));
        };
        // The print of the second differs a little from that of the first.
        for room in [2, 7] {
            for (point, descriptor) in &poster {
                let copy = descriptor.map(|v| v + world.rng.random_range(0..4));
                add(&mut index, World::seen_from(room) + point, room, &copy);
            }
        }
        for number in 0..600 {
            let room = number % 10;
            let point = world.point_in_room(room);
            let descriptor = std::array::from_fn(|_| world.rng.random_range(0..90));
            add(&mut index, point, room, &descriptor);
        }
        // The camera is in front of the first poster.
        let camera = world.camera(2);
        let camera_in_room = World::seen_from(2) - camera.translation;
        let mut pixels: Vec<Vector2<f64>> = Vec::new();
        let mut descriptors: Vec<[u8; 128]> = Vec::new();
        for (point, descriptor) in &poster {
            let point = camera
                .inverse()
                .transform_point(&(World::seen_from(2) + point));
            let noise = Vector2::new(normal(&mut world.rng), normal(&mut world.rng));
            pixels.push(PINHOLE.project(&point).unwrap() + 0.5 * noise);
            descriptors.push(descriptor.map(|v| v + world.rng.random_range(0..6)));
        }
        let candidates = index
            .candidates(&descriptors, &CandidateOptions::default())
            .unwrap();
        assert!(candidates.len() > 100, "both of most: {}", candidates.len());
        let matches: Vec<PointMatch> = candidates
            .iter()
            .map(|c| {
                let (point, seen_from) = landmarks[c.landmark as usize];
                PointMatch {
                    keypoint: c.keypoint,
                    landmark: c.landmark,
                    point_in_world: point,
                    point_covariance: Matrix3::zeros(),
                    seen_from,
                    pixel_ideal: pixels[c.keypoint],
                    sigma_px: 0.5,
                    shape: NoiseShape::ROUND,
                    quality: c.quality,
                }
            })
            .collect();
        for reach in [1.0, 1e6] {
            let options = PoseOptions {
                seed,
                reach,
                ..PoseOptions::default()
            };
            let hypotheses = poses(&PINHOLE, &matches, &options).unwrap();
            assert_eq!(hypotheses.len(), 2, "seed {seed}, reach {reach}");
            for room in [2, 7] {
                let truth = Se3::new(camera.rotation, World::seen_from(room) - camera_in_room);
                let hit = hypotheses.iter().any(|h| {
                    let (metres, radians) = apart(&truth, &h.world_from_camera);
                    metres < 0.1 && radians < 0.03
                });
                assert!(hit, "seed {seed}, room {room}");
            }
        }
    }
}
