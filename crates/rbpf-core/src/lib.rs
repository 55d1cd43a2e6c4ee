//! Building blocks of a Rao-Blackwellized particle filter.
//!
//! Each particle carries what is sampled (a path) and, conditioned on it, what is solved in closed
//! form (a map of Gaussian landmarks). This crate holds the parts that do not depend on the sensor:
//!
//! 1. [`streams`]: one random stream per (seed, frame, particle, purpose);
//! 2. [`log_weights`]: normalisation and effective count in log space;
//! 3. [`resampling`]: four unbiased schemes returning sorted ancestors; [`kld`]: how many to draw;
//! 4. [`landmark_map`]: a persistent map, cloned in O(1) and copied where it is written;
//! 5. [`history`]: a persistent path with the same sharing;
//! 6. [`circular`]: means of headings;
//! 7. [`diagnostics`]: unique ancestors and coalescence of the paths;
//! 8. [`particle_set`] and [`filter`]: weights and ancestors of a set, and the order of a frame over
//!    three narrow traits;
//! 9. [`models`]: what is asked of a robot and its sensor, by traits of one to three methods;
//! 10. [`proposal`]: from the motion model, extended, unscented, with exact weights;
//! 11. [`landmark_filter`] and [`landmark_particle`]: the landmarks of a particle and their update;
//! 12. [`range_bearing`] and [`vehicles`]: a planar sensor and two vehicles, ready to use;
//! 13. `association`: scans without ids, named by each particle.
//!
//! Everything unscented, and with it `MotionProposal` and `association`, whose likelihoods are by sigma points, is
//! of the feature `ukf` (on by default). Without it the forms by Jacobians remain.
//!
//! The results do not depend on the number of threads: random numbers are keyed by the particle,
//! and every reduction runs in particle order.

#[cfg(feature = "ukf")]
pub mod association;
pub mod circular;
pub mod diagnostics;
pub mod error;
pub mod filter;
pub mod history;
pub mod kld;
pub mod landmark_filter;
pub mod landmark_map;
pub mod landmark_particle;
pub mod log_weights;
pub mod models;
pub mod particle_set;
pub mod proposal;
pub mod range_bearing;
#[cfg(feature = "es-evolve")]
pub mod rejuvenation;
pub mod resampling;
pub mod streams;
pub mod vehicles;

mod factor;
#[cfg(feature = "ukf")]
mod unscented;

#[cfg(feature = "ukf")]
pub use association::{
    Associating, AssociationRules, DoubtingMapping, ExistenceRules, NamingParticle, Scan,
};
pub use circular::{Moments, circular_mean, weighted_moments, wrap_angle};
pub use diagnostics::{Genealogy, unique_ancestors};
pub use error::{RbpfError, StepError};
pub use filter::{
    FilterConfig, MapUpdate, NoMapUpdate, NoRejuvenation, ParticleCount, ParticleFilter, Proposal,
    Rejuvenation, RejuvenationReport, RejuvenationSchedule, StepReport,
};
pub use history::PersistentPath;
pub use kld::KldSampling;
#[cfg(feature = "ukf")]
pub use landmark_filter::UnscentedLandmarks;
pub use landmark_filter::{ExtendedLandmarks, LandmarkFilter, LandmarkUpdate};
pub use landmark_map::{CowMap, SharedLeaves};
pub use landmark_particle::{Landmark, LandmarkMapping, LandmarkParticle};
pub use log_weights::{effective_count, log_sum_exp, normalize};
pub use models::{
    FieldOfView, Frame, Gaussian, InverseObservation, MotionModel, ObservationJacobians,
    ObservationModel, PoseAndMap,
};
pub use particle_set::ParticleSet;
pub use proposal::{ExtendedProposal, Linearisation, linearised_log_likelihood};
#[cfg(feature = "ukf")]
pub use proposal::{MotionProposal, UnscentedProposal, log_likelihood};
pub use range_bearing::RangeBearing;
#[cfg(feature = "es-evolve")]
pub use rejuvenation::{InverseMotion, MovablePose, MoveError, MovePoses};
pub use resampling::{Resampler, resample};
pub use streams::{Purpose, Streams};
pub use vehicles::{Bicycle, Command, Deviation, Propagation, Unicycle};

#[cfg(all(doctest, feature = "ukf"))]
#[doc = include_str!("../README.md")]
pub struct ReadmeDoctests;
