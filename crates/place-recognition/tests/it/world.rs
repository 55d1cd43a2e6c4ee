//! A simulated map: rooms in a row, landmarks on their walls, and a camera in one of them.

use mono_geometry::{NoiseShape, Pinhole, Se3, so3};
use nalgebra::{Matrix3, Vector2, Vector3};
use place_recognition::PointMatch;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub(crate) const PINHOLE: Pinhole = Pinhole {
    width: 640,
    height: 480,
    fx: 420.0,
    fy: 420.0,
    cx: 319.5,
    cy: 239.5,
};
/// Distance of two rooms, metres.
const ROOM_M: f64 = 20.0;
pub(crate) const SIGMA_PX: f64 = 1.0;

pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

pub(crate) fn normal3(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(rng))
}

pub(crate) struct World {
    pub(crate) rng: ChaCha8Rng,
    rooms: u32,
}

impl World {
    pub(crate) fn new(seed: u64, rooms: u32) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            rooms,
        }
    }

    /// Where the keyframes of a room are.
    pub(crate) fn seen_from(room: u32) -> Vector3<f64> {
        Vector3::new(ROOM_M * f64::from(room), 0.0, 0.0)
    }

    /// A camera near the keyframes of a room, turned a little.
    pub(crate) fn camera(&mut self, room: u32) -> Se3 {
        let turn = 0.1 * normal3(&mut self.rng);
        let place = Self::seen_from(room) + 0.3 * normal3(&mut self.rng);
        Se3::new(so3::exp(&turn), place)
    }

    /// A point that the camera sees at a depth from 2 to 6 m; on a wall 4 m ahead if `planar`.
    pub(crate) fn point_in_view(&mut self, world_from_camera: &Se3, planar: bool) -> Vector3<f64> {
        let pixel = self.pixel();
        let depth = if planar {
            4.0
        } else {
            self.rng.random_range(2.0..6.0)
        };
        let ray = PINHOLE.normalize(&pixel).push(1.0);
        let point = world_from_camera.transform_point(&(depth * ray));
        if !planar {
            return point;
        }
        // Along the ray to the plane z = 4 of the world.
        let from = world_from_camera.translation;
        from + (point - from) * ((4.0 - from.z) / (point.z - from.z))
    }

    pub(crate) fn pixel(&mut self) -> Vector2<f64> {
        Vector2::new(
            self.rng.random_range(0.0..639.0),
            self.rng.random_range(0.0..479.0),
        )
    }

    /// A landmark anywhere in a room.
    pub(crate) fn point_in_room(&mut self, room: u32) -> Vector3<f64> {
        Self::seen_from(room)
            + Vector3::new(
                self.rng.random_range(-4.0..4.0),
                self.rng.random_range(-2.0..2.0),
                self.rng.random_range(2.0..6.0),
            )
    }

    /// A true match whose landmark is known with the given covariance: keypoint and landmark carry one number.
    pub(crate) fn true_match(
        &mut self,
        number: u32,
        world_from_camera: &Se3,
        point: Vector3<f64>,
        room: u32,
        covariance: &Matrix3<f64>,
    ) -> PointMatch {
        let seen = world_from_camera.inverse().transform_point(&point);
        let pixel = PINHOLE.project(&seen).expect("in front of the camera");
        let noise = SIGMA_PX * Vector2::new(normal(&mut self.rng), normal(&mut self.rng));
        let root = covariance.cholesky().map_or(Matrix3::zeros(), |c| c.l());
        PointMatch {
            keypoint: number as usize,
            landmark: number,
            point_in_world: point + root * normal3(&mut self.rng),
            point_covariance: *covariance,
            seen_from: Self::seen_from(room),
            pixel_ideal: pixel + noise,
            sigma_px: SIGMA_PX,
            shape: NoiseShape::ROUND,
            quality: self.rng.random_range(0.2..1.0),
        }
    }

    /// A wrong match with a landmark of `room`, or of any room.
    pub(crate) fn wrong_match(&mut self, number: u32, room: Option<u32>) -> PointMatch {
        let room = room.unwrap_or_else(|| self.rng.random_range(0..self.rooms));
        PointMatch {
            keypoint: number as usize,
            landmark: number,
            point_in_world: self.point_in_room(room),
            point_covariance: Matrix3::identity() * 1e-4,
            seen_from: Self::seen_from(room),
            pixel_ideal: self.pixel(),
            sigma_px: SIGMA_PX,
            shape: NoiseShape::ROUND,
            quality: self.rng.random_range(0.0..0.4),
        }
    }

    /// `right` true matches of points at random in view, then `wrong` wrong ones; the room of the latter may be given.
    pub(crate) fn matches(
        &mut self,
        world_from_camera: &Se3,
        room: u32,
        right: u32,
        wrong: u32,
        room_of_wrong: Option<u32>,
    ) -> Vec<PointMatch> {
        let covariance = Matrix3::identity() * 1e-4;
        let mut matches: Vec<PointMatch> = (0..right)
            .map(|number| {
                let point = self.point_in_view(world_from_camera, false);
                self.true_match(number, world_from_camera, point, room, &covariance)
            })
            .collect();
        matches.extend((right..right + wrong).map(|n| self.wrong_match(n, room_of_wrong)));
        matches
    }
}

/// Distance in metres and angle in radians of two poses.
pub(crate) fn apart(a: &Se3, b: &Se3) -> (f64, f64) {
    let difference = a.inverse().compose(b);
    (difference.translation.norm(), difference.rotation.angle())
}
