//! The commands, one file each with its arguments and its action.

pub(crate) mod batch;
pub(crate) mod calibrate;
pub(crate) mod camera;
mod checkpoints;
pub(crate) mod compare;
pub(crate) mod config;
pub(crate) mod eval;
mod eval_text;
pub(crate) mod features;
pub(crate) mod info;
mod interrupt;
pub(crate) mod localize;
mod map_file;
pub(crate) mod match_images;
pub(crate) mod report;
mod reporter;
pub(crate) mod run;
mod sequence_options;
mod stand_in;
mod threshold;
