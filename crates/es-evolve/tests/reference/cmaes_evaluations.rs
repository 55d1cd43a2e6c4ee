//! Evaluations that the crate `cmaes` needs on five functions in ten dimensions, medians of twenty seeds.
//!
//! A program of its own, because `cmaes` 0.2.2 brings an older nalgebra and rand that the workspace should not build. To run it:
//! make a package with this file as `src/main.rs` and `cmaes = { version = "0.2.2", default-features = false }`, then
//! run it in release mode. The medians are those of the test in the folder beside, for target 1e-9.

use cmaes::{CMAESOptions, DVector};

const D: usize = 10;

/// The rotation of the tests: 0.7 rad in every pair of coordinates, one after the other.
fn rotated(x: &DVector<f64>) -> DVector<f64> {
    let (sin, cos) = 0.7_f64.sin_cos();
    let mut x = x.clone();
    for i in 0..D {
        for j in i + 1..D {
            let (a, b) = (x[i], x[j]);
            x[i] = cos * a - sin * b;
            x[j] = sin * a + cos * b;
        }
    }
    x
}

fn ellipsoid(x: &DVector<f64>) -> f64 {
    (0..D).map(|i| 1e6_f64.powf(i as f64 / (D as f64 - 1.0)) * x[i] * x[i]).sum()
}

fn main() {
    let functions: [(&str, fn(&DVector<f64>) -> f64); 5] = [
        ("sphere", |x| x.norm_squared()),
        ("ellipsoid", ellipsoid),
        ("rotated ellipsoid", |x| ellipsoid(&rotated(x))),
        ("cigar", |x| x[0] * x[0] + 1e6 * x.rows(1, D - 1).norm_squared()),
        ("Rosenbrock", |x| {
            (0..D - 1)
                .map(|i| 100.0 * (x[i] * x[i] - x[i + 1]).powi(2) + (x[i] - 1.0).powi(2))
                .sum()
        }),
    ];
    for (name, function) in functions {
        let mut evaluations = Vec::new();
        let mut reached = 0;
        for seed in 0..20 {
            let start = if name == "Rosenbrock" { 0.0 } else { 1.0 };
            let sigma = if name == "Rosenbrock" { 0.5 } else { 1.0 };
            let mut run = CMAESOptions::new(vec![start; D], sigma)
                .fun_target(1e-9)
                .seed(seed)
                .max_function_evals(100_000)
                .build(|x: &DVector<f64>| function(x))
                .expect("options");
            let result = run.run();
            let best = result.overall_best.map_or(f64::INFINITY, |b| b.value);
            if best <= 1e-9 {
                reached += 1;
                evaluations.push(run.function_evals());
            }
        }
        evaluations.sort_unstable();
        let middle = evaluations.len() / 2;
        println!("{name}: reached {reached} of 20, median {}, all {evaluations:?}", (evaluations[middle - 1] + evaluations[middle]) / 2);
    }
}
