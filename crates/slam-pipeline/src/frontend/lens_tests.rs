//! Matches behind a fisheye: the noise is that of the real image, the gates are in the ideal one.

use estimation_base::Manifold;
use mono_geometry::{Camera, Distortion, Pinhole};
use nalgebra::{Matrix3, SVector, Vector2};
use vision_sift::Features;

use super::associate::associate;
use super::catalogue::Catalogue;
use super::frame::FrameFeatures;
use super::tests::{PARAMS, SIGMA_PX, descriptor, keypoint, map_point};
use crate::filter::tests::common::*;
use crate::method::DescriptorSearch;
use crate::rig::Rig;

const LANDMARKS: u32 = 40;

/// The camera sees 53 degrees off its axis in the corners of the ideal image: there the noise is 2.8 times as large along the radius.
fn fisheye() -> Rig {
    let pinhole = Pinhole {
        fx: 150.0,
        fy: 150.0,
        ..PINHOLE
    };
    let lens = Distortion::KannalaBrandt {
        k1: -0.01,
        k2: 0.004,
        k3: 0.0,
        k4: 0.0,
    };
    Rig {
        camera: Camera::new(pinhole, lens).unwrap(),
        mount: rig().mount,
    }
}

/// A gate of one sigma in the ideal image refuses a part of the right matches; the shape of the noise keeps all but one in a thousand.
#[test]
fn regress_right_matches_at_the_rim_of_a_fisheye_are_kept() {
    const SEEDS: u64 = 100;
    let rig = fisheye();
    let (mut kept, mut by_one_sigma) = (0, 0);
    for seed in 0..SEEDS {
        let mut rng = rng(600 + seed);
        let mut catalogue = Catalogue::new(DescriptorSearch::InView).unwrap();
        let mut particle = particle(pose(0.0, 0.0, 0.0));
        // The robot hardly moves: the noise of the pixels is all there is.
        let prior = planar_carrier().prior(
            &Vector2::zeros(),
            &particle.departure(),
            &control([0.1, 0.0, 0.0], [1e-4, 1e-4, 1e-4]),
        );
        let truth = prior
            .mean
            .retract(&(prior.factor * SVector::from_fn(|_, _| normal(&mut rng))));
        let (seen_from, expected_from) = (truth.place(&rig), prior.mean.place(&rig));
        let mut features = Features::default();
        for id in 0..LANDMARKS {
            let (a, b) = (uniform(&mut rng, -1.0, 1.0), uniform(&mut rng, -0.75, 0.75));
            let at = ahead(&expected_from, a, b, uniform(&mut rng, 1.8, 2.2));
            let look = descriptor(&mut rng);
            map_point(
                &mut catalogue,
                &mut particle,
                id,
                look,
                point(at, Matrix3::from_diagonal_element(1e-8)),
            );
            let in_camera = seen_from.camera_from_world * (at - seen_from.centre);
            let real = rig.camera.project(&in_camera).unwrap();
            let noise = Vector2::from_fn(|_, _| SIGMA_PX * normal(&mut rng));
            features.keypoints.push(keypoint(&(real + noise)));
            features.descriptors.push(look);
            let ideal = rig.camera.undistort_pixel(&(real + noise)).unwrap();
            let off = (ideal - rig.pinhole().project(&in_camera).unwrap()).norm();
            by_one_sigma += u32::from(off * off <= PARAMS.gate.limit * SIGMA_PX * SIGMA_PX);
        }
        let frame = FrameFeatures::new(&features, &rig.camera);
        let association = associate(&rig, &frame, &catalogue, &particle, &prior, &PARAMS);
        kept += association.inliers.len() as u32;
        let wrong = association
            .inliers
            .iter()
            .filter(|p| p.feature.id as usize != p.keypoint);
        assert_eq!(wrong.count(), 0, "seed {seed}");
    }
    let all = f64::from(LANDMARKS) * SEEDS as f64;
    let (kept, by_one_sigma) = (f64::from(kept) / all, f64::from(by_one_sigma) / all);
    // 1 in 1000 beyond the gate, and four standard errors of that.
    assert!(kept > 0.997, "{kept}");
    assert!(by_one_sigma < 0.96, "{by_one_sigma}");
}
