//! A landmark of a window as its cameras see it: residual, weight and derivatives of one sighting.
//!
//! With q the direction to the landmark in camera axes, every derivative is that of the pixel by q times that of q, and q is
//! affine in the three parameters: what a landmark needs for all of its sightings is found once.

use mono_geometry::inverse_depth::{HORIZON, LandmarkGeometry, Ray};
use mono_geometry::{Pinhole, PlacedCamera};
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

use super::window_landmarks::TrackSighting;

/// A landmark at some parameters.
pub(crate) struct Target {
    /// The direction to it from any centre.
    pub(crate) ray: Ray,
    /// Derivatives of the direction by the first two parameters, where it is anchored; those of a point are the axes of the
    /// world.
    by_image: Option<[Vector3<f64>; 2]>,
}

/// A sighting that a camera of the window can have, in units that make the noise of its pixel round.
pub(crate) struct Sight {
    /// Measured less predicted pixel.
    pub(crate) residual: Vector2<f64>,
    /// Weight of its square.
    pub(crate) weight: f64,
    /// Half its square in standard deviations, Huber's function.
    pub(crate) cost: f64,
    /// The direction to the landmark from the camera, world axes.
    pub(crate) direction: Vector3<f64>,
    /// Derivative of the pixel by it.
    pub(crate) by_direction: Matrix2x3<f64>,
    /// Derivative of the pixel by the parameters of the landmark.
    pub(crate) by_landmark: Matrix2x3<f64>,
}

impl Target {
    /// The landmark with parameters `mean`, anchored in `anchor` or a point.
    #[inline]
    pub(crate) fn new(anchor: Option<&PlacedCamera>, mean: &Vector3<f64>) -> Self {
        let geometry = anchor.map_or(LandmarkGeometry::Point, |camera| {
            LandmarkGeometry::InverseDepth { anchor: *camera }
        });
        Self {
            ray: geometry.ray(mean),
            by_image: anchor.map(|camera| {
                let axis = |row: usize| camera.camera_from_world.row(row).transpose();
                [axis(0), axis(1)]
            }),
        }
    }

    /// The sighting from `camera`; `None` where the landmark is not in front of it.
    #[inline]
    pub(crate) fn sight(
        &self,
        pinhole: &Pinhole,
        camera: &PlacedCamera,
        sighting: &TrackSighting,
    ) -> Option<Sight> {
        let baseline = self.ray.origin - camera.centre;
        let direction = self.ray.base + baseline * self.ray.rate;
        let rotation = &camera.camera_from_world;
        let q = rotation * direction;
        if q.z <= HORIZON * q.amax() {
            return None;
        }
        let (x, y) = (q.x / q.z, q.y / q.z);
        let predicted = Vector2::new(pinhole.fx * x + pinhole.cx, pinhole.fy * y + pinhole.cy);
        let whitening = &sighting.whitening;
        let residual = whitening.rows(sighting.pixel - predicted);
        let (weight, cost) = sighting.weigh(residual.norm_squared());
        let forward = rotation.row(2);
        let by_direction = whitening.rows(Matrix2x3::from_rows(&[
            (rotation.row(0) - forward * x) * (pinhole.fx / q.z),
            (rotation.row(1) - forward * y) * (pinhole.fy / q.z),
        ]));
        let by_landmark = match &self.by_image {
            Some([a, b]) => by_direction * Matrix3::from_columns(&[*a, *b, baseline]),
            None => by_direction,
        };
        Some(Sight {
            residual,
            weight,
            cost,
            direction,
            by_direction,
            by_landmark,
        })
    }
}
