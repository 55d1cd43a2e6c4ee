//! The simulations of Kim, Sakthivel and Chung, "Unscented FastSLAM", IEEE T-RO 24(4), 2008, section V:
//! FastSLAM 1.0, FastSLAM 2.0 and the unscented filter from the same traits, on the same data.
//!
//! `cargo run --release -p range-bearing-slam --example kim2008 [-- --quick] [-- --out FOLDER]`
//!
//! The example prints four tables; with `--out` it writes them as CSV too, and the NEES of every scan. The
//! paper gives the noise of its controls for the third setting only, and no maps. That noise is used
//! throughout, and every run has a map of its own.

#[path = "support/align.rs"]
mod align;
#[path = "support/arguments.rs"]
mod arguments;
#[path = "support/filters.rs"]
mod filters;
#[path = "support/fold.rs"]
mod fold;
#[path = "support/motion.rs"]
mod motion;
#[path = "support/output.rs"]
mod output;
#[path = "support/published.rs"]
mod published;
#[path = "support/score.rs"]
mod score;
#[path = "support/simulation.rs"]
mod simulation;

use arguments::Arguments;
use filters::{Filter, Trial};
use output::{Output, head, plus_minus};
use score::{NEES_BAND, Score, mean_and_error};
use simulation::{RECTANGLE, Settings, World, simulate};
use std::error::Error;
use std::fmt::Write;

/// Corners of the path of the noise sweep, 25 x 20 m.
const SMALL_LOOP: [[f64; 2]; 4] = [[25.0, 0.0], [25.0, 20.0], [0.0, 20.0], [0.0, 0.0]];
/// Corners of a path of about 500 m in 100 x 100 m.
const LARGE_LOOP: [[f64; 2]; 8] = [
    [100.0, 0.0],
    [100.0, 100.0],
    [70.0, 100.0],
    [70.0, 40.0],
    [30.0, 40.0],
    [30.0, 100.0],
    [0.0, 100.0],
    [0.0, 0.0],
];
/// Largest number of scans in a block: one second.
const LONGEST_BLOCK: usize = 5;

/// One line of a table: a filter and the form of its scans.
#[derive(Clone, Copy)]
struct Entry {
    name: &'static str,
    filter: Filter,
    /// Whether scans are folded.
    folded: bool,
}

const fn entry(name: &'static str, filter: Filter, folded: bool) -> Entry {
    Entry {
        name,
        filter,
        folded,
    }
}

const ENTRIES: [Entry; 10] = [
    entry("FastSLAM 1.0", Filter::FastSlam1, false),
    entry(
        "FastSLAM 2.0, published weights",
        Filter::FastSlam2Published,
        false,
    ),
    entry("FastSLAM 2.0, exact weights", Filter::FastSlam2, false),
    entry(
        "FastSLAM 2.0 with unscented landmarks",
        Filter::UnscentedLandmarks,
        false,
    ),
    entry(
        "unscented proposal, EKF landmarks",
        Filter::UnscentedPoses,
        false,
    ),
    entry("unscented", Filter::Unscented, false),
    entry("unscented, folded", Filter::Unscented, true),
    entry(
        "FastSLAM 2.0, exact weights, folded",
        Filter::FastSlam2,
        true,
    ),
    entry("unscented, moved after resampling", Filter::Moved, false),
    entry("unscented, folded and moved", Filter::Moved, true),
];
/// Positions in [`ENTRIES`].
const PUBLISHED: usize = 1;
const EXACT: usize = 2;
const EACH_SCAN: usize = 5;
const FOLDED: usize = 6;

/// A path with its landmarks and the noise.
struct Setting<'a> {
    path: &'a [[f64; 2]],
    /// Metres of path for a landmark, and its largest distance from the path.
    landmarks: (f64, f64),
    settings: Settings,
}

fn setting(path: &[[f64; 2]], range_deviation: f64, bearing_degrees: f64) -> Setting<'_> {
    Setting {
        path,
        landmarks: (6.0, 10.0),
        settings: Settings::slow(20.0, range_deviation, bearing_degrees),
    }
}

/// The scores of the same runs for every entry and every number of particles.
fn scores(
    setting: &Setting<'_>,
    entry: Entry,
    particles: usize,
    runs: u64,
) -> Result<Vec<Score>, Box<dyn Error>> {
    let (spacing, reach) = setting.landmarks;
    (0..runs)
        .map(|seed| {
            let world = World::along(setting.path, spacing, reach, seed);
            let (_, scans) = simulate(&world, &setting.settings, seed);
            let block = if entry.folded {
                fold::block_size(&setting.settings, LONGEST_BLOCK)
            } else {
                1
            };
            let scans = fold::fold_scans(&scans, block);
            let trial = Trial {
                filter: entry.filter,
                particles,
                scans: &scans,
                settings: &setting.settings,
                block,
                seed,
            };
            trial.score()
        })
        .collect()
}

fn column(scores: &[Score], value: impl Fn(&Score) -> f64) -> (f64, f64) {
    mean_and_error(&scores.iter().map(value).collect::<Vec<_>>())
}

/// Table (1): 3 particles, 0.2 m and 8 degrees.
fn rectangle(output: &Output, runs: u64) -> Result<(), Box<dyn Error>> {
    let setting = setting(&RECTANGLE, 0.2, 8.0);
    let mut rows = vec![head(&[
        "filter",
        "MSE m^2",
        "MSE aligned m^2",
        "RMSE aligned m",
        "at the end m",
        "aligned MSE of FastSLAM 2.0 over this",
    ])];
    let mut reference = f64::NAN;
    let all: Vec<_> = ENTRIES
        .iter()
        .map(|&entry| scores(&setting, entry, 3, runs))
        .collect::<Result<_, _>>()?;
    for (index, scores) in all.iter().enumerate() {
        let aligned = column(scores, |score| score.aligned_mse);
        if index == EXACT {
            reference = aligned.0;
        }
        rows.push(vec![
            ENTRIES[index].name.to_owned(),
            plus_minus(column(scores, |score| score.mse)),
            plus_minus(aligned),
            plus_minus(column(scores, |score| score.aligned_mse.sqrt())),
            plus_minus(column(scores, |score| score.last)),
            String::new(),
        ]);
    }
    for (row, scores) in rows[1..].iter_mut().zip(&all) {
        row[5] = format!(
            "{:.2}",
            reference / column(scores, |score| score.aligned_mse).0
        );
    }
    let title = format!(
        "(1) 100 x 20 m, 3 particles, 0.2 m and 8 degrees; mean and standard error of {runs} runs"
    );
    output.table("rectangle.csv", &title, &rows)
}

/// A row with the errors of one entry.
fn error_row(case: String, index: usize, scores: &[Score]) -> Vec<String> {
    vec![
        case,
        ENTRIES[index].name.to_owned(),
        plus_minus(column(scores, |score| score.mse)),
        plus_minus(column(scores, |score| score.aligned_mse)),
    ]
}

/// Table (1b), the sweep of Fig. 4: five noises, 10 particles.
fn sweep(output: &Output, runs: u64) -> Result<(), Box<dyn Error>> {
    let mut rows = vec![head(&["noise", "filter", "MSE m^2", "MSE aligned m^2"])];
    for (range, bearing) in [(0.1, 3.0), (0.2, 6.0), (0.2, 8.0), (0.3, 10.0), (0.3, 14.0)] {
        for index in [PUBLISHED, EXACT, EACH_SCAN, FOLDED] {
            let scores = scores(
                &setting(&SMALL_LOOP, range, bearing),
                ENTRIES[index],
                10,
                runs,
            )?;
            let noise = format!("{range} m {bearing} deg");
            rows.push(error_row(noise, index, &scores));
        }
    }
    output.table(
        "sweep.csv",
        &format!("(1b) 25 x 20 m, 10 particles, {runs} runs"),
        &rows,
    )
}

/// Table (2): the error over the number of particles.
fn particles(output: &Output, runs: u64, counts: &[usize]) -> Result<(), Box<dyn Error>> {
    let setting = setting(&LARGE_LOOP, 0.2, 6.0);
    let mut rows = vec![head(&["particles", "filter", "MSE m^2", "MSE aligned m^2"])];
    for &count in counts {
        for index in [EXACT, EACH_SCAN, FOLDED] {
            let scores = scores(&setting, ENTRIES[index], count, runs)?;
            rows.push(error_row(count.to_string(), index, &scores));
        }
    }
    output.table(
        "particles.csv",
        &format!("(2) 100 x 100 m, 500 m of path, 0.2 m and 6 degrees, {runs} runs"),
        &rows,
    )
}

/// Table (3), consistency: NEES averaged over the runs, scan by scan.
fn consistency(output: &Output, runs: u64, counts: &[usize]) -> Result<(), Box<dyn Error>> {
    let mut setting = setting(&SMALL_LOOP, 0.1, 1.0);
    setting.landmarks = (4.0, 4.0);
    setting.settings.range = 5.0;
    let mut rows = vec![head(&[
        "particles",
        "filter",
        "first exit s",
        "leaves for good s",
        "in the band %",
    ])];
    let mut series = "particles,filter,time_s,nees\n".to_owned();
    for &count in counts {
        for index in [EXACT, EACH_SCAN] {
            let scores = scores(&setting, ENTRIES[index], count, runs)?;
            let scans = scores
                .iter()
                .map(|score| score.nees.len())
                .min()
                .unwrap_or(0);
            let nees: Vec<f64> = (0..scans)
                .map(|scan| {
                    mean_and_error(
                        &scores
                            .iter()
                            .map(|score| score.nees[scan])
                            .collect::<Vec<_>>(),
                    )
                    .0
                })
                .collect();
            for (scan, value) in nees.iter().enumerate() {
                writeln!(
                    series,
                    "{count},{},{:.1},{value:.4}",
                    ENTRIES[index].name.replace(',', ""),
                    time(scan)
                )?;
            }
            let (first, good) = exits(&nees);
            let inside = nees
                .iter()
                .filter(|value| (NEES_BAND[0]..=NEES_BAND[1]).contains(value))
                .count();
            rows.push(vec![
                count.to_string(),
                ENTRIES[index].name.to_owned(),
                first.map_or("never".to_owned(), |scan| format!("{:.1}", time(scan))),
                good.map_or("never".to_owned(), |scan| format!("{:.1}", time(scan))),
                format!("{:.0}", 100.0 * inside as f64 / scans as f64),
            ]);
        }
    }
    output.write("nees.csv", &series)?;
    output.table(
        "consistency.csv",
        &format!("(3) 25 x 20 m, range 5 m, 0.1 m and 1 degree, {runs} runs"),
        &rows,
    )
}

fn time(scan: usize) -> f64 {
    0.2 * (scan + 1) as f64
}

/// The scan at which the mean NEES of a second first lies above the band, and the scan from which on it
/// always does.
fn exits(nees: &[f64]) -> (Option<usize>, Option<usize>) {
    const WINDOW: usize = 5;
    let above: Vec<bool> = nees
        .windows(WINDOW)
        .map(|window| window.iter().sum::<f64>() / WINDOW as f64 > NEES_BAND[1])
        .collect();
    let first = above
        .iter()
        .position(|&is| is)
        .map(|index| index + WINDOW - 1);
    let good = match above.iter().rposition(|&is| !is) {
        Some(last_inside) if last_inside + 1 < above.len() => Some(last_inside + WINDOW),
        Some(_) => None,
        None => first,
    };
    (first, good)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse()?;
    let output = Output::into(arguments.out);
    if arguments.quick {
        rectangle(&output, 10)?;
        sweep(&output, 5)?;
        particles(&output, 5, &[10, 50])?;
        consistency(&output, 10, &[50])
    } else {
        rectangle(&output, 200)?;
        sweep(&output, 50)?;
        particles(&output, 30, &[1, 3, 10, 50])?;
        consistency(&output, 30, &[50, 100, 500])
    }
}
