//! A sequence as all estimators see it: features and odometry, frame by frame, with the truth.
//!
//! Rendering and detection happen once a sequence; every estimator and every seed then works on the same keypoints.

use estimation_base::Se2;
use mono_geometry::{Camera, Distortion};
use nalgebra::Point3;
use slam_io::CameraFile;
use slam_pipeline::config::{Config, OdometrySection};
use slam_pipeline::{OdometryInterval, Rig, detector_of};
use std::collections::BTreeMap;
use std::time::Instant;
use vision_sift::{Features, GrayImage, Workspace};
use wall_scenes::{FRAME_PERIOD_S, Scene, SceneSpec};

use crate::noise::odometry_section;

/// A descriptor as the detector gives it.
type Descriptor = [u8; 128];

/// One sequence with its features.
#[derive(Debug)]
pub(crate) struct Recording {
    /// Name in the rows.
    pub(crate) name: String,
    /// The camera on the robot, as the calibration says.
    pub(crate) rig: Rig,
    /// Features of each frame.
    pub(crate) features: Vec<Features>,
    /// Odometry before each frame; none before the first.
    pub(crate) odometry: Vec<Vec<OdometryInterval>>,
    /// True body pose of each frame; none where the reference has no pose at its time.
    pub(crate) truth: Vec<Option<Se2>>,
    /// The noise that was put into the odometry; none for a recorded sequence.
    pub(crate) noise: Option<OdometrySection>,
    /// The camera file of a recorded sequence, which may state its standard deviations.
    pub(crate) camera: Option<CameraFile>,
    /// Mean time to detect and describe a frame, milliseconds.
    pub(crate) detection_ms: f64,
    /// The truth about what the keypoints saw.
    surface: Surface,
    /// Where each descriptor was measured, (frame, keypoint); `None` when two keypoints share it.
    origins: BTreeMap<Descriptor, Option<(usize, usize)>>,
}

/// The truth about what keypoints saw.
#[derive(Debug)]
pub(crate) enum Surface {
    /// A scene that knows the point behind every pixel.
    Scene(Box<Scene>),
    /// The points that the keypoints of each frame belong to.
    Points(Vec<Vec<Option<Point3<f64>>>>),
    /// Nothing is known.
    Unknown,
}

/// Everything of a recording but its features.
#[derive(Debug)]
pub(crate) struct Drive {
    pub(crate) name: String,
    pub(crate) rig: Rig,
    pub(crate) odometry: Vec<Vec<OdometryInterval>>,
    pub(crate) truth: Vec<Option<Se2>>,
    pub(crate) noise: Option<OdometrySection>,
    pub(crate) camera: Option<CameraFile>,
    pub(crate) surface: Surface,
}

impl Recording {
    /// Renders a scene and detects its keypoints.
    ///
    /// # Errors
    /// The specification or the detector's parameters are refused.
    pub(crate) fn rendered(name: &str, spec: SceneSpec, config: &Config) -> anyhow::Result<Self> {
        let scene = Scene::new(spec)?;
        let skins = scene.skins();
        let (features, detection_ms) = detect(config, scene.images(), |frame| {
            let image = scene.render(&skins, frame);
            Ok((image.width, image.height, image.pixels))
        })?;
        let drive = Drive::of_scene(name, scene)?;
        Ok(Self::new(drive, features, detection_ms))
    }

    /// A recording of known parts.
    pub(crate) fn new(drive: Drive, features: Vec<Features>, detection_ms: f64) -> Self {
        Self {
            origins: origins(&features),
            name: drive.name,
            rig: drive.rig,
            odometry: drive.odometry,
            truth: drive.truth,
            noise: drive.noise,
            camera: drive.camera,
            surface: drive.surface,
            detection_ms,
            features,
        }
    }

    /// The surface point, world axes, that the keypoint with this descriptor really saw.
    ///
    /// A landmark of a map carries the descriptor of its last sighting, byte for byte, which
    /// leads back to the frame and pixel that measured it. `None` where the ray leaves the
    /// scene, nothing is known of the scene, or the descriptor is not unique.
    pub(crate) fn surface_point(&self, descriptor: &Descriptor) -> Option<Point3<f64>> {
        let (frame, index) = (*self.origins.get(descriptor)?)?;
        match &self.surface {
            Surface::Scene(scene) => {
                let keypoint = &self.features[frame].keypoints[index];
                scene.point_at(frame, f64::from(keypoint.x), f64::from(keypoint.y))
            }
            Surface::Points(points) => points[frame][index],
            Surface::Unknown => None,
        }
    }
}

impl Drive {
    /// The drive of a scene.
    ///
    /// # Errors
    /// The scene's camera is none.
    pub(crate) fn of_scene(name: &str, scene: Scene) -> anyhow::Result<Self> {
        let (pinhole, mount) = scene.stated_calibration();
        let path = scene.path();
        let driven_m: f64 = path
            .poses
            .windows(2)
            .map(|p| (p[1].x - p[0].x).hypot(p[1].y - p[0].y))
            .sum();
        let last_s = path.times_s.last().copied().unwrap_or(0.0);
        let step_m = driven_m * FRAME_PERIOD_S / last_s.max(FRAME_PERIOD_S);
        Ok(Self {
            name: name.to_owned(),
            rig: Rig {
                camera: Camera::new(pinhole, Distortion::None)?,
                mount,
            },
            odometry: odometry(&scene),
            truth: scene.path().poses.iter().copied().map(Some).collect(),
            noise: Some(odometry_section(&scene.spec().odometry, step_m)),
            camera: None,
            surface: Surface::Scene(Box::new(scene)),
        })
    }
}

/// Keypoints of `frames` images as `config` detects them, and the mean time of a frame in milliseconds.
///
/// # Errors
/// The detector's parameters are refused, or an image cannot be made.
pub(crate) fn detect(
    config: &Config,
    frames: usize,
    mut image: impl FnMut(usize) -> anyhow::Result<(usize, usize, Vec<u8>)>,
) -> anyhow::Result<(Vec<Features>, f64)> {
    let detector = detector_of(&config.clone().check()?)?;
    let mut workspace = Workspace::new();
    let mut features = Vec::with_capacity(frames);
    let mut detection_s = 0.0;
    for frame in 0..frames {
        let (width, height, pixels) = image(frame)?;
        let view = GrayImage::new(width, height, &pixels)?;
        let mut found = Features::default();
        let start = Instant::now();
        detector.detect(&view, &mut workspace, &mut found)?;
        detection_s += start.elapsed().as_secs_f64();
        features.push(found);
    }
    Ok((features, detection_s * 1e3 / frames.max(1) as f64))
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

/// The rows of the scene in groups, one before each image.
fn odometry(scene: &Scene) -> Vec<Vec<OdometryInterval>> {
    (0..scene.images())
        .map(|image| {
            scene
                .odometry_before(image)
                .into_iter()
                .map(|(duration_s, row)| OdometryInterval {
                    duration_s,
                    v_mps: row.v_mps,
                    omega_radps: row.omega_radps,
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision_sift::Keypoint;
    use wall_scenes::ROWS_PER_FRAME;

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
