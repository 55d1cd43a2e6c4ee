//! The belief that a landmark exists, in maps of unknown association.
//!
//! A wrong measurement starts a landmark that is not there. Each landmark carries the log-odds of its
//! existence: they rise when it is seen and fall when it is expected and not seen, and a landmark that is
//! disbelieved leaves the map.

use crate::association::NamingParticle;
use crate::error::RangeBearingError;
use crate::frame::{Frame, Scan};
use crate::landmark_filter::LandmarkFilter;
use crate::landmark_particle::LandmarkMapping;
use crate::models::FieldOfView;
use rbpf_core::MapUpdate;
use std::collections::BTreeSet;

/// The log-odds of a landmark's existence, and the bound below which it is dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExistenceRules {
    /// Log-odds added when the landmark is seen.
    pub seen: f64,
    /// Log-odds added when it is expected and not seen; negative.
    pub missed: f64,
    /// The bound that the log-odds never exceed.
    pub highest: f64,
    /// The bound below which a landmark is removed.
    pub lowest: f64,
}

/// The map update for unknown association: updates the named landmarks, and doubts those that were
/// expected and not seen. O(M) a particle for M landmarks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubtingMapping<S, F> {
    /// The map update of the named landmarks.
    pub mapping: LandmarkMapping<S, F>,
    /// The rules of the log-odds.
    pub existence: ExistenceRules,
}

impl<S, F, C, const D: usize, const K: usize, const M: usize>
    MapUpdate<NamingParticle<D, K, M>, Scan<C, M>> for DoubtingMapping<S, F>
where
    S: FieldOfView<D, K>,
    F: LandmarkFilter<S, D, K, M>,
{
    type Error = RangeBearingError;

    fn update_map(
        &self,
        naming: &mut NamingParticle<D, K, M>,
        _: &Scan<C, M>,
    ) -> Result<(), RangeBearingError> {
        let frame = Frame {
            control: (),
            measurements: naming.take_named(),
        };
        let particle = &mut naming.particle;
        self.mapping.update_map(particle, &frame)?;
        let rules = &self.existence;
        let seen: BTreeSet<u32> = frame.measurements.iter().map(|(id, _)| *id).collect();
        for id in &seen {
            if let Some(landmark) = particle.map.get_mut(*id) {
                landmark.existence = (landmark.existence + rules.seen).min(rules.highest);
            }
        }
        let missed: Vec<u32> = particle
            .map
            .iter()
            .filter(|(id, landmark)| {
                !seen.contains(id)
                    && self
                        .mapping
                        .sensor
                        .expects(&particle.pose, &landmark.position.mean)
            })
            .map(|(id, _)| id)
            .collect();
        for id in missed {
            let Some(landmark) = particle.map.get_mut(id) else {
                continue;
            };
            landmark.existence += rules.missed;
            if landmark.existence < rules.lowest {
                particle.map.remove(id);
            }
        }
        Ok(())
    }
}
