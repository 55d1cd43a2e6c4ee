//! Losses against an earlier study.
//!
//! Rows of the same scene, settings, seed and method are paired, so that a hard seed does not blur the answer. For each
//! estimator the differences new - old of every measure are averaged, with the 95 % bootstrap interval over the seeds:
//! worse is what lies above zero with its whole interval. Fewer than three pairs are not judged.

use crate::row::Row;
use crate::statistics::{Interval, bootstrap_mean};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Least number of pairs a judgement needs.
const LEAST_PAIRS: usize = 3;

/// A measure of which less is better.
struct Measure {
    name: &'static str,
    unit: &'static str,
    factor: f64,
    of: fn(&Row) -> Option<f64>,
}

const MEASURES: &[Measure] = &[
    Measure {
        name: "position RMSE",
        unit: "mm",
        factor: 1e3,
        of: |row| Some(row.position_rmse_m),
    },
    Measure {
        name: "position RMSE, heading freed",
        unit: "mm",
        factor: 1e3,
        of: |row| row.position_rmse_heading_freed_m,
    },
    Measure {
        name: "heading RMSE",
        unit: "mrad",
        factor: 1e3,
        of: |row| Some(row.heading_rmse_rad),
    },
    Measure {
        name: "median landmark error",
        unit: "mm",
        factor: 1e3,
        of: |row| row.landmark_median_m,
    },
    Measure {
        name: "frames outside the NEES band",
        unit: "%",
        factor: 1e2,
        of: |row| Some(1.0 - row.nees_inside),
    },
];

/// The outcome of a comparison.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Regression {
    /// A list in Markdown of what got worse, what got better and what could not be judged.
    pub(crate) text: String,
    /// How many measures got worse.
    pub(crate) worse: usize,
}

/// Compares the rows of two studies.
pub(crate) fn compare(old: &[Row], new: &[Row]) -> Regression {
    let mut pairs: BTreeMap<_, Vec<(&Row, &Row)>> = BTreeMap::new();
    let by_key: BTreeMap<_, &Row> = old.iter().map(|row| (row.key(), row)).collect();
    for row in new {
        if let Some(before) = by_key.get(&row.key()) {
            let (scene, settings, _, rank, particles, method) = row.key();
            pairs
                .entry((scene, settings, rank, particles, method))
                .or_default()
                .push((before, row));
        }
    }
    let (mut worse, mut better, mut unjudged) = (Vec::new(), Vec::new(), Vec::new());
    for ((scene, settings, .., method), pairs) in &pairs {
        let title = format!("{scene} ({settings}), {method}");
        if pairs.len() < LEAST_PAIRS {
            unjudged.push(format!("{title}: {} pairs", pairs.len()));
            continue;
        }
        for measure in MEASURES {
            let of = |row: &Row| (measure.of)(row).map(|value| value * measure.factor);
            let changes: Vec<f64> = pairs
                .iter()
                .filter_map(|(old, new)| Some(of(new)? - of(old)?))
                .collect();
            let before: Vec<f64> = pairs.iter().filter_map(|(old, _)| of(old)).collect();
            if changes.len() < LEAST_PAIRS {
                continue;
            }
            let (Some(change), Some(before)) = (bootstrap_mean(&changes), bootstrap_mean(&before))
            else {
                continue;
            };
            let line = sentence(&title, measure, &before, &change, changes.len());
            if change.low > 0.0 {
                worse.push(line);
            } else if change.high < 0.0 {
                better.push(line);
            }
        }
    }
    let mut text = String::new();
    for (title, lines) in [
        ("Worse", &worse),
        ("Better", &better),
        ("Too few pairs to judge", &unjudged),
    ] {
        if !lines.is_empty() {
            let _ = writeln!(text, "{title}:");
            for line in lines {
                let _ = writeln!(text, "- {line}");
            }
        }
    }
    if pairs.is_empty() {
        text.push_str("No result of the earlier study has a counterpart.\n");
    } else if worse.is_empty() {
        text.push_str("Nothing got worse beyond its interval.\n");
    }
    Regression {
        text,
        worse: worse.len(),
    }
}

fn sentence(
    title: &str,
    measure: &Measure,
    before: &Interval,
    change: &Interval,
    pairs: usize,
) -> String {
    format!(
        "{title}: {} {:.2} to {:.2} {}, change {:+.2} [{:+.2}, {:+.2}] over {pairs} pairs",
        measure.name,
        before.mean,
        before.mean + change.mean,
        measure.unit,
        change.mean,
        change.low,
        change.high
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::QUICK;
    use crate::row::examples::row;

    fn study(errors: &[f64]) -> Vec<Row> {
        (1..)
            .zip(errors)
            .map(|(seed, &error)| row(seed, QUICK[4], error))
            .collect()
    }

    #[test]
    fn a_small_loss_on_every_seed_is_found_under_a_large_spread_of_the_seeds() {
        let old = study(&[0.010, 0.100, 0.050, 0.020, 0.070]);
        let new = study(&[0.011, 0.102, 0.051, 0.021, 0.072]);
        let found = compare(&old, &new);
        // Position RMSE, and the same with the heading freed.
        assert_eq!(found.worse, 2, "{}", found.text);
        assert!(found.text.contains(
            "wall (exact noise), exact 50: position RMSE 50.00 to 51.40 mm, change +1.40"
        ));
        let back = compare(&new, &old);
        assert_eq!(back.worse, 0);
        assert!(back.text.starts_with("Better:\n") && back.text.contains("Nothing got worse"));
    }

    #[test]
    fn equal_studies_and_mixed_changes_are_no_loss() {
        let old = study(&[0.010, 0.100, 0.050, 0.020, 0.070]);
        assert_eq!(compare(&old, &old).worse, 0);
        let new = study(&[0.012, 0.080, 0.055, 0.018, 0.069]);
        assert_eq!(compare(&old, &new).worse, 0);
    }

    #[test]
    fn two_pairs_are_not_judged_and_strangers_are_told() {
        let found = compare(&study(&[0.01, 0.01]), &study(&[0.9, 0.9]));
        assert_eq!(found.worse, 0);
        assert!(found.text.contains("exact 50: 2 pairs"), "{}", found.text);
        assert!(compare(&[], &study(&[0.1])).text.contains("counterpart"));
    }
}
