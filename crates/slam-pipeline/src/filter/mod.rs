//! The estimator: a particle, its proposal, weight and moves, and the start and update of its landmarks.
//!
//! Reading order: [`pose`] (the sampled camera pose), [`landmark`] (anchored inverse depth or point), [`motion`] (the
//! odometry prior), [`metric`] (the scale and the position in metres), [`particle`] (all of them together),
//! [`pixel_noise`] and [`observation`] (the measurements of a frame), [`linearised`] (statistical linearisation), [`likelihood`],
//! [`proposal`], [`evolution`], [`landmark_moments`], [`landmark_update`], [`mapping`], [`segment`], [`window_landmarks`],
//! [`window_equations`], [`window_settling`], [`local_batch`], [`fixed_lag`], [`adaptation`], [`drift`], [`revisit`],
//! [`path_correction`].

pub(crate) mod adaptation;
pub(crate) mod drift;
pub(crate) mod evolution;
pub(crate) mod first_order;
pub(crate) mod fixed_lag;
mod focal;
pub(crate) mod landmark;
pub(crate) mod landmark_moments;
pub(crate) mod landmark_update;
pub(crate) mod likelihood;
pub(crate) mod linearised;
pub(crate) mod local_batch;
pub(crate) mod mapping;
pub(crate) mod metric;
pub(crate) mod metric_path;
pub(crate) mod motion;
pub(crate) mod observation;
pub(crate) mod particle;
pub(crate) mod path_correction;
pub(crate) mod pixel_noise;
pub(crate) mod pose;
pub(crate) mod proposal;
pub(crate) mod revisit;
pub(crate) mod segment;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod window_equations;
pub(crate) mod window_landmarks;
pub(crate) mod window_settling;
pub(crate) mod window_sight;
