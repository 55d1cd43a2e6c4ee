//! The state of a system as bytes, and a system that goes on from them bit for bit.
//!
//! Everything that a frame changes is stored: floats with all their bits, what particles share once ([`rbpf_core::NodeTable`]). Random
//! numbers need no state, their streams are keyed by seed and frame. What follows from rig and configuration is not
//! stored; it must be given again, and be the same.
//!
//! The bytes are for the same version of the program. They may come from a damaged file: a list or number that the
//! frame loop relies on is checked before it is believed.

use mono_geometry::Se2;

use super::{Slam, SlamError, State};
use crate::config::ValidConfig;
use crate::known_map::MapUse;
use crate::rig::Rig;

impl Slam {
    /// Everything that the frames so far have changed, as bytes for [`Self::restore_state`]. O(memory of the state).
    ///
    /// # Errors
    /// [`SlamError::State`] for the method `paper`, whose descriptor forest is not stored.
    pub fn save_state(&self) -> Result<Vec<u8>, SlamError> {
        if self.state.catalogue.forest().is_some() {
            return Err(SlamError::State(
                "the method paper searches a k-d forest, which is not stored; exact and conventional have none"
                    .to_owned(),
            ));
        }
        postcard::to_allocvec(&(self.usage, &self.state))
            .map_err(|e| SlamError::State(e.to_string()))
    }

    /// The system that [`Self::save_state`] stored, for the same rig and configuration: the frames after it give the
    /// same bits as without the interruption.
    ///
    /// # Errors
    /// [`SlamError::State`] for bytes that are no state, or of another seed or number of particles; as [`Self::new`].
    pub fn restore_state(rig: Rig, config: &ValidConfig, bytes: &[u8]) -> Result<Self, SlamError> {
        let mut slam = Self::new(rig, config)?;
        if slam.state.catalogue.forest().is_some() {
            return Err(SlamError::State(
                "the method paper has no stored states".to_owned(),
            ));
        }
        let ((usage, state), rest) = postcard::take_from_bytes::<(MapUse, State)>(bytes)
            .map_err(|e| SlamError::State(format!("no state of this version: {e}")))?;
        if !rest.is_empty() {
            return Err(SlamError::State(format!("{} bytes too many", rest.len())));
        }
        check(&state, &slam.state).map_err(|rule| SlamError::State(rule.to_owned()))?;
        slam.state = state;
        slam.make_use(usage);
        Ok(slam)
    }

    /// Number of frames so far.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.state.frame
    }
}

/// The rule that a stored state breaks, if any.
fn check(state: &State, fresh: &State) -> Result<(), &'static str> {
    let rule = |holds: bool, rule: &'static str| if holds { Ok(()) } else { Err(rule) };
    let (set, new) = (state.filter.set(), fresh.filter.set());
    rule(
        state.filter.streams() == fresh.filter.streams(),
        "the seed is that of the configuration",
    )?;
    rule(
        set.len() == new.len(),
        "there are as many particles as the configuration says",
    )?;
    let keyframes = state.keyframe as usize;
    rule(
        state.path.len() == state.frame && (state.frame == 0 || keyframes > 0),
        "every frame has its place, on a keyframe",
    )?;
    rule(
        state
            .path
            .iter()
            .all(|place| place.keyframe < state.keyframe),
        "frames stand on keyframes",
    )?;
    rule(
        set.particles().iter().all(|p| p.path.len() == keyframes),
        "the path of a particle has all keyframes",
    )?;
    rule(
        state.window.solved <= state.window.steps.len(),
        "the steps that were solved lie in the window",
    )?;
    rule(
        set.particles().iter().all(|p| {
            p.origin
                .as_ref()
                .is_none_or(|o| o.path.len() + state.window.steps.len() == keyframes)
        }),
        "a window leads from the origin of a particle to the particle",
    )?;
    rule(
        state.drift.is_whole() && state.drift.limit() == fresh.drift.limit(),
        "the drift is a triangle of as many keyframes as the configuration allows",
    )?;
    let finite = |pose: &Se2| pose.x.is_finite() && pose.y.is_finite() && pose.phi.is_finite();
    rule(finite(&state.last.pose), "the last pose is finite")
}

/// The particle filter with all that its particles share.
pub(super) mod particles {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use rbpf_core::{
        Genealogy, NodeTable, ParticleFilter, ParticleSet, RbpfError, SharedNodes, StoredMap,
        StoredNodes, Streams,
    };
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::filter::landmark::Landmark;
    use crate::filter::metric::MetricState;
    use crate::filter::particle::{Keyframe, Particle};
    use crate::filter::pose::CameraPose;

    #[derive(Serialize, Deserialize)]
    struct StoredFilter {
        seed: u64,
        resampling_threshold: f64,
        log_weights: Vec<f64>,
        origins: Vec<usize>,
        genealogy: Genealogy,
        keyframes: StoredNodes<Keyframe>,
        landmarks: StoredNodes<Landmark>,
        /// Origins of particles, every one once.
        origins_of_windows: Vec<StoredParticle>,
        particles: Vec<StoredParticle>,
    }

    #[derive(Serialize, Deserialize)]
    struct StoredParticle {
        pose: CameraPose,
        path: StoredMap,
        map: StoredMap,
        metric: MetricState,
        /// Its number among the origins.
        origin: Option<u32>,
    }

    /// Collects what particles share.
    #[derive(Default)]
    struct Tables<'a> {
        keyframes: NodeTable<'a, Keyframe>,
        landmarks: NodeTable<'a, Landmark>,
        origins: Vec<StoredParticle>,
        numbers: BTreeMap<*const Particle, u32>,
    }

    impl<'a> Tables<'a> {
        fn put(&mut self, particle: &'a Particle) -> StoredParticle {
            // Named one by one, so that a new field is not forgotten. The motion prior is that of a frame being
            // processed: there is none between frames.
            let Particle {
                pose,
                path,
                map,
                metric,
                prior: _,
                origin,
            } = particle;
            StoredParticle {
                pose: *pose,
                path: self.keyframes.put_path(path),
                map: self.landmarks.put(map),
                metric: *metric,
                origin: origin.as_ref().map(|state| self.put_origin(state)),
            }
        }

        /// The number of an origin, which has none itself.
        fn put_origin(&mut self, state: &'a Arc<Particle>) -> u32 {
            if let Some(number) = self.numbers.get(&Arc::as_ptr(state)) {
                return *number;
            }
            let stored = self.put(state);
            let number = self.origins.len() as u32;
            self.origins.push(stored);
            self.numbers.insert(Arc::as_ptr(state), number);
            number
        }
    }

    pub(in crate::slam) fn serialize<S: Serializer>(
        filter: &ParticleFilter<Particle>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let set = filter.set();
        let mut tables = Tables::default();
        let particles = set.particles().iter().map(|p| tables.put(p)).collect();
        StoredFilter {
            seed: filter.streams().seed(),
            resampling_threshold: filter.config().resampling_threshold,
            log_weights: set.log_weights().to_vec(),
            origins: set.origins().to_vec(),
            genealogy: filter.genealogy().clone(),
            keyframes: tables.keyframes.into_nodes(),
            landmarks: tables.landmarks.into_nodes(),
            origins_of_windows: tables.origins,
            particles,
        }
        .serialize(serializer)
    }

    pub(in crate::slam) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<ParticleFilter<Particle>, D::Error> {
        rebuilt(StoredFilter::deserialize(deserializer)?).map_err(D::Error::custom)
    }

    fn rebuilt(stored: StoredFilter) -> Result<ParticleFilter<Particle>, RbpfError> {
        let keyframes = stored.keyframes.rebuild()?;
        let landmarks = stored.landmarks.rebuild()?;
        let mut origins: Vec<Arc<Particle>> = Vec::new();
        for state in &stored.origins_of_windows {
            let next = particle(state, &keyframes, &landmarks, &origins)?;
            origins.push(Arc::new(next));
        }
        let particles = stored
            .particles
            .iter()
            .map(|p| particle(p, &keyframes, &landmarks, &origins))
            .collect::<Result<Vec<_>, _>>()?;
        ParticleFilter::resume(
            ParticleSet::from_parts(particles, stored.log_weights, stored.origins)?,
            Streams::new(stored.seed),
            crate::slam::filter_config(stored.resampling_threshold),
            stored.genealogy,
        )
    }

    fn particle(
        stored: &StoredParticle,
        keyframes: &SharedNodes<Keyframe>,
        landmarks: &SharedNodes<Landmark>,
        origins: &[Arc<Particle>],
    ) -> Result<Particle, RbpfError> {
        let origin = match stored.origin {
            None => None,
            Some(number) => match origins.get(number as usize) {
                Some(state) => Some(state.clone()),
                None => return Err(RbpfError::Stored("origins are in the list")),
            },
        };
        Ok(Particle {
            pose: stored.pose,
            path: keyframes.path(stored.path)?,
            map: landmarks.map(stored.map)?,
            metric: stored.metric,
            prior: None,
            origin,
        })
    }
}
