//! The order in which a bundle is walked: observations sorted by landmark, then by pose, and where their blocks go.
//!
//! Built once for all iterations. A *link* is a pair (landmark, free pose) with at least one observation: it owns one
//! D x 3 block W of the normal equations. Links of neighbouring poses form a *run*: their rows in the reduced system
//! are contiguous, so that the Schur complement is subtracted in long inner loops.

use nalgebra::Vector2;

use super::intrinsics::Intrinsics;
use super::pose::BundlePose;
use super::problem::Problem;
use crate::noise_shape::NoiseShape;

/// Marks an observation from a fixed pose.
pub(super) const NO_LINK: usize = usize::MAX;

/// An observation in walking order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sighting {
    pub(super) pose: usize,
    /// Index of its link, [`NO_LINK`] for a fixed pose.
    pub(super) link: usize,
    /// Ideal, or of the real picture if the camera is unknown; likewise the noise.
    pub(super) pixel: Vector2<f64>,
    pub(super) sigma_px: f64,
    pub(super) shape: NoiseShape,
    /// Index in the list of the caller.
    pub(super) given: usize,
}

/// Consecutive links of one landmark whose free poses are consecutive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    /// First link, counted from the first link of the landmark.
    pub(super) local: usize,
    pub(super) length: usize,
    /// Free pose of the first link.
    pub(super) free_pose: usize,
}

#[derive(Debug)]
pub(super) struct Layout {
    /// Free poses in ascending order.
    pub(super) free_poses: Vec<usize>,
    /// Place of each pose among the free ones.
    pub(super) free_index: Vec<Option<usize>>,
    pub(super) sightings: Vec<Sighting>,
    /// Free pose of each link.
    pub(super) links: Vec<usize>,
    pub(super) runs: Vec<Run>,
    /// For each free pose the first that it shares a landmark or an odometry factor with, itself at the latest.
    pub(super) first: Vec<usize>,
    /// Parameters of the camera that are free, if it is unknown.
    pub(super) parameters: Vec<usize>,
    /// Where the sightings, links and runs of each landmark begin; one entry more than landmarks.
    pub(super) starts: Vec<Start>,
}

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Start {
    pub(super) sighting: usize,
    pub(super) link: usize,
    pub(super) run: usize,
}

impl Layout {
    /// For a problem that has been checked. O(n log n).
    pub(super) fn new<P: BundlePose<D>, const D: usize>(problem: &Problem<P, D>) -> Self {
        let mut free_index = vec![Some(0); problem.poses.len()];
        for pose in &problem.fixed_poses {
            free_index[*pose] = None;
        }
        let mut free_poses = Vec::new();
        for (pose, slot) in free_index.iter_mut().enumerate() {
            if let Some(index) = slot {
                *index = free_poses.len();
                free_poses.push(pose);
            }
        }
        let mut order: Vec<usize> = (0..problem.observations.len()).collect();
        order.sort_by_key(|&i| {
            let o = &problem.observations[i];
            (o.landmark, o.pose)
        });
        let unknown = problem.unknown_camera();
        let mut layout = Self {
            free_poses,
            free_index,
            sightings: Vec::with_capacity(order.len()),
            links: Vec::with_capacity(order.len()),
            runs: Vec::new(),
            first: Vec::new(),
            parameters: unknown.map_or(Vec::new(), Intrinsics::free),
            starts: Vec::with_capacity(problem.landmarks.len() + 1),
        };
        let mut rest = order.iter().peekable();
        for landmark in 0..problem.landmarks.len() {
            layout.open();
            while let Some(&&given) = rest
                .next_if(|&&i| problem.observations[i].landmark == landmark)
                .as_ref()
            {
                let o = &problem.observations[given];
                let link = layout.free_index[o.pose].map_or(NO_LINK, |free| layout.link(free));
                let (pixel, shape) = unknown.map_or((o.pixel_ideal, o.shape), |camera| {
                    camera.real_pixel(&o.pixel_ideal, &o.shape)
                });
                layout.sightings.push(Sighting {
                    pose: o.pose,
                    link,
                    pixel,
                    sigma_px: o.sigma_px,
                    shape,
                    given,
                });
            }
        }
        layout.open();
        layout.first = (0..layout.free_poses.len()).collect();
        for range in layout.starts.windows(2) {
            let links = &layout.links[range[0].link..range[1].link];
            for &pose in links {
                // Links ascend.
                layout.first[pose] = layout.first[pose].min(links[0]);
            }
        }
        for factor in &problem.odometry {
            let ends = (layout.free_index[factor.from], layout.free_index[factor.to]);
            if let (Some(from), Some(to)) = ends {
                let (low, high) = (from.min(to), from.max(to));
                layout.first[high] = layout.first[high].min(low);
            }
        }
        layout
    }

    /// Most links of one landmark.
    pub(super) fn longest(&self) -> usize {
        self.starts
            .windows(2)
            .map(|pair| pair[1].link - pair[0].link)
            .max()
            .unwrap_or(0)
    }

    fn open(&mut self) {
        self.starts.push(Start {
            sighting: self.sightings.len(),
            link: self.links.len(),
            run: self.runs.len(),
        });
    }

    /// The link of the landmark opened last to a free pose; poses come in ascending order.
    fn link(&mut self, free: usize) -> usize {
        let start = self.starts.last().copied().unwrap_or_default();
        let local = self.links.len() - start.link;
        if local > 0 && self.links.last() == Some(&free) {
            return self.links.len() - 1;
        }
        self.links.push(free);
        let open_runs = self.runs.len() - start.run;
        match self.runs.last_mut() {
            Some(run) if open_runs > 0 && run.free_pose + run.length == free => run.length += 1,
            _ => self.runs.push(Run {
                local,
                length: 1,
                free_pose: free,
            }),
        }
        self.links.len() - 1
    }
}
