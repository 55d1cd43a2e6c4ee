//! Samples from the best data first: PROSAC (Chum and Matas, CVPR 2005).
//!
//! With the data in order of quality, u_1 the best, trial t draws u_n and m - 1 of u_1..u_(n-1), where n grows from m to
//! N. T_n = T_N prod_{i<m} (n - i) / (N - i) of T_N uniform samples would lie in the first n data; n grows when that many
//! (rounded up, one by one) have been drawn, so that after T_N trials PROSAC has become uniform sampling.
//!
//! It stops at the n* among all n for which the trials needed for the first n data are fewest, provided that its
//! inliers are no accident: a wrong model has its sample, and each further datum with probability `beta`, so more than
//! m + j inliers among n must have a binomial tail below the significance, here divided by N as N tests are made.
//! Samples are drawn from the first n* data from then on.
//!
//! Degenerate: qualities without information cost little (the order is then a random one), misleading ones cost trials.
//! Do not use it when good qualities cluster in one place of the image: samples become ill-conditioned.

use rand_chacha::ChaCha8Rng;

use super::sampler::{Sampler, draw_distinct, uniform_trials_needed};

/// Quality-ordered sampler.
#[derive(Debug, Clone, PartialEq)]
pub struct Prosac {
    /// Number of trials after which sampling is uniform, T_N of the paper (200 000 there).
    pub growth_trials: f64,
    /// Probability that a datum agrees with a wrong model by accident, beta of the paper.
    pub accidental_share: f64,
    /// Probability of taking accidental inliers for a model, over all the prefixes tested.
    pub significance: f64,
    order: Vec<usize>,
    least_inliers: Vec<usize>,
    trial: f64,
    /// Largest position in use, n.
    prefix: usize,
    /// Expected samples within the prefix, T_n.
    expected: f64,
    /// The last trial of this prefix, T'_n.
    last_trial: f64,
    /// n*.
    stopping_prefix: usize,
}

impl Prosac {
    /// A sampler from one quality per datum, higher is better (for example a negative distance ratio); NaN comes last, equal
    /// ones keep their order. O(N log N).
    #[must_use]
    pub fn new(qualities: &[f64]) -> Self {
        let key = |i: usize| {
            if qualities[i].is_nan() {
                f64::NEG_INFINITY
            } else {
                qualities[i]
            }
        };
        let mut order: Vec<usize> = (0..qualities.len()).collect();
        order.sort_by(|a, b| key(*b).total_cmp(&key(*a)));
        Self {
            growth_trials: 200_000.0,
            accidental_share: 0.1,
            significance: 0.01,
            order,
            least_inliers: Vec::new(),
            trial: 0.0,
            prefix: 0,
            expected: 0.0,
            last_trial: 0.0,
            stopping_prefix: 0,
        }
    }
}

impl Sampler for Prosac {
    fn start(&mut self, data: usize, sample_size: usize) {
        // Data without a quality come after those with one, in their own order.
        self.order.retain(|index| *index < data);
        self.order.extend(self.order.len()..data);
        self.least_inliers = least_inliers(
            data,
            sample_size,
            self.accidental_share,
            self.significance / data as f64,
        );
        self.trial = 0.0;
        self.prefix = sample_size;
        self.expected = (0..sample_size)
            .map(|i| (sample_size - i) as f64 / (data - i) as f64)
            .product::<f64>()
            * self.growth_trials;
        self.last_trial = 1.0;
        self.stopping_prefix = data;
    }

    fn draw(&mut self, rng: &mut ChaCha8Rng, sample: &mut [usize]) {
        let size = sample.len();
        self.trial += 1.0;
        while self.trial > self.last_trial && self.prefix < self.stopping_prefix {
            let n = (self.prefix + 1) as f64;
            let grown = self.expected * n / (n - size as f64);
            self.last_trial += (grown - self.expected).ceil();
            self.expected = grown;
            self.prefix += 1;
        }
        let end = self.prefix.min(self.stopping_prefix);
        if self.trial > self.last_trial || self.prefix > self.stopping_prefix {
            draw_distinct(rng, end, sample);
        } else {
            draw_distinct(rng, end - 1, &mut sample[..size - 1]);
            sample[size - 1] = end - 1;
        }
        for index in sample {
            *index = self.order[*index];
        }
    }

    fn trials_needed(&mut self, inliers: &[bool], sample_size: usize, confidence: f64) -> f64 {
        let mut best = f64::INFINITY;
        self.stopping_prefix = self.order.len();
        let mut good = 0;
        for (k, index) in self.order.iter().enumerate() {
            good += usize::from(inliers[*index]);
            let n = k + 1;
            if n >= sample_size && good >= self.least_inliers[k] {
                let needed = uniform_trials_needed(good, n, sample_size, confidence);
                if needed <= best {
                    best = needed;
                    self.stopping_prefix = n;
                }
            }
        }
        best
    }
}

/// For every n = 1..=data the number of inliers among n that a wrong model reaches with probability below
/// `significance`: m + min { j : P(Binomial(n - m, share) >= j) < significance }. O(data).
fn least_inliers(data: usize, sample_size: usize, share: f64, significance: f64) -> Vec<usize> {
    let share = share.clamp(1e-6, 1.0 - 1e-6);
    let mut least = vec![usize::MAX; data];
    // Of `count` further data: P(X = j) and P(X > j), followed along the quantile j.
    let (mut j, mut mass, mut above) = (0_usize, 1.0_f64, 0.0_f64);
    for n in sample_size.max(1)..=data {
        let count = (n - sample_size) as f64;
        // The tail from j + 1 on must be below the significance.
        while above >= significance {
            mass *= (count - j as f64) / (j as f64 + 1.0) * share / (1.0 - share);
            j += 1;
            above -= mass;
        }
        least[n - 1] = sample_size + j + 1;
        // One datum more: the tail gains what stood just below it.
        above += share * mass;
        mass *= (1.0 - share) * (count + 1.0) / (count + 1.0 - j as f64);
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    /// P(Binomial(count, share) >= j) by summing all terms.
    fn tail(count: usize, share: f64, j: usize) -> f64 {
        let mut mass = (1.0 - share).powi(i32::try_from(count).unwrap());
        let mut sum = 0.0;
        for k in 0..=count {
            if k >= j {
                sum += mass;
            }
            mass *= (count - k) as f64 / (k + 1) as f64 * share / (1.0 - share);
        }
        sum
    }

    #[test]
    fn least_inliers_is_the_binomial_quantile() {
        for (data, size, share, significance) in [
            (1, 1, 0.05, 0.01),
            (300, 5, 0.05, 1e-4),
            (200, 8, 0.3, 0.02),
            (60, 2, 0.5, 1e-3),
        ] {
            let least = least_inliers(data, size, share, significance);
            assert_eq!(least.len(), data);
            for n in size..=data {
                let j = least[n - 1] - size;
                assert!(tail(n - size, share, j) < significance);
                assert!(
                    j == 0 || tail(n - size, share, j - 1) >= significance,
                    "{n}"
                );
            }
            assert!(least[..size - 1].iter().all(|v| *v == usize::MAX));
        }
    }
}
