//! Rows: the figures of one estimator on one sequence with one seed, a JSON line each.
//!
//! Equal inputs give equal bytes: no time and nothing of the machine is in a row. Times have lines of their own.

use crate::estimator::{family_of, family_rank};
use crate::limit::Limit;
use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// One line of `results.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// Name of the scene or of the sequence's folder.
    pub(crate) scene: String,
    /// Where the filter's configuration came from.
    pub(crate) settings: String,
    /// Seed of scene and filter; of the filter alone for a recorded sequence.
    pub(crate) seed: u64,
    /// Name of the estimator with its number of particles.
    pub(crate) method: String,
    /// Number of particles; 0 for dead reckoning.
    pub(crate) particles: u32,
    /// Frames.
    pub(crate) frames: usize,
    /// Filter steps after the first frame.
    pub(crate) keyframes: usize,
    /// Root mean square position error without alignment, metres.
    pub(crate) position_rmse_m: f64,
    /// The same with the first heading of the truth freed.
    pub(crate) position_rmse_heading_freed_m: Option<f64>,
    /// Position error of the last frame, metres.
    pub(crate) final_error_m: f64,
    /// Root mean square heading error, radians.
    pub(crate) heading_rmse_rad: f64,
    /// Relative error of the path's scale; positive is too long.
    pub(crate) scale_error: Option<f64>,
    /// Root mean square landmark error, metres; none without a map or without its truth.
    pub(crate) landmark_rmse_m: Option<f64>,
    /// Median landmark error, metres.
    pub(crate) landmark_median_m: Option<f64>,
    /// Landmarks in the final map.
    pub(crate) landmarks: usize,
    /// Root mean square of the position error the filter claims, metres.
    pub(crate) claimed_position_m: f64,
    /// Root mean square of the heading error the filter claims, radians.
    pub(crate) claimed_heading_rad: f64,
    /// Normalised estimation error squared, mean over the frames after the first; 3 is right.
    pub(crate) nees: f64,
    /// Share of the frames after the first whose NEES is below the 95 % quantile of chi-square with 3 degrees of freedom.
    pub(crate) nees_inside: f64,
    /// Share of these frames whose error in x, y and heading is within three claimed standard deviations.
    pub(crate) three_sigma: [f64; 3],
    /// Mean effective number of particles before resampling, over the filter steps.
    pub(crate) n_eff: Option<f64>,
    /// Steps that resampled.
    pub(crate) resamplings: usize,
    /// Mean matches used in a frame.
    pub(crate) matches: f64,
    /// The batch solution over the associations of this run; none where it was not asked for or not found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) batch: Option<Limit>,
}

/// One line of `times.jsonl`: what a row must not hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Times {
    /// As in the [`Row`].
    pub(crate) scene: String,
    /// As in the [`Row`].
    pub(crate) settings: String,
    /// As in the [`Row`].
    pub(crate) seed: u64,
    /// As in the [`Row`].
    pub(crate) method: String,
    /// Detection of a frame, milliseconds of one thread; shared by all estimators.
    pub(crate) detection_ms: f64,
    /// Mean time of a frame after detection, milliseconds of one thread; none for dead reckoning.
    pub(crate) frame_ms: Option<f64>,
}

impl Row {
    /// Order of the files and tables: scene, settings, seed, and the methods in the order of the table.
    pub(crate) fn key(&self) -> (String, String, u64, usize, u32, String) {
        (
            self.scene.clone(),
            self.settings.clone(),
            self.seed,
            family_rank(family_of(&self.method)),
            self.particles,
            self.method.clone(),
        )
    }
}

/// One line a value.
///
/// # Errors
/// A value that JSON cannot hold.
pub(crate) fn json_lines<T: Serialize>(values: &[T]) -> anyhow::Result<String> {
    let mut text = String::new();
    for value in values {
        text += &serde_json::to_string(value)?;
        text.push('\n');
    }
    Ok(text)
}

/// The rows of a file of JSON lines.
///
/// # Errors
/// The file cannot be read, or a line is no row; the message names file and line.
pub(crate) fn read_rows(file: &Path) -> anyhow::Result<Vec<Row>> {
    let text =
        fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    text.lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(index, line)| {
            serde_json::from_str(line)
                .with_context(|| format!("{}:{}: not a result", file.display(), index + 1))
        })
        .collect()
}

/// Sorted rows, each once.
///
/// # Errors
/// Two rows of the same scene, settings, seed and method that differ.
pub(crate) fn merged(rows: Vec<Row>) -> anyhow::Result<Vec<Row>> {
    let mut by_key = BTreeMap::new();
    for row in rows {
        let key = row.key();
        if let Some(old) = by_key.insert(key, row.clone()) {
            ensure!(
                old == row,
                "two different results of {}, {}, seed {}, {}",
                row.scene,
                row.settings,
                row.seed,
                row.method
            );
        }
    }
    Ok(by_key.into_values().collect())
}

#[cfg(test)]
pub(crate) mod examples {
    use super::Row;
    use crate::estimator::Estimator;

    /// A row with this position error.
    pub(crate) fn row(seed: u64, estimator: Estimator, error_m: f64) -> Row {
        Row {
            scene: "wall".into(),
            settings: "exact noise".into(),
            seed,
            method: estimator.label(),
            particles: estimator.particles,
            frames: 38,
            keyframes: 37,
            position_rmse_m: error_m,
            position_rmse_heading_freed_m: Some(error_m / 2.0),
            final_error_m: 0.0,
            heading_rmse_rad: 0.001,
            scale_error: Some(if seed == 1 { -0.1 } else { 0.1 }),
            landmark_rmse_m: (estimator.particles > 0).then_some(0.05),
            landmark_median_m: None,
            landmarks: 3,
            claimed_position_m: 0.01,
            claimed_heading_rad: 0.001,
            nees: 3.0,
            nees_inside: 0.95,
            three_sigma: [1.0, 0.9, 0.8],
            n_eff: None,
            resamplings: 4,
            matches: 0.0,
            batch: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::examples::row;
    use super::*;
    use crate::estimator::QUICK;

    #[test]
    fn rows_survive_their_file_and_shards_merge_to_the_whole() {
        let rows: Vec<Row> = (1..=3)
            .flat_map(|seed| QUICK.iter().map(move |&e| row(seed, e, 0.1 / 3.0)))
            .collect();
        let text = json_lines(&rows).unwrap();
        let folder = std::env::temp_dir().join(format!("synth-eval-rows-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let file = folder.join("rows.jsonl");
        fs::write(&file, format!("{text}\n")).unwrap();
        let read = read_rows(&file).unwrap();
        fs::write(&file, "{\"scene\": 3}\n").unwrap();
        let message = format!("{:#}", read_rows(&file).unwrap_err());
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(read, rows);
        assert!(message.contains("rows.jsonl:1: not a result"), "{message}");

        // Two shards, the second first, one row twice.
        let mut shards: Vec<Row> = rows[7..].to_vec();
        shards.extend_from_slice(&rows[..8]);
        assert_eq!(merged(shards).unwrap(), rows);
        let mut torn = rows.clone();
        torn.push(Row {
            nees: 4.0,
            ..rows[3].clone()
        });
        let message = merged(torn).unwrap_err().to_string();
        assert!(message.contains("seed 1, paper 50"), "{message}");
    }
}
