//! Pose posterior and importance weight where everything is nearly linear: a
//! prior of a millimetre and a milliradian, points metres away.

use crate::filter::evolution::PoseEvolution;
use crate::filter::first_order::first_order_posterior;
use crate::filter::landmark::projected_covariance;
use crate::filter::likelihood::Likelihood;
use crate::filter::linearised::pose_posterior;
use crate::filter::metric::ScaleNote;
use crate::filter::motion::{CarrierModel, MotionPrior};
use crate::filter::observation::{FrameObservation, MatchedFeature, Prepared, Scoring};
use crate::filter::particle::{Keyframe, Particle};
use crate::filter::pose::{PoseMatrix, PoseStep};
use crate::filter::proposal::PoseProposal;
use crate::method::{Evolution, LikelihoodForm, ProposalKind, WeightForm};
use crate::odometry::Control;
use crate::rig::Rig;
use estimation_base::Manifold;
use mono_geometry::inverse_depth::LandmarkGeometry;
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};
use rbpf_core::{Proposal, Rejuvenation, Streams};

use super::common::*;

const SIGMA_PX: f64 = 0.5;

struct Scene {
    rig: Rig,
    carrier: CarrierModel,
    control: Control,
    particle: Particle,
    observation: FrameObservation,
}

impl Scene {
    fn prior(&self) -> MotionPrior {
        self.carrier.prior(
            &self.rig.lever_m(),
            &self.particle.departure(),
            &self.control,
        )
    }

    fn proposal<'a>(
        &'a self,
        likelihood: &'a Likelihood,
        kind: ProposalKind,
        weight: WeightForm,
    ) -> PoseProposal<'a> {
        PoseProposal {
            rig: &self.rig,
            carrier: &self.carrier,
            likelihood,
            kind,
            weight,
        }
    }
}

/// Twenty uncertain points seen after a step of 0.1 m, most with a noise that a lens has stretched.
fn scene(seed: u64) -> Scene {
    let mut rng = rng(seed);
    let carrier = CarrierModel {
        tilt_sigma: 1e-3,
        tilt_time_s: 0.01,
        slope_sigma: 0.01,
        ..planar_carrier()
    };
    let u = control([0.1, 0.0, 0.02], [1e-3, 1e-3, 1e-3]);
    let mut p = particle(pose(0.4, -0.3, 3.13));
    let rig = rig_at(Vector2::new(0.1, 0.05));
    let prior = carrier.prior(&rig.lever_m(), &p.departure(), &u);
    let truth = prior
        .mean
        .retract(&(prior.factor * PoseStep::from_fn(|_, _| normal(&mut rng))));
    let matches = (0..20)
        .map(|id| {
            let (a, b) = (uniform(&mut rng, -0.4, 0.4), uniform(&mut rng, -0.3, 0.3));
            let at = ahead(&place(&prior.mean), a, b, uniform(&mut rng, 4.0, 8.0));
            let factor = Matrix3::new(2e-3, 0.0, 0.0, 1e-3, 3e-3, 0.0, -1e-3, 1e-3, 4e-3);
            let _ = p.map.insert(id, point(at, factor * factor.transpose()));
            let root = noise_root(SIGMA_PX, id);
            let noise = root * Vector2::from_fn(|_, _| uniform(&mut rng, -1.0, 1.0));
            MatchedFeature {
                id,
                pixel: pixel_of(&place(&truth), &at) + noise,
                noise: noise_of(&root),
                scoring: Scoring::Full,
                prototype: None,
            }
        })
        .collect();
    Scene {
        rig,
        carrier,
        control: u,
        particle: p,
        observation: FrameObservation {
            control: u,
            matches,
            initialised: Vec::new(),
            removed: Vec::new(),
        },
    }
}

fn likelihood() -> Likelihood {
    Likelihood {
        // No outliers here: the closed forms have none.
        outlier_share: 1e-40,
        form: LikelihoodForm::Exact,
    }
}

/// Jacobians and noises of all matches at the prior mean, from central differences.
fn linearised(
    prior: &MotionPrior,
    matches: &[Option<Prepared>],
) -> (DMatrix<f64>, DMatrix<f64>, DVector<f64>) {
    let n = 2 * matches.len();
    let (mut h, mut r, mut innovation) = (
        DMatrix::zeros(n, 6),
        DMatrix::zeros(n, n),
        DVector::zeros(n),
    );
    let camera = place(&prior.mean);
    for (i, m) in matches.iter().flatten().enumerate() {
        h.view_mut((2 * i, 0), (2, 6))
            .copy_from(&pose_jacobian(&prior.mean, &m.geometry, &m.mean));
        let j = m
            .geometry
            .parameter_jacobian(&pinhole(), &camera, &m.mean)
            .unwrap();
        let noise = projected_covariance(&j, &m.covariance) + m.noise.covariance();
        r.view_mut((2 * i, 2 * i), (2, 2)).copy_from(&noise);
        innovation
            .rows_mut(2 * i, 2)
            .copy_from(&(m.pixel - project(&camera, &m.geometry, &m.mean)));
    }
    (h, r, innovation)
}

fn dynamic(m: &PoseMatrix) -> DMatrix<f64> {
    DMatrix::from_iterator(6, 6, m.iter().copied())
}

#[test]
fn weight_is_the_evidence_whatever_the_draw() {
    for seed in 0..5 {
        let scene = scene(seed);
        let prior = scene.prior();
        let matches = scene.observation.prepare(&scene.particle);
        let (h, r, innovation) = linearised(&prior, &matches);
        let p = dynamic(&(prior.factor * prior.factor.transpose()));
        let s = &h * p * h.transpose() + r;
        let chol = s.cholesky().unwrap();
        let log_det: f64 = 2.0 * chol.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let evidence = -0.5
            * (innovation.dot(&chol.solve(&innovation))
                + log_det
                + innovation.len() as f64 * (2.0 * core::f64::consts::PI).ln());

        let likelihood = likelihood();
        let unscented = ProposalKind::Unscented { iterations: 2 };
        let exact = scene.proposal(&likelihood, unscented, WeightForm::Importance);
        let only = scene.proposal(&likelihood, unscented, WeightForm::LikelihoodOnly);
        let draw = |proposal: &PoseProposal<'_>, k: u64| {
            let mut copy = scene.particle.clone();
            let Ok(w) = proposal.propose(&mut copy, &scene.observation, &mut rng(1000 + k));
            w
        };
        // A draw moves a pixel by up to 3 (0.4 px of heading, 0.1 px of position); the curvature of the
        // projection over that is 370 px (3e-3)^2 = 3e-3 px a match, against residuals of 0.5 px with
        // variance 0.25 px^2 over 40 coordinates of either sign: sqrt(40) 3e-3 0.5 / 0.25 = 0.04.
        for k in 0..40 {
            let w = draw(&exact, k);
            assert!(
                (w - evidence).abs() < 0.04,
                "seed {seed}, draw {k}: {w} against {evidence}"
            );
        }
        // The likelihood alone wanders with the draw, and lies above the evidence by the divergence of
        // proposal q and prior p on average: KL(q | p) = (tr C + m^2 - 6) / 2 - ln det C^(1/2), whitened by p.
        let q = pose_posterior(&rig(), &prior, &matches, 2);
        let divergence =
            0.5 * (q.factor.norm_squared() + q.mean.norm_squared() - 6.0) - q.log_det_factor;
        let alone: Vec<f64> = (0..40).map(|k| draw(&only, k)).collect();
        let off = alone.iter().sum::<f64>() / 40.0 - evidence;
        let variance = alone
            .iter()
            .map(|w| (w - evidence - off).powi(2))
            .sum::<f64>()
            / 39.0;
        assert!(
            variance > 0.5 * 0.5,
            "likelihood alone has variance {variance}"
        );
        assert!(
            off > 1.0,
            "likelihood alone lacks log(prior / proposal): {off}"
        );
        let bound = 5.0 * (variance / 40.0).sqrt();
        assert!(
            (off - divergence).abs() < bound,
            "{off} against {divergence}"
        );
    }
}

#[test]
fn the_first_order_posterior_is_the_extended_kalman_update_however_wide_the_prior() {
    for seed in 0..5 {
        let scene = scene(seed);
        let matches = scene.observation.prepare(&scene.particle);
        let mut prior = scene.prior();
        prior.factor *= 30.0;
        let (h, r, innovation) = linearised(&prior, &matches);
        let p = dynamic(&(prior.factor * prior.factor.transpose()));
        let gain = (&h * &p * h.transpose() + r)
            .cholesky()
            .unwrap()
            .solve(&(&h * &p))
            .transpose();
        let step = &gain * &innovation;
        let covariance = &p - &gain * &h * &p;

        let found = first_order_posterior(&scene.rig, &prior, &matches);
        let found_step = prior.factor * found.mean;
        let found_covariance = dynamic(&found.pose_covariance(&prior));
        // In units of the posterior: a thousandth of a standard deviation.
        for i in 0..6 {
            let sigma = covariance[(i, i)].sqrt();
            assert!((found_step[i] - step[i]).abs() < 1e-3 * sigma, "{i}");
            assert!((found_covariance[(i, i)].sqrt() / sigma - 1.0).abs() < 1e-3);
        }
        // The sigma points of so wide a prior see its curvature: their posterior is another one.
        let unscented = pose_posterior(&scene.rig, &prior, &matches, 1);
        let apart = prior.factor * (unscented.mean - found.mean);
        let most = (0..6)
            .map(|i| apart[i].abs() / covariance[(i, i)].sqrt())
            .fold(0.0, f64::max);
        assert!(most > 0.05, "seed {seed}: {most}");
    }
}

#[test]
fn motion_proposal_weighs_by_the_likelihood() {
    // q = prior: the ratio is one, so the weight is the likelihood of the drawn pose itself.
    let scene = scene(9);
    let likelihood = likelihood();
    let proposal = scene.proposal(&likelihood, ProposalKind::Motion, WeightForm::Importance);
    for k in 0..10 {
        let mut copy = scene.particle.clone();
        let Ok(w) = proposal.propose(&mut copy, &scene.observation, &mut rng(k));
        let expected = likelihood.log(&scene.rig, &copy.pose, &scene.observation.prepare(&copy));
        assert!((w - expected).abs() < 1e-9 * expected.abs());
    }
}

#[test]
fn posterior_is_the_information_form() {
    for seed in 0..5 {
        let scene = scene(20 + seed);
        let prior = scene.prior();
        let matches = scene.observation.prepare(&scene.particle);
        let (h, r, innovation) = linearised(&prior, &matches);
        let a = dynamic(&prior.factor);
        // In coordinates whitened by the prior: Lambda = I + (H A)^T R^-1 (H A).
        let rows = &h * &a;
        let weighted = r.cholesky().unwrap().solve(&rows);
        let information = DMatrix::identity(6, 6) + rows.transpose() * &weighted;
        let chol = information.clone().cholesky().unwrap();
        let mean = chol.solve(&(weighted.transpose() * innovation));
        let covariance = chol.inverse();

        let posterior = pose_posterior(&rig(), &prior, &matches, 2);
        let got = dynamic(&(posterior.factor * posterior.factor.transpose()));
        // Slopes change by 1e-3 over the prior (1 mm in metres, 1 mrad).
        assert!(
            (&got - &covariance).norm() < 5e-3 * covariance.norm(),
            "seed {seed}"
        );
        for i in 0..6 {
            let off = (posterior.mean[i] - mean[i]).abs() / covariance[(i, i)].sqrt();
            assert!(off < 0.02, "seed {seed}, direction {i}: {off} sigma");
        }
        let log_det: f64 = posterior.factor.diagonal().iter().map(|d| d.ln()).sum();
        assert!((posterior.log_det_factor - log_det).abs() < 1e-12);
        // The images are what fixes the heading here.
        let pose_sigma = posterior.pose_covariance(&prior)[(3, 3)].sqrt();
        assert!(pose_sigma < 0.8e-3, "{pose_sigma:e}");
    }
}

#[test]
fn open_depth_tells_nothing_along_the_baseline() {
    let mut rng = rng(31);
    let start = pose(0.0, 0.0, 0.3);
    let anchor = place(&start);
    let mut p = particle(start);
    p.path.push(Keyframe {
        pose: start,
        camera: anchor,
        scale: ScaleNote::METRE,
    });
    let carrier = planar_carrier();
    let prior = carrier.prior(
        &Vector2::zeros(),
        &p.departure(),
        &control([0.2, 0.03, 0.02], [1e-3, 1e-3, 1e-3]),
    );
    let baseline = prior.mean.centre - start.centre;
    let mut direction = PoseStep::zeros();
    direction
        .fixed_rows_mut::<3>(0)
        .copy_from(&baseline.normalize());
    let whitened = prior.factor.solve_lower_triangular(&direction).unwrap();
    let geometry = LandmarkGeometry::InverseDepth { anchor };
    let told = |scoring: Scoring, rng: &mut rand_chacha::ChaCha8Rng| {
        let matches: Vec<Option<Prepared>> = (0..30)
            .map(|_| {
                let mean = Vector3::new(uniform(rng, -0.3, 0.3), uniform(rng, -0.3, 0.3), 1.25);
                let sigmas = Vector3::new(1e-3, 1e-3, 0.6);
                let landmark =
                    inverse_depth(mean, Matrix3::from_diagonal(&sigmas.component_mul(&sigmas)));
                let seen = Vector3::new(mean.x, mean.y, uniform(rng, 0.2, 1.0));
                let pixel = project(&place(&prior.mean), &geometry, &seen);
                Some(prepared(geometry, &landmark, pixel, 0.25, scoring))
            })
            .collect();
        let posterior = pose_posterior(&rig(), &prior, &matches, 1);
        let inverse = posterior
            .factor
            .solve_lower_triangular(&PoseMatrix::identity())
            .unwrap();
        let information = inverse.transpose() * inverse - PoseMatrix::identity();
        // Along the baseline, and across it in the plane (heading and height are told by both).
        let mut aside = PoseStep::zeros();
        aside[2] = 1.0;
        let aside = prior.factor.solve_lower_triangular(&aside).unwrap();
        (
            whitened.dot(&(information * whitened)),
            aside.dot(&(information * aside)),
        )
    };
    let (across_along, across_aside) = told(Scoring::AcrossEpipolar, &mut rng);
    let (full_along, _) = told(Scoring::Full, &mut rng);
    // Moving along the baseline slides every pixel on its epipolar line: nothing to first order; sigma points
    // of 1 mm leave third order only. Scored in full, thirty landmarks with their prior of inverse depth
    // claim to know the step to centimetres.
    assert!(
        across_aside > 1e4,
        "across the line much is told: {across_aside:e}"
    );
    assert!(
        across_along < 1e-6 * across_aside,
        "{across_along:e} of {across_aside:e}"
    );
    assert!(full_along > 100.0, "{full_along:e}");
    assert!(
        across_along < 1e-4 * full_along,
        "{across_along:e} of {full_along:e}"
    );
}

#[test]
fn exact_moves_leave_the_posterior_as_it_is() {
    // Draws of a nearly linear posterior have equal weights; Metropolis-Hastings steps with the target
    // p(z | s, map) p(s | s_{t-1}, u) must keep their distribution. With the likelihood alone the directions that
    // only odometry knows would spread without bound.
    const PARTICLES: usize = 2000;
    let scene = scene(77);
    let likelihood = likelihood();
    let proposal = scene.proposal(
        &likelihood,
        ProposalKind::Unscented { iterations: 2 },
        WeightForm::Importance,
    );
    let mut rng = rng(770);
    let mut particles = vec![scene.particle.clone(); PARTICLES];
    for p in &mut particles {
        let Ok(_) = proposal.propose(p, &scene.observation, &mut rng);
    }
    let before: Vec<_> = particles.iter().map(|p| p.pose).collect();
    let evolution = PoseEvolution {
        rig: &scene.rig,
        operators: Evolution::MetropolisHastings,
        steps: 8,
        likelihood: &likelihood,
    };
    let report = evolution
        .rejuvenate(&mut particles, &scene.observation, &Streams::new(5), 1)
        .unwrap();
    assert!(report.acceptance().unwrap() > 0.1, "{report:?}");
    let moved = particles
        .iter()
        .zip(&before)
        .filter(|(p, b)| p.pose != **b)
        .count();
    assert!(moved > PARTICLES / 2, "{moved} moved");

    let prior = scene.prior();
    let matches = scene.observation.prepare(&scene.particle);
    let posterior = pose_posterior(&rig(), &prior, &matches, 2);
    let middle = posterior.mean_pose(&prior);
    let draws: Vec<PoseStep> = particles.iter().map(|p| middle.local(&p.pose)).collect();
    let covariance = posterior.pose_covariance(&prior);
    let mean = draws.iter().sum::<PoseStep>() / PARTICLES as f64;
    for i in 0..6 {
        let off = mean[i].abs() / (covariance[(i, i)] / PARTICLES as f64).sqrt();
        assert!(
            off < 5.0,
            "direction {i}: the mean moved by {off} standard errors"
        );
    }
    // Crossover makes slots dependent; a share for that.
    assert_sample_covariance(&draws, &covariance, 0.05);
}
