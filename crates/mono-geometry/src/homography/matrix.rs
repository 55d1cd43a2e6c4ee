//! The homography itself: its matrix, the maps and errors of points, and the one through four points.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use crate::linalg::svd3;

/// An invertible map of the projective plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography {
    matrix: Matrix3<f64>,
    inverse: Matrix3<f64>,
}

impl Homography {
    /// A homography from its matrix, scaled to Frobenius norm 1 (the sign is kept). O(1).
    ///
    /// `None` if an entry is not finite or the matrix singular to rounding.
    #[must_use]
    pub fn from_matrix(matrix: &Matrix3<f64>) -> Option<Self> {
        let largest = matrix.amax();
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        // First by the largest entry: the square of a huge one would overflow.
        let scaled = matrix / largest;
        let scaled = scaled / scaled.norm();
        let singular_values = svd3(&scaled).ok()?.singular_values;
        if singular_values[2] <= 3.0 * f64::EPSILON * singular_values[0] {
            return None;
        }
        Some(Self {
            matrix: scaled,
            inverse: scaled.try_inverse()?,
        })
    }

    /// The only homography that maps four points to four others; the sign is such that the first source point has a
    /// positive third coordinate. O(1), without decomposition.
    ///
    /// `None` if two points coincide or three are collinear (to rounding) in either image, or a number is not finite.
    #[must_use]
    pub fn from_four_points(
        source: &[Vector2<f64>; 4],
        target: &[Vector2<f64>; 4],
    ) -> Option<Self> {
        let (from, source_shift) = Basis::new(source)?;
        let (to, target_shift) = Basis::new(target)?;
        let core = to.matrix
            * Matrix3::from_diagonal(&to.weights.component_div(&from.weights))
            * from.inverse;
        let matrix = target_shift.back() * core * source_shift.forth();
        let sign = (matrix * source[0].push(1.0)).z.signum();
        Self::from_matrix(&(matrix * sign))
    }

    /// H, of Frobenius norm 1.
    #[must_use]
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.matrix
    }

    /// The map from target to source.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let norm = self.inverse.norm();
        Self {
            matrix: self.inverse / norm,
            inverse: self.matrix * norm,
        }
    }

    /// Where a source point goes; `None` on the line that goes to infinity, or for NaN. O(1).
    #[must_use]
    pub fn map(&self, source: &Vector2<f64>) -> Option<Vector2<f64>> {
        dehomogenize(&(self.matrix * source.push(1.0)))
    }

    /// Where a target point comes from; `None` on the line that comes from infinity, or for NaN. O(1).
    #[must_use]
    pub fn map_inverse(&self, target: &Vector2<f64>) -> Option<Vector2<f64>> {
        dehomogenize(&(self.inverse * target.push(1.0)))
    }

    /// [`Self::map`] and its derivative with respect to the source point (2x2).
    #[must_use]
    pub fn map_with_jacobian(&self, source: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let image = self.matrix * source.push(1.0);
        let point = dehomogenize(&image)?;
        let h = &self.matrix;
        let jacobian = Matrix2::new(
            h[(0, 0)] - point.x * h[(2, 0)],
            h[(0, 1)] - point.x * h[(2, 1)],
            h[(1, 0)] - point.y * h[(2, 0)],
            h[(1, 1)] - point.y * h[(2, 1)],
        ) / image.z;
        jacobian
            .iter()
            .all(|v| v.is_finite())
            .then_some((point, jacobian))
    }

    /// target - H source, in units of the target; `None` as for [`Self::map`].
    #[must_use]
    pub fn transfer_error(
        &self,
        source: &Vector2<f64>,
        target: &Vector2<f64>,
    ) -> Option<Vector2<f64>> {
        self.map(source).map(|mapped| target - mapped)
    }

    /// |target - H source|^2 + |source - H^-1 target|^2; both images in one unit. `None` as for [`Self::map`].
    #[must_use]
    pub fn symmetric_transfer_squared(
        &self,
        source: &Vector2<f64>,
        target: &Vector2<f64>,
    ) -> Option<f64> {
        let forth = self.transfer_error(source, target)?;
        let back = source - self.map_inverse(target)?;
        Some(forth.norm_squared() + back.norm_squared())
    }

    /// Squared first-order distance of the pair (source, target) in R^4 from the pairs that H maps exactly.
    ///
    /// Chi-square with 2 degrees of freedom, times sigma^2, if every coordinate of both images has the standard
    /// deviation sigma. `None` where the constraint has no gradient, or for NaN. O(1).
    #[must_use]
    pub fn sampson_squared(&self, source: &Vector2<f64>, target: &Vector2<f64>) -> Option<f64> {
        // Constraint c = (H s)_xy - t (H s)_z = 0; its gradient by t is -(H s)_z I.
        let image = self.matrix * source.push(1.0);
        let constraint = image.xy() - target * image.z;
        let h = &self.matrix;
        let by_source = Matrix2::new(
            h[(0, 0)] - target.x * h[(2, 0)],
            h[(0, 1)] - target.x * h[(2, 1)],
            h[(1, 0)] - target.y * h[(2, 0)],
            h[(1, 1)] - target.y * h[(2, 1)],
        );
        let spread = by_source * by_source.transpose() + Matrix2::identity() * (image.z * image.z);
        let squared = constraint.dot(&(spread.try_inverse()? * constraint));
        squared.is_finite().then_some(squared.max(0.0))
    }
}

/// Whether every triple of four points turns the same way in both images, or every triple the opposite way.
///
/// Points in front of both cameras do: a plane does not reach infinity between them. A sample that fails this needs no
/// model. O(1); false for NaN.
#[must_use]
pub fn keeps_orientation(source: &[Vector2<f64>; 4], target: &[Vector2<f64>; 4]) -> bool {
    let products = TRIPLES.map(|[a, b, c]| {
        twice_area(&source[a], &source[b], &source[c])
            * twice_area(&target[a], &target[b], &target[c])
    });
    products.iter().all(|p| *p > 0.0) || products.iter().all(|p| *p < 0.0)
}

/// Index triples of four points.
const TRIPLES: [[usize; 3]; 4] = [[1, 2, 3], [2, 0, 3], [0, 1, 3], [0, 1, 2]];

/// x -> scale (x - centre): centroid at zero, mean distance sqrt 2.
#[derive(Debug, Clone, Copy)]
pub(super) struct Similarity {
    centre: Vector2<f64>,
    pub(super) scale: f64,
}

impl Similarity {
    /// `None` if all points coincide to rounding.
    pub(super) fn of(points: &[Vector2<f64>]) -> Option<Self> {
        let count = points.len() as f64;
        let centre = points.iter().map(|p| p / count).sum::<Vector2<f64>>();
        let distance = points
            .iter()
            .map(|p| (p - centre).norm() / count)
            .sum::<f64>();
        let scale = std::f64::consts::SQRT_2 / distance;
        let apart = distance > 4.0 * f64::EPSILON * centre.amax();
        (apart && scale.is_finite()).then_some(Self { centre, scale })
    }

    pub(super) fn apply(&self, point: &Vector2<f64>) -> Vector2<f64> {
        (point - self.centre) * self.scale
    }

    pub(super) fn forth(&self) -> Matrix3<f64> {
        let shift = -self.centre * self.scale;
        Matrix3::new(
            self.scale, 0.0, shift.x, 0.0, self.scale, shift.y, 0.0, 0.0, 1.0,
        )
    }

    pub(super) fn back(&self) -> Matrix3<f64> {
        let size = 1.0 / self.scale;
        Matrix3::new(
            size,
            0.0,
            self.centre.x,
            0.0,
            size,
            self.centre.y,
            0.0,
            0.0,
            1.0,
        )
    }
}

/// Three points as columns and the weights that make the fourth (1, 1, 1), in normalised coordinates.
struct Basis {
    matrix: Matrix3<f64>,
    inverse: Matrix3<f64>,
    weights: Vector3<f64>,
}

impl Basis {
    fn new(points: &[Vector2<f64>; 4]) -> Option<(Self, Similarity)> {
        if !points.iter().all(|p| p.iter().all(|v| v.is_finite())) {
            return None;
        }
        let similarity = Similarity::of(points)?;
        let [a, b, c, d] = points.map(|p| similarity.apply(&p));
        // Subtracting the centre leaves coordinates with an error of eps times their former size.
        let reach = points
            .iter()
            .fold(1.0, |m: f64, p| m.max(p.amax() * similarity.scale));
        let tolerance = 16.0 * f64::EPSILON * reach;
        let normalized = [a, b, c, d];
        let flat = TRIPLES.iter().any(|&[i, j, k]| {
            let (p, q, r) = (&normalized[i], &normalized[j], &normalized[k]);
            let side = (q - p).norm().max((r - p).norm()).max((r - q).norm());
            let apart = twice_area(p, q, r).abs() > tolerance * side;
            !apart
        });
        if flat {
            return None;
        }
        let matrix = Matrix3::from_columns(&[a.push(1.0), b.push(1.0), c.push(1.0)]);
        let inverse = matrix.try_inverse()?;
        let weights = inverse * d.push(1.0);
        Some((
            Self {
                matrix,
                inverse,
                weights,
            },
            similarity,
        ))
    }
}

fn twice_area(a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

pub(super) fn dehomogenize(image: &Vector3<f64>) -> Option<Vector2<f64>> {
    let point = image.xy() / image.z;
    point.iter().all(|v| v.is_finite()).then_some(point)
}
