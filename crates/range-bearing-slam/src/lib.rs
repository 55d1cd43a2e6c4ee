//! Range-bearing SLAM by a Rao-Blackwellized particle filter: the `FastSLAM` family, over models of your
//! own.
//!
//! Each particle carries a path and, given the path, a Gaussian for every landmark. The crate holds the
//! proposals of the pose (from the motion model, extended, unscented) with exact importance weights, the
//! filters of a landmark (by Jacobians, by sigma points), association by each particle where landmarks
//! have no names, and Metropolis-Hastings moves of the poses. A planar range-bearing sensor and two
//! vehicles are ready to use; other robots and sensors implement the traits [`MotionModel`] and
//! [`ObservationModel`]. The particle filter itself is crate [`rbpf_core`].
//!
//! # First example
//!
//! A robot at rest sees one landmark ten times. The map of the best particle holds it.
//!
//! ```
//! use nalgebra::{Vector2, Vector3};
//! use range_bearing_slam::{
//!     Deviation, ExtendedLandmarks, ExtendedProposal, Frame, LandmarkMapping, LandmarkParticle,
//!     Linearisation, ObservationModel, Propagation, RangeBearing, Unicycle,
//! };
//! use rbpf_core::{FilterConfig, NoRejuvenation, ParticleFilter, ParticleSet, Streams};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let sensor = RangeBearing::new(0.1, 0.02); // standard deviations in metres and radians
//! let noise = Deviation { fixed: 0.01, share: 0.1 };
//! let motion = Unicycle {
//!     speed: noise,
//!     turn_rate: noise,
//!     floor: [1e-3; 3],
//!     propagation: Propagation::Jacobians,
//! };
//! let linearisation = Linearisation::Sequential;
//! let proposal = ExtendedProposal { motion, sensor, linearisation };
//! let mapping = LandmarkMapping { sensor, filter: ExtendedLandmarks };
//!
//! let start = LandmarkParticle::<3, 2>::new(Vector3::zeros());
//! let set = ParticleSet::new(vec![start; 20])?;
//! let mut filter = ParticleFilter::new(set, Streams::new(1), FilterConfig::default())?;
//! let tree = Vector2::new(4.0, 3.0);
//! let measured = sensor.predict(&Vector3::zeros(), &tree).ok_or("not at the sensor")?;
//! for time in 0..10 {
//!     let frame = Frame { control: vec![], measurements: vec![(7, measured)] };
//!     filter.step(time, &frame, &proposal, &NoRejuvenation, &mapping)?;
//! }
//! let best = &filter.set().particles()[filter.set().best()];
//! let landmark = best.map.get(7).ok_or("in the map")?;
//! assert!((landmark.position.mean - tree).norm() < 0.1);
//! # Ok(())
//! # }
//! ```
//!
//! # Three types to know
//!
//! - [`LandmarkParticle`] is the particle: pose, path and map, cheap to clone.
//! - [`UnscentedProposal`], [`ExtendedProposal`] and [`MotionProposal`] draw its pose and weigh the draw.
//! - [`LandmarkMapping`] updates its map, through [`ExtendedLandmarks`] or [`UnscentedLandmarks`].
//!
//! With unknown association their places are taken by [`NamingParticle`], [`Associating`] and
//! [`DoubtingMapping`]. [`MovePoses`] rejuvenates after a resampling, and [`weighted_moments`] is the mean
//! pose of a set.
//!
//! # When to use it, and when not
//!
//! Use it for a robot with odometry and a sensor that measures single landmarks, with poses and landmarks
//! in a few dimensions, and a posterior that is near Gaussian given one path. A robot that may be in one
//! of two places needs more than these proposals, a map without landmarks (a grid) another map update, and
//! a camera whose landmarks have no depth at first another parametrisation: crate `slam-pipeline`. No
//! filter of this family keeps an honest covariance for long; where that matters, smooth the whole path.

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
pub use pose_moves::MovePoses;
pub use proposal::{ExtendedProposal, Linearisation, MotionProposal, UnscentedProposal};
pub use sensor::RangeBearing;
pub use vehicles::{Bicycle, Command, Deviation, Propagation, Unicycle};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct ReadmeDoctests;
