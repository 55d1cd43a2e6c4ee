//! The paper's experiment on rendered walls: which filter finds the path and the map best?
//!
//! For each seed a wall scene (38 frames, 320x240, Table I camera, wall at 2 m) is rendered in
//! memory and its keypoints are detected once; every estimator then runs on them, one thread
//! each, and is compared with the exact truth. The output folder gets
//!
//! - `results.jsonl`: one line per (seed, estimator), in the order of the table;
//! - `results.json`: the same rows with the means over seeds and the machine's part;
//! - `results.md`: the table that is printed;
//! - `figure7_map.svg`, `figure8_particles.svg`: in the manner of the paper's figures.
//!
//! The estimates do not depend on the number of threads; the times do, and on the load of the
//! machine.

use crate::estimator::{self, Estimator};
use crate::recording::Recording;
use crate::summary::{self, Summary};
use crate::trial::{self, Trial};
use crate::{figures, jobs};
use anyhow::{Context, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use wall_scenes::SceneSpec;

/// Seeds of a quick run.
const QUICK_SEEDS: u64 = 3;
/// Seeds of a full run.
const FULL_SEEDS: u64 = 8;
/// Most seeds of one run.
const MOST_SEEDS: u64 = 1000;

/// The extent of a comparison and the folder of its results.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Three seeds and the five most telling estimators.
    pub quick: bool,
    /// Number of seeds, 1, 2, ...; none for the default.
    pub seeds: Option<u64>,
    /// Folder of the results; created.
    pub out: PathBuf,
}

impl Options {
    /// How many seeds are run.
    ///
    /// # Errors
    /// None or more than a thousand were asked for.
    pub fn seed_count(&self) -> anyhow::Result<u64> {
        let default = if self.quick { QUICK_SEEDS } else { FULL_SEEDS };
        let seeds = self.seeds.unwrap_or(default);
        ensure!(
            (1..=MOST_SEEDS).contains(&seeds),
            "--seeds must be 1 to {MOST_SEEDS}, not {seeds}"
        );
        Ok(seeds)
    }
}

/// Runs the comparison, writes its files and returns the table as Markdown.
/// `progress` is told of every finished part, from several threads.
///
/// # Errors
/// A number of seeds out of range, a filter that fails, a folder that cannot be written.
pub fn run(options: &Options, progress: &(dyn Fn(&str) + Sync)) -> anyhow::Result<String> {
    let seeds: Vec<u64> = (1..=options.seed_count()?).collect();
    let estimators = if options.quick {
        estimator::QUICK
    } else {
        estimator::FULL
    };
    fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot create {}", options.out.display()))?;

    let recordings: Vec<Recording> = jobs::run(
        &seeds,
        |_| 1,
        |&seed| {
            let recording = Recording::new(SceneSpec::wall(seed))?;
            progress(&format!("seed {seed}: rendered and detected"));
            Ok(recording)
        },
    )?;
    let pairs = pairs(recordings.len(), estimators);
    let trials: Vec<Trial> = jobs::run(
        &pairs,
        |(_, estimator)| estimator.particles(),
        |&(scene, estimator)| {
            let trial = trial::run(estimator, &recordings[scene])?;
            progress(&format!(
                "seed {}: {}, {:.1} mm",
                trial.row.seed,
                trial.row.estimator,
                trial.row.position_rmse_m * 1e3
            ));
            Ok(trial)
        },
    )?;

    let rows: Vec<_> = trials.iter().map(|trial| &trial.row).collect();
    let summary = Summary::new(estimators, &rows, &recordings)?;
    let first = &trials[..estimators.len()];
    for (name, text) in [
        ("results.jsonl", summary::json_lines(&rows)?),
        ("results.json", summary.json(&rows)?),
        ("results.md", summary.markdown()),
        ("figure7_map.svg", figures::map(first, &recordings[0])),
        ("figure8_particles.svg", figures::particles(&summary)),
    ] {
        write_file(&options.out.join(name), &text)?;
    }
    Ok(summary.markdown())
}

/// Every (scene, estimator), scene by scene.
fn pairs(scenes: usize, estimators: &[Estimator]) -> Vec<(usize, Estimator)> {
    (0..scenes)
        .flat_map(|scene| estimators.iter().map(move |&estimator| (scene, estimator)))
        .collect()
}

fn write_file(file: &Path, text: &str) -> anyhow::Result<()> {
    let partial = file.with_extension("partial");
    fs::write(&partial, text)
        .and_then(|()| fs::rename(&partial, file))
        .with_context(|| format!("cannot write {}", file.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_go_scene_by_scene_in_the_order_of_the_table() {
        let pairs = pairs(2, estimator::QUICK);
        assert_eq!(pairs.len(), 2 * estimator::QUICK.len());
        for (index, (scene, estimator)) in pairs.into_iter().enumerate() {
            assert_eq!(scene, index / estimator::QUICK.len());
            assert_eq!(estimator, estimator::QUICK[index % estimator::QUICK.len()]);
        }
    }

    #[test]
    fn number_of_seeds_has_a_default_and_limits() {
        let of = |quick, seeds| {
            Options {
                quick,
                seeds,
                out: PathBuf::new(),
            }
            .seed_count()
        };
        assert_eq!(of(true, None).unwrap(), 3);
        assert_eq!(of(false, None).unwrap(), 8);
        assert_eq!(of(true, Some(5)).unwrap(), 5);
        assert!(of(false, Some(0)).unwrap_err().to_string().contains('0'));
        assert!(of(false, Some(1001)).is_err());
    }
}
