//! The robust estimation loop on lines in the plane: counts of trials against the binomial distribution, bail-out against a
//! naive loop, quality order, local optimisation, degenerate data.

use mono_geometry::ransac::{
    Msac, Options, Prosac, Sampler, Scorer, Solver, Stop, Uniform, ransac, uniform_trials_needed,
};
use nalgebra::{Matrix2, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Lines (a, b, c), a x + b y + c = 0, a^2 + b^2 = 1, through two points, or the total least squares line of many.
struct Line;

impl Solver for Line {
    type Datum = Vector2<f64>;
    type Model = Vector3<f64>;

    fn sample_size(&self) -> usize {
        2
    }

    fn fit(&self, data: &[Vector2<f64>], sample: &[usize], models: &mut Vec<Vector3<f64>>) {
        let (p, q) = (data[sample[0]], data[sample[1]]);
        let normal = Vector2::new(p.y - q.y, q.x - p.x);
        if normal.norm() > 0.0 {
            let normal = normal.normalize();
            models.push(normal.push(-normal.dot(&p)));
        }
    }

    fn refit(
        &self,
        data: &[Vector2<f64>],
        inliers: &[usize],
        _model: &Vector3<f64>,
    ) -> Option<Vector3<f64>> {
        let mean = inliers.iter().map(|i| data[*i]).sum::<Vector2<f64>>() / inliers.len() as f64;
        let scatter: Matrix2<f64> = inliers
            .iter()
            .map(|i| (data[*i] - mean) * (data[*i] - mean).transpose())
            .sum();
        let eigen = scatter.symmetric_eigen();
        let normal: Vector2<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
        Some(normal.push(-normal.dot(&mean)))
    }
}

/// Line of a fixed sample only: no refit.
struct Minimal;

impl Solver for Minimal {
    type Datum = Vector2<f64>;
    type Model = Vector3<f64>;

    fn sample_size(&self) -> usize {
        2
    }

    fn fit(&self, data: &[Vector2<f64>], sample: &[usize], models: &mut Vec<Vector3<f64>>) {
        Line.fit(data, sample, models);
    }
}

const SIGMA: f64 = 0.01;

fn scorer() -> impl Scorer<Vector2<f64>, Vector3<f64>> {
    Msac::new(
        |line: &Vector3<f64>, point: &Vector2<f64>| (line.dot(&point.push(1.0)) / SIGMA).powi(2),
        3.84,
    )
}

/// `inliers` points near y = 0.5 x + 0.1 in the unit square, then points anywhere in it.
fn points(seed: u64, inliers: usize, outliers: usize, sigma: f64) -> Vec<Vector2<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut points = Vec::new();
    for _ in 0..inliers {
        let x = rng.random::<f64>();
        points.push(Vector2::new(x, 0.5 * x + 0.1 + sigma * gauss(&mut rng)));
    }
    for _ in 0..outliers {
        points.push(Vector2::new(rng.random(), rng.random()));
    }
    points
}

fn is_truth(line: &Vector3<f64>, tolerance: f64) -> bool {
    let truth = Vector3::new(-0.5, 1.0, -0.1) / 1.25_f64.sqrt();
    (line - truth).amax().min((line + truth).amax()) < tolerance
}

#[test]
fn half_outliers_are_survived_and_the_seed_decides_everything() {
    let data = points(1, 100, 100, 0.2 * SIGMA);
    let options = Options::default();
    let run = |seed| {
        ransac(
            &Line,
            &scorer(),
            &mut Uniform::default(),
            &data,
            &Options { seed, ..options },
        )
    };
    let report = run(7);
    let best = report.best.as_ref().expect("a line");
    assert!(is_truth(&best.model, 0.01));
    assert!((0..100).all(|i| best.inliers.contains(&i)));
    assert_eq!(report, run(7));
    // Without local optimisation the model is the one of the sample drawn.
    let minimal = |seed| {
        ransac(
            &Minimal,
            &scorer(),
            &mut Uniform::default(),
            &data,
            &Options { seed, ..options },
        )
        .best
    };
    assert_eq!(minimal(7), minimal(7));
    assert_ne!(minimal(7), minimal(8));
    assert!(
        matches!(report.stop, Stop::Confident { trials, required } if required <= trials as f64)
    );
}

#[test]
fn the_number_of_trials_has_the_stated_confidence() {
    // 30 of 60 exact points: P = 30/60 29/59. After k trials the line is found with probability 1 - (1 - P)^k.
    let all_good = 30.0 * 29.0 / (60.0 * 59.0);
    let confidence = 0.9;
    let needed = uniform_trials_needed(30, 60, 2, confidence);
    assert!((needed - (1.0_f64 - confidence).ln() / (1.0_f64 - all_good).ln()).abs() < 1e-12);
    let limit = needed.ceil() as usize;
    let expected = 1.0 - (1.0_f64 - all_good).powi(i32::try_from(limit).unwrap());
    let seeds = 4000;
    let (mut found_in_limit, mut found) = (0, 0);
    for seed in 0..seeds {
        let data = points(1000 + seed, 30, 30, 0.0);
        let run = |max_trials, confidence| {
            let options = Options {
                confidence,
                min_trials: 0,
                max_trials,
                local_refits: 0,
                seed,
            };
            ransac(
                &Minimal,
                &scorer(),
                &mut Uniform::default(),
                &data,
                &options,
            )
        };
        let good = |report: mono_geometry::ransac::Report<Vector3<f64>>| {
            usize::from(is_truth(&report.best.expect("a line").model, 1e-9))
        };
        // At a confidence next to one the limit alone ends the run.
        found_in_limit += good(run(limit, 1.0));
        found += good(run(10_000, confidence));
    }
    let share = found_in_limit as f64 / seeds as f64;
    let standard_error = (expected * (1.0 - expected) / seeds as f64).sqrt();
    assert!(
        (share - expected).abs() < 4.5 * standard_error,
        "{share} {expected}"
    );
    // The adaptive run stops later if it has not found the line, so it succeeds at least that often.
    let share = found as f64 / seeds as f64;
    assert!(share > confidence - 4.5 * standard_error, "{share}");
    // Closed forms at the ends.
    assert_eq!(uniform_trials_needed(1, 60, 2, 0.9), f64::INFINITY);
    assert_eq!(uniform_trials_needed(60, 60, 2, 0.9), 0.0);
    assert_eq!(uniform_trials_needed(30, 60, 2, 0.0), 0.0);
}

#[test]
fn the_least_number_of_trials_is_made_unless_the_limit_is_lower() {
    let data = points(3, 60, 0, SIGMA);
    let trials = |min_trials, max_trials| {
        let options = Options {
            min_trials,
            max_trials,
            ..Options::default()
        };
        let report = ransac(&Line, &scorer(), &mut Uniform::default(), &data, &options);
        (report.trials, report.stop)
    };
    let (enough, _) = trials(0, 10_000);
    assert!(enough < 20, "{enough}");
    assert_eq!(trials(25, 10_000).0, 25);
    // The confidence was reached within the limit.
    let (made, stop) = trials(25, 15);
    assert!(made == 15 && matches!(stop, Stop::Confident { .. }));
}

#[test]
fn leaving_off_early_changes_nothing() {
    for seed in 0..30 {
        let data = points(seed, 40, 60, SIGMA);
        let options = Options {
            max_trials: 50,
            confidence: 1.0,
            local_refits: 0,
            seed,
            ..Options::default()
        };
        let report = ransac(
            &Minimal,
            &scorer(),
            &mut Uniform::default(),
            &data,
            &options,
        );
        // The slow and obvious loop.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut sampler = Uniform::default();
        sampler.start(data.len(), 2);
        let mut best: Option<(f64, Vector3<f64>)> = None;
        for _ in 0..50 {
            let mut sample = [0; 2];
            sampler.draw(&mut rng, &mut sample);
            let mut models = Vec::new();
            Line.fit(&data, &sample, &mut models);
            for model in models {
                let cost: f64 = data
                    .iter()
                    .map(|point| scorer().squared_residual(&model, point).min(3.84))
                    .sum();
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, model));
                }
            }
        }
        let (cost, model) = best.expect("a line");
        let found = report.best.expect("a line");
        assert_eq!((found.cost, found.model), (cost, model));
        assert_eq!(report.trials, 50);
        assert!(matches!(report.stop, Stop::TrialLimit { trials: 50, .. }));
    }
}

#[test]
fn a_quality_order_saves_trials_and_a_useless_one_costs_no_model() {
    let (mut uniform, mut informed, mut found, mut misled) = (0, 0, 0, 0);
    let runs = 40;
    for seed in 0..runs {
        // 20 % inliers; their quality is higher by two standard deviations on average.
        let data = points(seed, 60, 240, 0.3 * SIGMA);
        let mut rng = ChaCha8Rng::seed_from_u64(seed + 500);
        let qualities: Vec<f64> = (0..300)
            .map(|i| gauss(&mut rng) + if i < 60 { 2.0 } else { 0.0 })
            .collect();
        let useless: Vec<f64> = (0..300).map(|_| gauss(&mut rng)).collect();
        let options = Options {
            seed,
            ..Options::default()
        };
        uniform += ransac(&Line, &scorer(), &mut Uniform::default(), &data, &options).trials;
        let report = ransac(
            &Line,
            &scorer(),
            &mut Prosac::new(&qualities),
            &data,
            &options,
        );
        informed += report.trials;
        found += usize::from(is_truth(&report.best.expect("a line").model, 0.01));
        // A wrong line shares data with the true one: beyond the 4 % of an unrelated one.
        let mut prosac = Prosac::new(&useless);
        let report = ransac(&Line, &scorer(), &mut prosac, &data, &options);
        misled += usize::from(is_truth(&report.best.expect("a line").model, 0.01));
    }
    assert!(informed * 4 < uniform, "{informed} of {uniform}");
    assert_eq!((found, misled), (runs as usize, runs as usize));
}

#[test]
fn prosac_begins_with_the_best_and_ends_uniform() {
    let qualities: Vec<f64> = (0..50)
        .map(|i| if i == 3 { f64::NAN } else { f64::from(i) })
        .collect();
    let mut prosac = Prosac::new(&qualities);
    prosac.growth_trials = 500.0;
    prosac.start(50, 3);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut sample = [0; 3];
    prosac.draw(&mut rng, &mut sample);
    sample.sort_unstable();
    assert_eq!(sample, [47, 48, 49]);
    let mut counts = [0_i32; 50];
    let draws = 20_000;
    for trial in 0..draws + 1000 {
        prosac.draw(&mut rng, &mut sample);
        assert!(sample[0] != sample[1] && sample[1] != sample[2] && sample[0] != sample[2]);
        if trial >= 1000 {
            for index in sample {
                counts[index] += 1;
            }
        }
    }
    // Each datum is in a sample with probability 3/50; the one without a quality is no exception.
    let expected = f64::from(draws) * 0.06;
    let standard_error = (expected * 0.94).sqrt();
    assert!(
        counts
            .iter()
            .all(|count| (f64::from(*count) - expected).abs() < 4.5 * standard_error)
    );
}

#[test]
fn local_optimisation_lowers_the_cost_and_saves_trials() {
    let (mut with, mut without, mut trials_with, mut trials_without) = (0.0, 0.0, 0, 0);
    let (mut inliers_with, mut inliers_without) = (0, 0);
    for seed in 0..40 {
        let data = points(seed, 100, 100, SIGMA);
        let run = |local_refits| {
            let options = Options {
                local_refits,
                seed,
                confidence: 0.95,
                min_trials: 0,
                ..Options::default()
            };
            ransac(&Line, &scorer(), &mut Uniform::default(), &data, &options)
        };
        let (a, b) = (run(10), run(0));
        assert!(a.refits_accepted > 0 && b.refits_accepted == 0);
        trials_with += a.trials;
        trials_without += b.trials;
        let (a, b) = (a.best.expect("a line"), b.best.expect("a line"));
        with += a.cost;
        without += b.cost;
        inliers_with += a.inliers.len();
        inliers_without += b.inliers.len();
    }
    assert!(
        with < without && trials_with < trials_without,
        "{with} {without}"
    );
    assert!(inliers_with > inliers_without);
}

#[test]
fn degenerate_data_give_a_report_without_a_model() {
    let same = vec![Vector2::new(0.3, 0.4); 20];
    let options = Options {
        max_trials: 100,
        ..Options::default()
    };
    let report = ransac(&Line, &scorer(), &mut Uniform::default(), &same, &options);
    assert!(report.best.is_none());
    assert_eq!((report.trials, report.samples_without_model), (100, 100));
    assert_eq!(
        report.stop,
        Stop::TrialLimit {
            trials: 100,
            required: f64::INFINITY
        }
    );
    let one = ransac(
        &Line,
        &scorer(),
        &mut Prosac::new(&[1.0]),
        &same[..1],
        &options,
    );
    assert_eq!(
        one.stop,
        Stop::TooFewData {
            data: 1,
            required: 2
        }
    );
    let nan = vec![Vector2::new(f64::NAN, 0.0); 5];
    let report = ransac(&Line, &scorer(), &mut Prosac::new(&[]), &nan, &options);
    assert!(report.best.is_none());
    // Exactly a sample: its model, at once.
    let two = points(0, 2, 0, 0.0);
    let report = ransac(
        &Line,
        &scorer(),
        &mut Prosac::new(&[0.0, 1.0]),
        &two,
        &Options::default(),
    );
    assert!(is_truth(&report.best.expect("a line").model, 1e-9));
}
