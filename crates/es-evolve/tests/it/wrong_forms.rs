//! Wrong forms of the mover, each of which moves its target: what the rules of `resample_move` are for.
//!
//! Every case starts from independent samples of the target, so a correct move ends within four standard errors. The
//! right form is run beside the wrong one.

use es_evolve::{Manifold, MoveParams, StepFactors, resample_move};
use estimation_base::Se2;
use nalgebra::{Matrix1, Matrix3, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::support::{check_mean, generator, stream};

fn standard(x: f64) -> f64 {
    -0.5 * x * x
}

fn normals(count: usize, seed: u64) -> Vec<f64> {
    StandardNormal
        .sample_iter(generator(seed))
        .take(count)
        .collect()
}

/// Standard errors between the mean square and 1, that of the target; the square has variance 2.
fn errors_of_the_square(sample: &[f64]) -> f64 {
    let count = sample.len() as f64;
    let mean = sample.iter().map(|x| x * x).sum::<f64>() / count;
    (mean - 1.0) / (2.0 / count).sqrt()
}

/// Partners from the whole population, the slot that moves among them (partners from the moving half without the slot moved the
/// mean square by one standard error only, which shows nothing): the difference depends on its own genome, so backward
/// and forward step are not equally likely.
#[test]
fn the_slot_itself_among_the_partners_moves_the_target() {
    let (size, populations) = (4, 10_000);
    let mut wrong = normals(size * populations, 1);
    let mut rng = generator(2);
    for _ in 0..8 {
        for population in wrong.chunks_exact_mut(size) {
            let parents = population.to_vec();
            for (slot, x) in population.iter_mut().enumerate() {
                let a = rng.random_range(0..size);
                let b = (a + rng.random_range(1..size)) % size;
                let jitter: f64 = StandardNormal.sample(&mut rng);
                let gain = 2.38 / 2.0_f64.sqrt();
                let child = parents[slot] + gain * (parents[a] - parents[b]) + 0.05 * jitter;
                if rng.random::<f64>() < (standard(child) - standard(parents[slot])).exp() {
                    *x = child;
                }
            }
        }
    }
    // 17.7 measured.
    let errors = errors_of_the_square(&wrong);
    assert!(errors.abs() > 8.0, "{errors}");

    let mut right = normals(size * populations, 1);
    let target = |_: usize, x: &f64| standard(*x);
    let params = MoveParams {
        steps: 8,
        crossover_share: 1.0,
        ..MoveParams::default()
    };
    for (number, population) in right.chunks_exact_mut(size).enumerate() {
        let factors = StepFactors::Common(&const { Matrix1::new(1.0) });
        let streams = stream(10_000 + number as u64);
        resample_move(population, &target, factors, &params, &streams).unwrap();
    }
    let errors = errors_of_the_square(&right);
    assert!(errors.abs() < 4.0, "{errors}");
}

/// The likelihood alone as target, prior N(0, 1) and one observation z = 1 of unit noise left out: the mover keeps what it
/// is told to keep, N(1, 1) in place of the posterior N(0.5, 0.5).
#[test]
fn a_target_without_the_prior_is_another_one() {
    let size = 20_000;
    let start = || -> Vec<f64> {
        normals(size, 5)
            .iter()
            .map(|z| 0.5 + 0.5_f64.sqrt() * z)
            .collect()
    };
    let factors = StepFactors::Common(&const { Matrix1::new(0.7) });
    let params = MoveParams {
        steps: 30,
        ..MoveParams::default()
    };
    let mut wrong = start();
    let likelihood = |_: usize, x: &f64| standard(1.0 - x);
    resample_move(&mut wrong, &likelihood, factors, &params, &stream(6)).unwrap();
    let mean = wrong.iter().sum::<f64>() / size as f64;
    assert!((mean - 0.5) / (0.5 / size as f64).sqrt() > 50.0, "{mean}");
    check_mean("likelihood", &wrong, 1.0, 1.0);
    let mut right = start();
    let target = |_: usize, x: &f64| standard(1.0 - x) + standard(*x);
    resample_move(&mut right, &target, factors, &params, &stream(6)).unwrap();
    check_mean("posterior", &right, 0.5, 0.5);
}

/// Translation in body axes and a separate turn: the backward step is read in other axes than the forward one.
#[derive(Clone)]
struct BodyAxes(Se2);

impl Manifold<3> for BodyAxes {
    fn retract(&self, step: &Vector3<f64>) -> Self {
        let moved = self.0.act(&step.xy());
        Self(Se2::new(moved.x, moved.y, self.0.phi + step.z))
    }

    fn local(&self, other: &Self) -> Vector3<f64> {
        let between = self.0.between(&other.0);
        Vector3::new(between.x, between.y, between.phi)
    }
}

/// The mover asks of a space that a step is undone by its negative. The group of the plane does it, body axes do not.
#[test]
fn a_space_whose_steps_are_not_undone_moves_the_target() {
    let deviations = [1.0, 0.1, 0.5];
    let standardised = |pose: &Se2| {
        let Se2 { x, y, phi } = *pose;
        [x / deviations[0], y / deviations[1], phi / deviations[2]]
    };
    let target = |pose: &Se2| -> f64 { standardised(pose).map(standard).iter().sum() };
    let size = 20_000;
    let start: Vec<Se2> = normals(3 * size, 7)
        .chunks_exact(3)
        .map(|z| {
            Se2::new(
                deviations[0] * z[0],
                deviations[1] * z[1],
                deviations[2] * z[2],
            )
        })
        .collect();
    let factor = Matrix3::from_diagonal(&Vector3::new(0.5, 0.02, 0.5));
    let params = MoveParams {
        steps: 10,
        crossover_share: 0.0,
        ..MoveParams::default()
    };
    let errors = |population: &[Se2]| -> [f64; 3] {
        std::array::from_fn(|i| {
            let component: Vec<f64> = population.iter().map(|p| standardised(p)[i]).collect();
            errors_of_the_square(&component)
        })
    };
    let factors = StepFactors::Common(&factor);
    let mut right = start.clone();
    let on_group = |_: usize, pose: &Se2| target(pose);
    resample_move(&mut right, &on_group, factors, &params, &stream(8)).unwrap();
    let right = errors(&right);
    assert!(right.iter().all(|e| e.abs() < 4.0), "{right:?}");
    let mut wrong: Vec<BodyAxes> = start.into_iter().map(BodyAxes).collect();
    let in_body_axes = |_: usize, pose: &BodyAxes| target(&pose.0);
    resample_move(&mut wrong, &in_body_axes, factors, &params, &stream(8)).unwrap();
    let wrong: Vec<Se2> = wrong.into_iter().map(|pose| pose.0).collect();
    let wrong = errors(&wrong);
    assert!(wrong.iter().any(|e| e.abs() > 8.0), "{wrong:?}");
}
