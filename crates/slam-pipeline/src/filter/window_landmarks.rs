//! The landmarks seen in a window, each with its Gaussian at the beginning of it and its sightings.
//!
//! The prior of the depth is taken out of them. One landmark's guess is harmless, but hundreds of them share it,
//! and with every depth free they would agree on a shorter path: on rendered walls the scale shrank by a twentieth. In
//! the map the prior stays.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector2, Vector3};

use super::landmark::{InverseDepthPrior, Landmark, Parametrisation};
use super::observation::MatchedFeature;
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
    /// One over its variance afterwards.
    precision: f64,
}

impl TrackSighting {
    fn new(step: usize, matched: &MatchedFeature) -> Self {
        let whitening = matched.noise.whitening();
        Self {
            step,
            pixel: matched.pixel,
            precision: 1.0 / whitening.variance,
            whitening,
        }
    }

    /// The weight of a whitened residual of this squared length, and its cost: half its square in standard deviations, Huber's
    /// function beyond the bend.
    #[inline]
    pub(crate) fn weigh(&self, squared_length: f64) -> (f64, f64) {
        let squared = squared_length * self.precision;
        if squared > HUBER_SIGMAS * HUBER_SIGMAS {
            let normalised = squared.sqrt();
            (
                HUBER_SIGMAS / normalised * self.precision,
                HUBER_SIGMAS * (normalised - 0.5 * HUBER_SIGMAS),
            )
        } else {
            (self.precision, 0.5 * squared)
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
    let matches = |(k, step)| {
        let step: &Arc<WindowStep> = step;
        step.observation.matches.iter().map(move |m| (k, m))
    };
    let mut seen: Vec<(usize, &MatchedFeature)> =
        steps.iter().enumerate().flat_map(matches).collect();
    // Of each landmark the order of time stays.
    seen.sort_by_key(|(_, m)| m.id);
    seen.chunk_by(|(_, a), (_, b)| a.id == b.id)
        .filter_map(|seen| {
            // Sightings before its Gaussian is known tell nothing.
            let (first, mut track) = seen.iter().enumerate().find_map(|(i, (_, m))| {
                let track = Track::new(m.id, start.map.get(m.id), m.prototype, depth)?;
                Some((i, track))
            })?;
            if let Some(landmark) = end.map.get(track.id) {
                track.start = landmark.mean;
            }
            let sightings = seen[first..].iter();
            track.sightings = sightings.map(|(k, m)| TrackSighting::new(*k, m)).collect();
            Some(track)
        })
        .collect()
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
