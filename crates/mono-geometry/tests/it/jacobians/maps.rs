//! Maps built on cameras and groups: a point in anchored inverse depth seen by a camera, a homography, the essential
//! matrix of a motion.

use mono_geometry::epipolar::{Freedom, RelativePose};
use mono_geometry::homography::Homography;
use mono_geometry::inverse_depth::InverseDepthPoint;
use mono_geometry::{PlacedCamera, Se3, so3};
use nalgebra::{Matrix3, SVector, Vector2, Vector3, Vector6};
use proptest::prelude::*;

use super::dual::{Dual, exponential, product};
use super::groups::{hat3, hat6};
use crate::common::{config, pinhole};

/// Far below what a wrong term leaves, far above the rounding of a few dozen operations.
const ROUNDING: f64 = 1e-12;
/// Central differences of step 1e-6: truncation of order 1e-12, rounding of order 1e-10, both times the curvature.
const DIFFERENCES: f64 = 1e-7;

fn rotation_vector() -> impl Strategy<Value = Vector3<f64>> {
    let angle = prop_oneof![Just(0.0), Just(1e-12), Just(1e-5), -0.5..0.5_f64];
    (angle, -1.0..1.0_f64, -1.0..1.0_f64)
        .prop_map(|(angle, x, y)| Vector3::new(x, y, 1.0).normalize() * angle)
}

/// Pixel of h = (x, y, z).
fn pixel(h: [Dual; 3]) -> [Dual; 2] {
    let k = pinhole();
    [
        h[0] / h[2] * k.fx + Dual::constant(k.cx),
        h[1] / h[2] * k.fy + Dual::constant(k.cy),
    ]
}

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn inverse_depth_by_parameters_and_camera(
        anchor in rotation_vector(),
        camera in rotation_vector(),
        (x, y, z) in (-0.5..0.5_f64, -0.5..0.5_f64, -0.5..0.5_f64),
        (alpha, beta) in (-0.4..0.4_f64, -0.3..0.3_f64),
        rho in prop_oneof![Just(0.0), Just(1e-9), Just(-0.05), 0.01..1.0_f64],
    ) {
        let world_from_anchor = Se3::new(so3::exp(&anchor), Vector3::new(0.3, -0.2, 0.1));
        let world_from_camera = Se3::new(so3::exp(&camera), Vector3::new(x, y, z));
        let anchor = PlacedCamera::new(&world_from_anchor);
        let point = InverseDepthPoint { anchor, alpha, beta, rho };
        let view = PlacedCamera::new(&world_from_camera);
        let Some(prediction) = point.predict(&pinhole(), &view) else {
            return Ok(());
        };

        let turn = world_from_camera.rotation.inverse() * world_from_anchor.rotation;
        let shift = world_from_camera.rotation.inverse()
            * (world_from_anchor.translation - world_from_camera.translation);
        // The point in the camera times rho, and rho itself: homogeneous coordinates.
        let homogeneous = |m: &[Dual]| -> [Dual; 4] {
            let ray = [m[0], m[1], Dual::constant(1.0)];
            std::array::from_fn(|i| {
                if i == 3 {
                    return m[2];
                }
                (0..3).fold(m[2] * shift[i], |sum, j| sum + ray[j] * turn[(i, j)])
            })
        };
        let parameters = [alpha, beta, rho];
        let size = 1.0 + prediction.by_parameters.amax() + prediction.by_camera.amax();
        for j in 0..3 {
            let h = homogeneous(&Dual::seeded(&parameters, j));
            let dual = pixel([h[0], h[1], h[2]]);
            let moved = |sign: f64| {
                let mut m = point.parameters();
                m[j] += sign * 1e-6;
                InverseDepthPoint::new(&anchor, &m).project(&pinhole(), &view)
            };
            for i in 0..2 {
                let error = (prediction.by_parameters[(i, j)] - dual[i].slope).abs();
                prop_assert!(error < ROUNDING * size, "parameter {i} {j}: {error}");
                prop_assert!((prediction.pixel_ideal[i] - dual[i].value).abs() < ROUNDING * size);
            }
            if let (Some(plus), Some(minus)) = (moved(1.0), moved(-1.0)) {
                let error = ((plus - minus) / 2e-6 - prediction.by_parameters.column(j)).amax();
                prop_assert!(error < DIFFERENCES * size * size, "parameter {j}: {error}");
            }
        }
        let still = homogeneous(&Dual::seeded(&parameters, usize::MAX));
        for j in 0..6 {
            // (camera exp(delta))^-1 = exp(-delta) camera^-1.
            let delta = Dual::seeded(&[0.0; 6], j).into_iter().map(|d| -d).collect::<Vec<_>>();
            let back = exponential(&hat6(&delta));
            let h: [Dual; 3] = std::array::from_fn(|i| {
                (0..4).fold(Dual::constant(0.0), |sum, k| sum + back[i][k] * still[k])
            });
            let dual = pixel(h);
            for i in 0..2 {
                let error = (prediction.by_camera[(i, j)] - dual[i].slope).abs();
                prop_assert!(error < ROUNDING * size, "camera {i} {j}: {error}");
            }
            let moved = |sign: f64| {
                let mut delta = Vector6::zeros();
                delta[j] = sign * 1e-6;
                let pose = world_from_camera.compose(&Se3::exp(&delta));
                point.project(&pinhole(), &PlacedCamera::new(&pose))
            };
            if let (Some(plus), Some(minus)) = (moved(1.0), moved(-1.0)) {
                let error = ((plus - minus) / 2e-6 - prediction.by_camera.column(j)).amax();
                prop_assert!(error < DIFFERENCES * size * size, "camera {j}: {error}");
            }
        }
    }

    #[test]
    fn homography_by_the_source(
        entries in prop::array::uniform8(-0.3..0.3_f64),
        (x, y) in (-0.8..0.8_f64, -0.8..0.8_f64),
    ) {
        let [a, b, c, d, e, f, g, h] = entries;
        let matrix = Matrix3::new(1.0 + a, b, c, d, 1.0 + e, f, g, h, 1.0);
        let homography = Homography::from_matrix(&matrix).unwrap();
        let (_, jacobian) = homography.map_with_jacobian(&Vector2::new(x, y)).unwrap();
        for j in 0..2 {
            let p = Dual::seeded(&[x, y], j);
            let row = |i: usize| {
                p[0] * matrix[(i, 0)] + p[1] * matrix[(i, 1)] + Dual::constant(matrix[(i, 2)])
            };
            let mut step = Vector2::zeros();
            step[j] = 1e-6;
            let plus = homography.map(&(Vector2::new(x, y) + step)).unwrap();
            let minus = homography.map(&(Vector2::new(x, y) - step)).unwrap();
            let difference = (plus - minus) / 2e-6;
            for i in 0..2 {
                let dual = (row(i) / row(2)).slope;
                let size = 1.0 + jacobian.amax();
                prop_assert!((jacobian[(i, j)] - dual).abs() < ROUNDING * size);
                prop_assert!((jacobian[(i, j)] - difference[i]).abs() < DIFFERENCES * size * size);
            }
        }
    }

    #[test]
    fn essential_matrix_by_the_motion(
        turn in rotation_vector(),
        (x, y, z) in prop_oneof![
            Just((1.0, 0.0, 0.0)),
            Just((0.0, 0.0, -1.0)),
            (-1.0..1.0_f64, -1.0..1.0_f64, 0.1..1.0_f64),
        ],
    ) {
        let motion = Se3::new(so3::exp(&turn), Vector3::new(x, y, z));
        let pose = RelativePose::new(&motion).unwrap();
        let t = pose.second_from_first().translation;
        let basis = pose.tangent();
        let rotation = pose.second_from_first().rotation;
        for (k, tangent) in pose.tangents().iter().enumerate() {
            let delta = Dual::seeded(&[0.0; 5], k);
            // Along the tangents the length stays to first order.
            let moved: Vec<Dual> = (0..3)
                .map(|i| Dual::constant(t[i]) + delta[0] * basis[(i, 0)] + delta[1] * basis[(i, 1)])
                .collect();
            let turned = product(
                &std::array::from_fn(|i| std::array::from_fn(|j| Dual::constant(rotation[(i, j)]))),
                &exponential(&hat3(&delta[2..])),
            );
            let dual = product(&hat3(&moved), &turned);
            let mut step = SVector::<f64, 5>::zeros();
            step[k] = 1e-6;
            let difference = (pose.moved(&step).essential() - pose.moved(&-step).essential()) / 2e-6;
            for i in 0..3 {
                for j in 0..3 {
                    prop_assert!((tangent[(i, j)] - dual[i][j].slope).abs() < ROUNDING);
                    prop_assert!((tangent[(i, j)] - difference[(i, j)]).abs() < DIFFERENCES);
                }
            }
        }
    }
}
