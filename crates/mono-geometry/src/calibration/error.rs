//! Why there is no calibration.

use crate::error::GeometryError;

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// Not enough views can be used: a plane gives two constraints on the camera, and four parameters are unknown.
    #[error("{usable} of {given} views can be used, required: at least {required}")]
    TooFewViews {
        /// Views that can be used.
        usable: usize,
        /// Views given.
        given: usize,
        /// Views needed.
        required: usize,
    },
    /// Fewer equations than unknowns.
    #[error(
        "{equations} equations ({corners} corners) for {unknowns} unknowns ({parameters} parameters, {views} poses), required: more equations than unknowns"
    )]
    TooFewCorners {
        /// Corners in all usable views.
        corners: usize,
        /// Two a corner.
        equations: usize,
        /// Parameters of the camera.
        parameters: usize,
        /// Usable views.
        views: usize,
        /// Parameters and 6 a view.
        unknowns: usize,
    },
    /// A corner has a coordinate that is not finite, or a sigma that is not above zero.
    #[error(
        "corner {corner} of view {view} is unusable, required: finite coordinates, sigma finite and above 0"
    )]
    InvalidCorner {
        /// Index of the view.
        view: usize,
        /// Index of the corner in it.
        corner: usize,
    },
    /// An option or the image size is out of range, or a decomposition failed.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}
