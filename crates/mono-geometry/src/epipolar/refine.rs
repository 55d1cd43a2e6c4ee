//! Maximum-likelihood motion from many matches: least squares on Sampson distances, with covariance.
//!
//! Minimise sum_i r_i^2, r = q2^T E q1 / s, s^2 = var(q2^T E q1) to first order (see [`super::scorer`]), over the degrees
//! of freedom of E: five of a [`super::relative_pose::RelativePose`], two of planar motion. Sampson's distance is the
//! reprojection error to first order in noise over depth, without the points.
//!
//! 1. residuals and their exact derivatives, those of s included, for the tangents dE_k of E;
//! 2. Levenberg-Marquardt: (J^T J + l diag) step = -J^T r, by Cholesky ([`crate::Termination`] says why it
//!    stopped);
//! 3. stop when the step promises less than rounding changes, or after the given iterations;
//! 4. covariance (J^T J)^-1 at the minimum.
//!
//! Degenerate: matches that leave a direction undetermined (a turning camera that does not move, too few matches) make
//! J^T J singular: an error with the pivot. Outliers are not tamed: select inliers first, and see [`refine_narrowed`].
//!
//! Source: Hartley and Zisserman (2004), 11.4.3 and A6.2.

use nalgebra::linalg::Cholesky;
use nalgebra::{Const, Matrix3, SMatrix, SVector, Vector2};

use super::pair::Correspondence;
use super::scorer::SampsonScorer;
use crate::error::GeometryError;
use crate::least_squares::{Control, Model, Problem, Termination, Trial, minimise};
use crate::linalg::{self, cholesky};
use crate::ransac::Scorer;

/// A motion with K degrees of freedom that has an essential matrix.
pub trait Freedom<const K: usize>: Sized {
    /// E, of Frobenius norm sqrt 2.
    fn essential(&self) -> Matrix3<f64>;

    /// dE / d delta at delta = 0 of [`Self::moved`].
    fn tangents(&self) -> [Matrix3<f64>; K];

    /// The motion perturbed by delta.
    #[must_use]
    fn moved(&self, delta: &SVector<f64, K>) -> Self;
}

/// A refined motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refined<M, const K: usize> {
    /// The motion.
    pub model: M,
    /// Covariance of the perturbation of [`Freedom::moved`].
    pub covariance: SMatrix<f64, K, K>,
    /// Sum of squared residuals, in variances.
    pub chi_square: f64,
    /// Matches used minus K.
    pub degrees_of_freedom: usize,
    /// Steps tried.
    pub iterations: usize,
    /// Why it ended.
    pub termination: Termination,
}

/// Least squares from `start` over the matches (normalised coordinates) with the given indices; `variance` of a
/// coordinate along x and y, (sigma_px / f)^2. O(iterations x n K).
///
/// # Errors
/// [`GeometryError::NotPositiveDefinite`] if the matches do not determine the motion, K of them or fewer included.
pub fn refine<M: Freedom<K> + Clone, const K: usize>(
    start: &M,
    matches: &[Correspondence],
    indices: &[usize],
    variance: &Vector2<f64>,
    max_iterations: usize,
) -> Result<Refined<M, K>, GeometryError> {
    let mut problem = TwoViews {
        matches,
        indices,
        variance,
        model: start.clone(),
        normal: Normal::at(start, matches, indices, variance),
        step: SVector::zeros(),
        candidate: None,
    };
    let control = Control {
        damping: FIRST_DAMPING,
        first_damping: FIRST_DAMPING,
        max_iterations,
    };
    let (termination, iterations) = minimise(&mut problem, &control)?;
    let TwoViews { model, normal, .. } = problem;
    Ok(Refined {
        covariance: linalg::covariance(&normal.factor(&normal.information)?)?,
        model,
        chi_square: normal.chi_square,
        degrees_of_freedom: normal.used.saturating_sub(K),
        iterations,
        termination,
    })
}

/// Damping of the first step.
const FIRST_DAMPING: f64 = 1e-4;

/// The motion being refined.
struct TwoViews<'a, M, const K: usize> {
    matches: &'a [Correspondence],
    indices: &'a [usize],
    variance: &'a Vector2<f64>,
    model: M,
    normal: Normal<K>,
    step: SVector<f64, K>,
    candidate: Option<(M, Normal<K>)>,
}

impl<M: Freedom<K>, const K: usize> Problem for TwoViews<'_, M, K> {
    type Error = GeometryError;

    fn cost(&self) -> f64 {
        self.normal.chi_square
    }

    fn solve(&mut self, damping: f64) -> Result<Option<Model>, GeometryError> {
        let diagonal = self.normal.information.diagonal();
        let damped = self.normal.information + SMatrix::from_diagonal(&(diagonal * damping));
        self.step = self.normal.factor(&damped)?.solve(&-self.normal.gradient);
        let promised = -self.normal.gradient.dot(&self.step);
        let scaled = diagonal.component_mul(&self.step);
        Ok(Some(Model {
            decrease: promised + damping * scaled.dot(&self.step),
            length: promised.max(0.0).sqrt(),
        }))
    }

    fn evaluate(&mut self, _model: &Model) -> Option<Trial> {
        let model = self.model.moved(&self.step);
        let normal = Normal::at(&model, self.matches, self.indices, self.variance);
        // A match lost at a pair of epipoles must not count as a lower cost.
        if normal.used < self.normal.used {
            return None;
        }
        let trial = Trial::new(normal.chi_square);
        self.candidate = Some((model, normal));
        Some(trial)
    }

    fn accept(&mut self) -> Result<(), GeometryError> {
        if let Some((model, normal)) = self.candidate.take() {
            (self.model, self.normal) = (model, normal);
        }
        Ok(())
    }

    fn before_step(&self, model: &Model, _damping: f64) -> Option<Termination> {
        let threshold = 16.0 * f64::EPSILON * self.normal.chi_square;
        (model.decrease <= threshold).then_some(Termination::PredictedDecrease {
            decrease: model.decrease,
            threshold,
        })
    }
}

/// How often the matches are chosen again; a third time changes little.
const NARROWINGS: usize = 2;
/// Median of a chi-square distribution of one degree of freedom.
const CHI_SQUARE_MEDIAN_ONE: f64 = 0.454_936_423_119_572_7;

/// [`refine`] over those of the inliers that fit the noise the inliers show, for a threshold that was set too wide.
///
/// Twice: sigma^2 from the median of the squared distances, at most the scorer's variance; matches beyond the scorer's
/// threshold of that sigma are left out; least squares. The covariance is that of the scorer's variance, so on the large
/// side. O(iterations x n K + n log n).
///
/// # Errors
/// As [`refine`].
pub fn refine_narrowed<M: Freedom<K> + Clone, const K: usize>(
    start: &M,
    matches: &[Correspondence],
    inliers: &[usize],
    scorer: &SampsonScorer,
    max_iterations: usize,
) -> Result<Refined<M, K>, GeometryError> {
    let mut refined = refine(start, matches, inliers, &scorer.variance, max_iterations)?;
    for _ in 0..NARROWINGS {
        let essential = refined.model.essential();
        let squared: Vec<f64> = inliers
            .iter()
            .map(|index| scorer.squared_residual(&essential, &matches[*index]))
            .collect();
        let mut sorted = squared.clone();
        sorted.sort_by(f64::total_cmp);
        let Some(median) = sorted.get(sorted.len() / 2) else {
            break;
        };
        let threshold = scorer.threshold * (median / CHI_SQUARE_MEDIAN_ONE).min(1.0);
        // NaN, a pair of epipoles, is left out.
        let kept: Vec<usize> = std::iter::zip(inliers, squared)
            .filter(|(_, value)| *value <= threshold)
            .map(|(index, _)| *index)
            .collect();
        refined = refine(
            &refined.model,
            matches,
            &kept,
            &scorer.variance,
            max_iterations,
        )?;
    }
    Ok(refined)
}

/// Normal equations at a motion.
struct Normal<const K: usize> {
    information: SMatrix<f64, K, K>,
    gradient: SVector<f64, K>,
    /// The share that rounding of the derivatives alone adds to the diagonal of the information.
    rounding: SVector<f64, K>,
    chi_square: f64,
    used: usize,
}

impl<const K: usize> Normal<K> {
    fn at<M: Freedom<K>>(
        model: &M,
        matches: &[Correspondence],
        indices: &[usize],
        variance: &Vector2<f64>,
    ) -> Self {
        let essential = model.essential();
        let tangents = model.tangents();
        let mut normal = Self {
            information: SMatrix::zeros(),
            gradient: SVector::zeros(),
            rounding: SVector::zeros(),
            chi_square: 0.0,
            used: 0,
        };
        for index in indices {
            let Some((residual, row, scale)) =
                residual(&essential, &tangents, &matches[*index], variance)
            else {
                continue;
            };
            normal.information += row * row.transpose();
            normal.gradient += row * residual;
            normal.rounding += SVector::repeat(scale * scale);
            normal.chi_square += residual * residual;
            normal.used += 1;
        }
        // A product of three factors of unit size, summed over nine terms, is off by a few eps.
        let lengths = SVector::<f64, K>::from_fn(|k, _| tangents[k].norm_squared());
        normal.rounding.component_mul_assign(&lengths);
        normal.rounding *= (8.0 * f64::EPSILON).powi(2);
        normal
    }

    /// Cholesky factor of the (damped) information, unless a parameter moves no residual by more than rounding.
    fn factor(
        &self,
        matrix: &SMatrix<f64, K, K>,
    ) -> Result<Cholesky<f64, Const<K>>, GeometryError> {
        for pivot in 0..K {
            let (value, required) = (self.information[(pivot, pivot)], self.rounding[pivot]);
            // NaN is not determined either.
            let determined = value > required;
            if !determined {
                return Err(GeometryError::NotPositiveDefinite {
                    pivot,
                    value,
                    required,
                });
            }
        }
        cholesky(matrix)
    }
}

/// r, dr / d delta, and the size |q| |p| / s of the products r is a sum of; `None` at a pair of epipoles.
fn residual<const K: usize>(
    essential: &Matrix3<f64>,
    tangents: &[Matrix3<f64>; K],
    m: &Correspondence,
    variance: &Vector2<f64>,
) -> Option<(f64, SVector<f64, K>, f64)> {
    let (p, q) = (m.first.push(1.0), m.second.push(1.0));
    let in_second = essential * p;
    let in_first = essential.tr_mul(&q);
    let (a, b) = (
        in_second.xy().component_mul(variance),
        in_first.xy().component_mul(variance),
    );
    let squared = a.dot(&in_second.xy()) + b.dot(&in_first.xy());
    let usable = squared > 0.0 && squared.is_finite();
    if !usable {
        return None;
    }
    let scale = 1.0 / squared.sqrt();
    let value = q.dot(&in_second) * scale;
    let row = SVector::from_fn(|k, _| {
        let moved = tangents[k] * p;
        let moved_first = tangents[k].tr_mul(&q);
        // d(n / s) = dn / s - n / s (s ds) / s^2
        q.dot(&moved) * scale
            - value * (a.dot(&moved.xy()) + b.dot(&moved_first.xy())) * scale * scale
    });
    Some((value, row, p.norm() * q.norm() * scale))
}
