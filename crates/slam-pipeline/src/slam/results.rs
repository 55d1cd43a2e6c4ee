//! The results of a run: the whole path and the map in metres.

use mono_geometry::Se2;

use super::{MapLandmark, Slam};
use crate::frontend::catalogue::Stage;

impl Slam {
    /// The whole path of the best particle, one body pose a frame.
    #[must_use]
    pub fn smoothed_path(&self) -> Vec<Se2> {
        let set = self.state.filter.set();
        let best = &set.particles()[set.best()];
        let world = best.metric_world(self.rig.lever_m());
        self.state
            .path
            .iter()
            .filter_map(|frame| {
                let body = world.body(&best.path.get(frame.keyframe as usize)?.pose);
                Some(Se2::new(body.x, body.y, body.phi).compose(&frame.keyframe_from_body))
            })
            .collect()
    }

    /// The map of the best particle in metres, in order of id. Landmarks whose depth is not positive are left out.
    #[must_use]
    pub fn landmarks(&self) -> Vec<MapLandmark> {
        let set = self.state.filter.set();
        let best = &set.particles()[set.best()];
        let world = best.metric_world(self.rig.lever_m());
        self.state
            .catalogue
            .iter()
            .filter(|(_, e)| e.stage == Stage::Mapped)
            .filter_map(|(id, entry)| {
                let landmark = best.map.get(id)?;
                let point = best.metric_point(landmark, &world)?;
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
