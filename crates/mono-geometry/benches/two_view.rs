//! Two views: minimal solvers, a refinement, one robust run of each kind.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mono_geometry::epipolar::{
    Correspondence, EightPoint, FivePoint, PlanarTwoPoint, RelativePose, SampsonScorer,
    arc_from_one, essential_from_five, fundamental_from_points, planar_from_two, refine,
};
use mono_geometry::ransac::{Options, Uniform, ransac};
use mono_geometry::{Mount, Pinhole, Se2, Se3};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// 500 matches of a planar motion in normalised coordinates, every second one wrong.
fn matches(second_from_first: &Se3) -> Vec<Correspondence> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut matches = Vec::new();
    while matches.len() < 500 {
        let mut side = || rng.random_range(-0.45..0.45);
        let (first, wrong) = (Vector2::new(side(), side()), Vector2::new(side(), side()));
        let noise = Vector2::new(side(), side()) * 1e-3;
        let depth = rng.random_range(3.0..10.0);
        let moved = second_from_first.transform_point(&(first.push(1.0) * depth));
        let right = (moved / moved.z).xy() + noise;
        let second = if matches.len() % 2 == 0 { right } else { wrong };
        matches.push(Correspondence { first, second });
    }
    matches
}

fn benches(criterion: &mut Criterion) {
    let pinhole = Pinhole {
        width: 640,
        height: 480,
        fx: 700.0,
        fy: 700.0,
        cx: 319.5,
        cy: 239.5,
    };
    let mount = Mount::forward();
    let camera = |pose: &Se2| mount.world_from_camera(pose, 0.0, 0.0, 0.0);
    let second_from_first = camera(&Se2::new(0.9, 0.2, 0.15))
        .inverse()
        .compose(&camera(&Se2::identity()));
    let all = matches(&second_from_first);
    let good: Vec<Correspondence> = all.iter().step_by(2).copied().collect();
    let pixels: Vec<Correspondence> = all
        .iter()
        .map(|m| Correspondence {
            first: pinhole.pixel(&m.first),
            second: pinhole.pixel(&m.second),
        })
        .collect();
    let five: [Correspondence; 5] = std::array::from_fn(|k| good[k]);
    let mut solutions = Vec::new();
    criterion.bench_function("five_point", |b| {
        b.iter(|| {
            solutions.clear();
            essential_from_five(black_box(&five), &mut solutions);
            solutions.len()
        });
    });
    let eight: Vec<Correspondence> = pixels.iter().step_by(2).copied().collect();
    criterion.bench_function("eight_point_of_8", |b| {
        b.iter(|| fundamental_from_points(black_box(&eight[..8])));
    });
    criterion.bench_function("eight_point_of_250", |b| {
        b.iter(|| fundamental_from_points(black_box(&eight)));
    });
    let mut motions = Vec::new();
    criterion.bench_function("planar_two_point", |b| {
        b.iter(|| {
            motions.clear();
            planar_from_two(&mount, black_box(&[good[0], good[1]]), &mut motions);
            motions.len()
        });
    });
    criterion.bench_function("planar_arc_one_point", |b| {
        b.iter(|| arc_from_one(&mount, black_box(&good[0])));
    });
    let mut wrong = second_from_first;
    wrong.translation += Vector3::new(0.02, 0.01, -0.02);
    let start = RelativePose::new(&wrong).expect("a baseline");
    let indices: Vec<usize> = (0..good.len()).collect();
    criterion.bench_function("refine_pose_of_250", |b| {
        b.iter(|| {
            refine(
                black_box(&start),
                &good,
                &indices,
                &Vector2::repeat(1e-6),
                20,
            )
        });
    });
    let scorer = SampsonScorer::normalized(&pinhole, 0.5);
    let options = Options::default();
    criterion.bench_function("ransac_five_point_500_matches", |b| {
        b.iter(|| {
            let mut sampler = Uniform::default();
            ransac(
                &FivePoint::default(),
                &scorer,
                &mut sampler,
                black_box(&all),
                &options,
            )
        });
    });
    criterion.bench_function("ransac_eight_point_500_matches", |b| {
        b.iter(|| {
            let (mut sampler, scorer) = (Uniform::default(), SampsonScorer::pixels(0.5));
            ransac(
                &EightPoint,
                &scorer,
                &mut sampler,
                black_box(&pixels),
                &options,
            )
        });
    });
    criterion.bench_function("ransac_planar_500_matches", |b| {
        b.iter(|| {
            let mut sampler = Uniform::default();
            ransac(
                &PlanarTwoPoint { mount },
                &scorer,
                &mut sampler,
                black_box(&all),
                &options,
            )
        });
    });
}

criterion_group!(two_view, benches);
criterion_main!(two_view);
