//! A study: every estimator on every recording with every seed, in files.
//!
//! The output folder gets
//!
//! - `results.jsonl`: one line per (scene, settings, seed, method), sorted, the same bytes on every machine and for any
//!   number of threads;
//! - `times.jsonl`: the times of the same trials;
//! - `table.md`: the table that is printed.
//!
//! Shards of a study are merged from their `results.jsonl` with [`merge`]: the outcome is that of the whole study.

use crate::Options;
use crate::jobs;
use crate::plan::{Batch, Plan};
use crate::progress::Progress;
use crate::recording::Recording;
use crate::regression::compare;
use crate::row::{Row, Times, json_lines, merged, read_rows};
use crate::settings::Settings;
use crate::table;
use crate::trial;
use anyhow::{Context, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The outcome of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// The table, and what changed against an earlier study, as Markdown.
    pub text: String,
    /// How many measures got worse beyond their interval; 0 without an earlier study.
    pub worse: usize,
}

/// Runs a study, writes its files and returns the table.
/// `progress` is told of every finished trial, from several threads.
///
/// # Errors
/// Options that make no study, a filter that fails, a folder that cannot be read or written.
pub fn run(options: &Options, progress: &(dyn Fn(&str) + Sync)) -> anyhow::Result<Outcome> {
    let plan = Plan::new(options)?;
    let earlier = earlier(options.compare.as_deref())?;
    create(&options.out)?;
    let (rows, times) = trials(&plan, progress)?;
    write_file(&options.out.join("times.jsonl"), &json_lines(&times)?)?;
    conclude(rows, earlier.as_deref(), &options.out)
}

/// Merges the results of shards, writes `results.jsonl` and `table.md` into `out` and returns the table.
///
/// # Errors
/// A file that holds no results, two different results of the same trial, a folder that cannot be written.
pub fn merge(
    files: &[PathBuf],
    earlier_file: Option<&Path>,
    out: &Path,
) -> anyhow::Result<Outcome> {
    ensure!(!files.is_empty(), "merge needs files of results");
    let earlier = earlier(earlier_file)?;
    let mut rows = Vec::new();
    for file in files {
        rows.extend(read_rows(file)?);
    }
    create(out)?;
    conclude(rows, earlier.as_deref(), out)
}

fn earlier(file: Option<&Path>) -> anyhow::Result<Option<Vec<Row>>> {
    file.map(read_rows).transpose()
}

fn conclude(rows: Vec<Row>, earlier: Option<&[Row]>, out: &Path) -> anyhow::Result<Outcome> {
    let rows = merged(rows)?;
    let mut text = table::markdown(&rows);
    write_file(&out.join("results.jsonl"), &json_lines(&rows)?)?;
    write_file(&out.join("table.md"), &text)?;
    let mut worse = 0;
    if let Some(earlier) = earlier {
        let regression = compare(earlier, &rows);
        text.push_str("\n## Against the earlier study\n\n");
        text.push_str(&regression.text);
        worse = regression.worse;
    }
    Ok(Outcome { text, worse })
}

/// One trial of the plan: batch, seed, estimator.
type Job = (usize, u64, usize);

fn trials(plan: &Plan, tell: &(dyn Fn(&str) + Sync)) -> anyhow::Result<(Vec<Row>, Vec<Times>)> {
    let mut jobs_in_order: Vec<Job> = Vec::new();
    for (index, batch) in plan.batches.iter().enumerate() {
        for &seed in &batch.seeds {
            jobs_in_order
                .extend((0..plan.estimators.len()).map(|estimator| (index, seed, estimator)));
        }
    }
    let cost = |&(batch, _, estimator): &Job| {
        // Dead reckoning takes no time, but is often the first to ask for the recording.
        let particles = match plan.estimators[estimator].particles {
            0 => 5.0,
            particles => 20.0 + f64::from(particles),
        };
        particles * plan.batches[batch].source.frames() as f64
    };
    let shelf = Shelf::new(&plan.batches, plan.estimators.len(), &plan.settings);
    let progress = Progress::new(jobs_in_order.iter().map(cost), tell);
    // One after the other, so that few recordings are held at a time.
    let trials = jobs::run(
        &jobs_in_order,
        |_| 1,
        |job| {
            let &(batch, seed, estimator) = job;
            let trial = shelf.lend(batch, |recording| {
                trial::run(
                    plan.estimators[estimator],
                    recording,
                    seed,
                    &plan.settings,
                    plan.batch,
                )
            })?;
            progress.finished(
                cost(job),
                &format!(
                    "{}, seed {seed}: {}, {:.1} mm",
                    trial.row.scene,
                    trial.row.method,
                    trial.row.position_rmse_m * 1e3
                ),
            );
            Ok((trial.row, trial.times))
        },
    )?;
    Ok(trials.into_iter().unzip())
}

/// Recordings that are made when they are first asked for and dropped after their last use.
struct Shelf<'a> {
    batches: &'a [Batch],
    settings: &'a Settings,
    places: Vec<(Mutex<Option<Arc<Recording>>>, AtomicUsize)>,
}

impl<'a> Shelf<'a> {
    fn new(batches: &'a [Batch], estimators: usize, settings: &'a Settings) -> Self {
        let uses = |batch: &Batch| AtomicUsize::new(batch.seeds.len() * estimators);
        Self {
            batches,
            settings,
            places: batches
                .iter()
                .map(|batch| (Mutex::default(), uses(batch)))
                .collect(),
        }
    }

    fn lend<R>(
        &self,
        index: usize,
        job: impl FnOnce(&Recording) -> anyhow::Result<R>,
    ) -> anyhow::Result<R> {
        let (place, uses) = &self.places[index];
        let recording = {
            let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
            match &*place {
                Some(recording) => Arc::clone(recording),
                None => {
                    let made = Arc::new(self.batches[index].source.record(self.settings)?);
                    *place = Some(Arc::clone(&made));
                    made
                }
            }
        };
        let result = job(&recording);
        if uses.fetch_sub(1, Ordering::Relaxed) == 1 {
            *place.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
        result
    }
}

fn create(folder: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))
}

/// Writes a file under a temporary name and renames it when it is complete.
pub(crate) fn write_file(file: &Path, text: &str) -> anyhow::Result<()> {
    let partial = file.with_extension("partial");
    fs::write(&partial, text)
        .and_then(|()| fs::rename(&partial, file))
        .with_context(|| format!("cannot write {}", file.display()))
}
