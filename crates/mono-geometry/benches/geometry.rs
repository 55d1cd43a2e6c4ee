//! The operations a frame repeats by the thousand: projection with its Jacobian, undistortion, triangulation, poses from points.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mono_geometry::inverse_depth::InverseDepthPoint;
use mono_geometry::linalg::svd;
use mono_geometry::pnp::{Correspondence, RefineOptions, estimate_pose, p3p, refine_pose};
use mono_geometry::triangulation::{
    Acceptance, Observation, correct_match, triangulate, triangulate_two_views,
};
use mono_geometry::{
    Camera, Distortion, Mount, NoiseShape, Pinhole, PlacedCamera, Se2, Se3, epipolar, inverse_depth,
};
use nalgebra::{DMatrix, Vector2, Vector3};

fn poses(criterion: &mut Criterion, pinhole: &Pinhole) {
    let world_from_camera = Mount::forward().world_from_camera(&Se2::identity(), 0.1, 0.0, 0.3);
    let seen: Vec<_> = (0..20_u32)
        .map(|k| {
            let angle = f64::from(k) * 2.4;
            let depth = 2.0 + f64::from(k % 7) * 0.5;
            let across = Vector3::new(0.35 * angle.cos(), 0.3 * angle.sin(), 1.0) * depth;
            Correspondence {
                point_in_world: world_from_camera.transform_point(&across),
                pixel_ideal: pinhole.project(&across).expect("in front")
                    + Vector2::new((f64::from(k) * 1.7).sin(), (f64::from(k) * 2.9).cos()) * 0.5,
                sigma_px: 0.5,
                shape: NoiseShape::ROUND,
            }
        })
        .collect();
    let chosen = [seen[0], seen[3], seen[11]];
    let bearings = chosen.map(|c| pinhole.bearing(&c.pixel_ideal));
    let points = chosen.map(|c| c.point_in_world);
    criterion.bench_function("p3p", |b| b.iter(|| p3p(black_box(&bearings), &points)));
    let off = nalgebra::Vector6::new(0.05, 0.05, 0.05, 0.05, 0.05, 0.05);
    let start = world_from_camera.compose(&Se3::exp(&off));
    let options = RefineOptions::default();
    criterion.bench_function("refine_pose_20_points", |b| {
        b.iter(|| refine_pose(pinhole, &start, black_box(&seen), &options));
    });
    criterion.bench_function("estimate_pose_20_points", |b| {
        b.iter(|| estimate_pose(pinhole, black_box(&seen), &options));
    });
}

fn benches(criterion: &mut Criterion) {
    let pinhole = Pinhole {
        width: 320,
        height: 240,
        fx: 368.8262,
        fy: 369.90239,
        cx: 159.67029,
        cy: 121.54136,
    };
    let lens = Distortion::Radtan {
        k1: -0.28,
        k2: 0.07,
        p1: 2e-4,
        p2: 2e-5,
        k3: 0.0,
    };
    let camera = Camera::new(pinhole, lens).expect("valid");
    let point = Vector3::new(0.3, -0.2, 2.0);
    criterion.bench_function("project_radtan_with_jacobian", |b| {
        b.iter(|| camera.project_with_jacobian(black_box(&point)));
    });
    criterion.bench_function("project_pinhole_with_jacobian", |b| {
        b.iter(|| pinhole.project_with_jacobian(black_box(&point)));
    });
    let pixel = Vector2::new(20.0, 215.0);
    criterion.bench_function("undistort_pixel_radtan", |b| {
        b.iter(|| camera.undistort_pixel(black_box(&pixel)));
    });

    let mount = Mount::forward();
    let landmark = Vector3::new(2.0, 0.1, 0.2);
    for views in [2_u32, 5, 10] {
        let observations: Vec<_> = (0..views)
            .map(|k| {
                let y = 0.4 * f64::from(k) / f64::from(views - 1);
                let camera_from_world = mount
                    .world_from_camera(&Se2::new(0.0, y, 0.0), 0.0, 0.0, 0.0)
                    .inverse();
                let seen = pinhole
                    .project(&camera_from_world.transform_point(&landmark))
                    .expect("in front");
                Observation {
                    camera_from_world,
                    pixel_ideal: seen + Vector2::new(0.3, -0.2) * f64::from(k % 3),
                    sigma_px: 0.5,
                    shape: NoiseShape::ROUND,
                }
            })
            .collect();
        criterion.bench_function(&format!("triangulate_{views}_views"), |b| {
            b.iter(|| triangulate(&pinhole, black_box(&observations), &Acceptance::default()));
        });
        let anchor = PlacedCamera::new(&observations[0].camera_from_world.inverse());
        criterion.bench_function(&format!("refine_inverse_depth_{views}_views"), |b| {
            b.iter(|| inverse_depth::refine(&pinhole, &anchor, black_box(&observations), 25));
        });
        if let [first, second] = observations[..] {
            let two = [first, second];
            criterion.bench_function("triangulate_two_views_direct", |b| {
                b.iter(|| triangulate_two_views(&pinhole, black_box(&two), &Acceptance::default()));
            });
            let second_from_first = second
                .camera_from_world
                .compose(&first.camera_from_world.inverse());
            let matrix = epipolar::fundamental(&pinhole, &second_from_first).expect("baseline");
            let shifted = second.pixel_ideal + Vector2::new(0.0, 1.5);
            criterion.bench_function("correct_match", |b| {
                b.iter(|| {
                    correct_match(&matrix, black_box(&first.pixel_ideal), &shifted, 0.5, 0.5)
                });
            });
        }
    }

    poses(criterion, &pinhole);

    let anchor = mount.world_from_camera(&Se2::identity(), 0.0, 0.0, 0.0);
    let view = mount.world_from_camera(&Se2::new(0.1, 0.2, 0.05), 0.0, 0.0, 0.0);
    let (mean, _) = inverse_depth::first_sighting(&pinhole, &pixel, 0.5, 0.5, 0.25);
    let anchored = InverseDepthPoint::new(&PlacedCamera::new(&anchor), &mean);
    let view = PlacedCamera::new(&view);
    criterion.bench_function("predict_inverse_depth", |b| {
        b.iter(|| anchored.predict(&pinhole, black_box(&view)));
    });

    let matrix = DMatrix::from_fn(8, 9, |i, j| ((i * 9 + j) as f64 * 0.7).sin());
    criterion.bench_function("svd_8x9", |b| b.iter(|| svd(black_box(&matrix))));
}

criterion_group!(geometry, benches);
criterion_main!(geometry);
