//! Integration tests of the public interface, one binary. The simulations and readers of the examples
//! are compiled in, so that the tests run what the examples show.

#[path = "../../examples/support/align.rs"]
mod align;
#[path = "../../examples/support/filters.rs"]
mod filters;
#[path = "../../examples/support/fold.rs"]
mod fold;
#[path = "../../examples/support/motion.rs"]
mod motion;
#[path = "../../examples/support/mrclam_data.rs"]
mod mrclam_data;
#[path = "../../examples/support/mrclam_filters.rs"]
mod mrclam_filters;
#[path = "../../examples/support/park_filters.rs"]
mod park_filters;
#[path = "../../examples/support/published.rs"]
mod published;
#[path = "../../examples/support/run.rs"]
mod run;
#[path = "../../examples/support/score.rs"]
mod score;
#[path = "../../examples/support/simulation.rs"]
mod simulation;
#[path = "../../examples/support/tables.rs"]
mod tables;
#[path = "../../examples/support/victoria_data.rs"]
mod victoria_data;

mod association;
mod bad_input;
mod fixtures;
mod kim2008;
mod landmark_filter;
mod linear_slam;
mod pose_moves;
mod proposal;
mod real_data;
mod vehicles;
mod weights;
