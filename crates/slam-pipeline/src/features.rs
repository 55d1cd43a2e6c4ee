//! The feature detector that a configuration asks for.

use vision_sift::{Detector, SiftError, SiftParams};

use crate::config::ValidConfig;

/// Size, standard deviation of the blur in pixels, at which the part of the noise of a keypoint that grows with its size is as
/// large as the part that does not.
const SIZE_PX: f64 = 2.0;

/// Standard deviation of a coordinate of a keypoint of size `size_px` (standard deviation of its blur, pixels), where the
/// smallest keypoints have `smallest_px`.
///
/// A keypoint is an extremum of an image that was blurred by its size, so it is found less well the larger it is
/// (Zeisl, Georgel, Schweiger, Steinbach, Navab 2009). The rest of the noise is the same for all.
///
/// ```
/// use slam_pipeline::keypoint_sigma_px;
///
/// assert_eq!(keypoint_sigma_px(0.3, 0.0), 0.3);
/// assert!((keypoint_sigma_px(0.3, 2.0) - 0.3 * 2.0_f64.sqrt()).abs() < 1e-15);
/// ```
#[must_use]
pub fn keypoint_sigma_px(smallest_px: f64, size_px: f64) -> f64 {
    smallest_px * (size_px / SIZE_PX).hypot(1.0)
}

/// SIFT as configured.
///
/// # Errors
/// [`SiftError`] for a parameter out of range.
///
/// ```
/// use slam_pipeline::config::Config;
/// use slam_pipeline::detector_of;
/// use vision_sift::{Features, GrayImage, Workspace};
///
/// let mut config = Config::default();
/// config.features.max_keypoints = 300;
/// let detector = detector_of(&config.check()?)?;
///
/// let blank = vec![0_u8; 320 * 240];
/// let mut features = Features::default();
/// detector.detect(&GrayImage::new(320, 240, &blank)?, &mut Workspace::new(), &mut features)?;
/// assert!(features.keypoints.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn detector_of(config: &ValidConfig) -> Result<Detector, SiftError> {
    Detector::new(SiftParams {
        max_features: Some(config.features.max_keypoints as usize),
        contrast_threshold: config.features.contrast_threshold,
        edge_ratio: config.features.edge_ratio,
        ..SiftParams::default()
    })
}
