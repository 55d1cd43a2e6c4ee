//! Runs a sequence folder with the default configuration and writes every
//! result: `run_sequence SEQ OUT`.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use mono_slam::run::run_sequence;
use slam_io::{Sequence, write_run};
use slam_pipeline::config::Config;
use slam_report::render_run_html;

#[expect(clippy::print_stdout, reason = "an example reports on the terminal")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut folders = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(input), Some(out), None) = (folders.next(), folders.next(), folders.next()) else {
        return Err("usage: run_sequence SEQ OUT".into());
    };
    let sequence = Sequence::open(&input)?;
    let started = Instant::now();
    let clock = || started.elapsed().as_secs_f64();
    let run = run_sequence(&sequence, &Config::default().check()?, &clock, &mut |p| {
        if p.frame == p.frames || p.frame % 10 == 0 {
            println!(
                "frame {} of {}, {} landmarks",
                p.frame, p.frames, p.landmarks
            );
        }
    })?;
    let page = render_run_html(&run).into_bytes();
    write_run(&run, &out, &[("report.html", page)])?;
    if let Some(last) = run.frames.last() {
        println!(
            "ends at ({:.3}, {:.3}) m after {:.1} s; see {}",
            last.report.estimate.pose.x,
            last.report.estimate.pose.y,
            run.wall_s,
            out.join("report.html").display()
        );
    }
    Ok(())
}
