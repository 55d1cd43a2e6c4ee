//! Time to find one image in a map of 100 000 landmarks: 300 keypoints, of which 100 show landmarks of one place.
//!
//! `candidates` is the search of the descriptors, `poses` the solver on what it found, `both` the sum. `lost` is the solver
//! where no keypoint shows anything of the map. All run on one thread. The share of true neighbours that the search finds
//! is printed once.

#[path = "support/scene.rs"]
mod scene;
#[expect(dead_code, reason = "shared with the tests, which use more of it")]
#[path = "../tests/it/world.rs"]
mod world;

use criterion::{Criterion, criterion_group, criterion_main};
use mono_geometry::NoiseShape;
use nalgebra::{Matrix3, Vector2, Vector3};
use place_recognition::{Candidate, CandidateOptions, PlaceIndex, PointMatch, PoseOptions, poses};
use scene::{Patterns, seen_again};
use std::hint::black_box;
use world::{PINHOLE, SIGMA_PX, World, apart, normal};

const LANDMARKS: u32 = 100_000;
const ROOMS: u32 = 100;
const QUERIES: usize = 300;
const RIGHT: usize = 100;
const ROOM: u32 = 63;

struct Image {
    pixels: Vec<Vector2<f64>>,
    descriptors: Vec<[u8; 128]>,
}

#[expect(clippy::print_stdout, reason = "the recall belongs beside the times")]
fn locate(criterion: &mut Criterion) {
    let mut world = World::new(1, ROOMS);
    let patterns = Patterns::new(&mut world.rng, LANDMARKS as usize / 25);
    let mut index = PlaceIndex::new();
    let mut points: Vec<Vector3<f64>> = Vec::new();
    for id in 0..LANDMARKS {
        let descriptor = patterns.descriptor(&mut world.rng);
        index
            .insert(id, &descriptor)
            .expect("the index is not full");
        points.push(world.point_in_room(id % ROOMS));
    }
    let camera = world.camera(ROOM);
    let mut image = Image {
        pixels: Vec::new(),
        descriptors: Vec::new(),
    };
    let mut shown = Vec::new();
    for id in (0..LANDMARKS).filter(|id| id % ROOMS == ROOM) {
        let seen = camera.inverse().transform_point(&points[id as usize]);
        let Some(pixel) = PINHOLE.project(&seen) else {
            continue;
        };
        let inside = (0.0..640.0).contains(&pixel.x) && (0.0..480.0).contains(&pixel.y);
        if inside && shown.len() < RIGHT {
            let noise = Vector2::new(normal(&mut world.rng), normal(&mut world.rng));
            image.pixels.push(pixel + SIGMA_PX * noise);
            let descriptor = index.descriptor(id).expect("inserted above");
            image
                .descriptors
                .push(seen_again(&mut world.rng, &descriptor));
            shown.push(id);
        }
    }
    while image.pixels.len() < QUERIES {
        image.pixels.push(world.pixel());
        image.descriptors.push(patterns.descriptor(&mut world.rng));
    }
    let options = CandidateOptions::default();
    let search = |image: &Image| {
        index
            .candidates(&image.descriptors, &options)
            .expect("the options are in range")
    };
    let matches = |candidates: &[Candidate], image: &Image| -> Vec<PointMatch> {
        let to_match = |c: &Candidate| PointMatch {
            keypoint: c.keypoint,
            landmark: c.landmark,
            point_in_world: points[c.landmark as usize],
            point_covariance: Matrix3::identity() * 1e-4,
            seen_from: World::seen_from(c.landmark % ROOMS),
            pixel_ideal: image.pixels[c.keypoint],
            sigma_px: SIGMA_PX,
            shape: NoiseShape::ROUND,
            quality: c.quality,
        };
        candidates.iter().map(to_match).collect()
    };
    let solve = |matches: &[PointMatch]| {
        poses(&PINHOLE, matches, &PoseOptions::default()).expect("the options are in range")
    };
    let candidates = search(&image);
    let found = candidates
        .iter()
        .filter(|c| shown.get(c.keypoint) == Some(&c.landmark))
        .count();
    let right = matches(&candidates, &image);
    let places = solve(&right);
    println!(
        "{} candidates, {found} of {} true neighbours among them; {} places, the first with {} inliers, off by {:?}",
        candidates.len(),
        shown.len(),
        places.len(),
        places[0].inliers.len(),
        apart(&camera, &places[0].world_from_camera)
    );
    let mut group = criterion.benchmark_group("locate_300_in_100000");
    group.sample_size(20);
    group.bench_function("candidates", |b| b.iter(|| search(black_box(&image))));
    group.bench_function("poses", |b| b.iter(|| solve(black_box(&right))));
    group.bench_function("both", |b| {
        b.iter(|| solve(&matches(&search(black_box(&image)), &image)));
    });
    let elsewhere = Image {
        pixels: image.pixels.clone(),
        descriptors: (0..QUERIES)
            .map(|_| patterns.descriptor(&mut world.rng))
            .collect(),
    };
    let wrong = matches(&search(&elsewhere), &elsewhere);
    println!(
        "lost: {} candidates, {} places",
        wrong.len(),
        solve(&wrong).len()
    );
    group.bench_function("lost", |b| b.iter(|| solve(black_box(&wrong))));
    group.finish();
}

criterion_group!(benches, locate);
criterion_main!(benches);
