//! A robot whose body origin is not the point that does not slip, and whose turn rate has a bias: both are learned from
//! a simulated drive, and the path is better for it.

#![expect(clippy::print_stdout, reason = "an example shows its result")]

use slam_batch::{Constant, Constants, solve};

#[expect(clippy::unwrap_used, reason = "shared with the tests")]
#[path = "../tests/it/simulation.rs"]
mod simulation;

use simulation::{Drive, rmse, settings};

fn main() -> Result<(), slam_batch::BatchError> {
    let mut settings = settings();
    settings.truth = Constants::ZERO
        .with(Constant::TurningCentre, 0.12)
        .with(Constant::TurnRateBias, 0.02);
    let drive = Drive::new(&settings, 1);
    let wheels = rmse(drive.dead_reckoning.iter().copied(), &drive.truth);
    println!("dead reckoning {:.1} mm RMSE", wheels * 1e3);

    let nominal = solve(&drive.problem)?;
    let error = rmse(nominal.poses.iter().map(|p| p.pose), &drive.truth);
    println!("batch, nominal robot {:.1} mm RMSE", error * 1e3);

    let mut problem = drive.problem.clone();
    problem.model.constants = Constants::ZERO
        .with(Constant::TurningCentre, 0.2)
        .with(Constant::TurnRateBias, 0.05);
    let learned = solve(&problem)?;
    let error = rmse(learned.poses.iter().map(|p| p.pose), &drive.truth);
    println!("batch, constants learned {:.1} mm RMSE", error * 1e3);
    for c in &learned.constants {
        let truth = settings.truth[c.constant];
        println!(
            "  {} {:.4} +- {:.4}, true {truth}",
            c.constant.name(),
            c.value,
            c.sigma
        );
    }
    Ok(())
}
