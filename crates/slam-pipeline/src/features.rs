//! The feature detector that a configuration asks for.

use vision_sift::{Detector, SiftError, SiftParams};

use crate::config::ValidConfig;

/// SIFT as configured.
///
/// # Errors
/// [`SiftError`] for a parameter out of range.
pub fn detector_of(config: &ValidConfig) -> Result<Detector, SiftError> {
    Detector::new(SiftParams {
        max_features: Some(config.features.max_keypoints as usize),
        contrast_threshold: config.features.contrast_threshold,
        edge_ratio: config.features.edge_ratio,
        ..SiftParams::default()
    })
}
