//! Cameras and lens models: round trips, Jacobians against central differences, edges of the field.

use mono_geometry::{Camera, Distortion, GeometryError, Pinhole};
use nalgebra::{Matrix2x3, Vector2, Vector3};
use proptest::prelude::*;
use proptest::test_runner::Config;

use crate::common::pinhole;

fn lenses() -> Vec<Distortion> {
    vec![
        Distortion::None,
        // The magnitudes of real wide lenses, each sign of the radial terms.
        Distortion::Radtan {
            k1: -0.2834,
            k2: 0.0739,
            p1: 1.9e-4,
            p2: 1.8e-5,
            k3: 0.0,
        },
        Distortion::Radtan {
            k1: 0.12,
            k2: -0.25,
            p1: -2e-3,
            p2: 1e-3,
            k3: 0.11,
        },
        Distortion::Radtan {
            k1: -0.05,
            k2: 0.0,
            p1: 0.01,
            p2: -0.008,
            k3: -0.02,
        },
        // A depth camera's order of magnitude: large coefficients that nearly cancel.
        Distortion::Rational {
            k1: 0.45,
            k2: -2.4,
            p1: 9e-4,
            p2: -2e-4,
            k3: 1.4,
            k4: 0.33,
            k5: -2.2,
            k6: 1.35,
        },
        Distortion::KannalaBrandt {
            k1: 0.0,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
        },
        Distortion::KannalaBrandt {
            k1: -0.0137,
            k2: 0.0207,
            k3: -0.0127,
            k4: 0.0025,
        },
        Distortion::KannalaBrandt {
            k1: 0.05,
            k2: -0.03,
            k3: 0.01,
            k4: -0.002,
        },
    ]
}

fn numeric(camera: &Camera, point: &Vector3<f64>) -> Matrix2x3<f64> {
    let mut jacobian = Matrix2x3::zeros();
    let step = 1e-5 * point.norm();
    for j in 0..3 {
        let mut plus = *point;
        let mut minus = *point;
        plus[j] += step;
        minus[j] -= step;
        let pixel = |p: &Vector3<f64>| camera.project(p).expect("in front of the camera");
        let difference = pixel(&plus) - pixel(&minus);
        jacobian.set_column(j, &(difference / (2.0 * step)));
    }
    jacobian
}

proptest! {
    #![proptest_config(Config { cases: 300, failure_persistence: None, ..Config::default() })]

    /// Every pixel of a 60 degree camera survives the round trip, to 1e-10 px, in both directions.
    #[test]
    fn pixels_survive_the_round_trip(u in -0.5..319.5_f64, v in -0.5..239.5_f64) {
        for lens in lenses() {
            let camera = Camera::new(pinhole(), lens).unwrap();
            let pixel = Vector2::new(u, v);
            let ideal = camera.undistort_pixel(&pixel).unwrap();
            prop_assert!((camera.distort_pixel(&ideal) - pixel).norm() < 1e-10);
            let again = camera.undistort_pixel(&camera.distort_pixel(&ideal)).unwrap();
            prop_assert!((again - ideal).norm() < 1e-10, "{lens:?} {ideal}");
            let ray = camera.unproject(&pixel).unwrap();
            prop_assert!((ray.norm() - 1.0).abs() < 1e-15);
            prop_assert!((camera.project(&(ray * 7.0)).unwrap() - pixel).norm() < 1e-10);
            let normalized = camera.undistort(&camera.distort(&pinhole().normalize(&pixel))).unwrap();
            prop_assert!((normalized - pinhole().normalize(&pixel)).norm() < 1e-13);
            // The ideal pixel's ray, projected through the lens, is the pixel.
            let point = camera.pinhole().bearing(&ideal) * 3.0;
            prop_assert!((camera.project(&point).unwrap() - pixel).norm() < 1e-10);
            prop_assert!((camera.pinhole().project(&point).unwrap() - ideal).norm() < 1e-10);
        }
    }

    #[test]
    fn projection_jacobian_matches_differences(
        x in prop_oneof![Just(0.0), Just(1e-9), Just(-5e-4), Just(2e-3), -0.45..0.45_f64],
        y in prop_oneof![Just(0.0), Just(-1e-9), Just(5e-4), -0.35..0.35_f64],
        depth in prop_oneof![Just(0.01), Just(1.0), Just(1e3), 0.1..50.0_f64],
    ) {
        for lens in lenses() {
            let camera = Camera::new(pinhole(), lens).unwrap();
            let point = Vector3::new(x, y, 1.0) * depth;
            let (pixel, jacobian) = camera.project_with_jacobian(&point).unwrap();
            prop_assert_eq!(Some(pixel), camera.project(&point));
            let error = (jacobian - numeric(&camera, &point)).amax() * depth;
            prop_assert!(error < 1e-5, "{lens:?} {error}");
            // Moving along the ray changes nothing.
            prop_assert!((jacobian * point).norm() < 1e-9);
        }
    }
}

/// The largest slope error that 1e-12 in the distorted plane can make of a point, from the smallest singular value.
fn sensitivity(lens: &Distortion, point: &Vector2<f64>) -> f64 {
    let (_, jacobian) = lens.distort_with_jacobian(point);
    let (trace, determinant) = (jacobian.norm_squared(), jacobian.determinant().abs());
    trace.sqrt() / determinant
}

proptest! {
    #![proptest_config(Config { cases: 2_000, failure_persistence: None, ..Config::default() })]

    /// At a focal length of 1000 px, up to a millionth before the edge of the field: the pixel comes back to 1e-10 px,
    /// the ray to what the lens leaves of it there.
    #[test]
    fn undistortion_holds_1e_10_px_up_to_the_fold(
        share in prop_oneof![Just(0.0), Just(1e-12), Just(0.999), Just(1.0 - 1e-6), 0.0..1.0_f64], angle in 0.0..6.3_f64,
    ) {
        for lens in lenses() {
            let camera = Camera::new(Pinhole { fx: 1000.0, fy: 1000.0, ..pinhole() }, lens).unwrap();
            // Decentring moves the fold by a few p: the determinant says on which side the point is.
            let point = Vector2::new(angle.cos(), angle.sin()) * share * camera.field_radius().min(1.2);
            let jacobian = lens.distort_with_jacobian(&point).1;
            if jacobian.determinant() < 1e-9 {
                continue;
            }
            let pixel = camera.distort(&point);
            let back = camera.undistort(&pixel).unwrap();
            prop_assert!((camera.distort(&back) - pixel).norm() < 1e-10, "{lens:?} {share} {angle}");
            // Singular values below one stretch the rounding of the pixel; curvature may double that.
            let allowed = 4.0 * 2e-13 * sensitivity(&lens, &point) + 4e-16;
            prop_assert!((back - point).norm() < allowed, "{lens:?} {share} {angle}: {}", (back - point).norm());
        }
    }

    /// Lenses drawn at random, most of them absurd: inside its field every one is inverted, up to 2 % before the fold.
    #[test]
    fn any_radial_lens_is_inverted_inside_its_field(
        k1 in -1.0..1.0_f64, k2 in -1.0..1.0_f64, k3 in -1.0..1.0_f64, k4 in -0.5..0.5_f64,
        share in 0.0..0.98_f64, angle in 0.0..6.3_f64,
    ) {
        for lens in [
            Distortion::Radtan { k1, k2, p1: 0.0, p2: 0.0, k3 },
            Distortion::KannalaBrandt { k1, k2, k3, k4 },
            Distortion::Rational { k1, k2, p1: 0.0, p2: 0.0, k3, k4, k5: k3, k6: -k2 },
        ] {
            let radius = share * lens.field_radius().min(3.0);
            let point = Vector2::new(radius * angle.cos(), radius * angle.sin());
            let distorted = lens.distort(&point);
            let back = lens.undistort(&distorted).unwrap();
            let allowed = 2e-12 * (1.0 + distorted.norm()) * sensitivity(&lens, &point) + 1e-12;
            prop_assert!((back - point).norm() < allowed, "{lens:?} {point} {back}");
        }
    }

    /// Whatever undistort accepts is inside the field and maps to what was asked; the rest is an error, not a panic.
    #[test]
    fn undistort_never_returns_a_wrong_branch(
        k1 in -1.0..1.0_f64, k2 in -1.0..1.0_f64, p1 in -0.1..0.1_f64, p2 in -0.1..0.1_f64, k3 in -1.0..1.0_f64,
        x in -3.0..3.0_f64, y in -3.0..3.0_f64,
    ) {
        let wanted = Vector2::new(x, y);
        for lens in [
            Distortion::Radtan { k1, k2, p1, p2, k3 },
            Distortion::Rational { k1, k2, p1, p2, k3, k4: k2, k5: -k1, k6: k3 },
            Distortion::KannalaBrandt { k1, k2, k3, k4: p1 },
        ] {
            match lens.undistort(&wanted) {
                Ok(point) => {
                    // The residual bound, or four epsilon of a point where the lens is steep.
                    let (image, jacobian) = lens.distort_with_jacobian(&point);
                    let allowed = 5e-14 * (1.0 + wanted.norm()) + 1e-15 * jacobian.norm() * point.norm();
                    prop_assert!((image - wanted).norm() <= allowed);
                    prop_assert!(point.norm() < lens.field_radius());
                    prop_assert!(jacobian.determinant() > 0.0);
                }
                Err(error) => {
                    let outside = matches!(error, GeometryError::OutsideInvertibleField { .. });
                    prop_assert!(outside, "{error}");
                }
            }
        }
    }
}

#[test]
fn pinhole_closed_form() {
    let camera = Camera::new(pinhole(), Distortion::None).unwrap();
    let pixel = camera.project(&Vector3::new(1.0, -2.0, 4.0)).unwrap();
    assert_eq!(
        pixel,
        Vector2::new(159.670_29 + 368.826_20 / 4.0, 121.541_36 - 369.902_39 / 2.0)
    );
}

/// Numbers by hand: x = 0.2, y = -0.1, r2 = 0.05, gain = 1 - 0.3 * 0.05 + 0.1 * 0.0025 = 0.98525.
#[test]
fn radtan_closed_form_keeps_the_parameter_order() {
    let lens = Distortion::Radtan {
        k1: -0.3,
        k2: 0.1,
        p1: 0.01,
        p2: 0.02,
        k3: 0.0,
    };
    let got = lens.distort(&Vector2::new(0.2, -0.1));
    let expected = Vector2::new(
        0.2 * 0.98525 + 2.0 * 0.01 * (-0.02) + 0.02 * (0.05 + 0.08),
        -0.1 * 0.98525 + 0.01 * (0.05 + 0.02) + 2.0 * 0.02 * (-0.02),
    );
    assert!((got - expected).norm() < 1e-16);
}

#[test]
fn fisheye_closed_form() {
    let lens = Distortion::KannalaBrandt {
        k1: 0.1,
        k2: 0.0,
        k3: 0.0,
        k4: 0.0,
    };
    // 45 degrees along (3, 4) / 5.
    let theta = std::f64::consts::FRAC_PI_4;
    let bent = theta * (1.0 + 0.1 * theta * theta);
    let got = lens.distort(&Vector2::new(0.6, 0.8));
    assert!((got - Vector2::new(0.6, 0.8) * bent).norm() < 1e-15);
}

#[test]
fn nothing_behind_the_camera_or_beyond_the_fold_has_a_pixel() {
    for lens in lenses() {
        let camera = Camera::new(pinhole(), lens).unwrap();
        for z in [-1.0, 0.0, -0.0, f64::NAN, f64::NEG_INFINITY] {
            assert!(camera.project(&Vector3::new(0.1, 0.1, z)).is_none());
            assert!(
                camera
                    .project_with_jacobian(&Vector3::new(0.1, 0.1, z))
                    .is_none()
            );
        }
        assert!(camera.project(&Vector3::new(f64::NAN, 0.0, 1.0)).is_none());
        assert!(camera.project(&Vector3::new(1.0, 0.0, 1e-320)).is_none());
    }
    // This barrel folds at r = 1.054; without the check a ray at 61 degrees, r = 1.8, lands inside the image.
    let barrel = Distortion::Radtan {
        k1: -0.3,
        k2: 0.0,
        p1: 0.0,
        p2: 0.0,
        k3: 0.0,
    };
    let camera = Camera::new(pinhole(), barrel).unwrap();
    assert!(camera.contains(&camera.distort(&Vector2::new(1.8, 0.0)), 0.0));
    assert!(camera.project(&Vector3::new(1.8, 0.0, 1.0)).is_none());
    let error = camera.undistort(&Vector2::new(5000.0, 0.0)).unwrap_err();
    assert!(matches!(
        error,
        GeometryError::OutsideInvertibleField { .. }
    ));
    assert!(camera.undistort(&Vector2::new(f64::NAN, 0.0)).is_err());
}

#[test]
fn contains_measures_from_the_outer_border() {
    let camera = Camera::new(pinhole(), Distortion::None).unwrap();
    assert!(camera.contains(&Vector2::new(-0.5, 239.5), 0.0));
    assert!(!camera.contains(&Vector2::new(-0.51, 100.0), 0.0));
    assert!(camera.contains(&Vector2::new(3.5, 3.5), 4.0));
    assert!(!camera.contains(&Vector2::new(3.4, 3.5), 4.0));
    assert!(camera.contains(&Vector2::new(-10.0, 100.0), -10.0));
    assert!(!camera.contains(&Vector2::new(f64::NAN, 100.0), 0.0));
}

#[test]
fn camera_refuses_bad_intrinsics() {
    let bad = [
        Pinhole {
            fx: 0.0,
            ..pinhole()
        },
        Pinhole {
            fy: -1.0,
            ..pinhole()
        },
        Pinhole {
            fx: f64::NAN,
            ..pinhole()
        },
        Pinhole {
            fy: f64::INFINITY,
            ..pinhole()
        },
        Pinhole {
            cx: f64::NAN,
            ..pinhole()
        },
        Pinhole {
            width: 0,
            ..pinhole()
        },
        Pinhole {
            height: 0,
            ..pinhole()
        },
    ];
    for pinhole in bad {
        let error = Camera::new(pinhole, Distortion::None).unwrap_err();
        assert!(matches!(error, GeometryError::InvalidParameter { .. }));
    }
    let lens = Distortion::KannalaBrandt {
        k1: 0.0,
        k2: f64::NAN,
        k3: 0.0,
        k4: 0.0,
    };
    assert!(Camera::new(pinhole(), lens).is_err());
}

/// The rational lens by hand: x = 0.2, y = -0.1, s = 0.05.
#[test]
fn rational_closed_form_keeps_the_parameter_order() {
    let lens = Distortion::Rational {
        k1: -0.3,
        k2: 0.1,
        p1: 0.01,
        p2: 0.02,
        k3: 2.0,
        k4: 0.4,
        k5: -0.8,
        k6: 4.0,
    };
    let above = 1.0 - 0.3 * 0.05 + 0.1 * 0.0025 + 2.0 * 0.000_125;
    let below = 1.0 + 0.4 * 0.05 - 0.8 * 0.0025 + 4.0 * 0.000_125;
    let got = lens.distort(&Vector2::new(0.2, -0.1));
    let expected = Vector2::new(
        0.2 * above / below + 2.0 * 0.01 * (-0.02) + 0.02 * (0.05 + 0.08),
        -0.1 * above / below + 0.01 * (0.05 + 0.02) + 2.0 * 0.02 * (-0.02),
    );
    assert!((got - expected).norm() < 1e-16);
}

/// Just beyond the image of the fold there is no solution, in any model that has a fold.
#[test]
fn beyond_the_image_of_the_fold_there_is_no_solution() {
    let folding = [
        Distortion::Radtan {
            k1: -0.3,
            k2: 0.02,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
        },
        Distortion::Rational {
            k1: 0.1,
            k2: 0.0,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
            k4: 0.5,
            k5: 0.1,
            k6: 0.0,
        },
        Distortion::KannalaBrandt {
            k1: -0.2,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
        },
    ];
    for lens in folding {
        let camera = Camera::new(pinhole(), lens).unwrap();
        let fold = camera.field_radius();
        assert!(fold.is_finite(), "{lens:?}");
        for angle in [0.0_f64, 1.0, 2.5, 4.0] {
            let direction = Vector2::new(angle.cos(), angle.sin());
            let edge = lens.distort(&(direction * fold));
            let pixel = |share: f64| camera.pinhole().pixel(&(edge * share));
            assert!(camera.unproject(&pixel(1.0 - 1e-9)).is_ok(), "{lens:?}");
            let error = camera.unproject(&pixel(1.0 + 1e-9)).unwrap_err();
            let text = error.to_string();
            assert!(text.contains("outside the invertible field"), "{text}");
            // Inside the fold on either side of it: seen before, not after.
            let at = |share: f64| (direction * fold * share).push(1.0);
            assert!(camera.project(&at(1.0 - 1e-9)).is_some());
            assert!(camera.project(&at(1.0 + 1e-9)).is_none());
        }
    }
}

/// `tests/reference/opencv_cameras.csv`: pixels, Jacobians and undistorted points of OpenCV 5.0.0.
#[test]
fn val_opencv_three_lens_models() {
    let pinhole = Pinhole {
        width: 752,
        height: 480,
        fx: 458.654,
        fy: 457.296,
        cx: 367.215,
        cy: 248.375,
    };
    let lens = |name: &str| match name {
        "radtan" => Distortion::Radtan {
            k1: -0.283_408_11,
            k2: 0.073_959_07,
            p1: 0.000_193_59,
            p2: 1.761_871_14e-5,
            k3: -0.003,
        },
        "rational" => lenses()[4],
        "fisheye" => lenses()[6],
        other => panic!("no lens {other}"),
    };
    let (mut projected, mut undistorted) = (0, 0);
    for line in include_str!("../reference/opencv_cameras.csv").lines() {
        let mut fields = line.split(',');
        let kind = fields.next().unwrap();
        let lens = lens(fields.next().unwrap());
        let camera = Camera::new(pinhole, lens).unwrap();
        let n: Vec<f64> = fields.map(|field| field.parse().unwrap()).collect();
        if kind == "undistort" {
            let found = camera.undistort(&Vector2::new(n[0], n[1])).unwrap();
            // OpenCV iterates a fixed point, or Newton's method on the angle, to about 1e-11.
            assert!((found - Vector2::new(n[2], n[3])).norm() < 1e-10, "{line}");
            undistorted += 1;
            continue;
        }
        let point = Vector3::new(n[0], n[1], n[2]);
        let (pixel, by_point, by_parameters) = camera.project_with_jacobians(&point).unwrap();
        assert!((pixel - Vector2::new(n[3], n[4])).norm() < 1e-11, "{line}");
        let columns = 3 + camera.parameter_count();
        assert_eq!(n.len(), 5 + 2 * columns);
        for i in 0..2 {
            for j in 0..columns {
                let theirs = n[5 + i * columns + j];
                let ours = if j < 3 {
                    by_point[(i, j)]
                } else {
                    by_parameters[(i, j - 3)]
                };
                let close = (ours - theirs).abs() < 1e-10 * (1.0 + theirs.abs());
                assert!(close, "{i} {j}: {ours} {theirs} in {line}");
            }
        }
        projected += 1;
    }
    assert_eq!((projected, undistorted), (30, 18));
}

/// A finite point so far to the side that its pixel overflows was given an infinite pixel.
#[test]
fn regress_a_pinhole_pixel_that_overflows_is_none() {
    let far = Vector3::new(-1e306, 0.0, 1.0);
    assert!(pinhole().project(&far).is_none());
    assert!(pinhole().project_with_jacobian(&far).is_none());
}
