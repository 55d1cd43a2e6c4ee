//! FastSLAM 2.0 and the unscented filter on the frames of a recording, whatever the robot.

use super::published::PublishedProposal;
use nalgebra::{Vector2, Vector3};
use range_bearing_slam::{
    Associating, AssociationRules, DoubtingMapping, ExistenceRules, ExtendedLandmarks,
    ExtendedProposal, LandmarkMapping, LandmarkParticle, Linearisation, MotionModel,
    NamingParticle, RangeBearing, RangeBearingError, Scan, UnscentedLandmarks, UnscentedProposal,
    weighted_moments,
};
use rbpf_core::{
    FilterConfig, MapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, Streams,
};
use std::error::Error;

/// The estimate of a filter.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    /// Mean pose after each frame.
    pub(crate) poses: Vec<Vector3<f64>>,
    /// The map of the particle with the largest weight at the end.
    pub(crate) landmarks: Vec<(u32, Vector2<f64>)>,
}

/// A combination of proposal, weights and landmark filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// FastSLAM 2.0 with its published weights.
    FastSlam2Published,
    /// FastSLAM 2.0 with exact weights.
    FastSlam2,
    /// Unscented proposal and landmarks.
    Unscented,
}

impl Method {
    /// The name in tables.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::FastSlam2Published => "FastSLAM 2.0 published weights",
            Self::FastSlam2 => "FastSLAM 2.0",
            Self::Unscented => "unscented",
        }
    }
}

/// The models of a robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Robot<A> {
    /// The motion.
    pub(crate) motion: A,
    /// The sensor.
    pub(crate) sensor: RangeBearing,
    /// The rules by which measurements without ids are named.
    pub(crate) rules: AssociationRules,
    /// The rules by which landmarks are doubted.
    pub(crate) existence: ExistenceRules,
}

impl<A: MotionModel<3, Control: Clone + Sync> + Copy> Robot<A> {
    /// The path by the controls alone.
    pub(crate) fn dead_reckoning<'a>(
        &self,
        start: Vector3<f64>,
        controls: impl Iterator<Item = &'a A::Control>,
    ) -> Estimate
    where
        A::Control: 'a,
    {
        let mut pose = start;
        let poses = controls
            .map(|control| {
                pose = self.motion.predict(&pose, control).mean;
                pose
            })
            .collect();
        Estimate {
            poses,
            landmarks: Vec::new(),
        }
    }

    /// Runs a filter that names the measurements itself.
    ///
    /// # Errors
    /// Any error of the filter.
    pub(crate) fn associate(
        &self,
        method: Method,
        trial: &Trial<'_, Scan<A::Control, 2>>,
    ) -> Result<Estimate, Box<dyn Error>> {
        let start = NamingParticle::<3, 2, 2>::new(LandmarkParticle::new(trial.start));
        let (jacobians, sigma) = (self.by_jacobians(), self.by_sigma_points());
        let (jacobians, sigma) = (self.doubting(jacobians), self.doubting(sigma));
        let map = |naming: &NamingParticle<3, 2, 2>| naming.particle.clone();
        match method {
            Method::FastSlam2Published => {
                let proposal = self.associating(self.published());
                trial.run(start, &proposal, &jacobians, map)
            }
            Method::FastSlam2 => {
                let proposal = self.associating(self.extended());
                trial.run(start, &proposal, &jacobians, map)
            }
            Method::Unscented => {
                let proposal = self.associating(self.unscented());
                trial.run(start, &proposal, &sigma, map)
            }
        }
    }

    pub(crate) const fn published(&self) -> PublishedProposal<A> {
        PublishedProposal {
            motion: self.motion,
            sensor: self.sensor,
        }
    }

    pub(crate) const fn extended(&self) -> ExtendedProposal<A, RangeBearing> {
        ExtendedProposal {
            motion: self.motion,
            sensor: self.sensor,
            linearisation: Linearisation::Sequential,
        }
    }

    pub(crate) const fn unscented(&self) -> UnscentedProposal<A, RangeBearing> {
        UnscentedProposal {
            motion: self.motion,
            sensor: self.sensor,
            iterations: 2,
        }
    }

    pub(crate) const fn by_jacobians(&self) -> LandmarkMapping<RangeBearing, ExtendedLandmarks> {
        LandmarkMapping {
            sensor: self.sensor,
            filter: ExtendedLandmarks,
        }
    }

    pub(crate) const fn by_sigma_points(
        &self,
    ) -> LandmarkMapping<RangeBearing, UnscentedLandmarks> {
        LandmarkMapping {
            sensor: self.sensor,
            filter: UnscentedLandmarks,
        }
    }

    fn associating<I>(&self, inner: I) -> Associating<A, RangeBearing, I> {
        Associating {
            motion: self.motion,
            sensor: self.sensor,
            inner,
            rules: self.rules,
        }
    }

    const fn doubting<F: Copy>(
        &self,
        mapping: LandmarkMapping<RangeBearing, F>,
    ) -> DoubtingMapping<RangeBearing, F> {
        DoubtingMapping {
            mapping,
            existence: self.existence,
        }
    }
}

/// One run of a filter through the frames of a recording.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trial<'a, O> {
    /// The pose before the first frame.
    pub(crate) start: Vector3<f64>,
    /// Number of particles.
    pub(crate) particles: usize,
    /// Seed of the filter's random numbers.
    pub(crate) seed: u64,
    /// The frames.
    pub(crate) frames: &'a [O],
}

impl<O: Sync> Trial<'_, O> {
    /// Runs copies of `start` through all frames; `inner` is the particle with pose and map.
    ///
    /// # Errors
    /// Any error of the filter.
    pub(crate) fn run<P: Clone + Send + Sync + 'static>(
        &self,
        start: P,
        proposal: &impl Proposal<P, O, Error = RangeBearingError>,
        mapping: &impl MapUpdate<P, O, Error = RangeBearingError>,
        inner: impl Fn(&P) -> LandmarkParticle<3, 2>,
    ) -> Result<Estimate, Box<dyn Error>> {
        let set = ParticleSet::new(vec![start; self.particles])?;
        let streams = Streams::new(self.seed);
        let mut filter = ParticleFilter::new(set, streams, FilterConfig::default())?;
        let mut poses = Vec::with_capacity(self.frames.len());
        for (number, frame) in (0..).zip(self.frames) {
            filter.step(number, frame, proposal, &NoRejuvenation, mapping)?;
            let set = filter.set();
            let all: Vec<_> = set.particles().iter().map(|p| inner(p).pose).collect();
            let moments = weighted_moments(&all, &set.weights(), &[2]).ok_or("no particles")?;
            poses.push(moments.mean);
        }
        let best = inner(&filter.set().particles()[filter.set().best()]);
        let landmarks = best
            .map
            .iter()
            .map(|(id, landmark)| (id, landmark.position.mean))
            .collect();
        Ok(Estimate { poses, landmarks })
    }
}
