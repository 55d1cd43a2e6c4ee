//! Bad input through the public interface: the error names the entry and its value, and the filter stays
//! as it was.

use crate::fixtures::{gaussian, landmark, proposal_rng};
use estimation_base::CholeskyError;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use range_bearing_slam::{
    Command, Deviation, ExtendedLandmarks, ExtendedProposal, Frame, Gaussian, LandmarkFilter,
    LandmarkMapping, LandmarkParticle, LandmarkUpdate, Linearisation, MotionModel, MotionProposal,
    ObservationModel, Propagation, RangeBearing, RangeBearingError, Unicycle, UnscentedLandmarks,
    UnscentedProposal,
};
use rbpf_core::{
    FilterConfig, MapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, RbpfError,
    StepError, Streams,
};

type Particle = LandmarkParticle<3, 2>;
type Observed = Frame<Vec<Command>, 2>;

const SENSOR: RangeBearing = RangeBearing::new(0.1, 0.02);
const MOTION: Unicycle = Unicycle {
    speed: Deviation {
        fixed: 0.05,
        share: 0.1,
    },
    turn_rate: Deviation {
        fixed: 0.02,
        share: 0.1,
    },
    floor: [1e-3; 3],
    propagation: Propagation::Jacobians,
};

const PROPOSAL: ExtendedProposal<Unicycle, RangeBearing> = ExtendedProposal {
    motion: MOTION,
    sensor: SENSOR,
    linearisation: Linearisation::Sequential,
};
const MAPPING: LandmarkMapping<RangeBearing, ExtendedLandmarks> = LandmarkMapping {
    sensor: SENSOR,
    filter: ExtendedLandmarks,
};

fn particle(covariance: Matrix2<f64>) -> Particle {
    crate::fixtures::particle(Vector3::zeros(), [(4, gaussian(3.0, 1.0, covariance))])
}

fn frame(measurements: &[(u32, f64, f64)]) -> Observed {
    Frame {
        control: vec![Command {
            seconds: 0.1,
            speed: 1.0,
            turn: 0.1,
        }],
        measurements: measurements
            .iter()
            .map(|&(id, range, bearing)| (id, Vector2::new(range, bearing)))
            .collect(),
    }
}

/// The errors of all proposals and both landmark filters; the particle must not have changed.
fn errors(particle: &Particle, frame: &Observed) -> Vec<RangeBearingError> {
    let mut errors = vec![];
    let mut check = |proposal: &dyn Proposal<Particle, Observed, Error = RangeBearingError>| {
        let mut moved = particle.clone();
        let mut rng = proposal_rng(1, 0);
        if let Err(error) = proposal.propose(&mut moved, frame, &mut rng) {
            errors.push(error);
            assert_eq!(&moved, particle);
        }
    };
    check(&MotionProposal {
        motion: MOTION,
        sensor: SENSOR,
    });
    check(&PROPOSAL);
    check(&UnscentedProposal {
        motion: MOTION,
        sensor: SENSOR,
        iterations: 2,
    });
    let unscented = LandmarkMapping {
        sensor: SENSOR,
        filter: UnscentedLandmarks,
    };
    errors.extend(MAPPING.update_map(&mut particle.clone(), frame).err());
    errors.extend(unscented.update_map(&mut particle.clone(), frame).err());
    errors
}

#[test]
fn a_good_frame_has_no_error_with_any_map() {
    let seen = frame(&[(4, 3.0, 0.3), (9, 2.0, -0.5)]);
    assert_eq!(errors(&particle(Matrix2::identity()), &seen), []);
    // with a landmark that is known exactly, and with no landmark at all
    assert_eq!(errors(&particle(Matrix2::zeros()), &seen), []);
    assert_eq!(errors(&Particle::new(Vector3::zeros()), &seen), []);
    assert_eq!(errors(&Particle::new(Vector3::zeros()), &frame(&[])), []);
}

#[test]
fn duplicate_ids_are_named() {
    let seen = frame(&[(9, 2.0, -0.5), (4, 3.0, 0.3), (9, 2.1, -0.5)]);
    let all = errors(&particle(Matrix2::identity()), &seen);
    assert_eq!(
        all,
        vec![RangeBearingError::DuplicateId { id: 9, times: 2 }; 5]
    );
    assert!(
        all[0]
            .to_string()
            .contains("landmark 9 is measured 2 times")
    );
}

#[test]
fn a_measurement_that_is_not_finite_is_named() {
    // of a landmark in the map, and of one that is not
    for id in [4, 9] {
        let seen = frame(&[(id, 3.0, f64::INFINITY)]);
        let expected = RangeBearingError::MeasurementNotFinite {
            id,
            entry: 1,
            value: f64::INFINITY,
        };
        let all = errors(&particle(Matrix2::identity()), &seen);
        assert_eq!(all, vec![expected; 5]);
    }
    let all = errors(
        &particle(Matrix2::identity()),
        &frame(&[(4, f64::NAN, 0.0)]),
    );
    assert_eq!(all.len(), 5);
    assert!(
        all[0]
            .to_string()
            .contains("entry 0 of measurement 4 is NaN")
    );
}

#[test]
fn landmark_covariances_that_are_none_are_refused() {
    let seen = frame(&[(4, 3.0, 0.3)]);
    let all = errors(&particle(Matrix2::new(1.0, 2.0, 2.0, 1.0)), &seen);
    assert_eq!(all.len(), 5);
    for error in all {
        assert!(matches!(
            error,
            RangeBearingError::Covariance {
                what: "landmark",
                reason: CholeskyError::NotPositiveDefinite {
                    pivot: 1,
                    value: -3.0,
                    ..
                }
            }
        ));
    }
    let all = errors(&particle(Matrix2::new(1.0, 0.25, 0.5, 1.0)), &seen);
    let expected = RangeBearingError::Covariance {
        what: "landmark",
        reason: CholeskyError::NotSymmetric {
            row: 1,
            column: 0,
            difference: 0.25,
        },
    };
    assert_eq!(all, vec![expected; 5]);
}

/// A sensor and a robot with arbitrary covariances.
#[derive(Clone, Copy)]
struct Broken {
    noise: Matrix2<f64>,
    motion: Matrix3<f64>,
}

impl ObservationModel<3, 2, 2> for Broken {
    fn predict(&self, pose: &Vector3<f64>, landmark: &Vector2<f64>) -> Option<Vector2<f64>> {
        SENSOR.predict(pose, landmark)
    }

    fn noise(&self) -> Matrix2<f64> {
        self.noise
    }
}

impl MotionModel<3> for Broken {
    type Control = Vec<Command>;

    fn predict(&self, pose: &Vector3<f64>, _: &Vec<Command>) -> Gaussian<3> {
        Gaussian {
            mean: *pose,
            covariance: self.motion,
        }
    }
}

#[test]
fn noise_and_motion_covariances_that_are_none_are_refused() {
    let good = Broken {
        noise: Matrix2::identity(),
        motion: Matrix3::identity(),
    };
    let mut skewed = good.motion;
    skewed[(2, 0)] = 0.125;
    let cases = [
        (
            Broken {
                noise: -Matrix2::identity(),
                ..good
            },
            "measurement noise: pivot 0",
        ),
        (
            Broken {
                noise: Matrix2::new(1.0, 0.5, 0.0, 1.0),
                ..good
            },
            "measurement noise: entries (1, 0) and (0, 1) of the matrix differ by -0.5",
        ),
        (
            Broken {
                motion: Matrix3::zeros(),
                ..good
            },
            "motion model: pivot 0 of the matrix is 0",
        ),
        (
            Broken {
                motion: skewed,
                ..good
            },
            "motion model: entries (2, 0) and (0, 2) of the matrix differ by 0.125",
        ),
        (
            Broken {
                motion: good.motion * f64::NAN,
                ..good
            },
            "motion model: entry (0, 0) of the matrix is NaN",
        ),
    ];
    for (broken, message) in cases {
        let before = particle(Matrix2::identity());
        let mut moved = before.clone();
        let mut rng = proposal_rng(1, 0);
        let seen = frame(&[(4, 3.0, 0.3)]);
        let unscented = UnscentedProposal {
            motion: broken,
            sensor: broken,
            iterations: 2,
        };
        let motion = MotionProposal {
            motion: broken,
            sensor: broken,
        };
        let first = unscented.propose(&mut moved, &seen, &mut rng).unwrap_err();
        let second = motion.propose(&mut moved, &seen, &mut rng).unwrap_err();
        assert!(first.to_string().contains(message), "{first}");
        assert_eq!(first.to_string(), second.to_string());
        assert_eq!(moved, before);
    }
}

/// A sensor that sees nothing, so all weights are zero.
#[derive(Clone, Copy)]
struct Blind;

impl ObservationModel<3, 2, 2> for Blind {
    fn predict(&self, _: &Vector3<f64>, _: &Vector2<f64>) -> Option<Vector2<f64>> {
        None
    }

    fn noise(&self) -> Matrix2<f64> {
        Matrix2::identity()
    }
}

#[test]
fn zero_particles_and_zero_weights_leave_the_filter_as_it_was() {
    assert_eq!(
        ParticleSet::<Particle>::new(vec![]),
        Err(RbpfError::NoParticles)
    );
    let set = ParticleSet::new(vec![particle(Matrix2::identity()); 7]).unwrap();
    let mut filter = ParticleFilter::new(set, Streams::new(1), FilterConfig::default()).unwrap();
    let before = filter.set().clone();
    let blind = MotionProposal {
        motion: MOTION,
        sensor: Blind,
    };
    let seen = frame(&[(4, 3.0, 0.3)]);
    let result = filter.step(0, &seen, &blind, &NoRejuvenation, &MAPPING);
    let expected = RbpfError::DegenerateWeights {
        particles: 7,
        zero: 7,
        nan: 0,
        infinite: 0,
    };
    assert_eq!(result, Err(StepError::Filter(expected)));
    assert_eq!(filter.set(), &before);

    // an error in the map update of one particle undoes poses, weights and the maps of the others
    let failing = LandmarkMapping {
        sensor: SENSOR,
        filter: Fails,
    };
    let result = filter.step(0, &seen, &PROPOSAL, &NoRejuvenation, &failing);
    assert!(matches!(
        result,
        Err(StepError::MapUpdate { particle: 0, .. })
    ));
    assert_eq!(filter.set(), &before);
    assert!(
        filter
            .step(0, &seen, &PROPOSAL, &NoRejuvenation, &MAPPING)
            .is_ok()
    );
    assert_ne!(filter.set(), &before);
}

/// A map update that maps, and then fails for a particle that holds landmark 1000.
struct MapsThenFails;

impl MapUpdate<Particle, Observed> for MapsThenFails {
    type Error = RangeBearingError;

    fn update_map(
        &self,
        particle: &mut Particle,
        frame: &Observed,
    ) -> Result<(), RangeBearingError> {
        MAPPING.update_map(particle, frame)?;
        if particle.map.contains(1000) {
            return Err(RangeBearingError::NotFinite { what: "landmark" });
        }
        Ok(())
    }
}

/// The maps of the particles before the failing one have changed by then, but in the copy: the originals
/// are equal to what they were, and in the same memory.
#[test]
fn an_error_in_the_last_map_leaves_the_maps_before_it() {
    let mut particles = vec![particle(Matrix2::identity()); 7];
    let far = landmark(gaussian(50.0, 0.0, Matrix2::identity()));
    particles[6].map.insert(1000, far);
    let config = FilterConfig {
        resampling_threshold: 0.0,
        ..FilterConfig::default()
    };
    let set = ParticleSet::new(particles).unwrap();
    let mut filter = ParticleFilter::new(set, Streams::new(1), config).unwrap();
    let (before, genealogy) = (filter.set().clone(), filter.genealogy().clone());
    // one landmark to update, one to start
    let seen = frame(&[(4, 3.0, 0.3), (9, 2.0, -0.5)]);
    let result = filter.step(0, &seen, &PROPOSAL, &NoRejuvenation, &MapsThenFails);
    assert!(matches!(
        result,
        Err(StepError::MapUpdate { particle: 6, .. })
    ));
    assert_eq!((filter.set(), filter.genealogy()), (&before, &genealogy));
    for (now, then) in filter.set().particles().iter().zip(before.particles()) {
        assert_eq!(now.map.shared_leaves_with(&then.map).own_bytes, 0);
    }
    // without the failing particle the same frame changes every map
    let _ = filter.particles_mut()[6].map.remove(1000);
    let result = filter.step(0, &seen, &PROPOSAL, &NoRejuvenation, &MapsThenFails);
    assert!(result.is_ok());
    for (now, then) in filter.set().particles().iter().zip(before.particles()) {
        assert!(now.map.get(4) != then.map.get(4) && now.map.contains(9));
    }
}

/// A landmark filter that fails.
struct Fails;

impl LandmarkFilter<RangeBearing, 3, 2, 2> for Fails {
    fn start(
        &self,
        _: &RangeBearing,
        _: &Vector3<f64>,
        _: &Vector2<f64>,
    ) -> Result<Option<Gaussian<2>>, RangeBearingError> {
        Ok(None)
    }

    fn update(
        &self,
        _: &RangeBearing,
        _: &Vector3<f64>,
        _: &Vector2<f64>,
        _: &Gaussian<2>,
    ) -> Result<Option<LandmarkUpdate<2>>, RangeBearingError> {
        Err(RangeBearingError::NotFinite { what: "landmark" })
    }
}
