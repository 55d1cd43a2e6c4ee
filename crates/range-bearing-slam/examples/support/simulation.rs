//! A car with a range-bearing sensor drives a loop of waypoints among point landmarks: the
//! simulations of Kim, Sakthivel and Chung, "Unscented FastSLAM", IEEE T-RO 24(4), 2008, section V.
//!
//! The car follows its commands exactly; the filter is told the commands with noise, drawn anew every
//! 25 ms. Measurements carry the ids of their landmarks. All poses and landmarks are in the frame of the
//! first pose.

use estimation_base::wrap;
use nalgebra::{Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{Purpose, Streams};
use std::f64::consts::FRAC_PI_2;

/// Time between two commands, seconds (40 Hz).
pub(crate) const COMMAND_INTERVAL: f64 = 0.025;
/// Number of commands between two scans (5 Hz).
pub(crate) const COMMANDS_PER_SCAN: usize = 8;
/// Distance from the front to the rear axle, metres.
pub(crate) const WHEELBASE: f64 = 0.26;
/// Distance at which a waypoint is reached, metres.
const WAYPOINT_RADIUS: f64 = 1.0;
/// Largest steering angle, radians.
const MAX_STEERING: f64 = std::f64::consts::PI / 6.0;
/// Largest rate of the steering angle, radians per second.
const STEERING_RATE: f64 = std::f64::consts::PI / 9.0;

/// Corners of the paper's first path, 100 x 20 m. Its first leg lies on the x axis.
pub(crate) const RECTANGLE: [[f64; 2]; 4] = [[100.0, 0.0], [100.0, 20.0], [0.0, 20.0], [0.0, 0.0]];

/// The path of the car and the landmarks beside it, in metres.
#[derive(Clone, Debug)]
pub(crate) struct World {
    /// Corners of the loop; the car starts at the last one, facing the first.
    pub(crate) waypoints: Vec<Vector2<f64>>,
    /// Positions of the landmarks; the index is the id.
    pub(crate) landmarks: Vec<Vector2<f64>>,
}

impl World {
    /// A closed path through `waypoints`, with a landmark drawn about every `spacing` metres of it, up
    /// to `reach` metres to either side. The same `seed` gives the same world.
    pub(crate) fn along(waypoints: &[[f64; 2]], spacing: f64, reach: f64, seed: u64) -> Self {
        let waypoints: Vec<Vector2<f64>> =
            waypoints.iter().map(|&[x, y]| Vector2::new(x, y)).collect();
        let mut rng = Streams::new(seed).shared(0, Purpose::Scene);
        let mut landmarks = Vec::new();
        for (corner, end) in waypoints.iter().enumerate() {
            let start = waypoints[(corner + waypoints.len() - 1) % waypoints.len()];
            let along = end - start;
            let side = Vector2::new(-along.y, along.x).normalize();
            let count = (along.norm() / spacing).round().max(1.0);
            let mut step = 0.0;
            while step < count {
                let (u, v): (f64, f64) = (rng.random(), rng.random());
                landmarks
                    .push(start + along * ((step + u) / count) + side * (reach * (2.0 * v - 1.0)));
                step += 1.0;
            }
        }
        Self {
            waypoints,
            landmarks,
        }
    }
}

/// Speed of the car and standard deviations of its measurements.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Speed, metres per second.
    pub(crate) speed: f64,
    /// Standard deviation of the speed told to the filter, metres per second.
    pub(crate) speed_deviation: f64,
    /// Standard deviation of the steering angle told to the filter, radians.
    pub(crate) steering_deviation: f64,
    /// Farthest range, metres; the field of view is the half-plane ahead.
    pub(crate) range: f64,
    /// Standard deviation of the range, metres.
    pub(crate) range_deviation: f64,
    /// Standard deviation of the bearing, radians.
    pub(crate) bearing_deviation: f64,
    /// Number of laps round the waypoints.
    pub(crate) laps: usize,
}

impl Settings {
    /// One lap at 0.6 m/s with the control noise of the paper's third setting, which it gives for that
    /// setting only.
    pub(crate) const fn slow(range: f64, range_deviation: f64, bearing_degrees: f64) -> Self {
        Self {
            speed: 0.6,
            speed_deviation: 0.3,
            steering_deviation: 3_f64.to_radians(),
            range,
            range_deviation,
            bearing_deviation: bearing_degrees.to_radians(),
            laps: 1,
        }
    }
}

/// The commands up to a scan, and the scan.
#[derive(Clone, Debug)]
pub(crate) struct Scan {
    /// The true pose: x and y in metres, heading in radians.
    pub(crate) truth: Vector3<f64>,
    /// Speed and steering angle as told to the filter, one pair every [`COMMAND_INTERVAL`].
    pub(crate) commands: Vec<[f64; 2]>,
    /// Landmark ids with range and bearing.
    pub(crate) measurements: Vec<(u32, Vector2<f64>)>,
}

/// Landmarks and scans of a whole run, relative to the first pose, which is (0, 0, 0).
pub(crate) fn simulate(
    world: &World,
    settings: &Settings,
    seed: u64,
) -> (Vec<Vector2<f64>>, Vec<Scan>) {
    let start = world.waypoints[world.waypoints.len() - 1];
    let towards = world.waypoints[0] - start;
    let heading = towards.y.atan2(towards.x);
    let to_frame = |point: &Vector2<f64>| turned(&(point - start), -heading);
    let waypoints: Vec<_> = world.waypoints.iter().map(to_frame).collect();
    let landmarks: Vec<_> = world.landmarks.iter().map(to_frame).collect();

    let streams = Streams::new(seed);
    let mut pose = Vector3::zeros();
    let mut steering = 0.0;
    let mut scans = Vec::new();
    let mut target = 0;
    while target < waypoints.len() * settings.laps {
        let frame = scans.len() as u64;
        let mut rng = streams.shared(frame, Purpose::OdometryNoise);
        let mut commands = Vec::with_capacity(COMMANDS_PER_SCAN);
        for _ in 0..COMMANDS_PER_SCAN {
            let offset = waypoints[target % waypoints.len()] - pose.xy();
            if offset.norm() < WAYPOINT_RADIUS {
                target += 1;
            }
            steering = steer(&offset, pose.z, steering);
            pose = drive(&pose, settings.speed, steering);
            commands.push([
                settings.speed + settings.speed_deviation * normal(&mut rng),
                steering + settings.steering_deviation * normal(&mut rng),
            ]);
        }
        let mut rng = streams.shared(frame, Purpose::MeasurementNoise);
        let mut measurements = Vec::new();
        for (id, landmark) in (0..).zip(&landmarks) {
            let offset = landmark - pose.xy();
            let (range, bearing) = (offset.norm(), wrap(offset.y.atan2(offset.x) - pose.z));
            if range < settings.range && bearing.abs() < FRAC_PI_2 {
                let noisy = Vector2::new(
                    range + settings.range_deviation * normal(&mut rng),
                    wrap(bearing + settings.bearing_deviation * normal(&mut rng)),
                );
                measurements.push((id, noisy));
            }
        }
        scans.push(Scan {
            truth: pose,
            commands,
            measurements,
        });
    }
    (landmarks, scans)
}

/// The steering angle one command later, towards `offset`.
fn steer(offset: &Vector2<f64>, heading: f64, steering: f64) -> f64 {
    let wanted = wrap(offset.y.atan2(offset.x) - heading - steering);
    let most = STEERING_RATE * COMMAND_INTERVAL;
    (steering + wanted.clamp(-most, most)).clamp(-MAX_STEERING, MAX_STEERING)
}

/// Eq. (30): the pose one command later.
fn drive(pose: &Vector3<f64>, speed: f64, steering: f64) -> Vector3<f64> {
    let distance = speed * COMMAND_INTERVAL;
    let (sin, cos) = (pose.z + steering).sin_cos();
    Vector3::new(
        pose.x + distance * cos,
        pose.y + distance * sin,
        wrap(pose.z + distance * steering.sin() / WHEELBASE),
    )
}

fn turned(vector: &Vector2<f64>, angle: f64) -> Vector2<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(
        cos * vector.x - sin * vector.y,
        sin * vector.x + cos * vector.y,
    )
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}
