//! The loop: sample, fit, score, optimise, stop.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Sampler, Scorer, Solver};

/// How long to search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Probability of having drawn a sample of inliers only, in (0, 1); taken as the nearest value inside for others.
    pub confidence: f64,
    /// Least number of trials. The confidence is that of one sample without a wrong datum, which may still be an
    /// ill-conditioned one (five matches close together) whose inliers are a part of the right ones.
    pub min_trials: usize,
    /// Largest number of trials, which overrules the least.
    pub max_trials: usize,
    /// Largest number of refits on a new best model; 0 switches local optimisation off.
    pub local_refits: usize,
    /// Seed of the sampler.
    pub seed: u64,
}

impl Default for Options {
    /// Confidence 0.999, 20 to 10 000 trials, 10 refits, seed 0.
    fn default() -> Self {
        Self {
            confidence: 0.999,
            min_trials: 20,
            max_trials: 10_000,
            local_refits: 10,
            seed: 0,
        }
    }
}

/// A model and what agrees with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus<M> {
    /// The model.
    pub model: M,
    /// Indices of the data within the scorer's threshold, ascending.
    pub inliers: Vec<usize>,
    /// Sum of the costs of all data.
    pub cost: f64,
}

/// Why a run ended, with what was compared.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Stop {
    /// A sample of inliers only has been drawn with the wanted confidence.
    Confident {
        /// Trials made.
        trials: usize,
        /// Trials required by the best model's inliers.
        required: f64,
    },
    /// The largest number of trials was reached first.
    TrialLimit {
        /// Trials made.
        trials: usize,
        /// Trials the best model's inliers would require; infinite without a model.
        required: f64,
    },
    /// There are fewer data than a sample holds.
    TooFewData {
        /// Data given.
        data: usize,
        /// Data required.
        required: usize,
    },
}

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Report<M> {
    /// The best model; `None` if no sample gave any.
    pub best: Option<Consensus<M>>,
    /// Samples drawn.
    pub trials: usize,
    /// Samples that gave no model.
    pub samples_without_model: usize,
    /// Models scored, refits included.
    pub models: usize,
    /// Refits that lowered the cost.
    pub refits_accepted: usize,
    /// Why the run ended.
    pub stop: Stop,
}

/// Searches the model of least cost. O(trials x (fit + models x data)); scoring leaves off early.
///
/// Of models of equal cost the first found is kept.
pub fn ransac<S, Q, P>(
    solver: &S,
    scorer: &Q,
    sampler: &mut P,
    data: &[S::Datum],
    options: &Options,
) -> Report<S::Model>
where
    S: Solver,
    Q: Scorer<S::Datum, S::Model>,
    P: Sampler,
{
    let sample_size = solver.sample_size().max(1);
    let mut report = Report {
        best: None,
        trials: 0,
        samples_without_model: 0,
        models: 0,
        refits_accepted: 0,
        stop: Stop::TooFewData {
            data: data.len(),
            required: sample_size,
        },
    };
    if data.len() < sample_size {
        return report;
    }
    let confidence = if options.confidence > 0.0 {
        options.confidence.min(1.0 - f64::EPSILON)
    } else {
        0.0
    };
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut sample = vec![0; sample_size];
    let mut models = Vec::new();
    let mut mask = vec![false; data.len()];
    let mut required = f64::INFINITY;
    sampler.start(data.len(), sample_size);

    while report.trials < options.max_trials
        && (report.trials < options.min_trials || required > report.trials as f64)
    {
        report.trials += 1;
        sampler.draw(&mut rng, &mut sample);
        models.clear();
        solver.fit(data, &sample, &mut models);
        report.samples_without_model += usize::from(models.is_empty());
        let mut improved = false;
        for model in models.drain(..) {
            report.models += 1;
            let bound = report.best.as_ref().map_or(f64::INFINITY, |b| b.cost);
            if let Some(cost) = cost_below(scorer, &model, data, bound) {
                report.best = Some(consensus(scorer, model, data, cost));
                improved = true;
            }
        }
        if !improved {
            continue;
        }
        if let Some(best) = &mut report.best {
            for _ in 0..options.local_refits {
                let Some(better) = refit(solver, scorer, data, sample_size, best) else {
                    break;
                };
                report.models += 1;
                report.refits_accepted += 1;
                *best = better;
            }
            mask.fill(false);
            for index in &best.inliers {
                mask[*index] = true;
            }
            required = sampler.trials_needed(&mask, sample_size, confidence);
        }
    }
    let trials = report.trials;
    report.stop = if required <= trials as f64 {
        Stop::Confident { trials, required }
    } else {
        Stop::TrialLimit { trials, required }
    };
    report
}

/// The solver's model of the inliers of `best`, if it costs less.
fn refit<S: Solver, Q: Scorer<S::Datum, S::Model>>(
    solver: &S,
    scorer: &Q,
    data: &[S::Datum],
    sample_size: usize,
    best: &Consensus<S::Model>,
) -> Option<Consensus<S::Model>> {
    if best.inliers.len() < sample_size {
        return None;
    }
    let model = solver.refit(data, &best.inliers, &best.model)?;
    let cost = cost_below(scorer, &model, data, best.cost)?;
    Some(consensus(scorer, model, data, cost))
}

/// The sum of costs, `None` as soon as it reaches `bound`.
fn cost_below<D, M>(scorer: &impl Scorer<D, M>, model: &M, data: &[D], bound: f64) -> Option<f64> {
    let mut cost = 0.0;
    for datum in data {
        cost += scorer.cost(scorer.squared_residual(model, datum));
        // NaN is no cost to accept.
        if cost >= bound || cost.is_nan() {
            return None;
        }
    }
    Some(cost)
}

fn consensus<D, M>(scorer: &impl Scorer<D, M>, model: M, data: &[D], cost: f64) -> Consensus<M> {
    let threshold = scorer.threshold();
    let inliers = data
        .iter()
        .enumerate()
        .filter(|(_, datum)| scorer.squared_residual(&model, datum) <= threshold)
        .map(|(index, _)| index)
        .collect();
    Consensus {
        model,
        inliers,
        cost,
    }
}
