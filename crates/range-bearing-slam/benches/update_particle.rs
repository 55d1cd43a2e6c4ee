//! Time of one particle: a proposal with ten landmarks in view, the update of one landmark, the motion.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix2, Vector2, Vector3};
use range_bearing_slam::{
    Command, Deviation, ExtendedLandmarks, ExtendedProposal, Frame, Gaussian, Landmark,
    LandmarkFilter, LandmarkParticle, Linearisation, MotionModel, MotionProposal, ObservationModel,
    Propagation, RangeBearing, RangeBearingError, Unicycle, UnscentedLandmarks, UnscentedProposal,
};
use rbpf_core::{Proposal, Purpose, Streams};
use std::hint::black_box;

type Particle = LandmarkParticle<3, 2>;
type Observed = Frame<Vec<Command>, 2>;

const SENSOR: RangeBearing = RangeBearing::new(0.1, 0.02);
const DEVIATION: Deviation = Deviation {
    fixed: 0.05,
    share: 0.1,
};
const MATCHES: u32 = 10;

const fn unicycle(propagation: Propagation) -> Unicycle {
    Unicycle {
        speed: DEVIATION,
        turn_rate: DEVIATION,
        floor: [1e-3; 3],
        propagation,
    }
}

fn problem() -> (Particle, Observed) {
    let mut particle = Particle::new(Vector3::zeros());
    let mut measurements = Vec::new();
    for id in 0..MATCHES {
        let angle = f64::from(id) * 0.6;
        let mean = Vector2::new(6.0 * angle.cos(), 4.0 * angle.sin());
        let position = Gaussian {
            mean,
            covariance: Matrix2::new(0.02, 0.005, 0.005, 0.01),
        };
        let existence = 0.0;
        particle.map.insert(
            id,
            Landmark {
                position,
                existence,
            },
        );
        let truth = Vector3::new(0.12, 0.01, 0.01);
        measurements.extend(SENSOR.predict(&truth, &mean).map(|z| (id, z)));
    }
    let control = vec![Command {
        seconds: 0.1,
        speed: 1.0,
        turn: 0.1,
    }];
    (
        particle,
        Frame {
            control,
            measurements,
        },
    )
}

fn proposals(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("proposal, 10 landmarks");
    group.throughput(Throughput::Elements(1));
    let (particle, frame) = problem();
    let motion = unicycle(Propagation::Jacobians);
    let sensor = SENSOR;
    let prior = MotionProposal { motion, sensor };
    let extended = ExtendedProposal {
        motion,
        sensor,
        linearisation: Linearisation::Sequential,
    };
    let unscented = UnscentedProposal {
        motion,
        sensor,
        iterations: 2,
    };
    let all: [(
        &str,
        &dyn Proposal<Particle, Observed, Error = RangeBearingError>,
    ); 3] = [
        ("motion", &prior),
        ("extended", &extended),
        ("unscented, 2 iterations", &unscented),
    ];
    for (name, proposal) in all {
        let mut rng = Streams::new(1).stream(0, 0, Purpose::Proposal);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut moved = black_box(&particle).clone();
                proposal.propose(&mut moved, &frame, &mut rng)
            });
        });
    }
    group.finish();
}

fn landmarks(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("landmark update");
    group.throughput(Throughput::Elements(1));
    let (particle, frame) = problem();
    let held: Vec<(Gaussian<2>, Vector2<f64>)> = frame
        .measurements
        .iter()
        .filter_map(|(id, z)| Some((particle.map.get(*id)?.position, *z)))
        .collect();
    let pose = Vector3::new(0.1, 0.0, 0.01);
    let all: [(&str, &dyn LandmarkFilter<RangeBearing, 3, 2, 2>); 2] = [
        ("extended", &ExtendedLandmarks),
        ("unscented", &UnscentedLandmarks),
    ];
    for (name, filter) in all {
        let mut next = held.iter().cycle();
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                next.next()
                    .map(|(prior, z)| filter.update(&SENSOR, &pose, black_box(z), prior))
            });
        });
    }
    group.finish();
}

fn motions(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("motion of one command");
    let (particle, frame) = problem();
    for (name, propagation) in [
        ("Jacobians", Propagation::Jacobians),
        ("sigma points", Propagation::SigmaPoints),
    ] {
        let model = unicycle(propagation);
        group.bench_function(name, |bencher| {
            bencher.iter(|| model.predict(black_box(&particle.pose), &frame.control));
        });
    }
    group.finish();
}

criterion_group!(particle, proposals, landmarks, motions);
criterion_main!(particle);
