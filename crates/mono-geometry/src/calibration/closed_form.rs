//! Intrinsics in closed form from the image of the absolute conic (Zhang 2000, section 3.1 and appendix B).
//!
//! A view of the plane z = 0 has the homography H ~ K [r1 r2 t]. r1 and r2 are orthonormal, so with the symmetric
//! B = K^-T K^-1 (the image of the absolute conic) every view gives
//!
//! h1^T B h2 = 0 and h1^T B h1 = h2^T B h2,
//!
//! two equations linear in the entries of B. Steps: pixels centred and scaled to about 1, each homography scaled so
//! that its first two columns count as much in every view; the null vector of the stacked equations is B up to scale; K
//! follows by Cholesky's formulas.
//!
//! Without skew B12 = 0 and two views suffice; with skew three. If B is not positive definite, or the equations leave
//! more than one direction open (parallel planes give the same two equations), there is no answer, and
//! [`focal_length_from_centre`] takes the principal point as the image centre and fits the one number 1 / f^2. Planes
//! parallel to the image do not contain it either: h1 and h2 then have no third component.

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};

use crate::homography::Homography;
use crate::linalg::{NullVector, null_vector};

/// Whether pixels are rectangular.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Skew {
    /// The axes of the sensor are at right angles, as in every camera of this crate.
    Zero,
    /// The skew is estimated too.
    Free,
}

/// Intrinsics K = [fx skew cx; 0 fy cy; 0 0 1], pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosedForm {
    /// Focal length along x.
    pub fx: f64,
    /// Focal length along y.
    pub fy: f64,
    /// Principal point, x.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
    /// Skew; zero for [`Skew::Zero`].
    pub skew: f64,
}

/// K from the homographies board -> pixel of at least two views (three with skew). O(views).
///
/// `width` and `height` in pixels only centre and scale the equations. `None` if the views do not fix B, or it is not
/// positive definite.
#[must_use]
pub fn closed_form_intrinsics(
    homographies: &[Homography],
    width: usize,
    height: usize,
    skew: Skew,
) -> Option<ClosedForm> {
    let unknowns = match skew {
        Skew::Zero => 5,
        Skew::Free => 6,
    };
    if 2 * homographies.len() + 1 < unknowns {
        return None;
    }
    let frame = Frame::new(width, height);
    let mut rows = DMatrix::zeros(2 * homographies.len(), unknowns);
    for (view, homography) in homographies.iter().enumerate() {
        let [h1, h2] = frame.columns(homography);
        let mixed = conic_row(&h1, &h2);
        let equal = conic_row(&h1, &h1) - conic_row(&h2, &h2);
        for (axis, row) in [mixed, equal].iter().enumerate() {
            // B33, B11, B22, B13, B23, and B12 last, so that zero skew drops a column.
            for column in 0..unknowns {
                rows[(2 * view + axis, column)] = row[column];
            }
        }
    }
    let NullVector {
        vector: b, rank, ..
    } = null_vector(&rows).ok()?;
    if rank + 1 < unknowns {
        return None;
    }
    let b12 = if skew == Skew::Free { b[5] } else { 0.0 };
    let (b33, b11, b22, b13, b23) = (b[0], b[1], b[2], b[3], b[4]);
    let minor = b11 * b22 - b12 * b12;
    let cross = b12 * b13 - b11 * b23;
    let v0 = cross / minor;
    let lambda = b33 - (b13 * b13 + v0 * cross) / b11;
    let fx = (lambda / b11).sqrt();
    let fy = (lambda * b11 / minor).sqrt();
    let skew = -b12 * fx * fx * fy / lambda;
    let u0 = skew * v0 / fy - b13 * fx * fx / lambda;
    let result = ClosedForm {
        fx: fx * frame.scale,
        fy: fy * frame.scale,
        cx: u0 * frame.scale + frame.centre.x,
        cy: v0 * frame.scale + frame.centre.y,
        skew: skew * frame.scale,
    };
    [result.fx, result.fy, result.cx, result.cy, result.skew]
        .iter()
        .all(|v| v.is_finite())
        .then_some(result)
        .filter(|k| k.fx > 0.0 && k.fy > 0.0)
}

/// The focal length (fx = fy, pixels) with the principal point at the image centre, by least squares on 1 / f^2.
/// O(views).
///
/// `None` if the homographies do not contain it (planes parallel to the image) or 1 / f^2 is not positive.
#[must_use]
pub fn focal_length_from_centre(
    homographies: &[Homography],
    width: usize,
    height: usize,
) -> Option<f64> {
    let frame = Frame::new(width, height);
    let (mut product, mut square, mut rounding) = (0.0, 0.0, 0.0);
    for homography in homographies {
        let [h1, h2] = frame.columns(homography);
        // a / f^2 + c = 0.
        let equations = [
            (h1.xy().dot(&h2.xy()), h1.z * h2.z),
            (
                h1.xy().norm_squared() - h2.xy().norm_squared(),
                h1.z * h1.z - h2.z * h2.z,
            ),
        ];
        for (a, c) in equations {
            product -= a * c;
            square += a * a;
            rounding += f64::EPSILON * h1.norm_squared().max(h2.norm_squared());
        }
    }
    let inverse_square = product / square;
    // Both sides must be more than rounding errors of the columns.
    let contained = square.sqrt() > 64.0 * rounding && product.sqrt() > 64.0 * rounding;
    let focal_length = frame.scale / inverse_square.sqrt();
    (contained && focal_length > 0.0 && focal_length.is_finite()).then_some(focal_length)
}

/// (B33, B11, B22, B13, B23, B12) coefficients of p^T B q.
fn conic_row(p: &Vector3<f64>, q: &Vector3<f64>) -> nalgebra::SVector<f64, 6> {
    nalgebra::SVector::<f64, 6>::from([
        p.z * q.z,
        p.x * q.x,
        p.y * q.y,
        p.z * q.x + p.x * q.z,
        p.z * q.y + p.y * q.z,
        p.x * q.y + p.y * q.x,
    ])
}

/// Pixels centred on the image and divided by the mean side.
struct Frame {
    centre: Vector2<f64>,
    scale: f64,
}

impl Frame {
    fn new(width: usize, height: usize) -> Self {
        Self {
            centre: image_centre(width, height),
            scale: (0.5 * (width as f64 + height as f64)).max(1.0),
        }
    }

    /// First two columns of the homography to these coordinates, the geometric mean of their lengths 1.
    fn columns(&self, homography: &Homography) -> [Vector3<f64>; 2] {
        let to_frame = Matrix3::new(
            1.0 / self.scale,
            0.0,
            -self.centre.x / self.scale,
            0.0,
            1.0 / self.scale,
            -self.centre.y / self.scale,
            0.0,
            0.0,
            1.0,
        );
        let columns = to_frame * homography.matrix();
        let (h1, h2) = (columns.column(0), columns.column(1));
        let size = (h1.norm() * h2.norm()).sqrt();
        [h1 / size, h2 / size]
    }
}

/// Centre of the image area, pixels.
pub(super) fn image_centre(width: usize, height: usize) -> Vector2<f64> {
    Vector2::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0))
}
