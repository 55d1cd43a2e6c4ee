//! The frame driver: order, carried weights, unchanged state on errors, any number of threads,
//! and agreement with the Kalman filter.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{
    FilterConfig, MapUpdate, NoMapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal,
    Purpose, RbpfError, Rejuvenation, RejuvenationReport, RejuvenationSchedule, Resampler,
    StepError, StepStage, Streams, map_particles,
};
use std::convert::Infallible;

#[derive(Clone, Debug, PartialEq)]
struct Walker {
    position: f64,
    log: Vec<&'static str>,
}

fn walkers(count: usize) -> ParticleSet<Walker> {
    ParticleSet::new(vec![
        Walker {
            position: 0.0,
            log: vec![]
        };
        count
    ])
    .expect("not empty")
}

#[derive(Debug, PartialEq, thiserror::Error)]
#[error("refused at {position}")]
struct Refused {
    position: f64,
}

/// Random walk of unit variance, measured with variance r.
struct RandomWalk {
    r: f64,
}

impl Proposal<Walker, f64> for RandomWalk {
    type Error = Infallible;

    fn propose(&self, p: &mut Walker, z: &f64, rng: &mut ChaCha8Rng) -> Result<f64, Infallible> {
        p.position += rng.sample::<f64, _>(StandardNormal);
        p.log.push("propose");
        Ok(-0.5 * (z - p.position).powi(2) / self.r - 0.5 * (std::f64::consts::TAU * self.r).ln())
    }
}

/// Metropolis steps against a flat target: always accepted, small.
struct Shake;

impl Rejuvenation<Walker, f64> for Shake {
    type Error = Infallible;

    fn rejuvenate(
        &self,
        particles: &mut [Walker],
        _: &f64,
        streams: &Streams,
        frame: u64,
    ) -> Result<RejuvenationReport, Infallible> {
        let proposed = particles.len();
        map_particles(particles, |slot, particle| {
            let mut rng = streams.stream(frame, slot as u64, Purpose::Evolution);
            particle.position += 1e-3 * rng.random::<f64>();
            particle.log.push("rejuvenate");
        });
        Ok(RejuvenationReport {
            proposed,
            accepted: proposed / 2,
        })
    }
}

struct Note;

impl MapUpdate<Walker, f64> for Note {
    type Error = Infallible;

    fn update_map(&self, particle: &mut Walker, _: &f64) -> Result<(), Infallible> {
        particle.log.push("map");
        Ok(())
    }
}

/// Fails for particles below zero.
struct Refusing;

impl MapUpdate<Walker, f64> for Refusing {
    type Error = Refused;

    fn update_map(&self, particle: &mut Walker, _: &f64) -> Result<(), Refused> {
        if particle.position < 0.0 {
            return Err(Refused {
                position: particle.position,
            });
        }
        particle.position = 100.0;
        Ok(())
    }
}

fn filter(count: usize, config: FilterConfig) -> ParticleFilter<Walker> {
    ParticleFilter::new(walkers(count), Streams::new(4), config).expect("valid threshold")
}

#[test]
fn stages_run_in_the_order_of_the_frame() {
    let config = FilterConfig {
        resampling_threshold: 1.0,
        rejuvenation: RejuvenationSchedule::AfterResampling,
        ..FilterConfig::default()
    };
    let mut filter = filter(30, config);
    let report = filter
        .step(0, &0.3, &RandomWalk { r: 0.1 }, &Shake, &Note)
        .unwrap();
    assert!(report.resampled() && report.unique_ancestors < 30);
    assert_eq!(report.rejuvenation.acceptance(), Some(0.5));
    for particle in filter.set().particles() {
        assert_eq!(particle.log, ["propose", "rejuvenate", "map"]);
    }
    let equal = -(30.0_f64).ln();
    assert!(filter.set().log_weights().iter().all(|w| *w == equal));
    assert!(filter.set().origins().is_sorted());
}

#[test]
fn the_observer_is_told_the_stages_and_changes_nothing() {
    let config = FilterConfig {
        resampling_threshold: 1.0,
        ..FilterConfig::default()
    };
    let (mut observed, mut alone) = (filter(30, config), filter(30, config));
    let mut stages = vec![];
    let proposal = RandomWalk { r: 0.1 };
    let told = observed
        .step_observed(0, &0.3, &proposal, &Shake, &Note, &mut |stage| {
            stages.push(stage);
        })
        .unwrap();
    let untold = alone.step(0, &0.3, &proposal, &Shake, &Note).unwrap();
    let order = [
        StepStage::Proposal,
        StepStage::Rejuvenation,
        StepStage::MapUpdate,
    ];
    assert_eq!(stages, order);
    assert_eq!((told, observed.set()), (untold, alone.set()));
}

#[test]
fn weights_are_carried_while_the_set_is_not_resampled() {
    let config = FilterConfig {
        resampling_threshold: 0.0,
        ..FilterConfig::default()
    };
    let mut filter = filter(10, config);
    let mut expected = vec![0.0; 10];
    for frame in 0..5 {
        let z = frame as f64 * 0.2;
        let report = filter
            .step(frame, &z, &RandomWalk { r: 2.0 }, &Shake, &Note)
            .unwrap();
        assert!(!report.resampled());
        assert_eq!(
            (report.unique_ancestors, report.rejuvenation.proposed),
            (10, 0)
        );
        for (sum, particle) in expected.iter_mut().zip(filter.set().particles()) {
            *sum += -0.25 * (z - particle.position).powi(2);
        }
    }
    let mut normalised = ParticleSet::new(vec![(); 10]).unwrap();
    normalised.reweight(&expected).unwrap();
    let expected = normalised.log_weights();
    for (weight, expected) in filter.set().log_weights().iter().zip(expected) {
        assert!((weight - expected).abs() < 1e-12);
    }
}

#[test]
fn an_error_in_any_stage_leaves_the_set_unchanged() {
    let mut filter = filter(20, FilterConfig::default());
    filter
        .step(
            0,
            &0.0,
            &RandomWalk { r: 1.0 },
            &NoRejuvenation,
            &NoMapUpdate,
        )
        .unwrap();
    let (before, genealogy) = (filter.set().clone(), filter.genealogy().clone());

    let error = filter
        .step(1, &0.0, &RandomWalk { r: 0.05 }, &NoRejuvenation, &Refusing)
        .unwrap_err();
    assert!(
        matches!(error, StepError::MapUpdate { source: Refused { position }, .. } if position < 0.0)
    );
    assert_eq!((filter.set(), filter.genealogy()), (&before, &genealogy));

    let error = filter
        .step(
            1,
            &f64::NAN,
            &RandomWalk { r: 1.0 },
            &NoRejuvenation,
            &NoMapUpdate,
        )
        .unwrap_err();
    assert_eq!(
        error,
        StepError::Filter(RbpfError::DegenerateWeights {
            particles: 20,
            zero: 0,
            nan: 20,
            infinite: 0
        })
    );
    assert_eq!((filter.set(), filter.genealogy()), (&before, &genealogy));
}

#[cfg(feature = "parallel")]
#[test]
fn the_number_of_threads_changes_nothing() {
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| {
                let mut filter = filter(64, FilterConfig::default());
                let reports: Vec<_> = (0..40)
                    .map(|frame| {
                        let z = (frame as f64 * 0.1).sin();
                        filter
                            .step(frame, &z, &RandomWalk { r: 0.3 }, &Shake, &Note)
                            .unwrap()
                    })
                    .collect();
                (filter.set().clone(), reports)
            })
    };
    let (one, many) = (run(1), run(5));
    assert_eq!(one, many);
    assert!(one.1.iter().any(rbpf_core::StepReport::resampled));
}

#[test]
fn a_resumed_filter_goes_on_with_the_same_numbers() {
    let step = |filter: &mut ParticleFilter<Walker>, frame| {
        filter
            .step(frame, &0.1, &RandomWalk { r: 0.3 }, &Shake, &Note)
            .unwrap()
    };
    let mut whole = filter(16, FilterConfig::default());
    let mut part = filter(16, FilterConfig::default());
    for frame in 0..10 {
        step(&mut whole, frame);
        step(&mut part, frame);
    }
    let set = part.set();
    let restored = ParticleSet::from_parts(
        set.particles().to_vec(),
        set.log_weights().to_vec(),
        set.origins().to_vec(),
    )
    .unwrap();
    let mut resumed = ParticleFilter::resume(
        restored,
        Streams::new(4),
        FilterConfig::default(),
        part.genealogy().clone(),
    )
    .unwrap();
    for frame in 10..30 {
        assert_eq!(step(&mut whole, frame), step(&mut resumed, frame));
    }
    assert_eq!(whole.set(), resumed.set());
}

/// A random walk has a Kalman filter: mean and log evidence of the particle filter must come
/// within 5 standard errors of it, estimated over independent seeds, for every resampler.
#[test]
fn mean_and_evidence_agree_with_the_kalman_filter() {
    let measurements: Vec<f64> = (0..8).map(|t| (f64::from(t) * 0.7).sin() * 2.0).collect();
    let r = 0.5;
    let (mut mean, mut variance, mut evidence) = (0.0, 0.0, 0.0);
    for z in &measurements {
        variance += 1.0;
        let s = variance + r;
        evidence += -0.5 * (z - mean) * (z - mean) / s - 0.5 * (std::f64::consts::TAU * s).ln();
        mean += variance / s * (z - mean);
        variance -= variance * variance / s;
    }
    for resampler in [
        Resampler::Systematic,
        Resampler::Stratified,
        Resampler::Residual,
        Resampler::Multinomial,
    ] {
        let seeds = 60_u32;
        let (mut means, mut likelihoods) = (vec![], vec![]);
        for seed in 0..seeds {
            let mut filter = ParticleFilter::new(
                walkers(400),
                Streams::new(u64::from(seed)),
                FilterConfig {
                    resampler,
                    ..FilterConfig::default()
                },
            )
            .unwrap();
            let mut log_evidence = 0.0;
            for (frame, z) in measurements.iter().enumerate() {
                let report = filter
                    .step(
                        frame as u64,
                        z,
                        &RandomWalk { r },
                        &NoRejuvenation,
                        &NoMapUpdate,
                    )
                    .unwrap();
                log_evidence += report.log_evidence;
            }
            means.push(filter.set().weighted_mean(|p| p.position).unwrap());
            // the evidence itself, not its logarithm, is unbiased
            likelihoods.push((log_evidence - evidence).exp());
        }
        for (what, values, truth) in [("mean", &means, mean), ("evidence", &likelihoods, 1.0)] {
            let n = f64::from(seeds);
            let average = values.iter().sum::<f64>() / n;
            let spread = values.iter().map(|v| (v - average).powi(2)).sum::<f64>() / (n - 1.0);
            let error = 5.0 * (spread / n).sqrt();
            assert!(
                (average - truth).abs() < error,
                "{resampler:?} {what} {average} {truth} {error}"
            );
            assert!(
                error < 0.2,
                "{resampler:?} {what}: the test is too weak, {error}"
            );
        }
    }
}

#[test]
fn thinning_leaves_few_particles_in_equal_numbers_and_no_bias() {
    let weights = [0.05, 0.1, 0.15, 0.2, 0.25, 0.25_f64];
    let (trials, count) = (4000_u32, 2);
    let mut copies = [0.0; 6];
    for seed in 0..trials {
        let set = ParticleSet::from_parts(
            (0..6).collect::<Vec<i32>>(),
            weights.map(f64::ln).to_vec(),
            (0..6).collect(),
        )
        .unwrap();
        let mut filter =
            ParticleFilter::new(set, Streams::new(seed.into()), FilterConfig::default()).unwrap();
        let mut rng = filter.streams().shared(3, Purpose::Resampling);
        filter.thin(3, count, &mut rng).unwrap();
        let left = filter.set().particles();
        assert_eq!(left.len(), 6);
        // Two survivors with three copies each, or one that was drawn twice.
        assert_eq!(left[..3], [left[0]; 3]);
        assert_eq!(left[3..], [left[3]; 3]);
        assert!(
            filter
                .set()
                .weights()
                .iter()
                .all(|w| (w - 1.0 / 6.0).abs() < 1e-12)
        );
        assert!(filter.genealogy().common_ancestor_age(3).is_some() == (left[0] == left[3]));
        for particle in left {
            copies[*particle as usize] += 1.0 / (6.0 * f64::from(trials));
        }
    }
    // A share in two draws has a standard deviation below 1/2; four of them over 4000 trials.
    for (share, weight) in copies.iter().zip(weights) {
        assert!(
            (share - weight).abs() < 4.0 * 0.5 / f64::from(trials).sqrt(),
            "{copies:?}"
        );
    }
}

#[test]
fn bad_settings_are_refused() {
    for value in [-0.1, 1.1, f64::NAN] {
        let config = FilterConfig {
            resampling_threshold: value,
            ..FilterConfig::default()
        };
        assert!(matches!(
            ParticleFilter::new(walkers(2), Streams::new(0), config),
            Err(RbpfError::InvalidThreshold { .. })
        ));
    }
    assert_eq!(ParticleSet::<f64>::new(vec![]), Err(RbpfError::NoParticles));
    assert!(ParticleSet::from_parts(vec![1], vec![0.0, 0.0], vec![0]).is_err());
    let mut set = ParticleSet::new(vec![1, 2]).unwrap();
    assert!(set.select(&[2]).is_err() && set.select(&[]).is_err());
    assert!(set.reweight(&[f64::NEG_INFINITY; 2]).is_err() && set.reweight(&[0.0]).is_err());
    assert_eq!(set, ParticleSet::new(vec![1, 2]).unwrap());
    set.reweight(&[0.0, 1.0]).unwrap();
    assert_eq!(set.best(), 1);
}
