//! Importance weights: exact in the linear case for every proposal, and the wrong forms fail.

use crate::fixtures::{
    Displaced, Drift, Offset, Point, linear_problem, log_evidence, log_likelihood, proposal_rng,
};
use range_bearing_slam::{
    ExtendedProposal, Linearisation, MotionProposal, RangeBearingError, UnscentedProposal,
};
use rbpf_core::Proposal;

const fn extended(linearisation: Linearisation) -> ExtendedProposal<Drift, Offset> {
    ExtendedProposal {
        motion: Drift,
        sensor: Offset,
        linearisation,
    }
}

const fn unscented(iterations: u32) -> UnscentedProposal<Drift, Offset> {
    UnscentedProposal {
        motion: Drift,
        sensor: Offset,
        iterations,
    }
}

/// Increments of `n` draws, and the likelihoods alone of the poses drawn.
fn draws(
    proposal: &dyn Proposal<Point, Displaced, Error = RangeBearingError>,
    n: u64,
) -> (Vec<f64>, Vec<f64>) {
    let (particle, frame) = linear_problem();
    (0..n)
        .map(|draw| {
            let mut moved = particle.clone();
            let mut rng = proposal_rng(3, draw);
            let increment = proposal
                .propose(&mut moved, &frame, &mut rng)
                .expect("valid problem");
            assert_ne!(moved.pose, particle.pose);
            (increment, log_likelihood(&moved, &frame))
        })
        .unzip()
}

/// Mean of exp(log - reference) with its standard error.
fn mean_ratio(logs: &[f64], reference: f64) -> (f64, f64) {
    let n = logs.len() as f64;
    let ratios: Vec<f64> = logs.iter().map(|log| (log - reference).exp()).collect();
    let mean = ratios.iter().sum::<f64>() / n;
    let variance = ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[test]
fn the_linear_increment_is_the_evidence_for_every_draw() {
    let (particle, frame) = linear_problem();
    let evidence = log_evidence(&particle, &frame);
    let proposals: [&dyn Proposal<_, _, Error = _>; 5] = [
        &extended(Linearisation::Sequential),
        &extended(Linearisation::Together(1)),
        &extended(Linearisation::Together(3)),
        &unscented(1),
        &unscented(3),
    ];
    for (number, proposal) in proposals.into_iter().enumerate() {
        let (increments, likelihoods) = draws(proposal, 50);
        for increment in increments {
            assert!(
                (increment - evidence).abs() < 1e-10,
                "{number}: {increment} {evidence}"
            );
        }
        // the likelihood alone fails the same test, by far, for nearly every draw
        let far = likelihoods.iter().filter(|l| (*l - evidence).abs() > 0.1);
        assert!(far.count() > 40, "{number}");
    }
}

/// Whatever is drawn from, the mean of exp(increment) is the evidence. The likelihood alone is
/// right for the motion proposal only: for draws that have seen the measurement it is too large.
#[test]
fn the_mean_weight_is_the_evidence_and_the_likelihood_alone_is_not() {
    let (particle, frame) = linear_problem();
    let evidence = log_evidence(&particle, &frame);
    let motion = MotionProposal {
        motion: Drift,
        sensor: Offset,
    };
    let (increments, likelihoods) = draws(&motion, 40_000);
    let (mean, error) = mean_ratio(&increments, evidence);
    assert!((mean - 1.0).abs() < 4.5 * error, "{mean} {error}");
    assert!(error < 0.03, "too weak: {error}");
    for (increment, likelihood) in increments.iter().zip(&likelihoods) {
        assert!((increment - likelihood).abs() < 1e-10 * likelihood.abs().max(1.0));
    }

    let (_, likelihoods) = draws(&extended(Linearisation::Sequential), 4000);
    let (mean, error) = mean_ratio(&likelihoods, evidence);
    assert!((mean - 1.0).abs() > 20.0 * error, "{mean} {error}");
}
