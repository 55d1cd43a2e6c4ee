//! A robot drives along a wall: all poses and landmarks adjusted at once, beside dead reckoning.
//!
//! `adjust_wall_run [planar|spatial] [--loss none|huber|cauchy] [--outliers SHARE] [--frames N] [--landmarks N] [--seed N]
//! [--iterations N] [--repeat N] [--write FILE]`. Prints the cost curve, the errors and the time (the median of the repetitions); with
//! `--write` the problem, the result and the times go to a JSON file for docs/results/bundle_adjustment_scipy.py.

#![expect(clippy::print_stdout, reason = "an example shows its result")]

use std::fmt::Write as _;
use std::time::Instant;

use mono_geometry::bundle::{Adjustment, BundlePose, Options, Problem, adjust, covariance};
use mono_geometry::{RobustLoss, Se3};
use nalgebra::SMatrix;

#[path = "../tests/it/common/wall_run.rs"]
mod wall_run;

use wall_run::{Simulated, WallRun};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let mut run = WallRun::full(1);
    let mut options = Options::default();
    let (mut spatial, mut repeat, mut file) = (false, 1, None);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "planar" => spatial = false,
            "spatial" => spatial = true,
            "--loss" => options.loss = loss(&value()?)?,
            "--outliers" => run.outlier_share = value()?.parse()?,
            "--frames" => run.frames = value()?.parse()?,
            "--landmarks" => run.landmarks = value()?.parse()?,
            "--iterations" => options.max_iterations = value()?.parse()?,
            "--seed" => run.seed = value()?.parse()?,
            "--repeat" => repeat = value()?.parse()?,
            "--write" => file = Some(value()?),
            other => return Err(format!("unknown argument {other}").into()),
        }
    }
    let text = if spatial {
        report(&wall_run::spatial(&run), &options, repeat, "spatial")?
    } else {
        report(&wall_run::planar(&run), &options, repeat, "planar")?
    };
    if let Some(file) = file {
        std::fs::write(file, text)?;
    }
    Ok(())
}

fn loss(name: &str) -> Result<RobustLoss, Failure> {
    match name {
        "none" => Ok(RobustLoss::None),
        "huber" => Ok(RobustLoss::Huber { threshold: 2.0 }),
        "cauchy" => Ok(RobustLoss::Cauchy { threshold: 3.0 }),
        other => Err(format!("unknown loss {other}").into()),
    }
}

fn report<P: BundlePose<D>, const D: usize>(
    simulated: &Simulated<P, D>,
    options: &Options,
    repeat: usize,
    kind: &str,
) -> Result<String, Failure> {
    let problem = &simulated.problem;
    println!(
        "{kind}: {} poses, {} landmarks, {} observations, {} outliers",
        problem.poses.len(),
        problem.landmarks.len(),
        problem.observations.len(),
        simulated.outlier.iter().filter(|o| **o).count()
    );
    let mut seconds = Vec::new();
    let mut adjusted = adjust(problem, options)?;
    for _ in 0..repeat {
        let start = Instant::now();
        adjusted = adjust(problem, options)?;
        seconds.push(start.elapsed().as_secs_f64());
    }
    println!("iteration        cost   damping     step     gain");
    for (k, i) in adjusted.iterations.iter().enumerate() {
        println!(
            "{k:9} {:11.4} {:9.2e} {:8.1e} {:>8} {}",
            i.cost,
            i.damping,
            i.step_norm,
            i.gain_ratio.map_or("none".into(), |g| format!("{g:.3}")),
            if i.accepted { "" } else { "refused" }
        );
    }
    println!("{:?}", adjusted.termination);
    println!(
        "cost {:.6} from {:.6}",
        adjusted.cost, adjusted.initial_cost
    );
    println!(
        "position RMSE: dead reckoning {:.1} mm, adjusted {:.1} mm",
        1e3 * rmse(&simulated.poses, &problem.poses),
        1e3 * rmse(&simulated.poses, &adjusted.poses)
    );
    let solution = Problem {
        poses: adjusted.poses.clone(),
        landmarks: adjusted.landmarks.clone(),
        ..problem.clone()
    };
    let start = Instant::now();
    let sure = covariance(&solution, &options.loss)?;
    let covariance_s = start.elapsed().as_secs_f64();
    let last = problem.poses.len() - 1;
    if let Some(block) = sure.pose(last) {
        println!(
            "last pose, standard deviations: {:.3e}",
            block.diagonal().map(f64::sqrt).transpose()
        );
    }
    let mut sorted = seconds.clone();
    sorted.sort_by(f64::total_cmp);
    if let Some(median) = sorted.get(sorted.len() / 2) {
        println!(
            "median {:.1} ms, {:.2} ms an iteration; covariance {:.1} ms",
            1e3 * median,
            1e3 * median / adjusted.iterations.len().max(1) as f64,
            1e3 * covariance_s
        );
    }
    Ok(json(problem, options, &adjusted, &seconds, kind))
}

fn rmse<P: BundlePose<D>, const D: usize>(truth: &[P], estimate: &[P]) -> f64 {
    let squares: f64 = truth
        .iter()
        .zip(estimate)
        .map(|(t, e)| {
            (t.world_from_body().translation - e.world_from_body().translation).norm_squared()
        })
        .sum();
    (squares / truth.len() as f64).sqrt()
}

/// Everything an outside solver needs; poses as rotation (row by row) and translation in space.
fn json<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
    options: &Options,
    adjusted: &Adjustment<P>,
    seconds: &[f64],
    kind: &str,
) -> String {
    let pinhole = &problem.pinhole;
    let list = |items: Vec<String>| format!("[{}]", items.join(",\n"));
    let poses = |poses: &[P]| list(poses.iter().map(|p| spread(&p.world_from_body())).collect());
    let points = |points: &[nalgebra::Vector3<f64>]| {
        list(points.iter().map(|p| numbers(p.as_slice())).collect())
    };
    let (name, threshold) = match options.loss {
        RobustLoss::None => ("none", 0.0),
        RobustLoss::Huber { threshold } => ("huber", threshold),
        RobustLoss::Cauchy { threshold } => ("cauchy", threshold),
        other => unreachable!("{other:?} is not among the losses of this example"),
    };
    let mut text = String::new();
    let camera = [pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy];
    let parts = [
        ("kind", format!("{kind:?}")),
        ("loss", format!("{name:?}")),
        ("threshold", format!("{threshold:?}")),
        ("camera", numbers(&camera)),
        ("body_from_camera", spread(&problem.body_from_camera)),
        ("fixed", format!("{:?}", problem.fixed_poses)),
        ("poses", poses(&problem.poses)),
        ("landmarks", points(&problem.landmarks)),
        (
            "observations",
            list(
                problem
                    .observations
                    .iter()
                    .map(|o| {
                        numbers(&[
                            o.pose as f64,
                            o.landmark as f64,
                            o.pixel_ideal.x,
                            o.pixel_ideal.y,
                            o.sigma_px,
                        ])
                    })
                    .collect(),
            ),
        ),
        (
            "odometry",
            list(
                problem
                    .odometry
                    .iter()
                    .map(|f| {
                        format!(
                            "[{}, {}, {}, {}]",
                            f.from,
                            f.to,
                            spread(&f.motion.world_from_body()),
                            matrix(&f.covariance)
                        )
                    })
                    .collect(),
            ),
        ),
        ("result_cost", format!("{:?}", adjusted.cost)),
        ("result_poses", poses(&adjusted.poses)),
        ("result_landmarks", points(&adjusted.landmarks)),
        (
            "result_iterations",
            format!("{}", adjusted.iterations.len()),
        ),
        ("result_seconds", numbers(seconds)),
    ];
    for (k, (name, value)) in parts.iter().enumerate() {
        let open = if k == 0 { "{" } else { ",\n" };
        // Writing to a string cannot fail.
        let _ = write!(text, "{open}{name:?}: {value}");
    }
    text + "}\n"
}

fn numbers(values: &[f64]) -> String {
    format!("{values:?}")
}

fn matrix<const D: usize>(values: &SMatrix<f64, D, D>) -> String {
    numbers(values.transpose().as_slice())
}

/// Rotation row by row, then translation: 12 numbers.
fn spread(pose: &Se3) -> String {
    let mut values = pose.rotation.matrix().transpose().as_slice().to_vec();
    values.extend_from_slice(pose.translation.as_slice());
    numbers(&values)
}
