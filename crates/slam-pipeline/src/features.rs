//! The feature detector that a configuration asks for.

use vision_sift::{Detector, SiftError, SiftParams};

use crate::config::ValidConfig;

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
