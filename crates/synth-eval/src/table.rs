//! Means over the seeds as a table in Markdown, one for each scene.

use crate::row::Row;
use crate::statistics::{Interval, bootstrap_mean};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The claims of the paper, as pairs of (better, worse).
const CLAIMS: [(&str, &str); 4] = [
    ("exact 50", "conventional 500"),
    ("exact 10", "conventional 500"),
    ("paper 50", "conventional 500"),
    ("conventional 500", "conventional 100"),
];

/// One column.
struct Column {
    title: &'static str,
    cell: fn(&[&Row]) -> String,
}

const COLUMNS: &[Column] = &[
    Column {
        title: "estimator",
        cell: |rows| rows[0].method.clone(),
    },
    Column {
        title: "position RMSE mm",
        cell: |rows| full(rows, 1e3, |row| Some(row.position_rmse_m)),
    },
    Column {
        title: "heading freed mm",
        cell: |rows| short(rows, 1e3, |row| row.position_rmse_heading_freed_m),
    },
    Column {
        title: "claimed mm",
        cell: |rows| short(rows, 1e3, |row| Some(row.claimed_position_m)),
    },
    Column {
        title: "batch mm",
        cell: |rows| short(rows, 1e3, |row| Some(row.batch?.position_rmse_m)),
    },
    Column {
        title: "of the batch",
        cell: |rows| {
            ratio(rows, |row| {
                Some((row.position_rmse_m, row.batch?.position_rmse_m))
            })
        },
    },
    Column {
        title: "freed, of the batch",
        cell: |rows| {
            ratio(rows, |row| {
                let freed = row.position_rmse_heading_freed_m?;
                Some((freed, row.batch?.position_rmse_heading_freed_m?))
            })
        },
    },
    Column {
        title: "heading, of the batch",
        cell: |rows| {
            ratio(rows, |row| {
                Some((row.heading_rmse_rad, row.batch?.heading_rmse_rad))
            })
        },
    },
    Column {
        title: "final mm",
        cell: |rows| short(rows, 1e3, |row| Some(row.final_error_m)),
    },
    Column {
        title: "heading RMSE mrad",
        cell: |rows| full(rows, 1e3, |row| Some(row.heading_rmse_rad)),
    },
    Column {
        title: "claimed mrad",
        cell: |rows| short(rows, 1e3, |row| Some(row.claimed_heading_rad)),
    },
    Column {
        title: "\\|scale error\\| %",
        cell: |rows| short(rows, 1e2, |row| row.scale_error.map(f64::abs)),
    },
    Column {
        title: "landmark median mm",
        cell: |rows| short(rows, 1e3, |row| row.landmark_median_m),
    },
    Column {
        title: "landmark RMSE mm",
        cell: |rows| short(rows, 1e3, |row| row.landmark_rmse_m),
    },
    Column {
        title: "landmarks",
        cell: |rows| of_filter(rows, |row| row.landmarks as f64),
    },
    Column {
        title: "NEES",
        cell: |rows| short(rows, 1.0, |row| Some(row.nees)),
    },
    Column {
        title: "in band %",
        cell: |rows| short(rows, 1e2, |row| Some(row.nees_inside)),
    },
    Column {
        title: "3 sigma x, y, heading %",
        cell: |rows| {
            let share = |axis: usize| {
                let values: Vec<f64> = rows.iter().map(|row| row.three_sigma[axis]).collect();
                bootstrap_mean(&values).map_or(String::new(), |v| format!("{:.0}", v.mean * 1e2))
            };
            [share(0), share(1), share(2)].join(", ")
        },
    },
    Column {
        title: "N_eff",
        cell: |rows| short(rows, 1.0, |row| row.n_eff),
    },
    Column {
        title: "keyframes",
        cell: |rows| of_filter(rows, |row| row.keyframes as f64),
    },
    Column {
        title: "resampled",
        cell: |rows| of_filter(rows, |row| row.resamplings as f64),
    },
    Column {
        title: "matches",
        cell: |rows| of_filter(rows, |row| row.matches),
    },
];

/// Tables of sorted rows, one for each scene and settings, with what is needed to read them.
pub(crate) fn markdown(rows: &[Row]) -> String {
    let mut scenes: BTreeMap<(&str, &str), Vec<&Row>> = BTreeMap::new();
    for row in rows {
        scenes
            .entry((&row.scene, &row.settings))
            .or_default()
            .push(row);
    }
    let mut text = String::new();
    for ((scene, settings), rows) in scenes {
        section(&mut text, scene, settings, &rows);
    }
    text.push_str(
        "Mean over the seeds; after the sign the standard deviation from seed to seed, in brackets the 95 % bootstrap \
         interval of the mean. No alignment, except where the heading is freed (one turn about the start). Claimed is the \
         root mean square of the standard deviation the filter states. Landmark errors are taken to the surface point the \
         last sighting really saw. NEES has 3 degrees of freedom and is the mean over the frames; a frame is in the band \
         when its NEES is below 7.81, which 95 % of an honest filter's frames are. The batch is the maximum a posteriori \
         solution over the very associations of the same run; ratios are of the means over the seeds.\n",
    );
    text
}

fn section(text: &mut String, scene: &str, settings: &str, rows: &[&Row]) {
    let mut lines: BTreeMap<_, Vec<&Row>> = BTreeMap::new();
    let (mut seeds, mut frames) = (Vec::new(), Vec::new());
    for row in rows {
        let (_, _, _, rank, particles, method) = row.key();
        lines
            .entry((rank, particles, method))
            .or_default()
            .push(row);
        seeds.push(row.seed);
        frames.push(row.frames);
    }
    seeds.sort_unstable();
    seeds.dedup();
    let most = frames.iter().max().copied().unwrap_or(0);
    let _ = writeln!(
        text,
        "## {scene}, {settings}: {} seeds, {most} frames\n",
        seeds.len()
    );
    let titles: Vec<&str> = COLUMNS.iter().map(|column| column.title).collect();
    let _ = writeln!(text, "| {} |", titles.join(" | "));
    let _ = writeln!(text, "|---|{}", "--:|".repeat(COLUMNS.len() - 1));
    for rows in lines.values() {
        let cells: Vec<String> = COLUMNS.iter().map(|column| (column.cell)(rows)).collect();
        let _ = writeln!(text, "| {} |", cells.join(" | "));
    }
    text.push('\n');
    for (better, worse) in CLAIMS {
        if let Some(line) = duel(rows, better, worse) {
            let _ = writeln!(text, "- {line}");
        }
    }
    text.push('\n');
}

/// Two estimators on the same seeds; `None` where one did not run.
fn duel(rows: &[&Row], better: &str, worse: &str) -> Option<String> {
    let errors = |name: &str| -> BTreeMap<u64, f64> {
        rows.iter()
            .filter(|row| row.method == name)
            .map(|row| (row.seed, row.position_rmse_m))
            .collect()
    };
    let worse_errors = errors(worse);
    let gains: Vec<f64> = errors(better)
        .iter()
        .filter_map(|(seed, error)| Some(worse_errors.get(seed)? - error))
        .collect();
    let gain = bootstrap_mean(&gains)?;
    Some(format!(
        "{better} beats {worse} on {} of {} seeds, by {} mm position RMSE.",
        gains.iter().filter(|gain| **gain > 0.0).count(),
        gains.len(),
        bracketed(&gain, 1e3)
    ))
}

fn mean_of(rows: &[&Row], of: impl Fn(&Row) -> Option<f64>) -> Option<Interval> {
    let values: Vec<f64> = rows.iter().filter_map(|row| of(row)).collect();
    bootstrap_mean(&values)
}

/// Mean, spread and interval.
fn full(rows: &[&Row], factor: f64, of: impl Fn(&Row) -> Option<f64>) -> String {
    mean_of(rows, of).map_or(String::new(), |v| {
        let [mean, spread, low, high] =
            [v.mean, v.spread, v.low, v.high].map(|value| number(value * factor));
        format!("{mean} ± {spread} [{low}, {high}]")
    })
}

/// Mean alone.
fn short(rows: &[&Row], factor: f64, of: impl Fn(&Row) -> Option<f64>) -> String {
    mean_of(rows, of).map_or(String::new(), |v| number(v.mean * factor))
}

/// The mean of a measure as a multiple of the mean of the batch, over the rows that have one.
fn ratio(rows: &[&Row], of: impl Fn(&Row) -> Option<(f64, f64)>) -> String {
    let (mut ours, mut batch) = (0.0, 0.0);
    for (error, limit) in rows.iter().filter_map(|row| of(row)) {
        ours += error;
        batch += limit;
    }
    if batch > 0.0 {
        format!("{:.2} x", ours / batch)
    } else {
        String::new()
    }
}

/// Mean alone; nothing for dead reckoning.
fn of_filter(rows: &[&Row], of: impl Fn(&Row) -> f64) -> String {
    short(rows, 1.0, |row| (row.particles > 0).then(|| of(row)))
}

/// Mean and interval.
fn bracketed(value: &Interval, factor: f64) -> String {
    let [mean, low, high] = [value.mean, value.low, value.high].map(|v| number(v * factor));
    format!("{mean} [{low}, {high}]")
}

/// About three digits.
fn number(value: f64) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::QUICK;
    use crate::limit::Limit;
    use crate::row::examples::row;

    #[test]
    fn a_line_averages_its_rows_and_a_scene_has_its_own_table() {
        let mut rows = vec![row(1, QUICK[1], 0.02), row(2, QUICK[1], 0.06)];
        rows.push(Row {
            scene: "room".into(),
            ..row(1, QUICK[0], 0.5)
        });
        let text = markdown(&rows);
        assert!(text.contains("## wall, exact noise: 2 seeds, 38 frames"));
        assert!(text.contains("## room, exact noise: 1 seeds"));
        // Opposite scale errors do not cancel: 10 %.
        assert!(
            text.contains(
                "| conventional 100 | 40.0 ± 28.3 [20.0, 60.0] | 20.0 | 10.0 |  |  |  |  | 0.00 |"
            ),
            "{text}"
        );
        assert!(text.contains("| 10.0 |  | 50.0 | 3.00 | 3.00 | 95.0 | 100, 90, 80 |"));
        // Dead reckoning has neither landmarks nor matches.
        assert!(text.contains("| dead reckoning | 500 ± 0.00 [500, 500] |"));
    }

    #[test]
    fn the_batch_is_set_against_the_rows_that_have_one() {
        let with = Row {
            batch: Some(Limit {
                position_rmse_m: 0.02,
                position_rmse_heading_freed_m: None,
                heading_rmse_rad: 0.0005,
                nees: 3.0,
                nees_inside: 1.0,
            }),
            ..row(1, QUICK[1], 0.03)
        };
        let text = markdown(&[with, row(2, QUICK[1], 0.5)]);
        assert!(text.contains("| 20.0 | 1.50 x |  | 2.00 x |"), "{text}");
    }

    #[test]
    fn a_duel_pairs_the_seeds() {
        let mut rows = Vec::new();
        for (seed, few, many) in [(1, 0.10, 0.04), (2, 0.05, 0.06), (3, 0.30, 0.10)] {
            rows.push(row(seed, QUICK[1], few));
            rows.push(row(seed, QUICK[2], many));
        }
        // A seed of one alone has no partner.
        rows.push(row(4, QUICK[1], 0.9));
        let rows: Vec<&Row> = rows.iter().collect();
        let line = duel(&rows, "conventional 500", "conventional 100").unwrap();
        assert!(line.contains("on 2 of 3 seeds, by 83.3 ["), "{line}");
        assert_eq!(duel(&rows, "exact 50", "conventional 100"), None);
    }

    #[test]
    fn numbers_have_about_three_digits() {
        let texts = [0.5, 9.999, 12.345, 99.96, 1234.5, 2.5e6].map(number);
        assert_eq!(texts, ["0.50", "10.0", "12.3", "100", "1234", "2.5e6"]);
    }
}
