//! A rendered scene as all estimators see it: features and odometry, frame by frame.
//!
//! Rendering and detection happen once a scene; every estimator then works on the same
//! keypoints. Nothing is written to disk.

use crate::estimator::Estimator;
use nalgebra::Point3;
use slam_pipeline::{OdometryInterval, detector_of};
use std::collections::BTreeMap;
use std::time::Instant;
use vision_sift::{Features, GrayImage, Workspace};
use wall_scenes::{FRAME_PERIOD_S, ROWS_PER_FRAME};
use wall_scenes::{Scene, SceneSpec};

/// A descriptor as the detector gives it.
type Descriptor = [u8; 128];

/// One scene with its features.
#[derive(Debug)]
pub(crate) struct Recording {
    /// The scene; truth for everything.
    pub(crate) scene: Scene,
    /// Features of each frame.
    pub(crate) features: Vec<Features>,
    /// Odometry before each frame; none before the first.
    pub(crate) odometry: Vec<Vec<OdometryInterval>>,
    /// Mean time to detect and describe a frame, milliseconds.
    pub(crate) detection_ms: f64,
    /// Where each descriptor was measured, (frame, keypoint); `None` when two keypoints share it.
    origins: BTreeMap<Descriptor, Option<(usize, usize)>>,
}

impl Recording {
    /// Renders a scene and detects its keypoints.
    ///
    /// # Errors
    /// The specification or the detector's parameters are refused.
    pub(crate) fn new(spec: SceneSpec) -> anyhow::Result<Self> {
        let scene = Scene::new(spec)?;
        // Detection is the same for all estimators: the defaults.
        let config = Estimator::DeadReckoning.config(spec.seed, &spec.odometry);
        let detector = detector_of(&config.check()?)?;
        let mut workspace = Workspace::new();
        let mut features = Vec::with_capacity(spec.frames);
        let mut detection_s = 0.0;
        let skins = scene.skins();
        for frame in 0..spec.frames {
            let image = scene.render(&skins, frame);
            let view = GrayImage::new(image.width, image.height, &image.pixels)?;
            let mut found = Features::default();
            let start = Instant::now();
            detector.detect(&view, &mut workspace, &mut found)?;
            detection_s += start.elapsed().as_secs_f64();
            features.push(found);
        }
        let odometry = odometry(&scene);
        Ok(Self {
            odometry,
            detection_ms: detection_s * 1e3 / spec.frames as f64,
            origins: origins(&features),
            features,
            scene,
        })
    }

    /// The surface point, world axes, that the keypoint with this descriptor really saw.
    ///
    /// A landmark of a map carries the descriptor of its last sighting, byte for byte, which
    /// leads back to the frame and pixel that measured it. `None` where the ray leaves the
    /// scene or the descriptor is not unique.
    pub(crate) fn surface_point(&self, descriptor: &Descriptor) -> Option<Point3<f64>> {
        let (frame, index) = (*self.origins.get(descriptor)?)?;
        let keypoint = &self.features[frame].keypoints[index];
        self.scene
            .point_at(frame, f64::from(keypoint.x), f64::from(keypoint.y))
    }
}

fn origins(features: &[Features]) -> BTreeMap<Descriptor, Option<(usize, usize)>> {
    let mut origins = BTreeMap::new();
    for (frame, found) in features.iter().enumerate() {
        for (index, descriptor) in found.descriptors.iter().enumerate() {
            origins
                .entry(*descriptor)
                .and_modify(|place| *place = None)
                .or_insert(Some((frame, index)));
        }
    }
    origins
}

/// The rows of the scene in groups of one frame.
fn odometry(scene: &Scene) -> Vec<Vec<OdometryInterval>> {
    let mut groups = vec![Vec::new()];
    let moving = scene.odometry().len() - 1;
    for rows in scene.odometry()[..moving].chunks(ROWS_PER_FRAME) {
        groups.push(
            rows.iter()
                .map(|row| OdometryInterval {
                    duration_s: FRAME_PERIOD_S / ROWS_PER_FRAME as f64,
                    v_mps: row.v_mps,
                    omega_radps: row.omega_radps,
                })
                .collect(),
        );
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision_sift::Keypoint;

    fn found(tags: &[u8]) -> Features {
        let keypoint = Keypoint {
            x: 1.0,
            y: 2.0,
            sigma: 2.0,
            angle: 0.0,
            response: 0.1,
        };
        Features {
            keypoints: vec![keypoint; tags.len()],
            descriptors: tags.iter().map(|&tag| [tag; 128]).collect(),
        }
    }

    #[test]
    fn descriptors_lead_back_to_their_keypoint_unless_shared() {
        let map = origins(&[found(&[1, 2]), found(&[3, 2])]);
        assert_eq!(map[&[1; 128]], Some((0, 0)));
        assert_eq!(map[&[3; 128]], Some((1, 0)));
        assert_eq!(map[&[2; 128]], None);
    }

    #[test]
    fn there_is_one_group_of_odometry_a_frame() {
        let scene = Scene::new(SceneSpec {
            frames: 3,
            ..SceneSpec::wall(1)
        })
        .unwrap();
        let groups = odometry(&scene);
        let lengths: Vec<_> = groups.iter().map(Vec::len).collect();
        assert_eq!(lengths, [0, ROWS_PER_FRAME, ROWS_PER_FRAME]);
        assert_eq!(groups[2][0].v_mps, scene.odometry()[ROWS_PER_FRAME].v_mps);
    }
}
