//! Drives a filter through the frames of a recording.

use nalgebra::{Vector2, Vector3};
use rbpf_core::{
    FilterConfig, LandmarkParticle, MapUpdate, NoRejuvenation, ParticleFilter, ParticleSet,
    PoseAndMap, Proposal, RbpfError, Streams, weighted_moments,
};
use std::error::Error;

/// What a filter made of a recording.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    /// Mean pose after each frame.
    pub(crate) poses: Vec<Vector3<f64>>,
    /// The map of the particle with the largest weight at the end.
    pub(crate) landmarks: Vec<(u32, Vector2<f64>)>,
}

/// N copies of `start`, through all frames.
///
/// # Errors
/// What the filter reports.
pub(crate) fn run<P, O>(
    start: P,
    particles: usize,
    seed: u64,
    frames: &[O],
    proposal: &impl Proposal<P, O, Error = RbpfError>,
    mapping: &impl MapUpdate<P, O, Error = RbpfError>,
    holder: impl Fn(&P) -> LandmarkParticle<3, 2>,
) -> Result<Estimate, Box<dyn Error>>
where
    P: PoseAndMap<3, 2> + Send + Sync + 'static,
    O: Sync,
{
    let set = ParticleSet::new(vec![start; particles])?;
    let mut filter = ParticleFilter::new(set, Streams::new(seed), FilterConfig::default())?;
    let mut poses = Vec::with_capacity(frames.len());
    for (number, frame) in (0..).zip(frames) {
        filter.step(number, frame, proposal, &NoRejuvenation, mapping)?;
        let set = filter.set();
        let all: Vec<_> = set.particles().iter().map(PoseAndMap::pose).collect();
        let moments = weighted_moments(&all, &set.weights(), &[2]).ok_or("no particles")?;
        poses.push(moments.mean);
    }
    let best = holder(&filter.set().particles()[filter.set().best()]);
    let landmarks = best
        .map
        .iter()
        .map(|(id, landmark)| (id, landmark.position.mean))
        .collect();
    Ok(Estimate { poses, landmarks })
}
