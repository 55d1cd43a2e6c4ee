//! Errors against the number of particles, in the manner of the paper's Fig. 8.

use super::grid::{PANEL_WIDTH, grid};
use crate::estimator::family_of;
use crate::row::Row;
use crate::statistics::{Interval, bootstrap_mean};
use slam_report::{Colour, Layer, Plot};

/// Curves in the order of drawing.
const CURVES: [(&str, Colour); 3] = [
    ("conventional", Colour::Orange),
    ("paper", Colour::Purple),
    ("exact", Colour::Blue),
];

/// Position, heading and landmark errors over the logarithm of the number of particles, with bootstrap bands over the seeds.
pub(super) fn particles(rows: &[Row]) -> String {
    let panels = [
        curves(rows, "Position error", "position RMSE (mm)", |row| {
            Some(row.position_rmse_m * 1e3)
        }),
        curves(
            rows,
            "Landmark error",
            "median landmark error (mm)",
            |row| row.landmark_median_m.map(|error| error * 1e3),
        ),
        curves(rows, "Heading error", "heading RMSE (mrad)", |row| {
            Some(row.heading_rmse_rad * 1e3)
        }),
        curves(
            rows,
            "Honesty of the covariance",
            "frames in the 95 % NEES band (%)",
            |row| Some(row.nees_inside * 1e2),
        ),
    ];
    grid(
        &panels.map(|plot| plot.to_svg_file()),
        "Errors against the number of particles",
    )
}

fn curves(rows: &[Row], title: &str, y_label: &str, value: impl Fn(&Row) -> Option<f64>) -> Plot {
    let mut plot = Plot::new(title, "log10 of the number of particles", y_label);
    plot.width = PANEL_WIDTH;
    plot.height = 400.0;
    let (mut right, mut top) = (1.0_f64, 0.0_f64);
    for (family, colour) in CURVES {
        let curve = curve(rows, family, &value);
        for (x, interval) in &curve {
            right = right.max(*x);
            top = top.max(interval.high);
        }
        plot.layers.push(Layer::Band {
            label: String::new(),
            colour,
            points: curve.iter().map(|(x, v)| (*x, v.low, v.high)).collect(),
        });
        let means: Vec<_> = curve.iter().map(|(x, v)| (*x, v.mean)).collect();
        plot.layers.push(Layer::line(family, colour, means.clone()));
        plot.layers.push(Layer::Dots {
            label: String::new(),
            colour,
            radius: 4.0,
            points: means,
        });
    }
    let reckoned: Vec<f64> = rows
        .iter()
        .filter(|row| row.particles == 0)
        .filter_map(&value)
        .collect();
    if let Some(reckoned) = bootstrap_mean(&reckoned) {
        top = top.max(reckoned.mean);
        plot.layers.push(Layer::Level {
            label: "dead reckoning".into(),
            colour: Colour::Grey,
            y: reckoned.mean,
        });
    }
    plot.x_range = Some((0.95, right + 0.05));
    plot.y_range = Some((0.0, 1.05 * top.max(1.0)));
    plot
}

/// Mean and interval of a family at every number of particles, over log10 of that number.
fn curve(rows: &[Row], family: &str, value: &impl Fn(&Row) -> Option<f64>) -> Vec<(f64, Interval)> {
    let mut numbers: Vec<u32> = rows.iter().map(|row| row.particles).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let of = |particles: u32| {
        let values: Vec<f64> = rows
            .iter()
            .filter(|row| row.particles == particles && family_of(&row.method) == family)
            .filter_map(value)
            .collect();
        Some((f64::from(particles).log10(), bootstrap_mean(&values)?))
    };
    numbers.into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::QUICK;
    use crate::row::examples::row;

    #[test]
    fn a_curve_holds_its_family_alone() {
        let rows = [
            row(1, QUICK[1], 0.2),
            row(2, QUICK[1], 0.4),
            row(1, QUICK[2], 0.1),
            row(1, QUICK[4], 0.05),
        ];
        let found = curve(&rows, "conventional", &|row| Some(row.position_rmse_m));
        let points: Vec<(f64, f64)> = found.iter().map(|(x, v)| (*x, v.mean)).collect();
        assert_eq!(points.len(), 2);
        assert_eq!(points[0].0, 2.0);
        assert!((points[0].1 - 0.3).abs() < 1e-12 && (points[1].1 - 0.1).abs() < 1e-12);
        assert!(particles(&rows).contains("exact"));
    }
}
