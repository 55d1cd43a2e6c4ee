//! Consistency of points from two views at parallaxes of 0.5 to 20 degrees: NEES in metres and in inverse depth.
//!
//! Pixel noise 0.5 px in both views, all gates open: a point refused for its chi-square or its parallax is a point with a
//! certain error, and the NEES of those that remain has another distribution than chi-square. No trial is lost: that is
//! asserted.
//!
//! The expectation: with z the error of rho over its deviation and r = sigma_rho / rho, the error in metres is, in every
//! component, (1 + r z) times what the covariance reported at the estimate makes of the error in inverse depth. So the NEES
//! in metres is (1 + r z)^2 times that in inverse depth, of mean 3 + 5 r^2, and the depth error over its deviation is
//! -z (1 + r z), of mean -r. At 20 000 trials the bands are 3 +- 0.078 and 0 +- 0.032 (4.5 standard errors): r = 0.22, 0.11,
//! 0.055 at 0.5, 1, 2 degrees leaves the first at 0.5 and the second at all three.

use crate::common::{gauss, look_at, pinhole, see};
use mono_geometry::inverse_depth::{CONVERSION_LINEARITY_INDEX, NotYet, refine};
use mono_geometry::triangulation::{Acceptance, Observation, triangulate, triangulate_two_views};
use mono_geometry::{PlacedCamera, Se3};
use nalgebra::{Matrix3, Vector2, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const TRIALS: u32 = 20_000;
const SIGMA_PX: f64 = 0.5;
const DEPTH_M: f64 = 2.0;

/// Sums over trials of one parametrisation.
#[derive(Default)]
struct Consistency {
    nees: f64,
    /// Depth (or minus inverse depth) errors over their standard deviations.
    bias: f64,
    /// Depth errors above +3 and below -3 standard deviations.
    far: u32,
    near: u32,
}

impl Consistency {
    fn add(
        &mut self,
        error: &Vector3<f64>,
        covariance: &Matrix3<f64>,
        along: &Vector3<f64>,
    ) -> f64 {
        let nees = error.dot(&covariance.cholesky().expect("valid").solve(error));
        self.nees += nees;
        let score = along.dot(error) / along.dot(&(covariance * along)).sqrt();
        self.bias += score;
        self.far += u32::from(score > 3.0);
        self.near += u32::from(score < -3.0);
        nees
    }

    fn mean_nees(&self) -> f64 {
        self.nees / f64::from(TRIALS)
    }

    fn mean_bias(&self) -> f64 {
        self.bias / f64::from(TRIALS)
    }
}

struct Trials {
    /// sigma_rho / rho.
    ratio: f64,
    metres: Consistency,
    inverse: Consistency,
    /// Converted where the linearity index allows, and how many were refused.
    converted: Consistency,
    refused: u32,
    linearity_index: f64,
}

fn open() -> Acceptance {
    Acceptance {
        min_parallax_rad: 0.0,
        chi_square_probability: 1.0,
        max_iterations: 100,
    }
}

fn run(parallax_deg: f64) -> Trials {
    let mut rng = ChaCha8Rng::seed_from_u64(parallax_deg.to_bits());
    let target = Vector3::new(0.3, DEPTH_M, 0.1);
    let half = 0.5 * parallax_deg.to_radians();
    let cameras: [Se3; 2] = [-half, half].map(|a| {
        look_at(
            target + Vector3::new(a.sin(), -a.cos(), 0.02) * DEPTH_M,
            target + Vector3::x() * 0.1,
        )
    });
    let exact = cameras.map(|camera| see(&camera, &target, SIGMA_PX));
    let in_anchor = cameras[0].inverse().transform_point(&target);
    let truth = Vector3::new(
        in_anchor.x / in_anchor.z,
        in_anchor.y / in_anchor.z,
        1.0 / in_anchor.z,
    );
    let along = (target - cameras[0].translation).normalize();
    let mut trials = Trials {
        ratio: 0.0,
        metres: Consistency::default(),
        inverse: Consistency::default(),
        converted: Consistency::default(),
        refused: 0,
        linearity_index: 0.0,
    };
    for _ in 0..TRIALS {
        let observations: [Observation; 2] = exact.map(|mut o| {
            o.pixel_ideal += Vector2::new(gauss(&mut rng), gauss(&mut rng)) * SIGMA_PX;
            o
        });
        let found = triangulate(&pinhole(), &observations, &open()).expect("no trial is lost");
        let direct = triangulate_two_views(&pinhole(), &observations, &open()).expect("nor here");
        let apart = found.point - direct.point;
        assert!(apart.dot(&found.covariance.cholesky().expect("valid").solve(&apart)) < 1e-9);
        let in_metres = trials
            .metres
            .add(&(found.point - target), &found.covariance, &along);

        let [anchor, second] = cameras.map(|camera| PlacedCamera::new(&camera));
        let fitted = refine(&pinhole(), &anchor, &observations, 100).expect("no trial is lost");
        assert!((fitted.chi_square - found.chi_square).abs() < 1e-6 * (1.0 + found.chi_square));
        let in_inverse = trials.inverse.add(
            &(fitted.point.parameters() - truth),
            &fitted.covariance,
            &-Vector3::z(),
        );
        let stretched = in_inverse * (fitted.point.rho / truth.z).powi(2);
        assert!((in_metres - stretched).abs() < 1e-3 * (1.0 + stretched));
        let sigma_rho = fitted.covariance[(2, 2)].sqrt();
        trials.ratio += sigma_rho / truth.z / f64::from(TRIALS);
        trials.linearity_index +=
            fitted.point.linearity_index(sigma_rho, &second) / f64::from(TRIALS);
        match fitted.point.to_euclidean_if_linear(
            &fitted.covariance,
            &second,
            CONVERSION_LINEARITY_INDEX,
        ) {
            Ok((point, covariance)) => {
                trials.converted.add(&(point - target), &covariance, &along);
            }
            Err(NotYet::NotLinear {
                linearity_index,
                required,
            }) => {
                assert!(linearity_index > required);
                trials.refused += 1;
            }
            Err(other) => panic!("{other}"),
        }
    }
    trials
}

#[test]
fn nees_of_two_views_from_half_a_degree_to_twenty() {
    // Mean of chi-square with three degrees of freedom, variance 6; mean of a standard normal.
    let nees_band = 4.5 * (6.0 / f64::from(TRIALS)).sqrt();
    let bias_band = 4.5 / f64::from(TRIALS).sqrt();
    // Share beyond three deviations on one side: 0.00135.
    let tail = 0.001_35 * f64::from(TRIALS);
    let tail_band = 4.5 * tail.sqrt();
    for parallax in [0.5, 1.0, 2.0, 5.0, 20.0] {
        let trials = run(parallax);
        let (metres, inverse, ratio) = (&trials.metres, &trials.inverse, trials.ratio);
        println!(
            "{parallax:4} deg: r {ratio:.4}, L {:.3}; metres: NEES {:.3}, bias {:+.3}, tails {}/{}; inverse depth: \
             NEES {:.3}, bias {:+.3}, tails {}/{}; refused {}",
            trials.linearity_index,
            metres.mean_nees(),
            metres.mean_bias(),
            metres.near,
            metres.far,
            inverse.mean_nees(),
            inverse.mean_bias(),
            inverse.near,
            inverse.far,
            trials.refused,
        );
        // Inverse depth holds everywhere.
        assert!(
            (inverse.mean_nees() - 3.0).abs() < nees_band,
            "{parallax}: {}",
            inverse.mean_nees()
        );
        assert!(
            inverse.mean_bias().abs() < bias_band,
            "{parallax}: {}",
            inverse.mean_bias()
        );
        for count in [inverse.near, inverse.far] {
            assert!(
                (f64::from(count) - tail).abs() < tail_band,
                "{parallax}: {count}"
            );
        }
        // Metres do what the expansion in r says.
        let expected = 3.0 + 5.0 * ratio * ratio;
        assert!(
            (metres.mean_nees() - expected).abs() < nees_band * (1.0 + 4.0 * ratio),
            "{parallax}"
        );
        assert!(
            (metres.mean_bias() + ratio).abs() < bias_band * (1.0 + ratio),
            "{parallax}"
        );
        let outside = [
            (metres.mean_nees() - 3.0).abs() > nees_band,
            metres.mean_bias().abs() > bias_band,
            f64::from(metres.near) > tail + tail_band,
        ];
        match parallax {
            0.5 => assert_eq!(outside, [true, true, true], "{parallax}"),
            1.0 | 2.0 => assert_eq!(outside[1..], [true, true], "{parallax}"),
            _ => assert_eq!(outside, [false; 3], "{parallax}"),
        }
        // The index refuses exactly where metres fail, and what it lets through passes.
        if parallax < 3.0 {
            assert_eq!(trials.refused, TRIALS, "{parallax}");
            assert!(outside.contains(&true));
        } else {
            assert_eq!(trials.refused, 0, "{parallax}");
            let mean = trials.converted.mean_nees();
            assert!((mean - 3.0).abs() < nees_band, "{parallax}: {mean}");
            assert!(trials.converted.mean_bias().abs() < bias_band, "{parallax}");
        }
    }
}
