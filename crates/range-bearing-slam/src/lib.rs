#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`LandmarkParticle`] is the particle; [`UnscentedProposal`], [`ExtendedProposal`] and [`MotionProposal`] draw its pose and
//! weigh the draw; [`LandmarkMapping`] updates its map, through [`ExtendedLandmarks`] or [`UnscentedLandmarks`]. With unknown
//! association their places are taken by [`NamingParticle`], [`Associating`] and [`DoubtingMapping`]. [`MovePoses`] rejuvenates
//! after a resampling, and [`weighted_moments`] is the mean pose of a set. Robots and sensors of your own implement
//! [`MotionModel`] and [`ObservationModel`]; the particle filter is that of [`rbpf_core`].

mod association;
mod covariance;
mod error;
mod existence;
mod frame;
mod innovation;
mod landmark_filter;
mod landmark_particle;
mod models;
mod moments;
mod pose_moves;
mod proposal;
mod sensor;
mod spread;
mod vehicles;

pub use association::{Associating, AssociationRules, NamingParticle};
pub use error::{MoveError, RangeBearingError};
pub use existence::{DoubtingMapping, ExistenceRules};
pub use frame::{Frame, Scan};
pub use landmark_filter::{ExtendedLandmarks, LandmarkFilter, LandmarkUpdate, UnscentedLandmarks};
pub use landmark_particle::{Landmark, LandmarkMapping, LandmarkParticle};
pub use models::{
    FieldOfView, Gaussian, InverseObservation, MotionModel, ObservationJacobians, ObservationModel,
};
pub use moments::weighted_moments;
pub use nalgebra;
pub use pose_moves::MovePoses;
pub use proposal::{ExtendedProposal, Linearisation, MotionProposal, UnscentedProposal};
pub use rbpf_core;
pub use sensor::RangeBearing;
pub use vehicles::{Bicycle, Command, Deviation, Propagation, Unicycle};
