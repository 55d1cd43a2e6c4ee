//! Time of what every particle does at every filter step: the pose posterior
//! from 150 matches, and the update of one landmark, closed and open in depth.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix3, Vector2, Vector3};
use slam_pipeline::filter::landmark::{Landmark, LandmarkGeometry, Lens, Parametrisation};
use slam_pipeline::filter::landmark_update::LandmarkUpdate;
use slam_pipeline::filter::linearised::pose_posterior;
use slam_pipeline::filter::motion::{CarrierModel, Control};
use slam_pipeline::filter::observation::{Prepared, Scoring};
use slam_pipeline::filter::particle::{MetricState, Particle};
use slam_pipeline::filter::pose::{CameraPose, PlacedCamera};
use ukf::SigmaPoints;

const MATCHES: usize = 150;
const VARIANCE_PX2: f64 = 0.36;

fn lens() -> Lens {
    Lens {
        focal: Vector2::new(368.8, 369.9),
        centre: Vector2::new(159.7, 121.5),
    }
}

/// A camera that looks to the left of the body.
fn body_from_camera() -> Matrix3<f64> {
    Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0)
}

fn at(x: f64) -> CameraPose {
    CameraPose {
        centre: Vector3::new(x, 0.0, 0.0),
        phi: 0.0,
        roll: 0.0,
        pitch: 0.0,
    }
}

/// Landmark `i` on a grid of image directions, two metres away.
fn landmark(i: usize, rho: (f64, f64)) -> Landmark {
    let (column, row) = ((i % 15) as f64, (i / 15) as f64);
    Landmark {
        parametrisation: Parametrisation::InverseDepth { anchor: 0 },
        mean: Vector3::new(0.05 * (column - 7.0), 0.06 * (row - 4.5), rho.0),
        covariance: Matrix3::from_diagonal(&Vector3::new(2e-6, 2e-6, rho.1 * rho.1)),
    }
}

fn pose(criterion: &mut Criterion) {
    let anchor = PlacedCamera::new(&at(0.0), &body_from_camera());
    let geometry = LandmarkGeometry::new(Some(&anchor));
    let carrier = CarrierModel {
        lever_m: Vector2::zeros(),
        tilt_sigma: 0.006,
        tilt_time_s: 1.0,
        slope_sigma: 0.01,
        scale_drift: 0.01,
        scale_sigma: 0.05,
    };
    let control = Control {
        increment: [0.1, 0.0, 0.0],
        covariance: Matrix3::from_diagonal(&Vector3::new(2.5e-5, 1e-6, 1.44e-4)),
        dt_s: 1.0,
        distance_m: 0.1,
    };
    let prior = carrier.prior(&Particle::new(at(0.0), MetricState::new(0.05)), &control);
    let truth = PlacedCamera::new(&at(0.103), &body_from_camera());
    let mut group = criterion.benchmark_group("pose_posterior_150_matches");
    for (name, scoring, rho) in [
        ("full", Scoring::Full, (0.5, 0.01)),
        ("across_epipolar", Scoring::AcrossEpipolar, (0.5, 0.3)),
    ] {
        let matches: Vec<Option<Prepared>> = (0..MATCHES)
            .map(|i| {
                let l = landmark(i, rho);
                let pixel = lens().project(&truth, &geometry.ray(&l.mean))?;
                Some(Prepared {
                    geometry,
                    mean: l.mean,
                    covariance: l.covariance,
                    pixel,
                    variance_px2: VARIANCE_PX2,
                    scoring,
                })
            })
            .collect();
        group.bench_function(name, |b| {
            b.iter(|| {
                pose_posterior(
                    &lens(),
                    &body_from_camera(),
                    black_box(&prior),
                    black_box(&matches),
                    2,
                )
            });
        });
    }
    group.finish();
}

fn landmark_update(criterion: &mut Criterion) {
    let anchor = PlacedCamera::new(&at(0.0), &body_from_camera());
    let camera = PlacedCamera::new(&at(0.1), &body_from_camera());
    let geometry = LandmarkGeometry::new(Some(&anchor));
    let update = LandmarkUpdate {
        lens: lens(),
        points: SigmaPoints::default(),
    };
    let mut group = criterion.benchmark_group("landmark_update");
    for (name, rho) in [("closed_depth", (0.5, 0.01)), ("open_depth", (1.25, 0.625))] {
        let prior = landmark(70, rho);
        let seen = Vector3::new(prior.mean.x, prior.mean.y, 0.5);
        let pixel = lens()
            .project(&camera, &geometry.ray(&seen))
            .expect("two metres ahead of the camera");
        group.bench_function(name, |b| {
            b.iter(|| {
                update.update(
                    black_box(&camera),
                    &geometry,
                    black_box(&prior),
                    &pixel,
                    VARIANCE_PX2,
                )
            });
        });
    }
    group.finish();
}

criterion_group!(benches, pose, landmark_update);
criterion_main!(benches);
