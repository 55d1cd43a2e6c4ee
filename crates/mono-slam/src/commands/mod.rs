//! The commands, one file each with its arguments and its action.

pub(crate) mod batch;
pub(crate) mod calibrate;
pub(crate) mod camera;
pub(crate) mod compare;
pub(crate) mod config;
mod configuration;
pub(crate) mod eval;
mod eval_text;
pub(crate) mod features;
pub(crate) mod info;
pub(crate) mod match_images;
pub(crate) mod report;
pub(crate) mod run;
mod sequence_options;
mod stand_in;
mod threshold;
