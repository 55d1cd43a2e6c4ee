//! The results of a run: the whole path and the map in metres.

use mono_geometry::Se2;

use super::{MapLandmark, Slam};
use crate::filter::metric_path::MetricPath;
use crate::frontend::catalogue::Stage;

impl Slam {
    /// The whole path of the best particle, one body pose a frame.
    #[must_use]
    pub fn smoothed_path(&self) -> Vec<Se2> {
        let set = self.state.filter.set();
        let best = &set.particles()[set.best()];
        let world = MetricPath::new(best, self.rig.lever_m(), &self.tied());
        self.state
            .path
            .iter()
            .filter_map(|frame| {
                let pose = best.path.get(frame.keyframe as usize)?.pose;
                let body = world.body(frame.keyframe, &pose);
                Some(Se2::new(body.x, body.y, body.phi).compose(&frame.keyframe_from_body))
            })
            .collect()
    }

    /// The map of the best particle in metres, in order of id. Landmarks whose depth is not positive are left out.
    #[must_use]
    pub fn landmarks(&self) -> Vec<MapLandmark> {
        let set = self.state.filter.set();
        let best = &set.particles()[set.best()];
        let world = MetricPath::new(best, self.rig.lever_m(), &self.tied());
        self.state
            .catalogue
            .iter()
            .filter(|(_, e)| e.stage == Stage::Mapped)
            .filter_map(|(id, entry)| {
                let landmark = best.map.get(id)?;
                let anchor = landmark.anchor().unwrap_or(entry.first.keyframe);
                let point = world.point(best, landmark, anchor)?;
                Some(MapLandmark {
                    id,
                    position: point.position,
                    covariance: point.covariance,
                    observations: entry.observations,
                    descriptor: Some(entry.descriptor.clone()),
                })
            })
            .collect()
    }
}
