//! Numbers of OpenCV 5.0.0 (`reference/opencv_structure.py`): all poses of three points, poses of many, corrected matches
//! and their points; and of scipy 1.17.1, the points of least reprojection error.

use crate::common::pinhole;
use mono_geometry::epipolar::fundamental;
use mono_geometry::pnp::{Correspondence, RefineOptions, estimate_pose, p3p};
use mono_geometry::triangulation::{
    Acceptance, Correction, Observation, Rejection, Triangulated, correct_match,
    triangulate_two_views,
};
use mono_geometry::{NoiseShape, Se3, so3};
use nalgebra::{Vector2, Vector3};

/// The rows of one kind.
fn rows(kind: &str) -> Vec<Vec<f64>> {
    include_str!("../reference/opencv_structure.csv")
        .lines()
        .filter_map(|line| line.strip_prefix(kind)?.strip_prefix(','))
        .map(|line| line.split(',').map(|v| v.parse().expect("valid")).collect())
        .collect()
}

fn point(v: &[f64]) -> Vector3<f64> {
    Vector3::new(v[0], v[1], v[2])
}

fn pixel(v: &[f64]) -> Vector2<f64> {
    Vector2::new(v[0], v[1])
}

/// rvec, tvec.
fn pose(v: &[f64]) -> Se3 {
    Se3::new(so3::exp(&point(v)), point(&v[3..]))
}

fn apart(a: &Se3, b: &Se3) -> f64 {
    let delta = a.inverse().compose(b).log();
    delta.amax()
}

#[test]
fn val_opencv_solve_p3p() {
    let (mut theirs_total, mut ours_total) = (0, 0);
    let rows = rows("p3p");
    assert_eq!(rows.len(), 200);
    for row in rows {
        let points = [0, 3, 6].map(|k| point(&row[k..]));
        let rays = [9, 11, 13].map(|k| pinhole().bearing(&pixel(&row[k..])));
        let ours = p3p(&rays, &points);
        ours_total += ours.as_slice().len();
        for theirs in row[15..].chunks(6).map(pose) {
            theirs_total += 1;
            let nearest = ours
                .as_slice()
                .iter()
                .map(|found| apart(&found.inverse(), &theirs))
                .fold(f64::INFINITY, f64::min);
            // Their closed form is not polished: near a double root it keeps half of the digits.
            assert!(nearest < 1e-5, "{nearest}");
        }
    }
    // Every pose of theirs is one of ours; the counts say that we have no more than they.
    assert_eq!(ours_total, theirs_total);
}

#[test]
fn val_opencv_solve_pnp() {
    let rows = rows("pnp");
    assert_eq!(rows.len(), 40);
    for row in rows {
        let count = row[0] as usize;
        let (points, rest) = row[1..].split_at(3 * count);
        let (pixels, theirs) = rest.split_at(2 * count);
        let seen: Vec<_> = (0..count)
            .map(|k| Correspondence {
                point_in_world: point(&points[3 * k..]),
                pixel_ideal: pixel(&pixels[2 * k..]),
                sigma_px: 0.5,
                shape: NoiseShape::ROUND,
            })
            .collect();
        let fit = estimate_pose(&pinhole(), &seen, &RefineOptions::default()).expect("valid");
        let theirs = pose(theirs).inverse();
        let delta = fit
            .estimate
            .world_from_camera
            .inverse()
            .compose(&theirs)
            .log();
        for k in 0..6 {
            let sigma = fit.estimate.covariance[(k, k)].sqrt();
            assert!(
                delta[k].abs() < 1e-4 * sigma,
                "{count}: {} {sigma}",
                delta[k]
            );
        }
    }
}

/// Rays, views and the numbers of one match.
struct Match {
    second_from_first: Se3,
    pixels: [Vector2<f64>; 2],
    opencv_pixels: [Vector2<f64>; 2],
    opencv_point: Vector3<f64>,
    scipy_point: Vector3<f64>,
    scipy_cost: f64,
}

fn matches() -> Vec<Match> {
    let read = |row: &Vec<f64>| Match {
        second_from_first: pose(row),
        pixels: [pixel(&row[6..]), pixel(&row[8..])],
        opencv_pixels: [pixel(&row[10..]), pixel(&row[12..])],
        opencv_point: point(&row[14..]),
        scipy_point: point(&row[17..]),
        scipy_cost: row[20],
    };
    let matches: Vec<_> = rows("match").iter().map(read).collect();
    assert_eq!(matches.len(), 200);
    matches
}

impl Match {
    fn corrected(&self) -> Correction {
        let matrix = fundamental(&pinhole(), &self.second_from_first).expect("valid");
        correct_match(&matrix, &self.pixels[0], &self.pixels[1], 1.0, 1.0).expect("valid")
    }

    fn triangulated(&self) -> Result<Triangulated, Rejection> {
        let open = Acceptance {
            min_parallax_rad: 0.0,
            chi_square_probability: 1.0,
            max_iterations: 0,
        };
        let poses = [Se3::identity(), self.second_from_first];
        let views = [0, 1].map(|k| Observation {
            camera_from_world: poses[k],
            pixel_ideal: self.pixels[k],
            sigma_px: 1.0,
            shape: NoiseShape::ROUND,
        });
        triangulate_two_views(&pinhole(), &views, &open)
    }

    fn in_front(&self, point: &Vector3<f64>) -> bool {
        point.z > 0.0 && self.second_from_first.transform_point(point).z > 0.0
    }
}

#[test]
fn val_opencv_correct_matches() {
    let mut close = 0;
    for m in matches() {
        let ours = m.corrected();
        let theirs = m.opencv_pixels;
        let apart = [ours.first_px - theirs[0], ours.second_px - theirs[1]];
        let difference = (apart[0].norm_squared() + apart[1].norm_squared()).sqrt();
        let cost =
            (theirs[0] - m.pixels[0]).norm_squared() + (theirs[1] - m.pixels[1]).norm_squared();
        // Theirs, by the roots of a sextic, meets the constraint up to a tenth of a pixel beside the minimum: never cheaper,
        // and by no more than a step along the constraint costs.
        assert!(
            ours.chi_square <= cost * (1.0 + 1e-12),
            "{} {cost}",
            ours.chi_square
        );
        assert!(difference < 0.1, "{difference}");
        assert!(cost - ours.chi_square <= 2.0 * difference.powi(2) + 1e-12);
        close += usize::from(difference < 1e-4);
        if difference < 1e-6 && m.in_front(&m.opencv_point) {
            let found = m.triangulated().expect("valid");
            let relative = (found.point - m.opencv_point).norm() / m.opencv_point.norm();
            assert!(relative < 1e-6, "{relative}");
        }
    }
    assert!(close > 100, "{close}");
}

#[test]
fn val_scipy_two_view_minimum() {
    let mut compared = 0;
    for m in matches() {
        // Behind a camera least squares gives a point, we give a reason.
        if !m.in_front(&m.scipy_point) {
            assert!(m.triangulated().is_err());
            continue;
        }
        compared += 1;
        let found = m.triangulated().expect("valid");
        assert!((found.chi_square - m.scipy_cost).abs() < 1e-9 * (1.0 + m.scipy_cost));
        assert!((m.corrected().chi_square - m.scipy_cost).abs() < 1e-9 * (1.0 + m.scipy_cost));
        // Their step tolerance leaves a fraction of the deviation.
        for k in 0..3 {
            let apart = (found.point - m.scipy_point)[k].abs();
            assert!(apart < 1e-4 * found.covariance[(k, k)].sqrt(), "{apart}");
        }
    }
    assert!(compared > 190, "{compared}");
}
