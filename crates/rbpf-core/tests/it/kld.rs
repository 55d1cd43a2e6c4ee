//! A filter whose number of particles follows the spread of its poses.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{
    FilterConfig, KldSampling, NoMapUpdate, NoRejuvenation, ParticleCount, ParticleFilter,
    ParticleSet, Proposal, Purpose, Streams,
};
use std::convert::Infallible;

/// A position on a line, moved by unit noise and measured with the given deviation.
struct Walk {
    deviation: f64,
}

impl Proposal<f64, f64> for Walk {
    type Error = Infallible;

    fn propose(&self, x: &mut f64, z: &f64, rng: &mut ChaCha8Rng) -> Result<f64, Infallible> {
        *x += 0.1 * rng.sample::<f64, _>(StandardNormal);
        Ok(-0.5 * ((z - *x) / self.deviation).powi(2))
    }
}

fn sampling() -> KldSampling {
    KldSampling {
        error: 0.05,
        quantile: 2.326,
        widths: vec![0.25],
        min_particles: 50,
        max_particles: 5000,
    }
}

/// Sizes, frame by frame, of a filter that starts spread over 20 m and is told its position ever better.
fn sizes() -> (Vec<usize>, ParticleSet<f64>) {
    let mut rng = Streams::new(3).shared(0, Purpose::Initialisation);
    let start = (0..2000).map(|_| rng.random_range(-10.0..10.0)).collect();
    let config = FilterConfig {
        resampling_threshold: 1.0,
        ..FilterConfig::default()
    };
    let set = ParticleSet::new(start).expect("not empty");
    let count = ParticleCount::Kld {
        sampling: sampling(),
        pose: |x| vec![*x],
    };
    let mut filter = ParticleFilter::new(set, Streams::new(4), config)
        .and_then(|filter| filter.with_particle_count(count))
        .expect("settings in range");
    let mut sizes = Vec::new();
    for (frame, deviation) in [1e3, 5.0, 1.0, 0.3, 0.1].into_iter().enumerate() {
        let walk = Walk { deviation };
        let report = filter
            .step(frame as u64, &1.0, &walk, &NoRejuvenation, &NoMapUpdate)
            .expect("weights are finite");
        let ancestors = report.ancestors.expect("the threshold is one");
        assert_eq!(ancestors.len(), filter.set().len());
        assert_eq!(filter.genealogy().particles(), filter.set().len());
        let equal = -(filter.set().len() as f64).ln();
        assert!(filter.set().log_weights().iter().all(|w| *w == equal));
        sizes.push(filter.set().len());
    }
    (sizes, filter.set().clone())
}

#[test]
fn the_number_of_particles_follows_the_spread() {
    let (sizes, set) = sizes();
    // 20 m are 80 bins and a little more for the noise; the last posterior, of deviation 0.07 or more, a few.
    assert!(
        (sampling().bound(75)..=sampling().bound(86)).contains(&sizes[0]),
        "{sizes:?}"
    );
    assert!(sizes.windows(2).all(|pair| pair[1] < pair[0]), "{sizes:?}");
    assert!(*sizes.last().unwrap() <= sampling().bound(5), "{sizes:?}");
    let mean = set.weighted_mean(|x| *x).unwrap();
    // Posterior deviation below 0.1, the standard error of a mean of 50 below 0.1 / 7, and resampled four times.
    assert!((mean - 1.0).abs() < 0.1, "{mean}");
}

#[cfg(feature = "parallel")]
#[test]
fn the_number_does_not_depend_on_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(sizes)
    };
    let alone = run(1);
    for threads in [2, 3, 8] {
        assert_eq!(run(threads), alone, "{threads} threads");
    }
}
