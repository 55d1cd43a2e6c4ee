//! The estimator: what a particle is, how its pose is proposed, weighed and
//! moved, how its landmarks are started and updated.
//!
//! Reading order: [`pose`] (the sampled camera pose), [`particle`] (path, map,
//! local scale), [`landmark`] (anchored inverse depth or point), [`motion`]
//! (the odometry prior), [`observation`] (what one frame measured),
//! [`linearised`] (statistical linearisation), [`proposal`] (the unscented and
//! the motion proposal with their weights), [`likelihood`], [`evolution`],
//! [`landmark_update`], [`mapping`], [`drift`].

pub mod drift;
pub mod evolution;
pub mod landmark;
pub mod landmark_update;
pub mod likelihood;
pub mod linearised;
pub mod mapping;
pub mod motion;
pub mod observation;
pub mod particle;
pub mod pose;
pub mod proposal;
