//! Motion of a camera between two images from their matches.
//!
//! `relative_pose FILE [five|prosac|planar] [--sigma PX] [--min-trials N] [--repeat N] [--seed N]`. Prints rotation
//! (row by row) and direction of `second_from_first`, inliers, trials, and the processor time of one estimation, the median of the
//! repetitions (elapsed time where the system does not tell).
//!
//! The file is text, `#` starts a comment, pixels have the lens removed and (0, 0) is the centre of the top-left one:
//!
//! ```text
//! camera fx fy cx cy
//! mount r11 r12 r13 r21 ... r33              body_from_camera, row by row; for `planar` only
//! match u1 v1 u2 v2 [quality]                one line a match; higher is better, for `prosac` only
//! ```

#![expect(clippy::print_stdout, reason = "an example shows its result")]

use std::time::{Duration, Instant};

use mono_geometry::epipolar::{
    Correspondence, FivePoint, PlanarTwoPoint, RelativePose, SampsonScorer, choose_pose, refine,
    refine_narrowed,
};
use mono_geometry::ransac::{Options, Prosac, Report, Uniform, ransac};
use mono_geometry::{Mount, Pinhole, Se3};
use nalgebra::{Matrix3, Vector2, Vector3};

type Failure = Box<dyn std::error::Error>;

/// Steps of the last refinement; it converges in four or five.
const REFINEMENTS: usize = 20;

struct Input {
    pinhole: Pinhole,
    mount: Option<Mount>,
    matches: Vec<Correspondence>,
    qualities: Vec<f64>,
}

struct Estimate {
    second_from_first: Se3,
    inliers: usize,
    trials: usize,
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let (mut file, mut method) = (None, "five".to_owned());
    let (mut sigma_px, mut repeat, mut options) = (0.5, 1, Options::default());
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "five" | "prosac" | "planar" => method = argument,
            "--sigma" => sigma_px = value()?.parse()?,
            "--repeat" => repeat = value()?.parse()?,
            "--seed" => options.seed = value()?.parse()?,
            "--min-trials" => options.min_trials = value()?.parse()?,
            _ => file = Some(argument),
        }
    }
    let input = read(&std::fs::read_to_string(file.ok_or("a FILE is needed")?)?)?;
    let mut milliseconds = Vec::new();
    let mut found = None;
    for _ in 0..repeat.max(1) {
        let start = now();
        found = estimate(&input, &method, sigma_px, &options)?;
        milliseconds.push(1e3 * (now() - start).as_secs_f64());
    }
    milliseconds.sort_by(f64::total_cmp);
    let time = milliseconds[milliseconds.len() / 2];
    match found {
        Some(found) => {
            let numbers = |v: &[f64]| v.iter().map(|x| format!(" {x:.12}")).collect::<String>();
            let pose = &found.second_from_first;
            println!(
                "rotation{}",
                numbers(pose.rotation.matrix().transpose().as_slice())
            );
            println!("direction{}", numbers(pose.translation.as_slice()));
            println!("inliers {} of {}", found.inliers, input.matches.len());
            println!("trials {}", found.trials);
        }
        None => println!("no motion"),
    }
    println!("milliseconds {time:.4}");
    Ok(())
}

/// The motion, or `None` if no sample gives one or the points do not tell which of the four it is.
fn estimate(
    input: &Input,
    method: &str,
    sigma_px: f64,
    options: &Options,
) -> Result<Option<Estimate>, Failure> {
    let matches: Vec<_> = input
        .matches
        .iter()
        .map(|m| m.normalized(&input.pinhole))
        .collect();
    let scorer = SampsonScorer::normalized(&input.pinhole, sigma_px);
    // Rays that meet at less than three standard deviations of the noise cannot tell which way.
    let least_rad = 3.0 * sigma_px / input.pinhole.fx;
    if method == "planar" {
        let mount = input.mount.ok_or("`planar` needs the mount")?;
        let solver = PlanarTwoPoint { mount };
        let report = ransac(&solver, &scorer, &mut Uniform::default(), &matches, options);
        let trials = report.trials;
        return Ok(report.best.map(|best| {
            let refined = refine(
                &best.model,
                &matches,
                &best.inliers,
                &scorer.variance,
                REFINEMENTS,
            );
            let motion = refined.map_or(best.model, |r| r.model);
            Estimate {
                second_from_first: motion
                    .oriented(&matches, &best.inliers, least_rad)
                    .second_from_first(),
                inliers: best.inliers.len(),
                trials,
            }
        }));
    }
    let solver = FivePoint::default();
    let report: Report<Matrix3<f64>> = if method == "prosac" {
        let mut sampler = Prosac::new(&input.qualities);
        ransac(&solver, &scorer, &mut sampler, &matches, options)
    } else {
        ransac(&solver, &scorer, &mut Uniform::default(), &matches, options)
    };
    let Some(best) = report.best else {
        return Ok(None);
    };
    let Some(choice) = choose_pose(&best.model, &matches, &best.inliers, least_rad) else {
        return Ok(None);
    };
    let Ok(candidate) = choice.best() else {
        return Ok(None);
    };
    let start = RelativePose::new(&candidate.second_from_first).ok_or("no baseline")?;
    let refined = refine_narrowed(&start, &matches, &best.inliers, &scorer, REFINEMENTS);
    Ok(Some(Estimate {
        second_from_first: *refined.map_or(start, |r| r.model).second_from_first(),
        inliers: best.inliers.len(),
        trials: report.trials,
    }))
}

fn read(text: &str) -> Result<Input, Failure> {
    let (mut pinhole, mut mount) = (None, None);
    let (mut matches, mut qualities) = (Vec::new(), Vec::new());
    for (index, line) in text.lines().enumerate() {
        let mut words = line.split('#').next().unwrap_or("").split_whitespace();
        let Some(key) = words.next() else { continue };
        let numbers = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        match (key, numbers.as_slice()) {
            ("camera", &[fx, fy, cx, cy]) => {
                // The size does not enter.
                let (width, height) = (0, 0);
                pinhole = Some(Pinhole {
                    width,
                    height,
                    fx,
                    fy,
                    cx,
                    cy,
                });
            }
            ("mount", entries) if entries.len() == 9 => {
                let rotation = Matrix3::from_row_slice(entries);
                mount = Some(Mount::new(&rotation, &Vector3::zeros())?);
            }
            ("match", &[ua, va, ub, vb, ref quality @ ..]) if quality.len() < 2 => {
                matches.push(Correspondence {
                    first: Vector2::new(ua, va),
                    second: Vector2::new(ub, vb),
                });
                qualities.push(quality.first().copied().unwrap_or(f64::NAN));
            }
            _ => return Err(format!("line {}: `{line}`", index + 1).into()),
        }
    }
    Ok(Input {
        pinhole: pinhole.ok_or("no line `camera`")?,
        mount,
        matches,
        qualities,
    })
}

/// Processor time of this thread, elapsed time where the system does not tell.
fn now() -> Duration {
    // The system brings the count up to date when the thread is set aside.
    std::thread::sleep(Duration::from_nanos(1));
    let spent = std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|line| line.split_whitespace().next()?.parse().ok());
    spent.map_or_else(elapsed, Duration::from_nanos)
}

fn elapsed() -> Duration {
    use std::sync::OnceLock;
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}
