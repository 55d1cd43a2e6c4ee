//! The one error type of the crate: what was given, and what would have been accepted.

use estimation_base::Readable;

/// Why a geometric quantity could not be built or computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// A scalar parameter is outside its range (or not finite).
    #[error(
        "{name} is {}, required: {required}",
        Readable(*.value)
    )]
    InvalidParameter {
        /// Name of the parameter, with its unit if it has one.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The accepted range, in words.
        required: &'static str,
    },
    /// A pixel or distorted point has no undistorted counterpart: the lens model folds over before it.
    #[error(
        "distorted point ({}, {}) is outside the invertible field of the lens model: the nearest source, at radius {} (required: below {}), leaves {} (required: at most {})",
        Readable(*.x),
        Readable(*.y),
        Readable(*.radius),
        Readable(*.field_radius),
        Readable(*.residual),
        Readable(*.tolerance)
    )]
    OutsideInvertibleField {
        /// Distorted normalised x, without unit.
        x: f64,
        /// Distorted normalised y, without unit.
        y: f64,
        /// Radius of the best undistorted point found, normalised units.
        radius: f64,
        /// Radius at which the lens model folds over.
        field_radius: f64,
        /// The difference left between its image and the distorted point, normalised units.
        residual: f64,
        /// Residual that would have been accepted.
        tolerance: f64,
    },
    /// A pixel of a fisheye that no ray meets.
    #[error(
        "normalised pixel ({}, {}) is met by no ray of the camera",
        Readable(*.x),
        Readable(*.y)
    )]
    NoRay {
        /// (u - cx) / fx.
        x: f64,
        /// (v - cy) / fy.
        y: f64,
    },
    /// A 3x3 matrix is not a proper rotation.
    #[error(
        "not a rotation: largest entry of |R^T R - I| is {} (at most {}), determinant {} (required: +1)",
        Readable(*.deviation),
        Readable(*.tolerance),
        Readable(*.determinant)
    )]
    NotARotation {
        /// Largest absolute entry of `R^T R - I`.
        deviation: f64,
        /// Largest deviation accepted.
        tolerance: f64,
        /// Determinant of the matrix.
        determinant: f64,
    },
    /// A symmetric matrix is not positive definite.
    #[error(
        "not positive definite: pivot {pivot} is {}, required: above {}",
        Readable(*.value),
        Readable(*.required)
    )]
    NotPositiveDefinite {
        /// Index of the first offending pivot.
        pivot: usize,
        /// Its value.
        value: f64,
        /// The value it must exceed.
        required: f64,
    },
    /// Matrix sizes do not fit together.
    #[error("matrix has {rows} rows and {columns} columns, required: {required}")]
    Shape {
        /// Rows given.
        rows: usize,
        /// Columns given.
        columns: usize,
        /// The shapes that fit, in words.
        required: &'static str,
    },
    /// A decomposition met a NaN or an infinity, or did not converge.
    #[error(
        "singular value decomposition of a {rows}x{columns} matrix failed, required: finite entries"
    )]
    Svd {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// One entry of a list cannot be used.
    #[error(
        "{list} {index}: {name} is {}, required: {required}",
        Readable(*.value)
    )]
    InvalidElement {
        /// Name of an element of the list, in the singular.
        list: &'static str,
        /// Index of the entry.
        index: usize,
        /// Name of the number, with its unit if it has one.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The values accepted, in words.
        required: &'static str,
    },
    /// The measurements leave a motion of the whole free (gauge), so there is no covariance.
    #[error(
        "the measurements leave a direction free: information {} (pivot) at coordinate {coordinate} of pose {pose}, required: above {} (fix a pose or add a prior; the scale needs odometry or a second one)",
        Readable(*.value),
        Readable(*.required)
    )]
    GaugeFree {
        /// Index of the pose.
        pose: usize,
        /// Coordinate of its tangent, translation first.
        coordinate: usize,
        /// The pivot: the information about the coordinate, those before it known or (the last one) all unknown.
        value: f64,
        /// The value that rounding alone would leave of a zero.
        required: f64,
    },
}

/// `value` if it is finite and `accept` holds, the named error otherwise.
pub(crate) fn checked(
    name: &'static str,
    value: f64,
    required: &'static str,
    accept: impl Fn(f64) -> bool,
) -> Result<f64, GeometryError> {
    if value.is_finite() && accept(value) {
        Ok(value)
    } else {
        Err(GeometryError::InvalidParameter {
            name,
            value,
            required,
        })
    }
}

/// An entry of a list that cannot be used.
#[cfg(feature = "bundle")]
pub(crate) fn bad(
    list: &'static str,
    index: usize,
    name: &'static str,
    value: f64,
    required: &'static str,
) -> GeometryError {
    GeometryError::InvalidElement {
        list,
        index,
        name,
        value,
        required,
    }
}

impl From<estimation_base::CholeskyError> for GeometryError {
    fn from(error: estimation_base::CholeskyError) -> Self {
        use estimation_base::CholeskyError;
        let (pivot, value, required) = match error {
            CholeskyError::NotPositiveDefinite {
                pivot,
                value,
                required,
            } => (pivot, value, required),
            CholeskyError::NotFinite { row, value, .. } => (row, value, 0.0),
            // Only semidefinite and symmetric checks give others, which this crate does not make.
            _ => (0, f64::NAN, 0.0),
        };
        Self::NotPositiveDefinite {
            pivot,
            value,
            required,
        }
    }
}
