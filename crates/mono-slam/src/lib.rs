//! The library of the program `mono-slam`: a whole sequence through the frame loop, a camera from
//! image files.
//!
//! Use [`run::run_sequence`] to run a recorded sequence from your own program with the same results
//! as `mono-slam run`. A robot that processes frames as they arrive calls
//! [`slam_pipeline::Slam::step`] itself; files alone are read and written with [`slam_io`].
//!
//! ```no_run
//! use slam_io::{Sequence, write_run};
//! use slam_pipeline::config::Config;
//! use slam_report::render_run_html;
//!
//! let sequence = Sequence::open("drive".as_ref())?;
//! let config = Config::default().check()?;
//! let started = std::time::Instant::now();
//! let clock = move || started.elapsed().as_secs_f64();
//! let record = mono_slam::run::run_sequence(&sequence, &config, &clock, &mut |_| {})?;
//! let page = render_run_html(&record).into_bytes();
//! write_run(&record, "results".as_ref(), &[("report.html", page)])?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The three types to know are [`slam_io::Sequence`], [`slam_pipeline::config::Config`] and
//! [`slam_io::RunRecord`].

pub mod calibrate;
mod detection;
pub mod map_camera;
pub mod pairs;
pub mod recorded;
pub mod refine;
pub mod run;
mod run_error;
mod run_state;
pub mod smooth;
mod stopwatch;
pub mod warnings;
pub mod without_odometry;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
