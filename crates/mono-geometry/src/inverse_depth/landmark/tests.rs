//! Landmark forms: projection by the textbook formula, Jacobians by differences, refocusing by exhaustive search.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Rotation3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{LandmarkGeometry, first_sighting, first_sighting_with_covariance};
use crate::camera::Pinhole;
use crate::placed_camera::PlacedCamera;
use crate::se3::Se3;

fn pinhole() -> Pinhole {
    Pinhole {
        width: 320,
        height: 240,
        fx: 368.826_20,
        fy: 369.902_39,
        cx: 159.670_29,
        cy: 121.541_36,
    }
}

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

fn spread(rng: &mut ChaCha8Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| uniform(rng, -size, size))
}

/// A pose anywhere.
fn random_pose(rng: &mut ChaCha8Rng) -> Se3 {
    Se3::new(crate::so3::exp(&spread(rng, 3.0)), spread(rng, 2.0))
}

/// An anchor, and a camera a few decimetres and hundredths of a radian from it.
fn two_cameras(rng: &mut ChaCha8Rng) -> (PlacedCamera, PlacedCamera) {
    let anchor = random_pose(rng);
    let turn = crate::so3::exp(&spread(rng, 0.05));
    let near = Se3::new(
        turn * anchor.rotation,
        anchor.translation + spread(rng, 0.2),
    );
    (PlacedCamera::new(&anchor), PlacedCamera::new(&near))
}

/// World point at normalised image position (a, b) and `depth` in front of `camera`.
fn ahead(camera: &PlacedCamera, a: f64, b: f64, depth: f64) -> Vector3<f64> {
    camera.centre + camera.camera_from_world.transpose() * Vector3::new(a, b, 1.0) * depth
}

fn project(
    camera: &PlacedCamera,
    geometry: &LandmarkGeometry,
    parameters: &Vector3<f64>,
) -> Vector2<f64> {
    let ray = geometry.ray(parameters);
    ray.project(&pinhole(), camera).expect("in front")
}

#[test]
fn known_point_projects_where_the_drawing_says() {
    // The camera at (1, 2, 0.1) looks along world -x, its x axis along world y.
    let rotation = Matrix3::new(0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let pose = Se3::new(
        Rotation3::from_matrix_unchecked(rotation),
        Vector3::new(1.0, 2.0, 0.1),
    );
    let camera = PlacedCamera::new(&pose);
    // Two metres ahead of the camera, 0.5 m to its right, 0.3 m above it.
    let point = Vector3::new(-1.0, 2.5, 0.4);
    let seen = project(&camera, &LandmarkGeometry::Point, &point);
    let k = pinhole();
    let drawn = Vector2::new(k.cx + k.fx * 0.25, k.cy - k.fy * 0.15);
    assert!((seen - drawn).norm() < 1e-10, "{seen} {drawn}");
    let behind = LandmarkGeometry::Point.ray(&Vector3::new(3.0, 2.5, 0.4));
    assert!(behind.project(&k, &camera).is_none());
    // In front by less than a thousandth of its distance.
    let aside = LandmarkGeometry::Point.ray(&Vector3::new(0.999, 4.0, 0.1));
    assert!(aside.project(&k, &camera).is_none());
}

#[test]
fn both_forms_of_a_landmark_project_alike() {
    let mut rng = rng(1);
    for _ in 0..500 {
        let (anchor, camera) = two_cameras(&mut rng);
        let (a, b) = (uniform(&mut rng, -0.3, 0.3), uniform(&mut rng, -0.3, 0.3));
        let depth = uniform(&mut rng, 1.0, 20.0);
        let point = ahead(&anchor, a, b, depth);
        let anchored = LandmarkGeometry::InverseDepth { anchor };
        let by_depth = project(&camera, &anchored, &Vector3::new(a, b, 1.0 / depth));
        let by_point = project(&camera, &LandmarkGeometry::Point, &point);
        let in_camera = camera.camera_from_world * (point - camera.centre);
        let textbook = pinhole().project(&in_camera).expect("in front");
        // Pixels of some hundred, a few roundings each.
        assert!((by_depth - textbook).norm() < 1e-10);
        assert!((by_point - textbook).norm() < 1e-10);
    }
}

#[test]
fn parameter_jacobian_is_the_central_difference() {
    let mut rng = rng(2);
    for case in 0..500 {
        let (anchor, camera) = two_cameras(&mut rng);
        let (a, b) = (uniform(&mut rng, -0.3, 0.3), uniform(&mut rng, -0.3, 0.3));
        // Every fifth landmark at infinity.
        let rho = if case % 5 == 0 {
            0.0
        } else {
            uniform(&mut rng, 0.0, 0.8)
        };
        let (geometry, mean) = if case % 2 == 0 {
            (
                LandmarkGeometry::InverseDepth { anchor },
                Vector3::new(a, b, rho),
            )
        } else {
            (
                LandmarkGeometry::Point,
                ahead(&anchor, a, b, 1.0 / (rho + 0.1)),
            )
        };
        let analytic = geometry
            .parameter_jacobian(&pinhole(), &camera, &mean)
            .expect("in front");
        const H: f64 = 1e-6;
        let mut numeric = Matrix2x3::zeros();
        for j in 0..3 {
            let mut step = Vector3::zeros();
            step[j] = H;
            let difference = project(&camera, &geometry, &(mean + step))
                - project(&camera, &geometry, &(mean - step));
            numeric.set_column(j, &(difference / (2.0 * H)));
        }
        // Rounding of pixels of size 500 over 2 H: 500 eps / 1e-6 = 1e-7; truncation is below.
        let error = (analytic - numeric).norm();
        assert!(
            error < 1e-6 * (1.0 + analytic.norm()),
            "case {case}: {error:e}"
        );
    }
}

#[test]
fn the_point_covariance_is_first_order_propagation() {
    let mut rng = rng(3);
    for _ in 0..100 {
        let anchor = PlacedCamera::new(&random_pose(&mut rng));
        let mean = Vector3::new(
            uniform(&mut rng, -0.4, 0.4),
            uniform(&mut rng, -0.4, 0.4),
            uniform(&mut rng, 0.1, 1.0),
        );
        let factor = Matrix3::from_fn(|i, j| {
            if j <= i {
                uniform(&mut rng, 1e-4, 1e-3)
            } else {
                0.0
            }
        });
        let covariance = factor * factor.transpose();
        let geometry = LandmarkGeometry::InverseDepth { anchor };
        let (world, stated) = geometry.to_point(&mean, &covariance).expect("rho above 0");
        let at = |m: &Vector3<f64>| ahead(&anchor, m.x, m.y, 1.0 / m.z);
        assert!((world - at(&mean)).norm() < 1e-12);
        let h = 1e-5;
        let jacobian = Matrix3::from_fn(|i, j| {
            let mut step = Vector3::zeros();
            step[j] = h;
            (at(&(mean + step)) - at(&(mean - step)))[i] / (2.0 * h)
        });
        let expected = jacobian * covariance * jacobian.transpose();
        // Truncation (h / rho)^2 of the derivative.
        assert!((stated - expected).norm() < 1e-6 * stated.norm());
    }
    let anchored = LandmarkGeometry::InverseDepth {
        anchor: PlacedCamera::new(&Se3::identity()),
    };
    for rho in [0.0, -0.1] {
        let mean = Vector3::new(0.0, 0.0, rho);
        assert!(anchored.to_point(&mean, &Matrix3::identity()).is_none());
    }
    let point = Vector3::new(1.0, 2.0, 3.0);
    assert_eq!(
        LandmarkGeometry::Point.to_point(&point, &Matrix3::identity()),
        Some((point, Matrix3::identity()))
    );
}

/// Least distance from `pixel` over inverse depths in [0, highest], by trying all.
fn nearest_by_search(
    camera: &PlacedCamera,
    geometry: &LandmarkGeometry,
    mean: &Vector3<f64>,
    pixel: &Vector2<f64>,
    highest: f64,
) -> Option<f64> {
    const STEPS: usize = 4000;
    (0..=STEPS)
        .filter_map(|i| {
            let rho = highest * i as f64 / STEPS as f64;
            let ray = geometry.ray(&Vector3::new(mean.x, mean.y, rho));
            ray.project(&pinhole(), camera).map(|p| (p - pixel).norm())
        })
        .min_by(f64::total_cmp)
}

#[test]
fn refocus_projects_nearest_to_the_pixel() {
    let mut rng = rng(4);
    let (mut inside, mut clamped) = (0, 0);
    for case in 0..600 {
        let (anchor, camera) = two_cameras(&mut rng);
        let geometry = LandmarkGeometry::InverseDepth { anchor };
        let highest = uniform(&mut rng, 0.5, 4.0);
        let mean = Vector3::new(
            uniform(&mut rng, -0.3, 0.3),
            uniform(&mut rng, -0.3, 0.3),
            0.5 * highest,
        );
        if geometry.ray(&mean).project(&pinhole(), &camera).is_none() {
            continue;
        }
        // Some pixels near the line, some anywhere, beyond the epipole and both ends too.
        let on_line = Vector3::new(mean.x, mean.y, uniform(&mut rng, -0.5, 1.5) * highest);
        let pixel = match geometry.ray(&on_line).project(&pinhole(), &camera) {
            Some(p) if case % 3 > 0 => {
                p + Vector2::new(uniform(&mut rng, -2.0, 2.0), uniform(&mut rng, -2.0, 2.0))
            }
            _ => Vector2::new(uniform(&mut rng, 0.0, 320.0), uniform(&mut rng, 0.0, 240.0)),
        };
        let refocused = geometry.refocus(&pinhole(), &camera, &mean, &pixel, highest);
        assert_eq!(refocused.xy(), mean.xy());
        assert!(
            (0.0..=highest).contains(&refocused.z),
            "case {case}: {}",
            refocused.z
        );
        let at = project(&camera, &geometry, &refocused);
        let best = nearest_by_search(&camera, &geometry, &mean, &pixel, highest).expect("seen");
        let distance = (at - pixel).norm();
        assert!(
            distance <= best + 1e-6,
            "case {case}: rho {} of {highest} lies {distance} px away, the best {best} px",
            refocused.z
        );
        if refocused.z > 0.0 && refocused.z < highest {
            inside += 1;
        } else {
            clamped += 1;
        }
    }
    assert!(
        inside > 100 && clamped > 100,
        "{inside} inside, {clamped} at an end"
    );
}

#[test]
fn refocus_leaves_what_has_no_line() {
    let anchor = PlacedCamera::new(&Se3::identity());
    let mean = Vector3::new(0.1, -0.1, 0.5);
    let pixel = Vector2::new(10.0, 20.0);
    // No baseline, and a point.
    for geometry in [
        LandmarkGeometry::InverseDepth { anchor },
        LandmarkGeometry::Point,
    ] {
        let refocused = geometry.refocus(&pinhole(), &anchor, &mean, &pixel, 2.0);
        assert_eq!(refocused, mean);
    }
}

#[test]
fn a_first_sighting_projects_onto_its_pixel_with_its_noise() {
    let anchor = PlacedCamera::new(&random_pose(&mut rng(5)));
    let pixel = Vector2::new(100.0, 50.0);
    let (mean, covariance) = first_sighting(&pinhole(), &pixel, 0.5, 1.25, 0.625);
    let geometry = LandmarkGeometry::InverseDepth { anchor };
    assert!((project(&anchor, &geometry, &mean) - pixel).norm() < 1e-12);
    let jacobian = geometry
        .parameter_jacobian(&pinhole(), &anchor, &mean)
        .expect("in front");
    // At the anchor the depth does not show: what is left is the pixel noise.
    let noise = jacobian * covariance * jacobian.transpose();
    assert!((noise - Matrix2::identity() * 0.25).norm() < 1e-12);
    assert_eq!((mean.z, covariance[(2, 2)]), (1.25, 0.625 * 0.625));
    // With a noise of any shape the same, and that of a round one bit for bit.
    let stretched = Matrix2::new(0.9, 0.2, 0.2, 0.3);
    let (_, shaped) = first_sighting_with_covariance(&pinhole(), &pixel, &stretched, 1.25, 0.625);
    assert!((jacobian * shaped * jacobian.transpose() - stretched).norm() < 1e-12);
    for sigma in [0.1, 0.5, 0.6, 1.7] {
        let round = Matrix2::from_diagonal_element(sigma * sigma);
        assert_eq!(
            first_sighting_with_covariance(&pinhole(), &pixel, &round, 1.25, 0.625),
            first_sighting(&pinhole(), &pixel, sigma, 1.25, 0.625)
        );
    }
}
