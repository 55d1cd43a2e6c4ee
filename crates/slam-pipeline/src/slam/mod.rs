//! The frame loop: features and odometry in, pose and map out.
//!
//! Every frame is associated with the map in the best particle. A frame that moved far enough, saw too little of the
//! last step, or waited too long is a *keyframe*: a filter step of all particles in the order propose, weight,
//! resample, evolve, update the map, start landmarks. The frames between only refine the pose that is reported.
//!
//! A frame is planned from the unchanged state (`plan`, `keyframe`) and committed at its end (`commit`), so a frame that fails
//! leaves no trace. The decisions have files of their own: `keyframe_policy`, `scoring_budget`, `feature_budget`; the
//! gates and the belief in landmarks are those of the front end.

mod commit;
mod estimate;
mod feature_budget;
mod fixed_lag;
mod ground;
mod keyframe;
mod keyframe_policy;
mod landmark_budget;
mod lost;
mod map_exchange;
mod memory;
mod place;
mod plan;
mod recovery;
mod report;
mod results;
mod revisit;
mod scoring_budget;
mod standing;
mod stored;
#[cfg(test)]
mod tests;
mod tied;
mod window;

use mono_geometry::Se2;
use place_recognition::PlaceIndex;
use serde::{Deserialize, Serialize};

use rbpf_core::{
    FilterConfig, ParticleFilter, ParticleSet, RejuvenationSchedule, Resampler, Streams,
};
use thiserror::Error;
use vision_sift::Features;

use crate::ablation::Ablation;
use crate::config::ValidConfig;
use crate::filter::adaptation::Adaptation;
use crate::filter::drift::Drift;
use crate::filter::likelihood::Likelihood;
use crate::filter::metric::MetricState;
use crate::filter::motion::{CarrierModel, NoiseFactors};
use crate::filter::particle::Particle;
use crate::filter::pose::CameraPose;
use crate::frontend::association::AssociationParams;
use crate::frontend::catalogue::Catalogue;
use crate::frontend::gate::Gate;
use crate::known_map::MapUse;
use crate::method::{CarrierFreedom, Policies};
use crate::odometry::{Odometer, OdometryInterval};
use crate::rig::Rig;
use keyframe_policy::KeyframePolicy;
use lost::Lost;
pub use report::{
    FrameReport, KeypointFate, KeypointReport, MapLandmark, PoseEstimate, Stage, StageObserver,
    Tracking,
};
use window::Window;

/// Why a frame could not be processed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SlamError {
    /// The particle filter refused a step.
    #[error("frame {frame}: {source}")]
    Filter {
        /// Frame index.
        frame: usize,
        /// The reason that the filter gave.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The features are not one descriptor a keypoint.
    #[error("frame {frame}: {keypoints} keypoints come with {descriptors} descriptors")]
    Features {
        /// Frame index.
        frame: usize,
        /// Number of keypoints.
        keypoints: usize,
        /// Number of descriptors.
        descriptors: usize,
    },
    /// The descriptor index refused an operation.
    #[error("descriptor index: {0}")]
    Index(#[from] feature_kdtree::IndexError),
    /// A known map contradicts itself.
    #[error("map: {reason}")]
    Map {
        /// The first contradiction, with its numbers.
        reason: String,
    },
    /// The index of places refused a landmark.
    #[error("index of places: {0}")]
    Places(#[from] place_recognition::PlaceError),
    /// A state that cannot be stored, or bytes that are no state of this system.
    #[error("state of the filter: {0}")]
    State(String),
    /// A row of odometry is not a number.
    #[error("odometry: {0}")]
    Odometry(#[from] mono_geometry::GeometryError),
}

/// The inputs of one frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameInput<'a> {
    /// Keypoints and descriptors.
    pub features: &'a Features,
    /// Odometry since the previous frame.
    pub odometry: &'a [OdometryInterval],
}

/// The SLAM system: a camera on a wheeled robot, its pose and its map.
///
/// Equal inputs, configuration and seed give equal results for any number of threads of the current rayon pool.
///
/// ```
/// use mono_geometry::{Camera, Distortion, Mount, Pinhole};
/// use slam_pipeline::config::Config;
/// use slam_pipeline::{FrameInput, OdometryInterval, Rig, Slam};
/// use vision_sift::Features;
///
/// let pinhole = Pinhole { width: 320, height: 240, fx: 368.8, fy: 369.9, cx: 159.7, cy: 121.5 };
/// let rig = Rig { camera: Camera::new(pinhole, Distortion::None)?, mount: Mount::forward() };
/// let mut slam = Slam::new(rig, &Config::default().check()?)?;
/// // A lens that is covered: the robot lives on its odometry, and says how well.
/// let nothing = Features::default();
/// let driven = [OdometryInterval { duration_s: 1.0, v_mps: 0.5, omega_radps: 0.0 }];
/// let mut sigmas_m = Vec::new();
/// for _ in 0..4 {
///     let report = slam.step(&FrameInput { features: &nothing, odometry: &driven }, &mut |_| {})?;
///     sigmas_m.push(report.estimate.covariance[(0, 0)].sqrt());
/// }
/// assert!(sigmas_m.is_sorted() && sigmas_m[3] > 0.0);
/// assert_eq!(slam.smoothed_path().len(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Slam {
    rig: Rig,
    config: ValidConfig,
    policies: Policies,
    carrier: CarrierModel,
    likelihood: Likelihood,
    association: AssociationParams,
    keyframes: KeyframePolicy,
    usage: MapUse,
    state: State,
}

/// Everything that a frame changes.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct State {
    #[serde(with = "stored::particles")]
    filter: ParticleFilter<Particle>,
    catalogue: Catalogue,
    /// Looks of the landmarks of the map, to find a place again.
    places: PlaceIndex,
    /// Set while nothing of the map is seen where it is expected.
    lost: Option<Lost>,
    /// Motion since the last keyframe.
    odometer: Odometer,
    drift: Drift,
    /// How much larger than stated the process noise is.
    adaptation: Adaptation,
    /// The keyframes that may be driven again.
    window: Window,
    /// Index of the next frame.
    frame: usize,
    /// Index of the next keyframe.
    keyframe: u32,
    matches_at_keyframe: usize,
    /// Share of the matches of the last keyframe whose landmarks were not first seen long before.
    explored: f64,
    /// Estimate at the last keyframe.
    last: PoseEstimate,
    /// One entry a frame.
    path: Vec<FrameAnchor>,
}

/// The place of a frame relative to the keyframe before it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct FrameAnchor {
    keyframe: u32,
    keyframe_from_body: Se2,
    /// Whether the robot was lost.
    lost: bool,
}

impl Slam {
    /// A system at the origin with an empty map.
    ///
    /// # Errors
    /// [`SlamError::Filter`] or [`SlamError::Index`] for a configuration that the parts refuse.
    pub fn new(rig: Rig, config: &ValidConfig) -> Result<Self, SlamError> {
        Self::with_policies(rig, config, Policies::of(config))
    }

    /// A system without one part of its filter, for studies.
    ///
    /// # Errors
    /// As [`Self::new`].
    #[doc(hidden)]
    pub fn ablated(rig: Rig, config: &ValidConfig, part: Ablation) -> Result<Self, SlamError> {
        Self::with_policies(rig, config, Policies::of(config).without(config, part))
    }

    fn with_policies(
        rig: Rig,
        config: &ValidConfig,
        policies: Policies,
    ) -> Result<Self, SlamError> {
        let carrier = carrier_model(config, policies.carrier);
        let start = Particle::new(
            CameraPose {
                centre: *rig.position_in_body(),
                phi: 0.0,
                roll: 0.0,
                pitch: 0.0,
            },
            MetricState::new(&carrier),
        );
        let set = ParticleSet::new(vec![start; config.filter.particles as usize])
            .map_err(|e| filter_error(0, e))?;
        let filter = ParticleFilter::new(
            set,
            Streams::new(config.filter.seed),
            filter_config(policies.resampling_threshold),
        )
        .map_err(|e| filter_error(0, e))?;
        let guided_distance = config.association.guided_distance;
        Ok(Self {
            rig,
            carrier,
            likelihood: Likelihood {
                outlier_share: config.association.outlier_share,
                form: policies.likelihood,
            },
            association: AssociationParams {
                search: policies.search,
                ratio: config.association.ratio,
                gate: Gate {
                    limit: config.association.gate,
                },
                guided_distance_squared: (guided_distance * guided_distance) as u32,
                guided_ratio: config.association.guided_ratio,
                open_depth: config.mapping.open_depth,
                sigma_px: config.features.sigma_px,
                iterations: config.filter.iterations as usize,
            },
            keyframes: KeyframePolicy::from(&config.keyframes),
            usage: MapUse::Extend,
            state: State {
                filter,
                catalogue: Catalogue::new(policies.search)?,
                places: PlaceIndex::new(),
                lost: None,
                odometer: Odometer::with_step(&config.odometry, policies.motion_step),
                drift: Drift::keeping(config.mapping.max_keyframes),
                adaptation: Adaptation::default(),
                window: Window::default(),
                frame: 0,
                keyframe: 0,
                matches_at_keyframe: 0,
                explored: 1.0,
                last: PoseEstimate::origin(),
                path: Vec::new(),
            },
            policies,
            config: config.clone(),
        })
    }

    /// Processes the next frame; `observer` is told when each stage begins.
    ///
    /// Time is linear in the number of particles, of matches and of landmarks near the view; of the size of the map it
    /// depends only through a test of some nanoseconds for every keyframe that landmarks are anchored in.
    ///
    /// # Errors
    /// [`SlamError`]. The system is then exactly what it was before the call: the frame may be given again, or left out.
    pub fn step(
        &mut self,
        input: &FrameInput<'_>,
        observer: &mut dyn StageObserver,
    ) -> Result<FrameReport, SlamError> {
        let plan = self.plan(input, observer)?;
        Ok(self.commit(plan))
    }
}

impl Slam {
    /// The carrier with the process noise in force.
    fn carrier(&self) -> CarrierModel {
        CarrierModel {
            noise: match self.policies.carrier {
                CarrierFreedom::TiltHeightScale => self.state.adaptation.factors(),
                CarrierFreedom::Planar => NoiseFactors::NOMINAL,
            },
            // The scale of a place that was mapped before is what it was.
            scale_drift: self.carrier.scale_drift * self.state.explored,
            ..self.carrier
        }
    }
}

fn filter_config(resampling_threshold: f64) -> FilterConfig {
    FilterConfig {
        resampler: Resampler::Systematic,
        resampling_threshold,
        rejuvenation: RejuvenationSchedule::AfterResampling,
    }
}

fn carrier_model(config: &ValidConfig, freedom: CarrierFreedom) -> CarrierModel {
    let on = |value: f64| match freedom {
        CarrierFreedom::TiltHeightScale => value,
        CarrierFreedom::Planar => 0.0,
    };
    CarrierModel {
        tilt_sigma: on(config.carrier.tilt_sigma),
        tilt_time_s: config.carrier.tilt_time_s,
        slope_sigma: on(config.carrier.slope_sigma),
        scale_drift: on(config.carrier.scale_drift),
        scale_sigma: on(config.carrier.scale_sigma),
        turn_bias_sigma: on(config.carrier.turn_bias_sigma),
        turning_centre_sigma_m: on(config.carrier.turning_centre_sigma_m),
        noise: NoiseFactors::NOMINAL,
    }
}

fn filter_error(frame: usize, e: impl std::error::Error + Send + Sync + 'static) -> SlamError {
    SlamError::Filter {
        frame,
        source: Box::new(e),
    }
}
