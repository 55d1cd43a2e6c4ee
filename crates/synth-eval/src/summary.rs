//! Means over the seeds: the table and the files of figures.

use crate::estimator::{Estimator, odometry_section};
use crate::recording::Recording;
use crate::statistics::{Interval, bootstrap_mean, nees_band};
use crate::trial::Row;
use anyhow::ensure;
use serde::Serialize;
use serde_json::json;
use std::fmt::Write as _;
use std::fs;
use trajectory_eval::Statistics;

/// Means over the seeds of one estimator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Line {
    /// [`Estimator::label`].
    pub(crate) estimator: String,
    /// [`Estimator::family`].
    pub(crate) family: &'static str,
    /// Number of particles.
    pub(crate) particles: u32,
    /// Position RMSE, metres.
    pub(crate) position_rmse_m: Interval,
    /// Final position error, metres.
    pub(crate) final_error_m: Interval,
    /// Heading RMSE, radians.
    pub(crate) heading_rmse_rad: Interval,
    /// Magnitude of the relative scale error.
    pub(crate) scale_error_magnitude: Interval,
    /// Landmark RMSE, metres.
    pub(crate) landmark_rmse_m: Option<Interval>,
    /// Median landmark error, metres.
    pub(crate) landmark_median_m: Option<Interval>,
    /// Landmarks of the final map.
    pub(crate) landmarks: Interval,
    /// Position error the filter claims, metres.
    pub(crate) claimed_position_m: Interval,
    /// Heading error the filter claims, radians.
    pub(crate) claimed_heading_rad: Interval,
    /// NEES, mean over frames and seeds.
    pub(crate) nees: Interval,
    /// Share of the frames whose NEES, averaged over the seeds, lies inside the band.
    pub(crate) nees_inside: f64,
    /// Mean effective number of particles.
    pub(crate) n_eff: Option<Interval>,
    /// Filter steps.
    pub(crate) steps: Interval,
    /// Steps that resampled.
    pub(crate) resamplings: Interval,
    /// Time of a frame after detection, milliseconds of one thread.
    pub(crate) frame_ms: Option<Interval>,
}

/// Two estimators on the same scenes: paired, so that hard scenes do not blur the answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Duel {
    /// Expected to be better.
    pub(crate) better: String,
    /// Expected to be worse.
    pub(crate) worse: String,
    /// Scenes in which the first one's position RMSE is the smaller one.
    pub(crate) wins: usize,
    /// Scenes in all.
    pub(crate) scenes: usize,
    /// Position RMSE of the second less that of the first, metres.
    pub(crate) gain_m: Interval,
}

/// The claims of the paper, as pairs of (better, worse).
const CLAIMS: [(&str, &str); 3] = [
    ("exact 50", "conventional 500"),
    ("paper 50", "conventional 500"),
    ("conventional 500", "conventional 100"),
];

/// The whole comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Summary {
    /// Number of seeds.
    pub(crate) seeds: usize,
    /// Frames of a scene.
    pub(crate) frames: usize,
    /// Detection of a frame, milliseconds of one thread, mean over the scenes.
    pub(crate) detection_ms: f64,
    /// Most memory the whole program held, MiB; none where the system does not tell.
    pub(crate) peak_memory_mib: Option<f64>,
    /// 95 % band of a frame's NEES averaged over the seeds.
    pub(crate) nees_band: (f64, f64),
    /// One line an estimator, in the order given.
    pub(crate) lines: Vec<Line>,
    /// Who beats whom how often.
    pub(crate) duels: Vec<Duel>,
    /// The odometry noise all filters assume, as the configuration states it.
    pub(crate) odometry: String,
}

impl Summary {
    /// Averages rows that stand seed by seed in the order of `estimators`.
    ///
    /// # Errors
    /// Rows in another order, or none.
    pub(crate) fn new(
        estimators: &[Estimator],
        rows: &[&Row],
        recordings: &[Recording],
    ) -> anyhow::Result<Self> {
        let band = nees_band(recordings.len())?;
        let lines = estimators
            .iter()
            .enumerate()
            .map(|(index, estimator)| {
                let of_one: Vec<&Row> = rows
                    .iter()
                    .skip(index)
                    .step_by(estimators.len())
                    .copied()
                    .collect();
                line(*estimator, &of_one, band)
            })
            .collect::<anyhow::Result<_>>()?;
        let spec = recordings[0].scene.spec();
        let detection: Vec<f64> = recordings.iter().map(|r| r.detection_ms).collect();
        let noise = odometry_section(&spec.odometry);
        Ok(Self {
            seeds: recordings.len(),
            frames: spec.frames,
            detection_ms: detection.iter().sum::<f64>() / detection.len() as f64,
            peak_memory_mib: peak_memory_mib(),
            nees_band: band,
            lines,
            duels: CLAIMS
                .iter()
                .filter_map(|(better, worse)| duel(rows, better, worse))
                .collect(),
            odometry: format!(
                "per row {:.4} |v| and {:.4} rad/s, constant scale error {}",
                noise.velocity_noise_ratio, noise.turn_noise_radps, noise.scale_bias
            ),
        })
    }

    /// The table with what is needed to read it.
    pub(crate) fn markdown(&self) -> String {
        let mut text = String::from(
            "| estimator | position RMSE mm | claimed mm | final mm | heading RMSE mrad | \\|scale error\\| % | landmark RMSE mm | landmark median mm | landmarks | NEES | NEES in band | N_eff | resampled | ms/frame |\n\
             |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
        );
        for line in &self.lines {
            let optional =
                |value: &Option<Interval>, factor| value.map_or("".into(), |v| cell(&v, factor));
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.0} % | {} | {} | {} |",
                line.estimator,
                cell(&line.position_rmse_m, 1e3),
                mean(line.claimed_position_m.mean * 1e3),
                cell(&line.final_error_m, 1e3),
                cell(&line.heading_rmse_rad, 1e3),
                cell(&line.scale_error_magnitude, 1e2),
                optional(&line.landmark_rmse_m, 1e3),
                optional(&line.landmark_median_m, 1e3),
                line.landmark_rmse_m
                    .map_or(String::new(), |_| mean(line.landmarks.mean)),
                cell(&line.nees, 1.0),
                100.0 * line.nees_inside,
                line.n_eff.map_or(String::new(), |v| mean(v.mean)),
                if line.particles == 0 {
                    String::new()
                } else {
                    format!(
                        "{} of {}",
                        mean(line.resamplings.mean),
                        mean(line.steps.mean)
                    )
                },
                line.frame_ms.map_or(String::new(), |v| mean(v.mean)),
            );
        }
        text.push('\n');
        for duel in &self.duels {
            let _ = writeln!(
                text,
                "- {} beats {} in {} of {} scenes, by {} mm position RMSE.",
                duel.better,
                duel.worse,
                duel.wins,
                duel.scenes,
                cell(&duel.gain_m, 1e3)
            );
        }
        let (low, high) = self.nees_band;
        let _ = write!(
            text,
            "\nMean over {} wall scenes of {} frames, in brackets the 95 % bootstrap interval. No alignment. \
             Claimed is the root mean square of the standard deviation the filter states. \
             Landmark errors are taken to the surface point the last sighting really saw. \
             NEES has 3 degrees of freedom; averaged over the seeds, 95 % of the frames of a consistent filter lie in {low:.2} to {high:.2}. \
             Odometry noise of all: {}. \
             Times are of one thread after detection, which takes {:.0} ms a frame and is shared.",
            self.seeds, self.frames, self.odometry, self.detection_ms
        );
        if let Some(mib) = self.peak_memory_mib {
            let _ = write!(text, " Most memory of the whole comparison: {mib:.0} MiB.");
        }
        text.push('\n');
        text
    }

    /// Means and rows as one JSON document.
    ///
    /// # Errors
    /// A value that JSON cannot hold.
    pub(crate) fn json(&self, rows: &[&Row]) -> anyhow::Result<String> {
        let value = json!({ "summary": self, "rows": rows });
        Ok(serde_json::to_string_pretty(&value)? + "\n")
    }
}

/// One line a row.
///
/// # Errors
/// A value that JSON cannot hold.
pub(crate) fn json_lines(rows: &[&Row]) -> anyhow::Result<String> {
    let mut text = String::new();
    for row in rows {
        text += &serde_json::to_string(row)?;
        text.push('\n');
    }
    Ok(text)
}

/// Compares two estimators seed by seed; `None` where one did not run.
fn duel(rows: &[&Row], better: &str, worse: &str) -> Option<Duel> {
    let errors = |name: &str| -> Vec<(u64, f64)> {
        rows.iter()
            .filter(|row| row.estimator == name)
            .map(|row| (row.seed, row.position_rmse_m))
            .collect()
    };
    let gains: Vec<f64> = errors(better)
        .iter()
        .zip(errors(worse))
        .filter(|(b, w)| b.0 == w.0)
        .map(|(b, w)| w.1 - b.1)
        .collect();
    Some(Duel {
        better: better.to_owned(),
        worse: worse.to_owned(),
        wins: gains.iter().filter(|gain| **gain > 0.0).count(),
        scenes: gains.len(),
        gain_m: bootstrap_mean(&gains)?,
    })
}

fn line(estimator: Estimator, rows: &[&Row], band: (f64, f64)) -> anyhow::Result<Line> {
    let label = estimator.label();
    ensure!(
        !rows.is_empty() && rows.iter().all(|row| row.estimator == label),
        "rows of {label} are missing or out of order"
    );
    let optional = |of: &dyn Fn(&Row) -> Option<f64>| {
        let values: Vec<f64> = rows.iter().filter_map(|row| of(row)).collect();
        bootstrap_mean(&values)
    };
    let interval = |of: &dyn Fn(&Row) -> f64| {
        optional(&|row| Some(of(row))).ok_or_else(|| anyhow::anyhow!("no row of {label}"))
    };
    Ok(Line {
        family: estimator.family(),
        particles: estimator.particles(),
        position_rmse_m: interval(&|row| row.position_rmse_m)?,
        final_error_m: interval(&|row| row.final_error_m)?,
        heading_rmse_rad: interval(&|row| row.heading_rmse_rad)?,
        scale_error_magnitude: interval(&|row| row.scale_error.abs())?,
        landmark_rmse_m: optional(&|row| row.landmark_rmse_m),
        landmark_median_m: optional(&|row| row.landmark_median_m),
        landmarks: interval(&|row| row.landmarks as f64)?,
        claimed_position_m: interval(&|row| row.claimed_position_m)?,
        claimed_heading_rad: interval(&|row| row.claimed_heading_rad)?,
        nees: interval(&Row::mean_nees)?,
        nees_inside: share_inside(rows, band),
        n_eff: optional(&|row| row.n_eff),
        steps: interval(&|row| row.steps as f64)?,
        resamplings: interval(&|row| row.resamplings as f64)?,
        frame_ms: optional(&|row| row.frame_ms),
        estimator: label,
    })
}

/// Share of the frames whose NEES, averaged over the rows, lies inside the band.
fn share_inside(rows: &[&Row], (low, high): (f64, f64)) -> f64 {
    let frames = rows.iter().map(|row| row.nees.len()).min().unwrap_or(0);
    let inside = (0..frames)
        .filter(|&frame| {
            let values: Vec<f64> = rows.iter().map(|row| row.nees[frame]).collect();
            Statistics::of(&values).is_some_and(|s| (low..=high).contains(&s.mean))
        })
        .count();
    inside as f64 / frames.max(1) as f64
}

/// Mean and interval in the table's unit.
fn cell(value: &Interval, factor: f64) -> String {
    let [m, low, high] = [value.mean, value.low, value.high].map(|v| mean(v * factor));
    format!("{m} [{low}, {high}]")
}

/// About three digits.
fn mean(value: f64) -> String {
    if value.abs() >= 1e5 {
        format!("{value:.1e}")
    } else if value.abs() >= 99.95 {
        format!("{value:.0}")
    } else if value.abs() >= 9.995 {
        format!("{value:.1}")
    } else {
        format!("{value:.2}")
    }
}

/// `VmHWM` of this process.
fn peak_memory_mib() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::QUICK;

    fn row(seed: u64, estimator: Estimator, error: f64) -> Row {
        Row {
            seed,
            estimator: estimator.label(),
            particles: estimator.particles(),
            position_rmse_m: error,
            final_error_m: 0.0,
            heading_rmse_rad: 0.0,
            scale_error: if seed == 1 { -0.1 } else { 0.1 },
            landmark_rmse_m: (estimator.particles() > 0).then_some(0.05),
            landmark_median_m: None,
            landmarks: 3,
            claimed_position_m: 0.01,
            claimed_heading_rad: 0.001,
            nees: vec![error, 3.0],
            steps: 10,
            n_eff: None,
            resamplings: 4,
            matches: 0.0,
            frame_ms: Some(2.0),
        }
    }

    #[test]
    fn a_line_averages_its_rows_and_refuses_those_of_another() {
        let (a, b) = (row(1, QUICK[1], 0.02), row(2, QUICK[1], 0.06));
        let averaged = line(QUICK[1], &[&a, &b], (2.0, 4.0)).unwrap();
        assert!((averaged.position_rmse_m.mean - 0.04).abs() < 1e-15);
        // Opposite scale errors do not cancel.
        assert!((averaged.scale_error_magnitude.mean - 0.1).abs() < 1e-15);
        assert_eq!(averaged.nees_inside, 0.5);
        assert!((averaged.nees.mean - 1.52).abs() < 1e-12);
        assert_eq!(averaged.landmark_median_m, None);
        let message = line(QUICK[2], &[&a, &b], (2.0, 4.0)).unwrap_err();
        assert!(message.to_string().contains("conventional 500"));
    }

    #[test]
    fn a_duel_pairs_the_seeds() {
        let mut rows = Vec::new();
        for (seed, few, many) in [(1, 0.10, 0.04), (2, 0.05, 0.06), (3, 0.30, 0.10)] {
            rows.push(row(seed, QUICK[1], few));
            rows.push(row(seed, QUICK[2], many));
        }
        let rows: Vec<&Row> = rows.iter().collect();
        let duel_of_two = duel(&rows, "conventional 500", "conventional 100").unwrap();
        assert_eq!((duel_of_two.wins, duel_of_two.scenes), (2, 3));
        assert!((duel_of_two.gain_m.mean - 0.25 / 3.0).abs() < 1e-12);
        assert_eq!(duel(&rows, "exact 50", "conventional 100"), None);
    }

    #[test]
    fn json_lines_are_one_object_a_row_in_order() {
        let rows: Vec<Row> = QUICK.iter().map(|&e| row(1, e, 0.1)).collect();
        let text = json_lines(&rows.iter().collect::<Vec<_>>()).unwrap();
        let read: Vec<serde_json::Value> = text
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        assert_eq!(read.len(), QUICK.len());
        for (value, estimator) in read.iter().zip(QUICK) {
            assert_eq!(value["estimator"], estimator.label());
            assert_eq!(
                value["landmark_rmse_m"].is_null(),
                estimator.particles() == 0
            );
        }
    }

    #[test]
    fn numbers_have_about_three_digits() {
        let texts = [0.5, 9.999, 12.345, 99.96, 1234.5, 2.5e6].map(mean);
        assert_eq!(texts, ["0.50", "10.0", "12.3", "100", "1234", "2.5e6"]);
    }
}
