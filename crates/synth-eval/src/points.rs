//! Scenes without images: surface points seen as keypoints, hundreds of drives in the time of one rendering.
//!
//! Points are drawn on what the camera really sees: at every second frame random pixels are cast into the scene until the
//! image shows [`VISIBLE`] points. In each image every point that the geometry does not hide is found with probability
//! [`FOUND`], at its projection with [`NOISE_PX`] of Gaussian noise; [`OUTLIERS`] of them lie anywhere instead; and keypoints that
//! no other image has come on top ([`CLUTTER`]). A descriptor is a random direction of its own for each point, with noise from
//! image to image: 64 between two sightings, 340 between two points, as SIFT's are.
//!
//! The noise is Gaussian and independent, which that of a detector is not: judge by rendered images, count by points.

use crate::recording::{Drive, Recording, Surface};
use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use vision_sift::{Features, Keypoint};
use wall_scenes::{Scene, SceneSpec};

/// Points in view of an image.
const VISIBLE: usize = 220;
/// Probability that a point in view is found.
const FOUND: f64 = 0.8;
/// Standard deviation of a pixel coordinate.
const NOISE_PX: f64 = 0.35;
/// Share of the found points that lie anywhere.
const OUTLIERS: f64 = 0.03;
/// Keypoints of one image alone, as a share of the points in view.
const CLUTTER: f64 = 0.25;
/// Noise of a descriptor's values, levels.
const DESCRIPTOR_NOISE: f64 = 4.0;
/// Length of a descriptor, levels.
const DESCRIPTOR_LENGTH: f64 = 512.0;
/// A ray may end this much before a point that it belongs to, as a share of the depth.
const SAME_DEPTH: f64 = 1e-9;
/// Images from one look for new points to the next, at frame rate one.
const LOOK_EVERY: usize = 2;
/// Casts of a look, at most: some pixels may leave the scene.
const MOST_CASTS: usize = 10 * VISIBLE;

/// A point on a surface.
struct SurfacePoint {
    position: Point3<f64>,
    descriptor: [f64; 128],
    response: f32,
}

/// Simulates the keypoints of a scene.
///
/// # Errors
/// The specification is refused.
pub(crate) fn simulate(name: &str, spec: SceneSpec) -> anyhow::Result<Recording> {
    let scene = Scene::new(spec)?;
    let mut rng = ChaCha8Rng::seed_from_u64(spec.seed);
    rng.set_stream(u64::from(u32::from_be_bytes(*b"pnts")));
    let points = surface_points(&scene, &mut rng);
    let (mut features, mut truth) = (Vec::new(), Vec::new());
    for image in 0..scene.images() {
        let (found, seen) = keypoints(&scene, image, &points, &mut rng);
        features.push(found);
        truth.push(seen);
    }
    let mut drive = Drive::of_scene(&format!("{name} points"), scene)?;
    drive.surface = Surface::Points(truth);
    Ok(Recording::new(drive, features, 0.0))
}

fn surface_points(scene: &Scene, rng: &mut ChaCha8Rng) -> Vec<SurfacePoint> {
    let pinhole = Scene::pinhole();
    let rate = scene.spec().frame_rate;
    let step = (LOOK_EVERY * rate.multiple / rate.divisor).max(1);
    let mut points: Vec<SurfacePoint> = Vec::new();
    for image in (0..scene.images()).step_by(step) {
        let mut visible = points
            .iter()
            .filter(|point| pixel(scene, image, &point.position).is_some())
            .count();
        for _ in 0..MOST_CASTS {
            if visible >= VISIBLE {
                break;
            }
            let u = rng.random::<f64>() * (pinhole.width as f64 - 1.0);
            let v = rng.random::<f64>() * (pinhole.height as f64 - 1.0);
            if let Some(position) = scene.point_at(image, u, v) {
                points.push(SurfacePoint {
                    position,
                    descriptor: direction(rng),
                    response: 0.02 + 0.08 * rng.random::<f32>(),
                });
                visible += 1;
            }
        }
    }
    points
}

/// Where an image shows a point, unless something hides it.
fn pixel(scene: &Scene, image: usize, point: &Point3<f64>) -> Option<[f64; 2]> {
    let [u, v] = scene.project(image, point)?;
    let depth = (scene.world_from_camera(image).inverse() * point).z;
    let surface = scene.depth_at(image, u, v)?;
    (surface > depth * (1.0 - SAME_DEPTH)).then_some([u, v])
}

/// The keypoints of an image, and the surface point that each belongs to.
fn keypoints(
    scene: &Scene,
    image: usize,
    points: &[SurfacePoint],
    rng: &mut ChaCha8Rng,
) -> (Features, Vec<Option<Point3<f64>>>) {
    let pinhole = Scene::pinhole();
    let (width, height) = (pinhole.width as f64 - 1.0, pinhole.height as f64 - 1.0);
    let (mut features, mut truth) = (Features::default(), Vec::new());
    let mut add = |[u, v]: [f64; 2], response, descriptor, point| {
        if (0.0..=width).contains(&u) && (0.0..=height).contains(&v) {
            features.keypoints.push(Keypoint {
                x: u as f32,
                y: v as f32,
                sigma: 2.0,
                angle: 0.0,
                response,
            });
            features.descriptors.push(descriptor);
            truth.push(point);
        }
    };
    for point in points {
        let Some([u, v]) = pixel(scene, image, &point.position) else {
            continue;
        };
        if rng.random::<f64>() > FOUND {
            continue;
        }
        let place = if rng.random::<f64>() < OUTLIERS {
            [rng.random::<f64>() * width, rng.random::<f64>() * height]
        } else {
            let mut noise = || NOISE_PX * rng.sample::<f64, _>(StandardNormal);
            [u + noise(), v + noise()]
        };
        let descriptor = noisy(&point.descriptor, rng);
        add(place, point.response, descriptor, Some(point.position));
    }
    for _ in 0..(CLUTTER * VISIBLE as f64) as usize {
        let place = [rng.random::<f64>() * width, rng.random::<f64>() * height];
        let response = 0.02 + 0.08 * rng.random::<f32>();
        let descriptor = noisy(&direction(rng), rng);
        add(place, response, descriptor, None);
    }
    (features, truth)
}

/// A random descriptor with the statistics of the roots of a histogram.
fn direction(rng: &mut ChaCha8Rng) -> [f64; 128] {
    let values: [f64; 128] = std::array::from_fn(|_| -(1.0 - rng.random::<f64>()).ln());
    let sum: f64 = values.iter().sum();
    values.map(|value| DESCRIPTOR_LENGTH * (value / sum).sqrt())
}

fn noisy(descriptor: &[f64; 128], rng: &mut ChaCha8Rng) -> [u8; 128] {
    descriptor.map(|value| {
        let noise: f64 = rng.sample(StandardNormal);
        (value + DESCRIPTOR_NOISE * noise).round().clamp(0.0, 255.0) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keypoints_lie_on_their_points_with_the_stated_noise() {
        let spec = SceneSpec {
            frames: 8,
            ..SceneSpec::wall(3)
        };
        let recording = simulate("wall", spec).unwrap();
        let scene = Scene::new(spec).unwrap();
        let (mut square, mut near, mut far, mut clutter) = (0.0, 0.0, 0.0, 0.0);
        for (image, features) in recording.features.iter().enumerate() {
            assert!((150..450).contains(&features.keypoints.len()));
            for (keypoint, descriptor) in features.keypoints.iter().zip(&features.descriptors) {
                let Some(point) = recording.surface_point(descriptor) else {
                    clutter += 1.0;
                    continue;
                };
                let [u, v] = scene.project(image, &point).unwrap();
                let (du, dv) = (f64::from(keypoint.x) - u, f64::from(keypoint.y) - v);
                if du.hypot(dv) < 6.0 * NOISE_PX {
                    near += 1.0;
                    square += (du * du + dv * dv) / 2.0;
                } else {
                    far += 1.0;
                }
            }
        }
        // About 1400 sightings: deviation within 2 % each sigma, outliers within 0.5 %.
        let rms = (square / near).sqrt();
        assert!((rms / NOISE_PX - 1.0).abs() < 0.08, "{rms}");
        assert!((far / (near + far) - OUTLIERS).abs() < 0.02, "{far} {near}");
        assert!((clutter / 8.0 / (CLUTTER * VISIBLE as f64) - 1.0).abs() < 0.01);
    }

    #[test]
    fn descriptors_tell_points_apart() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (a, b) = (direction(&mut rng), direction(&mut rng));
        let mut distance = |x: &[f64; 128], y: &[f64; 128]| {
            let (x, y) = (noisy(x, &mut rng), noisy(y, &mut rng));
            let square: f64 = x
                .iter()
                .zip(&y)
                .map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2))
                .sum();
            square.sqrt()
        };
        let (same, other) = (distance(&a, &a), distance(&a, &b));
        assert!((50.0..80.0).contains(&same), "{same}");
        assert!((280.0..400.0).contains(&other), "{other}");
    }

    #[test]
    fn a_hidden_point_is_not_found() {
        let scene = Scene::new(SceneSpec {
            frames: 8,
            ..SceneSpec::wall(3)
        })
        .unwrap();
        let seen = scene.point_at(0, 100.0, 100.0).unwrap();
        assert!(pixel(&scene, 0, &seen).is_some());
        let camera = Point3::from(scene.world_from_camera(0).translation.vector);
        let behind = camera + (seen - camera) * 1.01;
        assert!(scene.project(0, &behind).is_some());
        assert_eq!(pixel(&scene, 0, &behind), None);
    }
}
