//! A built scene and its exact truth.
//!
//! World axes: x forward along the first heading, y left, z up; the origin is the first body pose, on the floor.

use crate::calibration::CalibrationError;
use crate::camera::{self, Lens};
use crate::error::SceneError;
use crate::facet::{Facet, nearest};
use crate::layout::{course, furniture, walk};
use crate::odometry::{OdometryRow, report};
use crate::skin::paint::{Skins, paint_facets};
use crate::spec::SceneSpec;
use crate::stream::{Purpose, stream};
use crate::timing::{FRAME_PERIOD_S, ROWS_PER_FRAME};
use crate::trajectory::{Drive, DriveStreams, TruePath};
use crate::walker;
use crate::world::World;
use mono_geometry::{Mount, Pinhole};
use nalgebra::{Isometry3, Point3};
use std::borrow::Cow;

/// A built scene: geometry, the true path, the odometry. Skins are painted apart.
///
/// ```
/// use wall_scenes::{Scene, SceneSpec};
///
/// // The first experiment of the paper, shortened: a textured wall 2 m to the left of a straight path.
/// let scene = Scene::new(SceneSpec { frames: 3, ..SceneSpec::wall(7) })?;
///
/// // The truth costs no rendering: the world point behind a pixel, and where the next frame sees it.
/// let point = scene.point_at(0, 160.0, 120.0).ok_or("nothing there")?;
/// assert!((point.y - 2.0).abs() < 0.5);
/// let [u, _] = scene.project(1, &point).ok_or("out of the image")?;
/// assert!(u < 160.0, "the wall moves to the left");
///
/// // Images need the skins, which are painted once a scene.
/// let skins = scene.skins();
/// let image = scene.render(&skins, 0);
/// assert_eq!((image.width, image.height), (320, 240));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Scene {
    pub(crate) spec: SceneSpec,
    pub(crate) world: World,
    path: TruePath,
    odometry: Vec<OdometryRow>,
}

impl Scene {
    /// Builds the scene of a specification, without painting it: quick.
    ///
    /// # Errors
    /// As [`SceneSpec::check`], or a kidnapping over a distance that the room does not offer.
    pub fn new(spec: SceneSpec) -> Result<Self, SceneError> {
        spec.check()?;
        let drive = Drive {
            course: course(&spec),
            frames: spec.frames,
            rate: spec.frame_rate,
            carrier: spec.carrier,
            stops: spec.stops,
            kidnap: spec.mishaps.kidnap,
            shutter_s: spec.mishaps.shutter_s,
        };
        let stream = |purpose| stream(spec.seed, purpose, 0);
        let path = TruePath::drive(
            &drive,
            &mut DriveStreams {
                steering: stream(Purpose::Path),
                slip: stream(Purpose::Slip),
                sway: stream(Purpose::Sway),
            },
        )?;
        let odometry = report(
            &path.controls,
            &spec.odometry,
            &spec.carrier,
            &mut stream(Purpose::Odometry),
        );
        let world = furniture(&spec);
        Ok(Self {
            spec,
            world,
            path,
            odometry,
        })
    }

    /// The specification it was built from.
    pub fn spec(&self) -> &SceneSpec {
        &self.spec
    }

    /// Paints the skins that [`Self::render`] looks at; a second or so.
    pub fn skins(&self) -> Skins {
        paint_facets(&self.world.facets, &self.world.paints, self.spec.seed)
    }

    /// True path and control.
    pub fn path(&self) -> &TruePath {
        &self.path
    }

    /// The rows the wheels report.
    pub fn odometry(&self) -> &[OdometryRow] {
        &self.odometry
    }

    /// The true camera of all scenes without a fisheye: Table I of the paper, without distortion.
    #[must_use]
    pub fn pinhole() -> Pinhole {
        CalibrationError::default().pinhole(Lens::Pinhole)
    }

    /// The true pose of the camera in the body, which looks to the left.
    #[must_use]
    pub fn mount() -> Mount {
        CalibrationError::default().mount()
    }

    /// Camera and mount as the sequence's `camera.toml` states them, with the errors of the specification; the camera without
    /// the lens of a fisheye.
    #[must_use]
    pub fn stated_calibration(&self) -> (Pinhole, Mount) {
        let calibration = &self.spec.calibration;
        (calibration.pinhole(self.spec.lens()), calibration.mount())
    }

    /// The odometry between an image and the one before it as (seconds, row), rows clipped to the interval; nothing
    /// before the first.
    ///
    /// # Panics
    /// When `image` is beyond the drive.
    pub fn odometry_before(&self, image: usize) -> Vec<(f64, OdometryRow)> {
        let Some(previous) = image.checked_sub(1) else {
            return Vec::new();
        };
        let rate = self.spec.frame_rate;
        let (first, first_share) = rate.row(previous);
        let (last, last_share) = rate.row(image);
        let row_s = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
        (first..=last)
            .filter_map(|row| {
                let from = if row == first { first_share } else { 0.0 };
                let to = if row == last { last_share } else { 1.0 };
                (to > from).then(|| ((to - from) * row_s, self.odometry[row]))
            })
            .collect()
    }

    /// Number of images.
    pub fn images(&self) -> usize {
        self.path.poses.len()
    }

    /// Camera poses while the shutter of a frame is open, equally apart in time; its own pose where it is open for no time.
    pub(crate) fn exposure_poses(&self, frame: usize) -> Vec<Isometry3<f64>> {
        let open = &self.path.exposures[frame];
        if open.is_empty() {
            return vec![self.world_from_camera(frame)];
        }
        open.iter()
            .map(|(pose, attitude)| camera::world_from_camera(pose, attitude))
            .collect()
    }

    /// True camera pose of a frame.
    ///
    /// # Panics
    /// When `frame` is not below the number of frames.
    pub fn world_from_camera(&self, frame: usize) -> Isometry3<f64> {
        camera::world_from_camera(&self.path.poses[frame], &self.path.attitudes[frame])
    }

    /// Depth (camera z, metres) of the surface seen at a pixel position of a frame;
    /// `None` outside the image or where the ray leaves the scene.
    ///
    /// # Panics
    /// When `frame` is not below the number of frames.
    pub fn depth_at(&self, frame: usize, u: f64, v: f64) -> Option<f64> {
        if !camera::on_image(u, v) {
            return None;
        }
        let pose = self.world_from_camera(frame);
        let origin = Point3::from(pose.translation.vector);
        let facets = self.facets_at(frame);
        // The ray has unit camera depth, so its parameter is the depth.
        nearest(
            &facets,
            0..facets.len(),
            &origin,
            &(pose * self.spec.lens().ray(u, v)),
        )
        .map(|hit| hit.distance)
    }

    /// The facets of the scene at the time of a frame.
    pub(crate) fn facets_at(&self, frame: usize) -> Cow<'_, [Facet]> {
        let mut facets = Cow::Borrowed(&self.world.facets[..]);
        if self.spec.mishaps.walker {
            let place = walk(&self.spec).at(self.path.times_s[frame]);
            walker::place(facets.to_mut(), place);
        }
        facets
    }

    /// World point seen at a pixel position of a frame, as [`Self::depth_at`].
    ///
    /// # Panics
    /// When `frame` is not below the number of frames.
    pub fn point_at(&self, frame: usize, u: f64, v: f64) -> Option<Point3<f64>> {
        let depth = self.depth_at(frame, u, v)?;
        Some(self.world_from_camera(frame) * Point3::from(self.spec.lens().ray(u, v) * depth))
    }

    /// Pixel at which a frame would see a world point if nothing hid it; `None`
    /// behind the camera or outside the image.
    ///
    /// # Panics
    /// When `frame` is not below the number of frames.
    pub fn project(&self, frame: usize, point: &Point3<f64>) -> Option<[f64; 2]> {
        let seen = self.world_from_camera(frame).inverse() * point;
        self.spec
            .lens()
            .project(&seen)
            .filter(|&[u, v]| camera::on_image(u, v))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{HEIGHT, WIDTH};
    use crate::screen::ScreenIndex;

    #[test]
    fn screen_index_misses_no_facet() {
        let fisheye = SceneSpec {
            fisheye_px: Some(140.0),
            ..SceneSpec::room(4)
        };
        for spec in [SceneSpec::wall(3), SceneSpec::room(3), fisheye] {
            let lens = spec.lens();
            let scene = Scene::new(spec).unwrap();
            for frame in [0, 17, 25] {
                let pose = scene.world_from_camera(frame);
                let index = ScreenIndex::new(&scene.world.facets, &pose, lens);
                let eye = Point3::from(pose.translation.vector);
                for k in 0..2000 {
                    let (column, row) = (k * 7919 % WIDTH, k * 104_729 % HEIGHT);
                    let direction = pose * lens.ray(column as f64 + 0.37, row as f64 - 0.44);
                    let facets = &scene.world.facets;
                    let candidates = index.at(column, row).iter().map(|&k| k as usize);
                    let fast = nearest(facets, candidates, &eye, &direction);
                    assert_eq!(fast, nearest(facets, 0..facets.len(), &eye, &direction));
                }
            }
        }
    }
}
