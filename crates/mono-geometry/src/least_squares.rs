//! One Levenberg-Marquardt driver for every nonlinear least-squares problem of the crate, and why it stopped.
//!
//! Problem: find the estimate of least cost, a sum of squared (and perhaps robustly weighted) residuals, from a start.
//! A [`Problem`] supplies its normal equations, the damped step (H + mu D) step = -g with D the diagonal of H, and the
//! cost after a step; how it stores and eliminates its unknowns is its own affair, so the driver allocates nothing.
//!
//! Steps of an iteration: solve; stop if the problem finds the step settled; evaluate the cost there. With the gain
//! ratio = (decrease of the cost) / (decrease of the quadratic model), a step that lowers the cost is taken and
//! mu *= max(1/3, 1 - (2 gain - 1)^3), nu = 2; any other is refused and mu *= nu, nu *= 2 (Nielsen 1999). A start
//! damping of zero makes it Gauss-Newton's method, which damps only after a step was refused.
//!
//! Degenerate: a singular system has no undamped step; the problem either reports it as an error or lets the damping
//! rise. Directions that no residual sees stay where they started.
//!
//! Source: Levenberg (1944), Marquardt (1963); Madsen, Nielsen and Tingleff (2004), algorithm 3.16.

use estimation_base::Readable;

/// Damping below this is no damping: one unit in the last place of the diagonal.
const MIN_DAMPING: f64 = f64::EPSILON;

/// At this damping a step is 1e-12 of one along the scaled gradient: no descent is left to find.
const MAX_DAMPING: f64 = 1e12;

/// Why a minimisation ended: the measured value and the one it was compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Termination {
    /// The gradient is small enough.
    Gradient {
        /// max |g_j| / sqrt(h_j), without unit.
        largest: f64,
        /// The tolerance.
        threshold: f64,
    },
    /// The next step is short enough; it was not taken.
    Step {
        /// Its length, in standard deviations of the estimate.
        length: f64,
        /// The tolerance.
        threshold: f64,
    },
    /// The next step would lower the cost by no more than counts as a decrease; it was not taken.
    PredictedDecrease {
        /// Decrease of the cost that the normal equations predict.
        decrease: f64,
        /// The decrease that counts as none.
        threshold: f64,
    },
    /// The last step lowered the cost by next to nothing.
    CostChange {
        /// Decrease relative to the cost before.
        relative: f64,
        /// The tolerance.
        threshold: f64,
    },
    /// The residuals are rounding errors: the data are free of noise.
    Exact {
        /// Cost reached.
        cost: f64,
        /// Cost of rounding errors alone.
        threshold: f64,
    },
    /// No step lowers the cost, however short.
    Stalled {
        /// Damping reached.
        damping: f64,
        /// Largest allowed.
        limit: f64,
    },
    /// All iterations were used up.
    IterationLimit {
        /// Steps tried, taken or refused.
        iterations: usize,
        /// Decrease of the cost in the last step taken, relative to the cost before (1 if none was taken).
        relative: f64,
    },
}

impl std::fmt::Display for Termination {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut say = |what: &str, value: f64, than: &str, bound: f64| {
            write!(f, "{what} {}, {than} {}", Readable(value), Readable(bound))
        };
        match *self {
            Self::Gradient { largest, threshold } => {
                say("the gradient is", largest, "small enough below", threshold)
            }
            Self::Step { length, threshold } => {
                say("the next step is", length, "short enough below", threshold)
            }
            Self::PredictedDecrease {
                decrease,
                threshold,
            } => say(
                "the next step would lower the cost by",
                decrease,
                "as good as nothing below",
                threshold,
            ),
            Self::CostChange {
                relative,
                threshold,
            } => say(
                "the last step lowered the cost by a share of",
                relative,
                "as good as nothing below",
                threshold,
            ),
            Self::Exact { cost, threshold } => {
                say("the cost is", cost, "rounding errors below", threshold)
            }
            Self::Stalled { damping, limit } => say(
                "no step lowers the cost at a damping of",
                damping,
                "the largest allowed is",
                limit,
            ),
            Self::IterationLimit {
                iterations,
                relative,
            } => write!(
                f,
                "{iterations} steps were used up, the last one lowered the cost by a share of {}",
                Readable(relative)
            ),
        }
    }
}

impl Termination {
    /// Whether the result is a minimum to within a tolerance.
    #[must_use]
    pub fn converged(&self) -> bool {
        !matches!(self, Self::Stalled { .. } | Self::IterationLimit { .. })
    }
}

/// One iteration of the cost curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Cost after the iteration.
    pub cost: f64,
    /// Damping of the step, relative to the diagonal of the Hessian.
    pub damping: f64,
    /// Length of the step, in the problem's own measure; NaN if the system could not be solved.
    pub step_norm: f64,
    /// Decrease of the cost over that of the model; `None` if there was no cost to compare (system not solved, a point
    /// behind a camera, overflow).
    pub gain_ratio: Option<f64>,
    /// Whether the step was taken.
    pub accepted: bool,
}

/// The verdict of the quadratic model on the step just solved for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Model {
    /// Decrease of the cost that it predicts.
    pub(crate) decrease: f64,
    /// Length of the step, in the problem's own measure.
    pub(crate) length: f64,
}

/// A step that was evaluated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Trial {
    /// Cost of the step that will be taken.
    pub(crate) cost: f64,
    /// Cost of the step as solved for, which tells how good the model is; another than `cost` if it was stretched.
    pub(crate) unit_cost: f64,
}

impl Trial {
    /// A step that is taken as it was solved for.
    pub(crate) fn new(cost: f64) -> Self {
        Self {
            cost,
            unit_cost: cost,
        }
    }
}

/// A least-squares problem at its current estimate, which it owns.
pub(crate) trait Problem {
    /// The error that ends the minimisation without a result.
    type Error;

    /// Cost of the current estimate.
    fn cost(&self) -> f64;

    /// Solves for the damped step; `Ok(None)` if only more damping can help.
    ///
    /// # Errors
    /// If no damping can help.
    fn solve(&mut self, damping: f64) -> Result<Option<Model>, Self::Error>;

    /// Evaluates the step; `None` outside the domain.
    fn evaluate(&mut self, model: &Model) -> Option<Trial>;

    /// Makes the step evaluated last the current estimate.
    ///
    /// # Errors
    /// If its normal equations do not exist.
    fn accept(&mut self) -> Result<(), Self::Error>;

    /// Whether a cost counts as lower.
    fn improves(&self, cost: f64) -> bool {
        cost < self.cost()
    }

    /// Whether the estimate just reached ends it; `last` is the step that led there.
    fn at_estimate(&self, _last: Option<Taken>) -> Option<Termination> {
        None
    }

    /// Whether the step just solved for ends it, untaken.
    fn before_step(&self, _model: &Model, _damping: f64) -> Option<Termination> {
        None
    }

    /// Whether the refusal of a step ends it.
    fn after_refusal(&self, _model: &Model) -> Option<Termination> {
        None
    }

    /// Told of every iteration.
    fn record(&mut self, _iteration: Iteration) {}
}

/// A step that was taken.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Taken {
    /// Decrease of the cost relative to the cost before.
    pub(crate) relative: f64,
    /// Length of the step, in the problem's own measure.
    pub(crate) length: f64,
}

/// How to damp, and when to give up.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Control {
    /// Damping of the first step, relative to the diagonal; zero for Gauss-Newton.
    pub(crate) damping: f64,
    /// Least damping after a refusal.
    pub(crate) first_damping: f64,
    /// Steps tried, taken or refused.
    pub(crate) max_iterations: usize,
}

/// Minimises from the problem's current estimate; returns why it ended and the steps tried.
///
/// # Errors
/// As [`Problem::solve`] and [`Problem::accept`].
pub(crate) fn minimise<P: Problem>(
    problem: &mut P,
    control: &Control,
) -> Result<(Termination, usize), P::Error> {
    let mut damping = control.damping;
    let mut growth = 2.0;
    let mut iterations = 0;
    let mut last: Option<Taken> = None;
    if let Some(termination) = problem.at_estimate(None) {
        return Ok((termination, 0));
    }
    loop {
        let model = problem
            .solve(damping)?
            .filter(|m| m.decrease.is_finite() && !m.length.is_nan());
        if let Some(termination) = model.and_then(|m| problem.before_step(&m, damping)) {
            return Ok((termination, iterations));
        }
        if iterations >= control.max_iterations {
            let relative = last.map_or(1.0, |taken| taken.relative);
            let termination = Termination::IterationLimit {
                iterations,
                relative,
            };
            return Ok((termination, iterations));
        }
        iterations += 1;
        let before = problem.cost();
        let trial = model
            .and_then(|m| problem.evaluate(&m))
            .filter(|t| t.cost.is_finite());
        let gain_ratio = match (model, trial) {
            (Some(m), Some(t)) => Some((before - t.unit_cost) / m.decrease),
            _ => None,
        };
        let accepted = model.is_some_and(|m| m.decrease > 0.0)
            && trial.is_some_and(|t| problem.improves(t.cost));
        let step_norm = model.map_or(f64::NAN, |m| m.length);
        if accepted {
            problem.accept()?;
        }
        problem.record(Iteration {
            cost: problem.cost(),
            damping,
            step_norm,
            gain_ratio,
            accepted,
        });
        if accepted {
            let relative = (before - problem.cost()) / before;
            last = Some(Taken {
                relative,
                length: step_norm,
            });
            if let Some(termination) = problem.at_estimate(last) {
                return Ok((termination, iterations));
            }
            let shrink = 1.0 - (2.0 * gain_ratio.unwrap_or(1.0) - 1.0).powi(3);
            damping *= shrink.max(1.0 / 3.0);
            growth = 2.0;
            if damping < MIN_DAMPING {
                damping = MIN_DAMPING.min(control.damping);
            }
        } else {
            if let Some(termination) = model.and_then(|m| problem.after_refusal(&m)) {
                return Ok((termination, iterations));
            }
            damping = (damping * growth).max(control.first_damping);
            growth *= 2.0;
            // NaN in place of a damping ends it too.
            let in_range = damping <= MAX_DAMPING;
            if !in_range {
                let termination = Termination::Stalled {
                    damping,
                    limit: MAX_DAMPING,
                };
                return Ok((termination, iterations));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley as a sum of two squares, (1 - x)^2 + 100 (y - x^2)^2, over 2.
    struct Valley {
        at: [f64; 2],
        step: [f64; 2],
        costs: Vec<f64>,
        refused: usize,
    }

    impl Valley {
        fn new(at: [f64; 2]) -> Self {
            Self {
                at,
                step: [0.0; 2],
                costs: Vec::new(),
                refused: 0,
            }
        }

        fn residuals([x, y]: [f64; 2]) -> [f64; 2] {
            [1.0 - x, 10.0 * (y - x * x)]
        }

        fn cost_at(at: [f64; 2]) -> f64 {
            0.5 * Self::residuals(at).iter().map(|r| r * r).sum::<f64>()
        }

        fn moved(&self) -> [f64; 2] {
            [self.at[0] + self.step[0], self.at[1] + self.step[1]]
        }
    }

    impl Problem for Valley {
        type Error = std::convert::Infallible;

        fn cost(&self) -> f64 {
            Self::cost_at(self.at)
        }

        fn solve(&mut self, damping: f64) -> Result<Option<Model>, Self::Error> {
            let [r0, r1] = Self::residuals(self.at);
            let slope = -20.0 * self.at[0];
            // J = [[-1, 0], [slope, 10]].
            let (h00, h01, h11) = (1.0 + slope * slope, 10.0 * slope, 100.0);
            let (g0, g1) = (-r0 + slope * r1, 10.0 * r1);
            let (d00, d11) = (h00 * (1.0 + damping), h11 * (1.0 + damping));
            let determinant = d00 * d11 - h01 * h01;
            self.step = [
                (-g0 * d11 + g1 * h01) / determinant,
                (g0 * h01 - g1 * d00) / determinant,
            ];
            let [s0, s1] = self.step;
            let damped = damping * (h00 * s0 * s0 + h11 * s1 * s1);
            Ok(Some(Model {
                decrease: 0.5 * (damped - g0 * s0 - g1 * s1),
                length: s0.hypot(s1),
            }))
        }

        fn evaluate(&mut self, _model: &Model) -> Option<Trial> {
            Some(Trial::new(Self::cost_at(self.moved())))
        }

        fn accept(&mut self) -> Result<(), Self::Error> {
            self.at = self.moved();
            Ok(())
        }

        fn before_step(&self, model: &Model, damping: f64) -> Option<Termination> {
            (model.length <= 1e-12 && damping < 1.0).then_some(Termination::Step {
                length: model.length,
                threshold: 1e-12,
            })
        }

        fn record(&mut self, iteration: Iteration) {
            self.costs.push(iteration.cost);
            self.refused += usize::from(!iteration.accepted);
        }
    }

    fn control(damping: f64, max_iterations: usize) -> Control {
        Control {
            damping,
            first_damping: 1e-4,
            max_iterations,
        }
    }

    #[test]
    fn finds_the_end_of_the_valley_damped_or_not() {
        for damping in [0.0, 1e-4, 1.0] {
            let mut valley = Valley::new([-1.2, 1.0]);
            let Ok((termination, iterations)) = minimise(&mut valley, &control(damping, 200));
            assert!(termination.converged(), "{termination:?}");
            assert!((valley.at[0] - 1.0).abs() < 1e-9 && (valley.at[1] - 1.0).abs() < 1e-9);
            assert_eq!(valley.costs.len(), iterations);
            assert!(valley.costs.windows(2).all(|w| w[1] <= w[0]));
            // The first Gauss-Newton step from there overshoots: refusals happen, and the cost never rises.
            assert!(valley.refused > 0, "{damping}");
        }
    }

    #[test]
    fn the_limit_is_named() {
        let mut valley = Valley::new([-1.2, 1.0]);
        let Ok((termination, iterations)) = minimise(&mut valley, &control(1e-4, 3));
        assert_eq!(iterations, 3);
        assert!(matches!(
            termination,
            Termination::IterationLimit { iterations: 3, relative } if relative > 0.0
        ));
        assert!(!termination.converged());
    }
}
