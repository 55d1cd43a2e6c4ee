//! The landmarks seen in a window, each with its Gaussian at the beginning of it and its sightings.
//!
//! The prior of the depth is taken out of them. One landmark's guess is harmless, but hundreds of them share it,
//! and with every depth free they would agree on a shorter path: on rendered walls the scale shrank by a twentieth. In
//! the map the prior stays.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector2, Vector3};

use super::landmark::{InverseDepthPrior, Landmark, Parametrisation};
use super::particle::Particle;
use super::pixel_noise::Whitening;
use super::segment::WindowStep;

/// Information about an inverse depth that stays in a window, about infinity, as a share of that of its prior; it keeps a landmark
/// without parallax regular.
const LEFT_OF_DEPTH: f64 = 1e-3;
/// Residuals beyond this many standard deviations count linearly.
const HUBER_SIGMAS: f64 = 2.5;

/// A landmark of the window.
pub(crate) struct Track {
    /// Identity.
    pub(crate) id: u32,
    /// How its parameters are read.
    pub(crate) parametrisation: Parametrisation,
    /// Information at the beginning of the window, and information times mean, without the prior of the depth.
    pub(crate) prior_information: Matrix3<f64>,
    pub(crate) prior_vector: Vector3<f64>,
    /// The information of the prior of the inverse depth that was taken out, and its mean.
    pub(crate) depth: (f64, f64),
    /// Where it is linearised first.
    pub(crate) start: Vector3<f64>,
    /// Its sightings in the window, in order of time.
    pub(crate) sightings: Vec<TrackSighting>,
}

/// A sighting of a landmark in the window.
pub(crate) struct TrackSighting {
    /// Step of the window.
    pub(crate) step: usize,
    /// Measured pixel, undistorted.
    pub(crate) pixel: Vector2<f64>,
    /// The map that makes its noise round.
    pub(crate) whitening: Whitening,
}

impl TrackSighting {
    /// The weight of a whitened residual of this length, and its cost: half its square in standard deviations, Huber's function
    /// beyond the bend.
    pub(crate) fn weigh(&self, length: f64) -> (f64, f64) {
        let variance = self.whitening.variance;
        let normalised = length / variance.sqrt();
        if normalised > HUBER_SIGMAS {
            (
                HUBER_SIGMAS / normalised / variance,
                HUBER_SIGMAS * (normalised - 0.5 * HUBER_SIGMAS),
            )
        } else {
            (1.0 / variance, 0.5 * normalised * normalised)
        }
    }
}

/// The landmarks seen in the window, with their Gaussians at its beginning, in `start`, or after their first sighting; linearised
/// first where `end` has them.
#[must_use]
pub(crate) fn tracks(
    start: &Particle,
    end: &Particle,
    steps: &[Arc<WindowStep>],
    depth: InverseDepthPrior,
) -> Vec<Track> {
    let mut tracks: BTreeMap<u32, Track> = BTreeMap::new();
    for (k, step) in steps.iter().enumerate() {
        for m in &step.observation.matches {
            let track = match tracks.entry(m.id) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(vacant) => {
                    let Some(mut track) = Track::new(m.id, start.map.get(m.id), m.prototype, depth)
                    else {
                        continue;
                    };
                    if let Some(landmark) = end.map.get(m.id) {
                        track.start = landmark.mean;
                    }
                    vacant.insert(track)
                }
            };
            track.sightings.push(TrackSighting {
                step: k,
                pixel: m.pixel,
                whitening: m.noise.whitening(),
            });
        }
    }
    tracks.into_values().collect()
}

impl Track {
    /// The landmark as the map at the beginning has it, or as its first sighting left it, without the prior of its depth;
    /// `None` when it is neither or its covariance is singular.
    fn new(
        id: u32,
        known: Option<&Landmark>,
        prototype: Option<Landmark>,
        depth: InverseDepthPrior,
    ) -> Option<Self> {
        let landmark = known.copied().or(prototype)?;
        let mut prior_information = landmark.covariance.cholesky()?.inverse();
        let mut prior_vector = prior_information * landmark.mean;
        let mut depth_prior = (0.0, depth.mean);
        if landmark.anchor().is_some() {
            let (guess, weight) = if known.is_some() {
                (depth.mean, 1.0 / (depth.sigma * depth.sigma))
            } else {
                (landmark.mean.z, 1.0 / landmark.covariance[(2, 2)])
            };
            let taken = weight.min(prior_information[(2, 2)]);
            prior_information[(2, 2)] += weight * LEFT_OF_DEPTH - taken;
            prior_vector.z -= taken * guess;
            depth_prior = (taken, guess);
        }
        Some(Self {
            id,
            parametrisation: landmark.parametrisation,
            prior_information,
            prior_vector,
            depth: depth_prior,
            start: landmark.mean,
            sightings: Vec::new(),
        })
    }
}
