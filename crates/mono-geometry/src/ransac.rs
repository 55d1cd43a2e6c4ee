//! Random sample consensus: the model most data agree with, found among data of which many are wrong.
//!
//! Minimise over models sum_i rho(e_i^2), rho(s) = min(s, T): the truncated quadratic of MSAC (Torr and Zisserman 2000),
//! e_i in standard deviations, T a chi-square quantile. The minimum is sought among models fitted to random samples of
//! the fewest data that fix one (Fischler and Bolles 1981). Four pieces, each replaceable without the others:
//!
//! - [`Solver`]: models from a sample, and optionally a better one from many data;
//! - [`Scorer`]: how badly a datum fits a model; [`Msac`] makes one of a closure;
//! - [`Sampler`]: which data to try next: [`Uniform`], or [`Prosac`] when the data come with a quality;
//! - [`ransac`]: the loop, with local optimisation (Chum, Matas and Kittler 2003) and a number of trials that adapts to
//!   the share of inliers found.
//!
//! Steps of a trial: draw a sample; fit; score every model, leaving off as soon as it costs more than the best so far
//! (exact: costs are never negative); on a new best, refit to its inliers while that lowers the cost; recompute the number of
//! trials after which a sample of inliers only has been drawn with the wanted confidence. One seed gives one result, on
//! any machine and with any number of threads.
//!
//! Degenerate: a degenerate sample gives no model and costs a trial. Fewer data than a sample, or no model at all, is a
//! report without a model, not an error. A model always has its own sample as inliers: a consensus barely above the
//! sample size is no evidence, and the caller has to look at [`Consensus::inliers`]. With inlier shares below about 10 %
//! and samples of 8 the number of trials explodes; take a smaller sample or a quality order.

mod driver;
mod prosac;
mod sampler;
mod scorer;
mod solver;

pub use driver::{Consensus, Options, Report, Stop, ransac};
pub use prosac::Prosac;
pub use sampler::{Sampler, Uniform, uniform_trials_needed};
pub use scorer::{Msac, Scorer};
pub use solver::Solver;
