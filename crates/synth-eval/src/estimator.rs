//! The estimators under comparison: dead reckoning and the filters, each with its number of particles.
//!
//! All filters share one configuration, so detection, matching, keyframes and map management are the same; what
//! differs is the method and the number of particles.

use anyhow::{Context, bail, ensure};
use slam_pipeline::Ablation;
use slam_pipeline::config::{Config, Method};

/// The way poses are computed: a line of the table without its number of particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Family {
    /// Odometry alone.
    DeadReckoning,
    /// A particle filter.
    Filter(Method),
    /// The exact filter without one of its parts.
    Without(Ablation),
}

/// All families in the order of the table, by the name that is printed.
const FAMILIES: &[(&str, Family)] = &[
    ("dead reckoning", Family::DeadReckoning),
    ("conventional", Family::Filter(Method::Conventional)),
    ("paper", Family::Filter(Method::Paper)),
    ("exact", Family::Filter(Method::Exact)),
    ("no evolution", Family::Without(Ablation::NoEvolution)),
    ("no unscented", Family::Without(Ablation::NoUnscented)),
    (
        "FastSLAM 2.0",
        Family::Without(Ablation::FirstOrderProposal),
    ),
    ("resample always", Family::Without(Ablation::ResampleAlways)),
    ("delayed starts", Family::Without(Ablation::DelayedStarts)),
    ("likelihood only", Family::Without(Ablation::LikelihoodOnly)),
    (
        "weights not carried",
        Family::Without(Ablation::WeightsNotCarried),
    ),
];

/// Most particles of an estimator.
const MOST_PARTICLES: u32 = 10_000;

/// One entry of the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Estimator {
    /// The way poses are computed.
    pub(crate) family: Family,
    /// How many particles; 0 for dead reckoning.
    pub(crate) particles: u32,
}

const fn filter(method: Method, particles: u32) -> Estimator {
    Estimator {
        family: Family::Filter(method),
        particles,
    }
}

/// Particles of the ablations.
const ABLATED_PARTICLES: u32 = 50;

/// The exact filter and all its ablations.
pub(crate) fn ablations() -> Vec<Estimator> {
    FAMILIES
        .iter()
        .filter(|(_, family)| matches!(family, Family::Filter(Method::Exact) | Family::Without(_)))
        .map(|(_, family)| Estimator {
            family: *family,
            particles: ABLATED_PARTICLES,
        })
        .collect()
}

/// Odometry alone.
pub(crate) const DEAD_RECKONING: Estimator = Estimator {
    family: Family::DeadReckoning,
    particles: 0,
};

/// The entries of `--quick`.
pub(crate) const QUICK: &[Estimator] = &[
    DEAD_RECKONING,
    filter(Method::Conventional, 100),
    filter(Method::Conventional, 500),
    filter(Method::Paper, 50),
    filter(Method::Exact, 50),
];

/// The entries of a full run.
pub(crate) const FULL: &[Estimator] = &[
    DEAD_RECKONING,
    filter(Method::Conventional, 100),
    filter(Method::Conventional, 500),
    filter(Method::Paper, 50),
    filter(Method::Paper, 100),
    filter(Method::Exact, 10),
    filter(Method::Exact, 20),
    filter(Method::Exact, 50),
    filter(Method::Exact, 100),
];

impl Estimator {
    /// Reads `dead-reckoning` or `FAMILY:PARTICLES`, spaces of the name as hyphens.
    ///
    /// # Errors
    /// Another name, or a number of particles that is none.
    pub(crate) fn parse(text: &str) -> anyhow::Result<Self> {
        let (name, particles) = match text.split_once(':') {
            Some((name, number)) => {
                let particles: u32 = number
                    .parse()
                    .with_context(|| format!("{text}: `{number}` is no number of particles"))?;
                ensure!(
                    (1..=MOST_PARTICLES).contains(&particles),
                    "{text}: particles must be 1 to {MOST_PARTICLES}"
                );
                (name, particles)
            }
            None => (text, 0),
        };
        let Some((_, family)) = FAMILIES
            .iter()
            .find(|(known, _)| known.replace(' ', "-") == name)
        else {
            let known: Vec<String> = FAMILIES
                .iter()
                .map(|(known, _)| known.replace(' ', "-"))
                .collect();
            bail!("no method `{name}`: one of {}", known.join(", "));
        };
        let estimator = Self {
            family: *family,
            particles,
        };
        ensure!(
            (particles == 0) == (*family == Family::DeadReckoning),
            "{text}: a filter is written with its number of particles ({name}:50), dead-reckoning without"
        );
        Ok(estimator)
    }

    /// The family's name as printed.
    pub(crate) fn family_name(self) -> &'static str {
        FAMILIES
            .iter()
            .find(|(_, family)| *family == self.family)
            .map_or("", |(name, _)| name)
    }

    /// Name as printed.
    pub(crate) fn label(self) -> String {
        match self.family {
            Family::DeadReckoning => self.family_name().to_owned(),
            Family::Filter(_) | Family::Without(_) => {
                format!("{} {}", self.family_name(), self.particles)
            }
        }
    }

    /// Makes `config` that of this estimator: its method, its particles, one thread.
    pub(crate) fn configure(self, config: &mut Config, seed: u64) {
        match self.family {
            Family::DeadReckoning => {}
            Family::Filter(method) => config.filter.method = method,
            Family::Without(_) => config.filter.method = Method::Exact,
        }
        if self.particles > 0 {
            config.filter.particles = self.particles;
        }
        config.filter.seed = seed;
        config.filter.threads = 1;
    }
}

/// The family a label of a table line belongs to.
pub(crate) fn family_of(label: &str) -> &str {
    label
        .rsplit_once(' ')
        .filter(|(_, number)| number.parse::<u32>().is_ok())
        .map_or(label, |(family, _)| family)
}

/// Place of a family in the table; unknown ones come last.
pub(crate) fn family_rank(family: &str) -> usize {
    FAMILIES
        .iter()
        .position(|(name, _)| *name == family)
        .unwrap_or(FAMILIES.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_read_back_from_its_label() {
        for estimator in FULL.iter().chain(&ablations()) {
            let label = estimator.label();
            let text = match estimator.particles {
                0 => label.replace(' ', "-"),
                n => format!("{}:{n}", estimator.family_name().replace(' ', "-")),
            };
            assert_eq!(Estimator::parse(&text).unwrap(), *estimator);
            assert_eq!(family_of(&label), estimator.family_name());
        }
        assert!(family_rank("exact") > family_rank("conventional"));
        assert_eq!(family_rank("of old"), FAMILIES.len());
    }

    #[test]
    fn wrong_methods_say_what_is_wrong() {
        for (text, word) in [
            ("exact", "exact:50"),
            ("exact:0", "particles"),
            ("exact:many", "many"),
            ("dead-reckoning:5", "dead-reckoning"),
            ("kalman:3", "conventional"),
        ] {
            let message = Estimator::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }

    #[test]
    fn quick_is_a_part_of_full_in_the_same_order() {
        let mut full = FULL.iter();
        assert!(QUICK.iter().all(|entry| full.any(|other| other == entry)));
    }
}
