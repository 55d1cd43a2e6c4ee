//! The landmark filter: closed form where it is linear, a brute-force maximum
//! a posteriori where it is not, no shrinking, consistency.

use crate::filter::landmark::{InverseDepthPrior, Landmark};
use crate::filter::landmark_moments::AxisPoints;
use crate::filter::landmark_update::LandmarkUpdate;
use crate::filter::pixel_noise::PixelNoise;
use mono_geometry::PlacedCamera;
use mono_geometry::inverse_depth::LandmarkGeometry;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};
use ukf::{SigmaPoints, Verdict, assess_consistency, normalized_error_squared};

use super::common::*;

const SIGMA_PX: f64 = 0.5;
/// Prior of inverse depth: two sigmas above zero, nearest 0.4 m.
const RHO: InverseDepthPrior = OPEN_DEPTH;

fn pixel_noise() -> PixelNoise {
    PixelNoise::round(SIGMA_PX)
}

fn filter() -> LandmarkUpdate<'static> {
    LandmarkUpdate {
        pinhole: &PINHOLE,
        points: AxisPoints::new(&SigmaPoints::default()),
    }
}

#[test]
fn sideways_motion_is_linear_and_equals_kalman() {
    // Moving in the image plane keeps the third coordinate of the ray at one: the pixel is
    // (fx (a + rho t) + cx, fy b + cy), linear in all three numbers. Closed and open depth, noise that a lens has stretched.
    for sigma_rho in [0.02, 0.5] {
        let anchor = place(&pose(0.0, 0.0, 0.0));
        let camera = place(&pose(0.25, 0.0, 0.0));
        let geometry = LandmarkGeometry::InverseDepth { anchor };
        let k = pinhole();
        let factor = Matrix3::new(
            2e-3,
            0.0,
            0.0,
            1e-3,
            2e-3,
            0.0,
            0.3 * sigma_rho,
            -0.2 * sigma_rho,
            sigma_rho,
        );
        let prior = inverse_depth(Vector3::new(0.1, -0.05, 0.8), factor * factor.transpose());
        // The camera moves to its right: what is seen moves left.
        let h = Matrix2x3::new(k.fx, 0.0, -0.25 * k.fx, 0.0, k.fy, 0.0);
        let predicted = Vector2::new(k.cx, k.cy) + h * prior.mean;
        let innovation = Vector2::new(1.1, -0.7);
        let noise = noise_of(&noise_root(SIGMA_PX, 2));
        let s = h * prior.covariance * h.transpose() + noise.covariance();
        let gain = prior.covariance * h.transpose() * s.cholesky().unwrap().inverse();
        let mean = prior.mean + gain * innovation;
        let covariance = prior.covariance - gain * s * gain.transpose();
        let updated = filter()
            .update(
                &geometry.view(&camera),
                &prior,
                &(predicted + innovation),
                &noise,
            )
            .unwrap();
        assert_eq!(updated.parametrisation, prior.parametrisation);
        assert!((updated.mean - mean).norm() < 1e-9, "sigma_rho {sigma_rho}");
        assert!((updated.covariance - covariance).norm() < 1e-9 * prior.covariance.norm());
    }
}

#[test]
fn far_innovation_is_gated() {
    let anchor = place(&pose(0.0, 0.0, 0.0));
    let camera = place(&pose(0.25, 0.0, 0.0));
    let geometry = LandmarkGeometry::InverseDepth { anchor };
    let prior = inverse_depth(
        Vector3::new(0.0, 0.0, 0.5),
        Matrix3::from_diagonal_element(1e-8),
    );
    let predicted = project(&camera, &geometry, &prior.mean);
    let at = |dy: f64| {
        let pixel = predicted + Vector2::new(0.0, dy * SIGMA_PX);
        filter().update(&geometry.view(&camera), &prior, &pixel, &pixel_noise())
    };
    // 18.4 = 4.29^2; the landmark adds little.
    assert!(at(4.2).is_some() && at(4.4).is_none());
}

/// Maximum a posteriori inverse depth: for every depth on a grid the best (alpha, beta) by
/// Gauss-Newton, and the depth of least cost.
fn map_by_search(
    camera: &PlacedCamera,
    geometry: &LandmarkGeometry,
    prior: &Landmark,
    pixel: &Vector2<f64>,
) -> f64 {
    const STEPS: usize = 20_000;
    let sigma = prior.covariance.diagonal().map(f64::sqrt);
    let highest = prior.mean.z + 4.0 * sigma.z;
    let mut best = (f64::INFINITY, 0.0);
    for i in 0..=STEPS {
        let rho = highest * i as f64 / STEPS as f64;
        let mut m = Vector3::new(prior.mean.x, prior.mean.y, rho);
        let mut cost = f64::INFINITY;
        for _ in 0..4 {
            let Some(at) = geometry.ray(&m).project(&pinhole(), camera) else {
                cost = f64::INFINITY;
                break;
            };
            let residual = (pixel - at) / SIGMA_PX;
            let from_prior = (m - prior.mean).component_div(&sigma);
            cost = residual.norm_squared() + from_prior.norm_squared();
            let j = geometry.parameter_jacobian(&pinhole(), camera, &m).unwrap();
            let j = j.fixed_columns::<2>(0) / SIGMA_PX;
            let weight = Matrix2::from_diagonal(&sigma.xy().map(|s| s.powi(-2)));
            let gradient = j.tr_mul(&residual) - weight * (m - prior.mean).xy();
            let step = (j.tr_mul(&j) + weight).cholesky().unwrap().solve(&gradient);
            m.x += step.x;
            m.y += step.y;
        }
        if cost < best.0 {
            best = (cost, rho);
        }
    }
    best.1
}

#[test]
fn open_depth_finds_the_maximum_a_posteriori() {
    let mut rng = rng(51);
    let mut compared = 0;
    for case in 0..60 {
        let from = pose(0.0, 0.0, 0.0);
        let anchor = place(&from);
        // Sideways, towards the scene (world y) and turned: the pixel is far from linear in the depth.
        let mut to = pose(
            uniform(&mut rng, 0.15, 0.4),
            uniform(&mut rng, -0.1, 0.15),
            uniform(&mut rng, -0.1, 0.1),
        );
        to.centre.z = uniform(&mut rng, -0.02, 0.02);
        let camera = place(&to);
        let geometry = LandmarkGeometry::InverseDepth { anchor };
        let (a, b) = (uniform(&mut rng, -0.3, 0.3), uniform(&mut rng, -0.3, 0.3));
        let depth = uniform(&mut rng, 0.7, 6.0);
        let first = Vector2::new(
            pinhole().cx + pinhole().fx * a,
            pinhole().cy + pinhole().fy * b,
        );
        let noise = Vector2::from_fn(|_, _| SIGMA_PX * normal(&mut rng));
        let prior =
            Landmark::from_first_sighting(&pinhole(), 0, &first, &PixelNoise::round(SIGMA_PX), RHO);
        let pixel = pixel_of(&camera, &ahead(&anchor, a, b, depth)) + noise;
        let Some(updated) =
            filter().update(&geometry.view(&camera), &prior, &pixel, &pixel_noise())
        else {
            continue;
        };
        let sigma = updated.covariance[(2, 2)].sqrt();
        let best = map_by_search(&camera, &geometry, &prior, &pixel);
        // The grid's step is 1.9e-4; the mean of a skewed posterior is not its mode.
        let off = (updated.mean.z - best).abs();
        assert!(
            off < 0.1 * sigma + 2e-4,
            "case {case}: {} against {best}, sigma {sigma}",
            updated.mean.z
        );
        compared += 1;
    }
    assert!(compared >= 57, "{compared} of 60 within the gate of 1e-4");
}

/// Mean error of the inverse depth of far points after two sightings, and its standard error.
fn far_points(widened: bool) -> (f64, f64) {
    const SEEDS: u64 = 100;
    const POINTS: usize = 200;
    let truth = 1.0 / 8.0;
    let anchor = place(&pose(0.0, 0.0, 0.0));
    let camera = place(&pose(0.1, 0.0, 0.0));
    let geometry = LandmarkGeometry::InverseDepth { anchor };
    let (mut sum, mut squares) = (0.0, 0.0);
    for seed in 0..SEEDS {
        let mut rng = rng(seed);
        for _ in 0..POINTS {
            let (a, b) = (uniform(&mut rng, -0.3, 0.3), uniform(&mut rng, -0.3, 0.3));
            let p = ahead(&anchor, a, b, 1.0 / truth);
            let mut seen = |c: &PlacedCamera| {
                pixel_of(c, &p) + Vector2::from_fn(|_, _| SIGMA_PX * normal(&mut rng))
            };
            let prior = Landmark::from_first_sighting(
                &pinhole(),
                0,
                &seen(&anchor),
                &PixelNoise::round(SIGMA_PX),
                RHO,
            );
            let pixel = seen(&camera);
            let updated = if widened {
                filter().first(&geometry.view(&camera), &prior, &pixel, &pixel_noise())
            } else {
                filter().update(&geometry.view(&camera), &prior, &pixel, &pixel_noise())
            };
            // A gate of 1e-4 drops the same tails on both sides.
            if let Some(l) = updated {
                sum += l.mean.z - truth;
                squares += (l.mean.z - truth).powi(2);
            }
        }
    }
    let n = (SEEDS as usize * POINTS) as f64;
    let mean = sum / n;
    (mean, ((squares / n - mean * mean) / n).sqrt())
}

#[test]
fn far_points_are_not_drawn_nearer() {
    // Measured: -1.5e-4 +- 1.4e-4 1/m with the prior widened eightfold for the first update; with the
    // width of the search +8.9e-4 +- 1.4e-4, drawn from 8 m to 7.94 m by a prior centred at 0.8 m.
    let (bias, error) = far_points(true);
    assert!(
        bias.abs() < 4.0 * error,
        "widened: {bias:e}, standard error {error:e}"
    );
    let (bias, error) = far_points(false);
    assert!(
        bias > 4.0 * error,
        "search prior: {bias:e}, standard error {error:e}"
    );
}

#[test]
fn covariance_stays_positive_definite() {
    let mut rng = rng(52);
    let (mut updates, mut refused) = (0, 0);
    while updates < 1000 {
        let from = random_pose(&mut rng);
        let anchor = place(&from);
        let geometry = LandmarkGeometry::InverseDepth { anchor };
        let (a, b) = (uniform(&mut rng, -0.3, 0.3), uniform(&mut rng, -0.3, 0.3));
        let p = ahead(&anchor, a, b, uniform(&mut rng, 0.8, 50.0));
        let mut landmark = Landmark::from_first_sighting(
            &pinhole(),
            0,
            &pixel_of(&anchor, &p),
            &PixelNoise::round(SIGMA_PX),
            RHO,
        );
        for _ in 0..20 {
            let camera = place(&near(&mut rng, &from));
            let pixel =
                pixel_of(&camera, &p) + Vector2::from_fn(|_, _| SIGMA_PX * normal(&mut rng));
            match filter().update(&geometry.view(&camera), &landmark, &pixel, &pixel_noise()) {
                Some(next) => {
                    assert_eq!(next.covariance, next.covariance.transpose());
                    assert!(next.covariance.cholesky().is_some());
                    // A measurement never makes the depth less sure, but for the re-linearisation.
                    assert!(next.covariance[(2, 2)] <= landmark.covariance[(2, 2)] * 1.01);
                    landmark = next;
                    updates += 1;
                }
                None => refused += 1,
            }
        }
    }
    assert!(refused < updates / 20, "{refused} refused");
}

#[test]
fn errors_are_as_large_as_the_covariance_says() {
    let mut rng = rng(53);
    let mut values = Vec::new();
    for _ in 0..400 {
        let from = pose(0.0, 0.0, 0.0);
        let anchor = place(&from);
        let geometry = LandmarkGeometry::InverseDepth { anchor };
        let truth = Vector3::new(
            uniform(&mut rng, -0.3, 0.3),
            uniform(&mut rng, -0.3, 0.3),
            uniform(&mut rng, 0.05, 1.0),
        );
        let p = ahead(&anchor, truth.x, truth.y, 1.0 / truth.z);
        let mut seen = |c: &PlacedCamera| {
            pixel_of(c, &p) + Vector2::from_fn(|_, _| SIGMA_PX * normal(&mut rng))
        };
        let prior = Landmark::from_first_sighting(
            &pinhole(),
            0,
            &seen(&anchor),
            &PixelNoise::round(SIGMA_PX),
            RHO,
        );
        let at = |i: f64| place(&pose(0.1 * i, 0.01 * i, 0.02 * i));
        let Some(mut landmark) = filter().first(
            &geometry.view(&at(1.0)),
            &prior,
            &seen(&at(1.0)),
            &pixel_noise(),
        ) else {
            continue;
        };
        for i in 2..6 {
            let camera = at(f64::from(i));
            if let Some(next) = filter().update(
                &geometry.view(&camera),
                &landmark,
                &seen(&camera),
                &pixel_noise(),
            ) {
                landmark = next;
            }
        }
        values.push(
            normalized_error_squared(&(landmark.mean - truth), &landmark.covariance).unwrap(),
        );
    }
    assert!(values.len() > 395);
    let verdict = assess_consistency(values, 3, 0.999).unwrap();
    assert_eq!(verdict.verdict, Verdict::Consistent, "{verdict:?}");
}
