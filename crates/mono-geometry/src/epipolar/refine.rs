//! Maximum-likelihood motion from many matches: least squares on Sampson distances, with covariance.
//!
//! Minimise sum_i r_i^2, r = q2^T E q1 / s, s^2 = var(q2^T E q1) to first order (see [`super::scorer`]), over the degrees
//! of freedom of E: five of a [`super::relative_pose::RelativePose`], two of planar motion. Sampson's distance is the
//! reprojection error to first order in noise over depth, without the points.
//!
//! 1. residuals and their exact derivatives, those of s included, for the tangents dE_k of E;
//! 2. Levenberg-Marquardt: (J^T J + l diag) step = -J^T r, by Cholesky; l is divided by ten on success, multiplied on
//!    failure;
//! 3. stop when the step promises less than rounding changes, or after the given iterations;
//! 4. covariance (J^T J)^-1 at the minimum.
//!
//! Degenerate: matches that leave a direction undetermined (a turning camera that does not move, too few matches) make
//! J^T J singular: an error with the pivot. Outliers are not tamed: select inliers first, and see [`refine_narrowed`].
//!
//! Source: Hartley and Zisserman (2004), 11.4.3 and A6.2.

use nalgebra::linalg::Cholesky;
use nalgebra::{Const, Matrix3, SMatrix, SVector, Vector2};

use super::Correspondence;
use super::scorer::SampsonScorer;
use crate::error::GeometryError;
use crate::linalg::cholesky;
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

/// Why the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Termination {
    /// A step would lower the sum of squares by less than rounding changes it.
    Converged {
        /// Decrease promised by the linear model.
        promised: f64,
        /// Decrease that would have been worth a step.
        threshold: f64,
    },
    /// No damping gave a lower sum.
    NoDecrease {
        /// The damping reached.
        damping: f64,
    },
    /// The iterations were used up.
    IterationLimit {
        /// Their number.
        iterations: usize,
    },
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
    let mut model = start.clone();
    let mut normal = Normal::at(&model, matches, indices, variance);
    let mut damping = 1e-4;
    let mut iterations = 0;
    let termination = loop {
        if iterations == max_iterations {
            break Termination::IterationLimit { iterations };
        }
        let diagonal = SMatrix::<f64, K, K>::from_diagonal(&normal.information.diagonal());
        let damped = normal.information + diagonal * damping;
        let step = normal.factor(&damped)?.solve(&-normal.gradient);
        let promised = -normal.gradient.dot(&step);
        let threshold = 16.0 * f64::EPSILON * normal.chi_square;
        if promised <= threshold {
            break Termination::Converged {
                promised,
                threshold,
            };
        }
        iterations += 1;
        let next = model.moved(&step);
        let next_normal = Normal::at(&next, matches, indices, variance);
        if next_normal.chi_square < normal.chi_square && next_normal.used >= normal.used {
            (model, normal) = (next, next_normal);
            damping = (damping * 0.1).max(1e-12);
        } else {
            damping *= 10.0;
            if damping > 1e8 {
                break Termination::NoDecrease { damping };
            }
        }
    };
    let covariance = normal.factor(&normal.information)?.inverse();
    Ok(Refined {
        model,
        covariance,
        chi_square: normal.chi_square,
        degrees_of_freedom: normal.used.saturating_sub(K),
        iterations,
        termination,
    })
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
    /// What rounding of the derivatives alone adds to the diagonal of the information.
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
