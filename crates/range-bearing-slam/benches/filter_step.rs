//! Time of a step: the copy it works on, the map updates and the whole.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix2, Vector2, Vector3};
use range_bearing_slam::{
    Command, Deviation, ExtendedLandmarks, ExtendedProposal, Frame, Gaussian, Landmark,
    LandmarkMapping, LandmarkParticle, Linearisation, ObservationModel, Propagation, RangeBearing,
    Unicycle,
};
use rbpf_core::{
    FilterConfig, MapUpdate, NoMapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Streams,
};
use std::hint::black_box;

const PARTICLES: usize = 100;
const UPDATED: u32 = 10;
const SENSOR: RangeBearing = RangeBearing::new(0.1, 0.02);
const MOTION: Unicycle = Unicycle {
    speed: DEVIATION,
    turn_rate: DEVIATION,
    floor: [1e-3; 3],
    propagation: Propagation::Jacobians,
};
const DEVIATION: Deviation = Deviation {
    fixed: 0.02,
    share: 0.1,
};
const MAPPING: LandmarkMapping<RangeBearing, ExtendedLandmarks> = LandmarkMapping {
    sensor: SENSOR,
    filter: ExtendedLandmarks,
};

fn landmark(id: u32) -> Landmark<2> {
    let angle = f64::from(id % 997) * 0.01;
    Landmark {
        position: Gaussian {
            mean: Vector2::new(5.0 + 3.0 * angle.cos(), 3.0 * angle.sin()),
            covariance: Matrix2::identity() * 0.01,
        },
        existence: 0.0,
    }
}

/// Ids of landmarks in leaves of their own, for every map of at least a thousand.
fn updated() -> impl Iterator<Item = u32> {
    (0..UPDATED).map(|k| k * 97)
}

/// Map updates of a step while the set before the step lives (as `ParticleFilter::step` keeps it for the case of
/// an error), and when it does not.
fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step, N = 100, M = 10000, 10 updates");
    let mut particle = LandmarkParticle::<3, 2>::new(Vector3::zeros());
    particle.map = (0..10_000).map(|id| (id, landmark(id))).collect();
    let measurements: Vec<_> = updated()
        .filter_map(|id| {
            let z = SENSOR.predict(&Vector3::zeros(), &landmark(id).position.mean)?;
            Some((id, z))
        })
        .collect();
    let control = vec![Command {
        seconds: 0.01,
        speed: 0.1,
        turn: 0.0,
    }];
    let frame = Frame {
        control,
        measurements,
    };
    let update = |particles: &mut [LandmarkParticle<3, 2>]| {
        for particle in particles {
            black_box(MAPPING.update_map(particle, &frame).is_ok());
        }
    };
    // maps that have had their ten leaves to themselves, as after some frames
    let settled = || {
        let mut particles = vec![particle.clone(); PARTICLES];
        update(&mut particles);
        particles
    };
    let mut alone = settled();
    group.bench_function("map updates alone", |bencher| {
        bencher.iter(|| update(&mut alone));
    });
    let mut set = settled();
    group.bench_function("copy, map updates, drop of the old set", |bencher| {
        bencher.iter(|| {
            let mut next = set.clone();
            update(&mut next);
            set = next;
        });
    });
    group.bench_function("copy alone", |bencher| {
        bencher.iter(|| black_box(set.clone()));
    });
    let proposal = ExtendedProposal {
        motion: MOTION,
        sensor: SENSOR,
        linearisation: Linearisation::Sequential,
    };
    let filter = || {
        let config = FilterConfig {
            resampling_threshold: 0.0,
            ..FilterConfig::default()
        };
        let set = ParticleSet::new(settled()).expect("particles");
        ParticleFilter::new(set, Streams::new(1), config).expect("settings")
    };
    let mut whole = filter();
    let mut time = 0;
    group.bench_function("whole step", |bencher| {
        bencher.iter(|| {
            time += 1;
            whole.step(time, &frame, &proposal, &NoRejuvenation, &MAPPING)
        });
    });
    let mut localising = filter();
    group.bench_function("whole step without map updates", |bencher| {
        bencher.iter(|| {
            time += 1;
            localising.step(time, &frame, &proposal, &NoRejuvenation, &NoMapUpdate)
        });
    });
    group.bench_function("first update after a resampling to one", |bencher| {
        bencher.iter_batched(
            || vec![particle.clone(); PARTICLES],
            |mut particles| {
                update(&mut particles);
                particles
            },
            BatchSize::SmallInput,
        );
    });
    group.finish();
}

criterion_group!(steps, step);
criterion_main!(steps);
