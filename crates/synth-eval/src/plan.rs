//! The trials of a study: which recordings are made, and which estimators run on them with which seeds.

use crate::estimator::{DEAD_RECKONING, Estimator, FULL, QUICK, ablations};
use crate::recording::Recording;
use crate::scene_name::scene;
use crate::settings::Settings;
use crate::{Options, points, sequence};
use anyhow::{Context, ensure};
use std::path::PathBuf;
use wall_scenes::SceneSpec;

/// Seeds of a quick run.
const QUICK_SEEDS: u64 = 3;
/// Seeds of a full run.
const FULL_SEEDS: u64 = 8;
/// Most seeds of one run.
const MOST_SEEDS: u64 = 10_000;

/// The origin of a recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Source {
    /// A scene to render.
    Rendered {
        /// Name of the scene.
        name: String,
        /// The scene.
        spec: SceneSpec,
    },
    /// A scene whose keypoints are simulated.
    Points {
        /// Name of the scene.
        name: String,
        /// The scene.
        spec: SceneSpec,
    },
    /// A recorded sequence.
    Folder(PathBuf),
}

/// One recording and the seeds that run on it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Batch {
    /// The recording.
    pub(crate) source: Source,
    /// Seeds of the filter.
    pub(crate) seeds: Vec<u64>,
}

/// Everything that a study does.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plan {
    /// The recordings in the order they are made.
    pub(crate) batches: Vec<Batch>,
    /// The estimators that run on each of them.
    pub(crate) estimators: Vec<Estimator>,
    /// The configuration they share.
    pub(crate) settings: Settings,
    /// Whether the batch solution of every run is computed.
    pub(crate) batch: bool,
}

impl Source {
    /// Makes the recording.
    ///
    /// # Errors
    /// The scene or the folder is refused.
    pub(crate) fn record(&self, settings: &Settings) -> anyhow::Result<Recording> {
        let config = settings.of_detection();
        match self {
            Self::Rendered { name, spec } => Recording::rendered(name, *spec, &config),
            Self::Points { name, spec } => points::simulate(name, *spec),
            Self::Folder(folder) => sequence::read(folder, &config),
        }
    }

    /// Frames of a scene; a guess for a folder, which is not opened for it.
    pub(crate) fn frames(&self) -> usize {
        match self {
            Self::Rendered { spec, .. } | Self::Points { spec, .. } => {
                spec.frames * spec.frame_rate.multiple / spec.frame_rate.divisor
            }
            Self::Folder(_) => 200,
        }
    }
}

impl Plan {
    /// The plan of some options.
    ///
    /// # Errors
    /// An unknown scene or method, seeds or a shard out of range, a configuration file that is none.
    pub(crate) fn new(options: &Options) -> anyhow::Result<Self> {
        let default = if options.quick {
            QUICK_SEEDS
        } else {
            FULL_SEEDS
        };
        let (first, last) = options.seeds.unwrap_or((1, default));
        ensure!(
            1 <= first && first <= last && last - first < MOST_SEEDS,
            "--seeds must be N or FIRST-LAST with 1 <= FIRST <= LAST and at most {MOST_SEEDS} seeds, not {first}-{last}"
        );
        let (shard, shards) = options.shard.unwrap_or((1, 1));
        ensure!(
            1 <= shard && shard <= shards,
            "--shard must be I/N with 1 <= I <= N, not {shard}/{shards}"
        );
        let mut estimators = if options.methods.is_empty() && options.ablations {
            vec![DEAD_RECKONING]
        } else if options.methods.is_empty() {
            if options.quick { QUICK } else { FULL }.to_vec()
        } else {
            options
                .methods
                .iter()
                .map(|text| Estimator::parse(text))
                .collect::<anyhow::Result<Vec<_>>>()?
        };
        if options.ablations {
            let missing: Vec<Estimator> = ablations()
                .into_iter()
                .filter(|estimator| !estimators.contains(estimator))
                .collect();
            estimators.extend(missing);
        }
        let settings = match &options.config {
            Some(file) => Settings::read(file)?,
            None if options.default_config => Settings::Default,
            None => Settings::ExactNoise,
        };
        let mut units = Vec::new();
        let wall = [String::from("wall")];
        let scenes: &[String] = if options.scenes.is_empty() && options.sequences.is_empty() {
            &wall
        } else {
            &options.scenes
        };
        for name in scenes {
            for seed in first..=last {
                let mut spec = scene(name, seed)?;
                spec.frames = options.frames.unwrap_or(spec.frames);
                spec.check().with_context(|| format!("scene {name}"))?;
                let name = name.clone();
                let source = if options.points {
                    Source::Points { name, spec }
                } else {
                    Source::Rendered { name, spec }
                };
                units.push((source, seed));
            }
        }
        for folder in &options.sequences {
            for seed in first..=last {
                units.push((Source::Folder(folder.clone()), seed));
            }
        }
        let mut batches: Vec<Batch> = Vec::new();
        for (source, seed) in units
            .into_iter()
            .skip(shard as usize - 1)
            .step_by(shards as usize)
        {
            match batches.last_mut() {
                Some(batch) if batch.source == source => batch.seeds.push(seed),
                _ => batches.push(Batch {
                    source,
                    seeds: vec![seed],
                }),
            }
        }
        Ok(Self {
            batches,
            estimators,
            settings,
            batch: options.batch,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options() -> Options {
        Options {
            out: "out".into(),
            ..Options::default()
        }
    }

    #[test]
    fn shards_divide_the_seeds_and_forget_none() {
        let mut options = Options {
            scenes: vec!["wall".into(), "room".into()],
            sequences: vec!["there".into()],
            seeds: Some((3, 7)),
            ..options()
        };
        let whole = Plan::new(&options).unwrap();
        // Ten scenes of one seed each, and one folder with five.
        assert_eq!(whole.batches.len(), 11);
        assert_eq!(whole.batches[10].seeds, [3, 4, 5, 6, 7]);
        let mut found: Vec<(String, u64)> = Vec::new();
        for shard in 1..=4 {
            options.shard = Some((shard, 4));
            for batch in Plan::new(&options).unwrap().batches {
                for seed in batch.seeds {
                    found.push((format!("{:?}", batch.source), seed));
                }
            }
        }
        found.sort();
        let mut all: Vec<(String, u64)> = Vec::new();
        for batch in whole.batches {
            for seed in batch.seeds {
                all.push((format!("{:?}", batch.source), seed));
            }
        }
        all.sort();
        assert_eq!(found, all);
    }

    #[test]
    fn seeds_have_a_default_and_limits() {
        let seeds = |options: &Options| Plan::new(options).map(|plan| plan.batches.len());
        assert_eq!(seeds(&options()).unwrap(), 8);
        let quick = Options {
            quick: true,
            ..options()
        };
        assert_eq!(seeds(&quick).unwrap(), 3);
        for (wrong, word) in [
            (
                Options {
                    seeds: Some((0, 3)),
                    ..options()
                },
                "0-3",
            ),
            (
                Options {
                    shard: Some((3, 2)),
                    ..options()
                },
                "3/2",
            ),
            (
                Options {
                    scenes: vec!["cave".into()],
                    ..options()
                },
                "cave",
            ),
            (
                Options {
                    methods: vec!["best:5".into()],
                    ..options()
                },
                "best",
            ),
            (
                Options {
                    frames: Some(1),
                    ..options()
                },
                "wall",
            ),
        ] {
            let message = format!("{:#}", seeds(&wrong).unwrap_err());
            assert!(message.contains(word), "{message}");
        }
    }
}
