//! Scans without ids: gate, mutual exclusion, new landmarks, weights, existence.

use crate::fixtures::{gaussian, particle, proposal_rng};
use nalgebra::{Matrix2, Vector2, Vector3};
use range_bearing_slam::{
    Associating, AssociationRules, Command, Deviation, DoubtingMapping, ExistenceRules,
    ExtendedLandmarks, ExtendedProposal, Frame, LandmarkMapping, Linearisation, NamingParticle,
    ObservationModel, Propagation, RangeBearing, RangeBearingError, Scan, Unicycle,
};
use rbpf_core::{MapUpdate, Proposal};

type Inner = ExtendedProposal<Unicycle, RangeBearing>;

const MOTION: Unicycle = Unicycle {
    speed: Deviation {
        fixed: 0.01,
        share: 0.0,
    },
    turn_rate: Deviation {
        fixed: 0.01,
        share: 0.0,
    },
    floor: [1e-3; 3],
    propagation: Propagation::Jacobians,
};

/// Quantile 0.99 of chi-square with two degrees of freedom.
const GATE: f64 = 9.210_340;

fn associating(sensor: RangeBearing) -> Associating<Unicycle, RangeBearing, Inner> {
    Associating {
        motion: MOTION,
        sensor,
        inner: Inner {
            motion: MOTION,
            sensor,
            linearisation: Linearisation::Sequential,
        },
        rules: AssociationRules {
            gate: GATE,
            new_landmark: 30.0,
            log_new: -3.0,
        },
    }
}

fn naming(landmarks: &[(f64, f64)]) -> NamingParticle<3, 2, 2> {
    let position = |&(x, y): &(f64, f64)| gaussian(x, y, Matrix2::identity() * 1e-4);
    let landmarks = (0..).zip(landmarks.iter().map(position));
    NamingParticle::new(particle(Vector3::zeros(), landmarks))
}

fn scan(sensor: &RangeBearing, points: &[(f64, f64)]) -> Scan<Vec<Command>, 2> {
    Scan {
        control: vec![],
        measurements: points
            .iter()
            .map(|&(x, y)| {
                sensor
                    .predict(&Vector3::zeros(), &Vector2::new(x, y))
                    .expect("not at the sensor")
            })
            .collect(),
    }
}

#[test]
fn measurements_are_named_once_and_new_ones_start() {
    let sensor = RangeBearing::new(0.05, 0.02);
    let mut particle = naming(&[(4.0, 0.0), (4.0, 1.0), (-3.0, 2.0)]);
    // two near landmark 0, the nearer one later; one on landmark 2; one nowhere; one a little off 1
    let scan = scan(
        &sensor,
        &[
            (4.12, 0.0),
            (4.01, 0.0),
            (-3.0, 2.0),
            (0.0, 6.0),
            (4.0, 1.38),
        ],
    );
    let mut rng = proposal_rng(1, 0);
    let proposal = associating(sensor);
    let log_weight = proposal.propose(&mut particle, &scan, &mut rng).unwrap();
    let ids: Vec<u32> = particle.named().iter().map(|(id, _)| *id).collect();
    // the first is inside the gate of 0, which is taken: unclear; the last lies between gate and new
    assert_eq!(ids, [0, 2, 3]);

    // the weight: what the inner proposal says of the named ones, and log_new three times
    let mut inner = naming(&[(4.0, 0.0), (4.0, 1.0), (-3.0, 2.0)]).particle;
    let frame = Frame {
        control: vec![],
        measurements: particle.named().to_vec(),
    };
    let mut rng = proposal_rng(1, 0);
    let named = proposal
        .inner
        .propose(&mut inner, &frame, &mut rng)
        .unwrap();
    assert!((log_weight - (named - 9.0)).abs() < 1e-12);
}

#[test]
fn landmarks_expected_and_missed_fade_away() {
    let sensor = RangeBearing {
        farthest: 10.0,
        half_angle: 1.5,
        ..RangeBearing::new(0.05, 0.02)
    };
    // ahead; ahead but too far to be sure; behind
    let mut particle = naming(&[(4.0, 0.0), (9.0, 0.0), (-4.0, 0.0)]);
    let mapping = DoubtingMapping {
        mapping: LandmarkMapping {
            sensor,
            filter: ExtendedLandmarks,
        },
        existence: ExistenceRules {
            seen: 1.0,
            missed: -0.75,
            highest: 2.0,
            lowest: -1.0,
        },
    };
    let proposal = associating(sensor);
    let step = |particle: &mut NamingParticle<3, 2, 2>, points: &[(f64, f64)]| {
        let scan = scan(&sensor, points);
        let mut rng = proposal_rng(1, 0);
        proposal
            .propose(particle, &scan, &mut rng)
            .expect("valid scan");
        mapping.update_map(particle, &scan).expect("valid scan");
    };
    let existence = |particle: &NamingParticle<3, 2, 2>, id| {
        particle
            .particle
            .map
            .get(id)
            .map(|landmark| landmark.existence)
    };
    for _ in 0..3 {
        step(&mut particle, &[(4.0, 0.0)]);
    }
    assert_eq!(existence(&particle, 0), Some(2.0));
    for expected in [Some(1.25), Some(0.5), Some(-0.25), Some(-1.0), None] {
        step(&mut particle, &[]);
        assert_eq!(existence(&particle, 0), expected);
    }
    assert_eq!(existence(&particle, 1), Some(0.0));
    assert_eq!(existence(&particle, 2), Some(0.0));
    assert_eq!(particle.particle.path.len(), 8);
}

#[test]
fn a_bad_measurement_names_its_place() {
    let sensor = RangeBearing::new(0.05, 0.02);
    let mut particle = naming(&[(4.0, 0.0)]);
    let before = particle.clone();
    let mut scan = scan(&sensor, &[(4.0, 0.0), (3.0, 3.0)]);
    scan.measurements[1].y = f64::INFINITY;
    let mut rng = proposal_rng(1, 0);
    let result = associating(sensor).propose(&mut particle, &scan, &mut rng);
    let expected = RangeBearingError::MeasurementNotFinite {
        id: 1,
        entry: 1,
        value: f64::INFINITY,
    };
    assert_eq!(result, Err(expected));
    assert_eq!(particle, before);
}
